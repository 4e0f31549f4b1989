# SPDX-License-Identifier: GPL-3.0-or-later
"""What the layers of a surface let out of what glows below them."""

from ..arrays import Floats
from ..bsdfs import Inputs
from ..bsdfs.principled import emitted
from . import ONE, SOURCES, Call, unit


@SOURCES.register("EMITTED")
def _emitted(call: Call) -> Floats:
    """Return what the alpha, sheen and coat of a Principled BSDF leave of its emission."""
    context, values = call.context, call.values()
    weight = ONE.repeat(len(context.normal), axis=0)
    normal, geometric = unit(values["Normal"]), context.geometric
    return emitted(Inputs(values, call.settings, weight, normal, geometric, context.incoming))
