# SPDX-License-Identifier: GPL-3.0-or-later
"""What each light of a scene truly emits, and why that is not what Blender's number suggests."""

from collections.abc import Iterator
from dataclasses import dataclass
from decimal import Decimal
from typing import Any, NamedTuple

import numpy as np

from .arrays import Floats
from .emitters import emitters
from .errors import Finding, RadError
from .lights import Light, LightRecord, Model, light_from_record
from .lights._emission import RANGE_K, stated_emission
from .lights.area import AreaLight
from .lights.mesh import MeshLight
from .lights.point import PointLight
from .lights.spot import SpotLight
from .lights.world import WorldLight
from .quantities import EFFICACIES_LM_W, K_M
from .scene import Scene
from .spectra import colour_temperature, spectrum
from .working_space import xyz_from_rgb

# What a row holds, radiant and luminous, in the order of `_amounts`.
KEYS = (
    ("radiant_flux_W", "luminous_flux_lm"),
    ("peak_radiant_intensity_W_sr", "peak_luminous_intensity_cd"),
    ("radiance_W_m2_sr", "luminance_cd_m2"),
    ("irradiance_W_m2", "illuminance_lx"),
)
LEDS_K = {"LED-B1": 2733, "LED-B2": 2998, "LED-B3": 4103, "LED-B4": 5109, "LED-B5": 6598}
DAYLIGHT = "D65"
PHOTOPIC = (
    f"{K_M:.0f} lm/W takes each watt as green of 555 nm, where the eye sees best: "
    "100 W are 68 300 lm"
)
SAME = 1e-4  # relative, below which two figures are one
LINKED = "light linking: it lights, or is shadowed by, chosen objects only"


class Note(NamedTuple):
    """Why a light is not what its number says, and by how much of what that would give."""

    code: str
    message: str
    effect_percent: float | None = None


@dataclass(frozen=True)
class _Source:
    """One piece of a row: its light in both models; None emits nothing, a string is not known."""

    name: str
    kind: str
    light: Light | str | None
    other: Light | str | None
    record: LightRecord | None = None


def inspect_lights(scene: Scene, efficacy: float) -> tuple[list[dict[str, Any]], list[Finding]]:
    """Return a row for each light object, mesh emitter and world, and findings about them.

    Flux and notes are those of one piece of `count`, their mean where they differ; intensity and
    radiance are the greatest in any direction. Values are None where they have no meaning or are
    not known. `efficacy` is in lm/W.
    """
    groups: dict[str, list[_Source]] = {}
    for source in _sources(scene):
        groups.setdefault(source.name, []).append(source)
    findings = list(scene.findings)
    rows: list[dict[str, Any]] = []
    for name, sources in groups.items():
        findings += [
            Finding(n.code, "warning", name, *n[1:]) for n in _unit_scale(scene, sources[0])
        ]
        rows.append(_row(scene, efficacy, sources, findings))
    if not any(row["luminous_flux_lm"] or row["illuminance_lx"] for row in rows):
        findings.append(Finding("nothing-emits", "warning", "", "no light that is known to emit"))
    return rows, findings


def light_notes(scene: Scene) -> Iterator[tuple[str, Note]]:
    """Yield each light's name with what is to be known of it; for one of many instances."""
    sources = {source.name: source for source in reversed(list(_sources(scene)))}
    for name, source in reversed(sources.items()):
        for note in (*_unit_scale(scene, source), *_notes(scene, source)):
            yield name, note


def _sources(scene: Scene) -> Iterator[_Source]:
    other: Model = "physical" if scene.model == "cycles" else "cycles"
    for record in scene.light_records:
        mine, theirs = (_built(record, model) for model in (scene.model, other))
        yield _Source(record.name, record.bl_type, mine, theirs, record)
    for emitter in emitters(scene)[0]:
        light = emitter.light
        if light.kind not in ("MESH", "WORLD"):
            continue
        dark = isinstance(light, MeshLight) and not light.radiant_flux().any()
        known = emitter.cause.feature if emitter.cause else None if dark else light
        yield _Source(light.name, light.kind, known, known)


