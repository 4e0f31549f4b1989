# SPDX-License-Identifier: GPL-3.0-or-later
"""Lights: a file a kind, each with its derivation, units, closed form, sampling and density."""

from ._base import LIGHTS, RAYS, Light, LightRecord, LightSample, Model, light_from_record
from ._environment import SkyMap

__all__ = [
    "LIGHTS",
    "RAYS",
    "Light",
    "LightRecord",
    "LightSample",
    "Model",
    "SkyMap",
    "light_from_record",
]
