# SPDX-License-Identifier: GPL-3.0-or-later
"""The dict of `report.json`: everything that was found, in CONTRACT's schema."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from .. import __version__
from ..checking import Result, Terms
from ..film import Film
from ..rays import embree_version
from ..scene import Scene
from ..strict_json import plain

SCHEMA = 1


def build_document(
    scene: Scene,
    result: Result,
    terms: Terms,
    *,
    efficacy_lm_W: float,
    witness_name: str,
    overridden: Mapping[str, tuple[Any, Any]],
    asked: Mapping[str, list[str]],
    seconds: Mapping[str, float],
) -> dict[str, Any]:
    """Return the document of one comparison.

    `overridden` are the witness's settings that were not the file's, name to (file's, used);
    `asked` are other options of the command line with their values; `seconds` are by step, beyond
    those in `result`.
    """
    film, judged = result.film, result.comparison.to_json()
    findings = [*film.findings, *judged.pop("findings")]
    inside = film.inside
    steps = ("read", "ours", "cycles", "compare", "report")
    document = {
        "schema": SCHEMA,
        "verdict": judged["verdict"],
        "scene": {
            "file": scene.file,
            "sha256": scene.sha256,
            "frame": scene.frame,
            "camera": scene.camera.name if scene.camera else None,
            "resolution": scene.resolution,
            "unit_scale_m": scene.unit_scale_m,
        },
        "versions": {
            "blender_rad": __version__,
            "blender": ".".join(map(str, scene.blender_version)),
            "numpy": np.__version__,
            "embree": embree_version(),
        },
        "settings": {
            "tolerance": terms.tolerance,
            "confidence": terms.confidence,
            "model": scene.model,
            "shading": scene.shading,
            "efficacy_lm_W": efficacy_lm_W,
            "samples": float(np.mean(film.samples[inside])) if inside.any() else 0.0,
            "cycles_samples": result.witness_samples,
            "cycles_seeds": len(result.pictures) if result.witness_samples else None,
            "overridden": {
                name: {"file": before, "used": used} for name, (before, used) in overridden.items()
            },
            "asked": dict(asked),
        },
        **{key: judged[key] for key in ("pixels", "metrics", "lights")},
        "coverage": coverage(film),
        "findings": findings,
        "witnesses": [{"name": witness_name, **judged}],
        "seconds": dict.fromkeys(steps, 0.0) | result.seconds | dict(seconds),
    }
    return plain(document)


def coverage(film: Film) -> dict[str, Any]:
    """Return which share of the picture the estimator can do, and what left the rest out."""
    total = int(film.inside.sum())
    supported = 1.0 - int((film.excluded & film.inside).sum()) / total if total else 0.0
    causes = sorted(film.excluded_by.items(), key=lambda item: -item[1])
    return {
        "supported_pixel_fraction": supported,
        "unsupported": [{**vars(cause), "pixels": pixels} for cause, pixels in causes],
    }