def _built(record: LightRecord, model: Model) -> Light | str | None:
    if not record.shown:
        return None
    try:
        return record.unknown or light_from_record(record, model)
    except RadError as error:  # an IES text that is none
        return str(error)


def _amounts(kind: str, light: Light | str | None, metre: float) -> Floats:
    """Return flux, peak intensity, radiance and facing irradiance, (4, 3), nan for none."""
    found = np.full((4, 3), np.nan)
    if light is None:
        found[3 if kind == "SUN" else slice(2)] = 0.0
    elif not isinstance(light, str):
        found[0] = light.leaving_flux() * metre**2
        found[1] = light.peak_radiant_intensity() * metre**2
        found[2], found[3] = light.peak_radiance(), light.facing_irradiance()
    return np.where(np.isfinite(found), found, np.nan)


def _row(
    scene: Scene, efficacy: float, sources: list[_Source], findings: list[Finding]
) -> dict[str, Any]:
    first, weights = sources[0], np.array(scene.luminance_weights)
    placed = [instance.name for instance in scene.instances]
    # The parts of a world are one thing.
    counts = {"WORLD": 1, "MESH": placed.count(first.name)}
    count = counts.get(first.kind, len(sources))
    pieces, twins = (
        np.array([_amounts(first.kind, light, scene.unit_scale_m) for light in lights])
        for lights in ([s.light for s in sources], [s.other for s in sources])
    )
    amounts, others = (_joined(each, weights, count) for each in (pieces, twins))
    if first.kind == "WORLD":
        amounts[3], others[3] = pieces[:, 3].sum(axis=0), twins[:, 3].sum(axis=0)
    values: dict[str, Any] = {}
    for (radiant, luminous), rgb, twin in zip(KEYS, amounts, others, strict=True):
        values |= {
            radiant: rgb.mean(),
            f"{radiant}_rgb": rgb,
            luminous: efficacy * (weights @ rgb),
            f"other_model_{radiant}": twin.mean(),
            f"other_model_{luminous}": efficacy * (weights @ twin),
        }
    values = {k: None if np.isnan(value).any() else value.tolist() for k, value in values.items()}
    colour = next((rgb for rgb in amounts if np.any(rgb > 0.0)), np.zeros(3))
    temperature = colour_temperature((xyz_from_rgb(scene.chromaticities) @ colour).tolist())[0]
    row: dict[str, Any] = {
        "name": first.name,
        "type": first.kind,
        "count": count,
        "blender_energy": first.record and float(first.record.properties["energy"]),
        **values,
        "nominal": True,
        "efficacy_lm_W": efficacy,
        "correlated_colour_temperature_K": temperature,
    }
    names = first.name, first.record and first.record.data
    notes = [f.message for f in findings if f.object and f.object in names]
    notes += [LINKED] * (first.name in scene.linking)
    notes += [note.message for note in _notes(scene, first)]
    fluxes = pieces[:, 0].mean(axis=1)
    if len(sources) == count and np.ptp(fluxes) > SAME * np.abs(fluxes).max():
        low, high = fluxes.min(), fluxes.max()
        notes.append(f"its {count} instances differ, {low:.4g} to {high:.4g} W: this is the mean")
    ies = isinstance(first.light, Light) and first.light.distribution is not None
    if efficacy == K_M and not ies and any(values[luminous] for _, luminous in KEYS):
        notes += [PHOTOPIC, _spectrum(first.kind, temperature)]
    return {**row, "notes": list(dict.fromkeys(notes))}


def _joined(pieces: Floats, weights: Floats, count: int) -> Floats:
    """Return the mean flux of `count` pieces (k, 4, 3) and their greatest other amounts, (4, 3)."""
    amounts = pieces[np.argmax(np.abs(pieces @ weights), axis=0), np.arange(4)]
    amounts[0] = pieces[:, 0].sum(axis=0) / count
    return amounts


def figure(value: float | None) -> str:
    """Return four digits of a number, thousands apart; nothing for None."""
    text = "" if value is None else f"{value:.4g}"
    plain = value is not None and 1e-3 <= abs(value) < 1e9
    return f"{Decimal(text):,f}".replace(",", " ") if plain else text


