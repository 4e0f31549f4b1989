# SPDX-License-Identifier: GPL-3.0-or-later
"""EXR files: our passes out, and anybody's picture in."""

import json
import os
import unicodedata
from collections.abc import Iterable, Mapping
from itertools import chain, count, product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .arrays import Singles
from .atomic import atomic_path
from .errors import RadError, unknown_name
from .film import Film
from .scene import Scene
from .working_space import INTEROP_IDS, rec709_from_working

Pixels = Singles

PASSES = ("Irradiance", "Illuminance", "Luminance", "StandardError", "Depth", "Normal")
_OLD_NAMES = {  # of passes, by those that Blender 5 gave them; ours has R, G, B without a layer
    "": "Combined",
    "Diffuse Direct": "DiffDir",
    "Diffuse Indirect": "DiffInd",
    "Diffuse Color": "DiffCol",
}
_LONGEST_NAME = 200  # bytes; EXR's limit is 255 for the whole channel


def channel_names(names: Iterable[str]) -> dict[str, str]:
    """Return the part of a channel's name that stands for each of `names`, all different.

    `.` and control characters become `_`; where that makes two names alike, later ones get a
    suffix.
    """
    result: dict[str, str] = {}
    for name in names:
        safe = "".join("_" if c == "." or unicodedata.category(c) == "Cc" else c for c in name)
        safe = safe.encode("utf-8")[:_LONGEST_NAME].decode("utf-8", "ignore") or "_"
        every = chain([safe], (f"{safe}_{number}" for number in count(2)))
        result[name] = next(unique for unique in every if unique not in result.values())
    return result


def film_channels(
    film: Film, scene: Scene, efficacy_lm_W: float, passes: Iterable[str]
) -> dict[str, NDArray[Any]]:
    """Return the channels of `passes`, each (h, w): of `PASSES`, and ``Light.<name>``."""
    weights = efficacy_lm_W * np.array(scene.luminance_weights)
    layers = channel_names(film.lights)
    channels = _triple("", "RGB", film.radiance) | {"A": film.alpha}
    makers: dict[str, Any] = {
        "Irradiance": lambda: _triple("Irradiance.", "RGB", film.irradiance),
        "Illuminance": lambda: {"Illuminance.V": film.irradiance @ weights},
        "Luminance": lambda: {"Luminance.V": film.radiance @ weights},
        "StandardError": lambda: _triple("StandardError.", "RGB", film.standard_error),
        "Depth": lambda: {"Depth.V": film.depth},
        "Normal": lambda: _triple("Normal.", "XYZ", film.normal),
    }
    for name in passes:
        if name in makers:
            channels |= makers[name]()
        else:
            light = name.removeprefix("Light.")
            radiance = film.lights[light] + film.shown.get(light, 0.0)
            channels |= _triple(f"Light.{layers[light]}.", "RGB", radiance)
    return channels


def _triple(prefix: str, letters: str, image: NDArray[Any]) -> dict[str, NDArray[Any]]:
    return {prefix + letter: image[..., k] for k, letter in enumerate(letters)}


def film_header(film: Film, scene: Scene, efficacy_lm_W: float) -> dict[str, Any]:
    """Return header attributes that say what the pixels mean."""
    from . import __version__

    return {
        "chromaticities": tuple(scene.chromaticities),
        "software": f"blender-rad {__version__}",
        "sceneHash": scene.sha256,
        "model": scene.model,
        "shading": scene.shading,
        "efficacy_lm_W": float(efficacy_lm_W),
        "samplesPerPixel": float(np.mean(film.samples[film.inside])) if film.inside.any() else 0.0,
        "lightNames": json.dumps({v: k for k, v in channel_names(film.lights).items()}),
    }


def write_exr(
    path: str | os.PathLike[str],
    channels: Mapping[str, NDArray[Any]],
    header: Mapping[str, Any] | None = None,
) -> None:
    """Write float32 channels (h, w) to `path`, which appears whole or not at all."""
    import OpenEXR

    kind = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    attributes: dict[str, Any] = kind | dict(header or {})
    data = {name: np.ascontiguousarray(v, dtype=np.float32) for name, v in channels.items()}
    with atomic_path(path) as temporary, OpenEXR.File(attributes, data) as file:
        file.write(str(temporary))