def _ratio(over: Floats, under: Floats) -> float:
    """Return the factor between two triples of one colour."""
    channel = int(np.argmax(np.abs(under)))
    return float(over[channel] / under[channel])


def _unit_scale(scene: Scene, source: _Source) -> Iterator[Note]:
    """Yield what the unit scale makes of a power, with both figures."""
    pair = source.light, source.other
    cycles, physical = pair if scene.model == "cycles" else pair[::-1]
    if scene.unit_scale_m == 1.0 or not (isinstance(cycles, Light) and isinstance(physical, Light)):
        return
    effect = _ratio(cycles.leaving_flux(), physical.leaving_flux()) - 1.0
    if source.record and abs(effect) > SAME:
        energy = source.record.properties["energy"]
        why = f"a unit is {scene.unit_scale_m:g} m, but Cycles lets light fall off over units"
        both = f"{figure(energy)} W light the scene as {figure(energy * (1.0 + effect))} W would"
        yield Note("unit-scale", f"{why}: its {both}", 100.0 * effect)


def _notes(scene: Scene, source: _Source) -> Iterator[Note]:
    """Yield why a light is not what its number says."""
    light, record = source.light, source.record
    if isinstance(light, str):
        yield Note("light-unknown", f"what it emits is not known: {light}")
    elif light is None:
        why = _why_dark(record) if record else "it has no area"
        yield Note("light-dark", f"emits nothing: {why}", 0.0)
    elif isinstance(light, MeshLight):
        share = _ratio(light.leaving_flux(), light.radiant_flux())
        hollow = f"closed or hollow: {100.0 * share:.3g} % of what its faces emit gets out"
        both = "shines from both faces, half of it from each"
        effect = 100.0 * (share - 1.0) if share < 1.0 - SAME else 0.0
        yield Note("mesh-faces", hollow if effect else both, effect)
    elif isinstance(light, WorldLight) and light.sky is not None:
        up = "the irradiance is that of a surface that looks up"
        spot = "the radiance that of the brightest spot"
        mean = f"the mean is {figure(float(light.rgb.mean()))} W/(m² sr)"
        yield Note("sky-by-direction", f"by direction: {up}, {spot}; {mean}", 0.0)
    elif record is not None:
        yield from _of_power(light, record)
        yield from _of_colour(record, np.array(scene.luminance_weights))
        yield from _of_shape(light, record, scene.unit_scale_m)
        if light.distribution is not None:
            cycles = EFFICACIES_LM_W["cycles-ies"]
            said = f"its IES file's candela are W/sr over {cycles} lm/W in Cycles"
            said += " (--efficacy cycles-ies), which looks at no TILT or size; "
            said += f"over {K_M} in the physical model"
            yield Note("ies-efficacy", said, 100.0 * (K_M / cycles - 1.0))
        if not light.cast_shadow:
            yield Note("no-shadow", "casts no shadow: it lights what is behind walls too")


def _why_dark(record: LightRecord) -> str:
    properties = record.properties
    reasons = {
        "it is hidden in renders": not record.shown,
        "it is a portal, which guides the world's light": bool(properties.get("cycles.is_portal")),
        "its strength is 0": properties["energy"] == 0.0,
        "its colour is black": not any(properties["color"]),
        "its nodes give nothing": not any(properties.get("node_emission", (1.0,))),
    }
    return next((text for text, holds in reasons.items() if holds), "its scale is 0")


def _of_power(light: Light, record: LightRecord) -> Iterator[Note]:
    properties = record.properties
    energy, exposure = float(properties["energy"]), float(properties.get("exposure", 0.0))
    if energy < 0.0:
        yield Note("negative-energy", "its strength is below 0: it takes light away", -200.0)
    if exposure != 0.0:
        said = f"exposure {exposure:.3g} makes its {figure(energy)} {figure(energy * 2**exposure)}"
        yield Note("light-exposure", said, 100.0 * (2**exposure - 1.0))
    if properties.get("normalize", True) or (light.kind == "SUN" and light.is_delta):
        return
    if light.kind == "SUN":
        said, power = "its strength is its radiance, and a wider angle is more light", None
    elif light.kind != "AREA" and light.is_delta:
        said, power = "without a radius, that is 4 times its power", 4.0
    else:
        said = "its strength is W a square unit, and a larger light is more light"
        power = _ratio(light.rgb, stated_emission(record))
    yield Note("not-normalised", f"not normalised: {said}", power and 100.0 * (power - 1.0))