def read_picture(
    path: str | os.PathLike[str], chromaticities: tuple[float, ...] | None = None
) -> Pixels:
    """Return the beauty pass (h, w, 3) of an EXR file, as `read_passes` does.

    Colours become those of `chromaticities`, where these are given and the file states others.
    """
    passes, header = read_passes(path, ("Combined.RGB",))
    picture, stated = passes["Combined.RGB"], stated_chromaticities(header)
    if not (stated and chromaticities) or np.allclose(stated, chromaticities, atol=1e-3):
        return picture
    matrix = np.linalg.solve(rec709_from_working(chromaticities), rec709_from_working(stated))
    return (picture @ matrix.T).astype(np.float32)


def stated_chromaticities(header: Mapping[str, Any]) -> tuple[float, ...] | None:
    """Return those that the header of an EXR file states, or those of the space that it names."""
    stated = header.get("chromaticities") or INTEROP_IDS.get(header.get("colorInteropID", ""))
    return stated and tuple(map(float, stated))


def read_passes(
    path: str | os.PathLike[str],
    *choices: tuple[str, ...],
    also: tuple[str, ...] = (),
    view_layer: str | None = None,
) -> tuple[dict[str, Pixels], dict[str, Any]]:
    """Return passes (h, w, n) of an EXR file, of ours or of Blender's, and its header.

    The file has one part or many; of its view layers the first that has what is asked for counts,
    or `view_layer` alone. `choices` are sets of passes that would each do, the best first: names as
    before Blender 5, each with its channels, such as ``DiffDir.RGB``; channels without a pass are
    of ``Combined``. `also` are wanted where they exist. RadError is for a file that cannot be read,
    or names what it holds in place of `choices`.
    """
    planes, header = read_planes(path)
    views: dict[str, dict[str, dict[str, Pixels]]] = {}
    for name, plane in planes.items():
        layer, _, letter = name.rpartition(".")
        view, _, layer = layer.rpartition(".")
        views.setdefault(view, {}).setdefault(_OLD_NAMES.get(layer, layer), {})[letter] = plane
    if view_layer is not None and view_layer not in views:
        raise unknown_name("view layer", view_layer, os.fspath(path), [*filter(None, views)])
    searched = views.values() if view_layer is None else [views[view_layer]]
    for wanted, passes in product(choices, searched):
        found: dict[str, Pixels] = {}
        for name in (*wanted, *also):
            layer, letters = name.split(".")
            group = passes.get(layer, {})
            if set(letters) <= set(group):
                found[name] = np.stack([group[letter] for letter in letters], axis=-1)
        if set(wanted) <= set(found):
            return found, header
    listed = ", or ".join(" and ".join(wanted) for wanted in choices)
    held = {f"{layer}.{''.join(group)}" for passes in searched for layer, group in passes.items()}
    has = ", ".join(sorted(held))[:300] or "nothing"
    raise RadError("not the passes needed", os.fspath(path), f"expected {listed}; has {has}")


def read_planes(path: str | os.PathLike[str]) -> tuple[dict[str, Pixels], dict[str, Any]]:
    """Return all channels by full name, and the attributes of all parts, the first's first."""
    import OpenEXR

    if not os.path.isfile(path):
        raise RadError("no such file", os.fspath(path), "expected an EXR picture")
    planes: dict[str, Pixels] = {}
    header: dict[str, Any] = {}
    try:
        with OpenEXR.File(os.fspath(path), separate_channels=True) as file:
            for part in file.parts:
                header, own = dict(part.header) | header, part.header.get("name", "")
                for name, channel in reversed(part.channels.items()):
                    full = name if not own or name.startswith(own) else f"{own}.{name}"  # Blender 5
                    planes[full] = np.array(channel.pixels, dtype=np.float32)
    except RuntimeError as error:
        said = f"expected one; the reader says: {error}"
        raise RadError("not a readable EXR file", os.fspath(path), said) from None
    return planes, header