def _of_colour(record: LightRecord, weights: Floats) -> Iterator[Note]:
    properties = record.properties
    tints = {"colour": properties["color"], "nodes": properties.get("node_emission", 1.0)}
    if properties.get("use_temperature"):
        kelvin, (low, high) = properties["temperature"], RANGE_K
        ends = f", as at {low if kelvin < low else high:.0f} K, where colours end"
        kind = f"{kelvin:.0f} K{ends * (not low <= kelvin <= high)}"
        tints[kind] = properties["temperature_color"]
    for name, tint in ((name, np.array(tint)) for name, tint in tints.items()):
        if np.any(np.abs(tint - 1.0) > SAME):
            luminous = float(weights @ tint)
            said = f"{name}: {luminous:.3g} times the lm and {tint.mean():.3g} times the W of white"
            yield Note("light-colour", said, 100.0 * (luminous - 1.0))


def _of_shape(light: Light, record: LightRecord, metre: float) -> Iterator[Note]:
    scale = np.sqrt(np.sum(record.world_from_light[:3, :3] ** 2, axis=0))
    scaled = bool(np.any(np.abs(scale - 1.0) > SAME))
    if isinstance(light, SpotLight) and light.distribution is None:
        share = _ratio(light.radiant_flux(), light.rgb)
        angle = np.degrees(2.0 * np.arccos(light.cos_half_angle))
        said = f"its {angle:.3g}° cone cuts light off and gathers none"
        left = f"{100.0 * share:.3g} % of its power leaves"
        yield Note("spot-cone", f"{said}: {left}", 100.0 * (share - 1.0))
        if scaled and np.ptp(scale) > SAME * scale.max():
            yield Note("light-scale", "its object's scale stretches the cone")
    if isinstance(light, PointLight) and light.radius > 0.0:
        radius = light.radius * metre
        if light.soft_falloff:
            share = 100.0 / (1.0 + radius**2)
            disc = f"a disc of radius {radius:.3g} m that faces every point, and 1 m away gives"
            said = f"soft falloff: {disc} {share:.3g} % of what its power says"
            yield Note("soft-falloff", said, share - 100.0)
        if scaled:
            yield Note("light-scale", "its object's scale does not act on its radius", 0.0)
    if isinstance(light, AreaLight):
        if light.is_delta:
            beam = "no spread: a parallel beam, which has no intensity and no radiance"
            yield Note("spread", beam, 0.0)
        elif light.spread < np.pi - SAME and light.distribution is None:
            gain = np.pi * _ratio(light.peak_radiant_intensity(), light.radiant_flux())
            angle = np.degrees(light.spread)
            axis = f"its {angle:.3g}° spread gathers its power: {gain:.3g} times as bright on axis"
            yield Note("spread", axis, 0.0)
        if scaled:
            u, v = (np.linalg.norm(axis) * metre for axis in (light.axis_u, light.axis_v))
            yield Note("light-scale", f"with its object's scale it is {u:.3g} × {v:.3g} m", 0.0)


def _spectrum(kind: str, temperature: float | None) -> str:
    """Return which spectrum to choose."""
    if temperature is None:
        return "too far from white for a usual spectrum: choose the --efficacy of its source"
    name = min(LEDS_K, key=lambda led: abs(1.0 / LEDS_K[led] - 1.0 / temperature))
    name = DAYLIGHT if kind in ("SUN", "WORLD") else name
    efficacy = spectrum(name).efficacy_lm_W
    return f"a white like {name}, which has {efficacy:.0f} lm/W: --efficacy {efficacy:.0f}"
