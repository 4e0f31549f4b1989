# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings and set-ups that bias a photometric render, each with its effect; a function a rule.

An effect is that on the light of the whole picture, or of the light that the finding is about. It
follows from the setting's own equation, or from small pictures of our engine with and without it.
Certain and at least 1 % is an error; what only may be, or is smaller, a warning; else information.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from .coincidence import coincident_faces
from .direct import DirectLight
from .errors import Finding, Severity
from .film import Film
from .inspection import light_notes
from .lights import Light, light_from_record
from .quantities import GLTF_LM_W
from .rendering import Settings, render
from .scene import CLAY_ALBEDO, Scene, World

NOTICEABLE, SAME = 1.0, 0.01  # [%]; the first is what `check` tolerates by default
# Of the small pictures: pixels of the longer side, samples a pixel, and time [s].
SIDE, SAMPLES, SECONDS = 64, 32, 5.0
GRAVITY = ("error", "warning", "info")
DEFAULT_WORLD = 0.05087609  # Blender's
MOST_BOUNCES = 1024  # that Cycles takes
# Of the notes on lights: errors whatever the picture, and what only may be meant otherwise.
CERTAIN = {"negative-energy", "unit-scale"}
POSSIBLE = {"soft-falloff", "not-normalised", "no-shadow", "spot-cone", "ies-efficacy"}
LOSSY = ("DWAA", "DWAB", "B44", "B44A", "PXR24")


class Said(NamedTuple):
    """What a rule found; without a severity the effect gives it."""

    message: str
    effect_percent: float | None = None
    severity: Severity | None = None
    about: str = ""


# fmt: off
# Rules of one setting: code, setting, its only harmless value, effect [%], severity, what is said.
Effect = float | Callable[[Any], float] | None
PLAIN: tuple[tuple[str, str, object, Effect, Severity | None, str], ...] = (
    ("engine", "render.engine", "CYCLES", None, None,
     "{} is no path tracer in units of light: take Cycles"),
    ("film-exposure", "cycles.film_exposure", 1.0, lambda factor: 100.0 * (factor - 1.0), None,
     "film exposure {:.4g} multiplies every EXR value: set it to 1, or divide by it"),
    ("clamp-indirect", "cycles.sample_clamp_indirect", 0.0, None, None,
     "indirect clamp {:.4g} cuts bright bounced samples, not direct light: set it to 0"),
    ("fast-gi", "cycles.use_fast_gi", False, None, "error",
     "fast GI puts ambient occlusion on top or in place of bounced light: switch it off"),
    ("denoising", "cycles.use_denoising", False, None, None,
     "the denoiser guesses pixels from their neighbours: switch it off, take more samples"),
    ("adaptive-sampling", "cycles.use_adaptive_sampling", False, None, None,
     "the noise threshold ends pixels before they meet what is bright, too dark: switch it off"),
    ("pixel-filter", "cycles.pixel_filter_type", "BOX", 0.0, None,
     "filter {} spreads samples over pixels: means stay, edges do not: take Box"),
    ("light-threshold", "cycles.light_sampling_threshold", 0.0, 0.0, None,
     "light threshold {:.3g} adds noise, no bias (and nothing with the light tree)"),
    ("time-limit", "cycles.time_limit", 0.0, 0.0, None,
     "the time limit of {:g} s may leave noise, no bias"),
    ("compositor", "compositor", "", None, None,
     "the compositor changes the picture ({}): switch it off under Post Processing"),
    ("sequencer", "sequencer", False, None, "error",
     "the sequencer's strips take the picture's place: switch it off under Post Processing"),
    ("simplify", "render.use_simplify", False, None, None,
     "Simplify cuts subdivisions and textures, and may cull objects: switch it off"),
    ("resolution-percentage", "render.resolution_percentage", 100, 0.0, None,
     "the picture has {} % of its resolution, and the same light"),
    ("material-override", "material_override", "", None, "error",
     "the layer's material {} takes the emission of meshes away, closes glass: clear it"),
)
# fmt: on


@dataclass(frozen=True)
class Lint:
    """A scene with its settings (see `render_settings`), and what small pictures of it tell."""

    scene: Scene
    settings: Mapping[str, Any]
    threads: int | None = None

    def __getitem__(self, setting: str) -> Any:
        return self.settings[setting]

    def small(self, **changed: Any) -> Scene:
        """Return the `changed` scene with a small picture."""
        own = self.scene.resolution
        width, height = (max(1, side * SIDE // max(own)) for side in own)
        return replace(self.scene, resolution=(width, height), border=None, **changed)

    def _picture(self, scene: Scene, samples: int, seconds: float | None = None) -> Film | None:
        if scene.camera is None:
            return None
        return render(scene, Settings(samples, threads=self.threads, time_limit=seconds))

    @cached_property
    def film(self) -> Film | None:
        """The scene as it is; None without a camera."""
        return self._picture(self.small(), SAMPLES, SECONDS)

    def without(self, **changed: Any) -> dict[str, float]:
        """Return what the scene as it is gives over the `changed` one [%], by light and in all.

        Empty without a camera or the time for a sample; all lights together are ``""``. Both
        pictures are of the same samples: most noise goes where one is divided by the other.
        """
        taken = 0 if self.film is None else int(self.film.samples.min())
        other = self._picture(self.small(**changed), taken) if taken else None
        if self.film is None or other is None:
            return {}
        kept = ~(self.film.excluded | other.excluded) & (self.film.samples == taken)
        own, others = (
            {name: float(layer[kept].sum()) for name, layer in film.lights.items()}
            for film in (self.film, other)
        )
        pairs = {name: (own.get(name, 0.0), light) for name, light in others.items()}
        pairs[""] = (sum(own.values()), sum(others.values()))
        return {name: 100.0 * (a / b - 1.0) for name, (a, b) in pairs.items() if b}

    def with_lights(self, lights: Iterable[Light], names: set[str], message: str) -> Iterator[Said]:
        """Yield what tells the lights `names` from those in their place."""
        effects = self.without(lights=tuple(lights)) if names else {}
        yield from (Said(message, effects.get(name), None, name) for name in sorted(names))

    @property
    def of_reflections(self) -> Severity:
        """How much counts what acts on reflections and glass alone."""
        return "warning" if any(m.unsupported for m in self.scene.materials) else "info"

    @cached_property
    def albedo(self) -> float:
        """Mean albedo π Σ L / Σ E of what the camera sees, weighted by the light on it."""
        if self.film is None or not self.film.irradiance.any():
            return CLAY_ALBEDO
        reflected = (self.film.radiance - self.film.seen)[~self.film.excluded].sum()
        received = self.film.irradiance[~self.film.excluded].sum()
        return float(np.clip(np.pi * reflected / max(received, 1e-30), 0.0, 1.0))


Rule = Callable[[Lint], Iterator[Said]]
RULES: dict[str, Rule] = {}
# By code, what makes a finding go away and is safe: values by the path from the scene, or, where it
# begins with ``data``, from the object that the finding is about.
FIXES: dict[str, dict[str, Any]] = {
    code: {setting: harmless} for code, setting, harmless, *_ in PLAIN if "." in setting
} | {
    "compositor": {"render.use_compositing": False},
    "sequencer": {"render.use_sequencer": False},
}


def rule(code: str, fix: Mapping[str, Any] | None = None) -> Callable[[Rule], Rule]:
    """Return a decorator that makes a function the rule `code`, which `fix` would satisfy."""
    if fix:
        FIXES[code] = dict(fix)
    return lambda function: RULES.setdefault(code, function)


@rule("view-exposure")
def _view(lint: Lint) -> Iterator[Said]:
    names = ("exposure", "gamma", "view_transform", "look")
    said = ", ".join(f"{name} {lint[f'view_settings.{name}']}" for name in names)
    yield Said(f"the view ({said}) is in PNG and JPEG only, EXR has radiance: measure there", 0.0)


@rule("output-format")
def _output(lint: Lint) -> Iterator[Said]:
    names = ("file_format", "exr_codec", "color_depth")
    kind, codec, depth = (lint[f"render.image_settings.{name}"] for name in names)
    if "EXR" not in kind:
        yield Said(f"{kind} holds display colours, cut at white: save OpenEXR of 32 bits")
    elif codec in LOSSY or depth == "16":
        yield Said(f"EXR of {depth} bits with {codec} rounds: save 32 bits with ZIP", None, "info")


@rule("clamp-direct", {"cycles.sample_clamp_direct": 0.0})
def _clamp_direct(lint: Lint) -> Iterator[Said]:
    """Take it as a limit on the mean of R, G and B: E[min(x, c)] ≤ min(E[x], c) for any noise."""
    if (limit := lint["cycles.sample_clamp_direct"]) > 0.0:
        film, lost = lint.film, 0.0
        if film is not None:
            light = film.radiance[~film.excluded].mean(axis=1)
            lost = float(np.maximum(light - limit, 0.0).sum() / max(light.sum(), 1e-30))
        said = "cuts bright samples, this much of the light at least: set it to 0"
        yield Said(f"direct clamp {limit:.4g} {said}", -100.0 * lost or None)


@rule("bounces", {"cycles.max_bounces": MOST_BOUNCES, "cycles.diffuse_bounces": MOST_BOUNCES})
def _bounces(lint: Lint) -> Iterator[Said]:
    """In a closed room of albedo ρ the light is E Σ ρᵏ: after n bounces ρⁿ⁺¹ of it is missing."""
    count = min(lint["cycles.max_bounces"], lint["cycles.diffuse_bounces"])
    lost = 100.0 * lint.albedo ** (count + 1)
    said = f"{count} diffuse bounces at a mean albedo of {lint.albedo:.2f} lose up to {lost:.2g} %"
    severity: Severity = "warning" if lost >= SAME else "info"
    yield Said(f"{said} of the light, if the room is closed: raise both limits", -lost, severity)


@rule("glossy-filter", {"cycles.blur_glossy": 0.0})
def _glossy(lint: Lint) -> Iterator[Said]:
    if (blur := lint["cycles.blur_glossy"]) > 0.0:
        said = "blurs bounced reflections, direct light is left: set it to 0"
        yield Said(f"filter glossy {blur:.4g} {said}", None, lint.of_reflections)


@rule("caustics", {"cycles.caustics_reflective": True, "cycles.caustics_refractive": True})
def _caustics(lint: Lint) -> Iterator[Said]:
    kinds = [k for k in ("reflective", "refractive") if not lint[f"cycles.caustics_{k}"]]
    if kinds:
        said = "light that glass and metal throw is missing: switch them on"
        yield Said(f"{' and '.join(kinds)} caustics are off, {said}", None, lint.of_reflections)


@rule("working-space")
def _working_space(lint: Lint) -> Iterator[Said]:
    if (space := lint.scene.working_space) != "Linear Rec.709":
        weights = ", ".join(f"{weight:.4f}" for weight in lint.scene.luminance_weights)
        yield Said(f"RGB are {space}: luminance weighs them {weights}, not as Rec.709", 0.0)


@rule("default-world")
def _default_world(lint: Lint) -> Iterator[Said]:
    world = lint.scene.world
    if world.known and np.allclose(world.radiance, DEFAULT_WORLD, rtol=1e-3):
        said = f"Blender's grey world adds {math.pi * DEFAULT_WORLD:.2f} W/m²: black, if unmeant"
        yield Said(said, lint.without(world=World()).get(""), "warning")


@rule("blocked-driver")
def _dark_by_driver(lint: Lint) -> Iterator[Said]:
    blocked = {f.object for f in lint.scene.findings if f.code == "blocked-driver"}
    for record in lint.scene.light_records:
        if {record.name, record.data} & blocked and not record.properties["energy"]:
            said = "its strength is 0, since its driver may not run: bake it, or set a value"
            yield Said(said, -100.0, "error", record.data)


@rule("light-linking")
def _linking(lint: Lint) -> Iterator[Said]:
    said = "makes light that no lamp gives: clear it for a photometric render"
    effects = lint.without(linking={}) if lint.scene.linking else {}
    for name in lint.scene.linking:
        yield Said(f"light linking {said}", effects.get(name), "warning", name)
    for one in lint.scene.unsupported:
        if one.feature == "Shadow catcher":
            yield Said(f"a shadow catcher {said}", None, "warning", one.name)
    held = {k for k, material in enumerate(lint.scene.materials) if material.held_out}
    for name in {i.name for i in lint.scene.instances if held.intersection(i.materials)}:
        yield Said("a holdout is a hole in the picture, whatever its light", None, "warning", name)


@rule("soft-falloff", {"data.use_soft_falloff": False})
def _soft_falloff(lint: Lint) -> Iterator[Said]:
    every: list[Any] = [*lint.scene.lights]
    soft = (light for light in every if getattr(light, "soft_falloff", False))
    names = {light.name for light in soft if light.radius > 0.0}
    lights = [replace(x, soft_falloff=False) if x.name in names else x for x in every]
    said = "soft falloff makes it a disc that faces every point: switch it off"
    yield from lint.with_lights(lights, names, said)


@rule("area-sheared")
def _sheared(lint: Lint) -> Iterator[Said]:
    """Hold its light against the physical model's: true outline, area and normal."""
    scene = lint.scene
    names = {light.name for light in scene.lights if "area-sheared" in light.notes}
    if scene.unit_scale_m == 1.0 and scene.model == "cycles":
        true = (light_from_record(r, "physical") for r in scene.light_records if r.name in names)
        lights = [light for light in scene.lights if light.name not in names]
        said = "its axes are askew, and Cycles takes a wrong area: unscale its parent"
        yield from lint.with_lights([*lights, *filter(None, true)], names, said)


@rule("terminator")
def _terminator(lint: Lint) -> Iterator[Said]:
    offsets = ("terminator_geometry_offset", "terminator_shading_offset")
    smooth = [i for i in lint.scene.instances if lint.scene.meshes[i.mesh].smooth.any()]
    moved = {i.name for i in smooth if any(getattr(i, name) for name in offsets)}
    if moved:
        plain = tuple(replace(i, **dict.fromkeys(offsets, 0.0)) for i in lint.scene.instances)
        what = f"shadow terminator offsets of {len(moved)} smooth objects, such as {min(moved)},"
        effect = lint.without(instances=plain).get("")
        yield Said(f"{what} move light at the shadow's edge: set them to 0", effect, "warning")


@rule("glass-blocks-light")
def _glass(lint: Lint) -> Iterator[Said]:
    """Hold it against the same scene without the shadows of what bends light."""
    glass = {k for k, material in enumerate(lint.scene.materials) if material.glass}
    stops = [i.visible_shadow and not glass.isdisjoint(i.materials) for i in lint.scene.instances]
    pairs = list(zip(lint.scene.instances, stops, strict=True))
    names = sorted({instance.name for instance, stopping in pairs if stopping})
    if not names:
        return
    clear = tuple(replace(i, visible_shadow=i.visible_shadow and not own) for i, own in pairs)
    effect = lint.without(instances=clear).get("")
    if effect is None or abs(effect) >= SAME:
        said = f"glass ({', '.join(names[:3])}) stops direct light, which passes as caustics alone"
        remedy = "for light that passes straight switch off its shadow rays"
        yield Said(f"{said}, noisy, after bounces: {remedy}", effect, "warning")


@rule("coincident-faces")
def _coincident(lint: Lint) -> Iterator[Said]:
    """Hold what such faces send to the camera against the whole: all of it may be lost."""
    for cause, mask in coincident_faces(DirectLight(lint.small())).items():
        total = 0.0 if lint.film is None else float(np.abs(lint.film.radiance).sum())
        share = float(np.abs(lint.film.radiance[mask]).sum()) / total if lint.film and total else 0
        said = f"{cause.feature}: rounding alone decides whether Cycles lights them"
        remedy = "delete one of the two, or move them apart"
        yield Said(f"{said}; {remedy}", -100.0 * share, "warning", cause.name)


@rule("gltf-emission")
def _gltf_emission(lint: Lint) -> Iterator[Said]:
    names = sorted({m.name for m in lint.scene.materials if m.emits or not m.emission_known})
    if names and lint.scene.file.lower().endswith((".gltf", ".glb")):
        said = "glTF emission counts cd/m², Blender takes it for W/(m² sr): divide by 683"
        yield Said(f"{said} ({', '.join(names[:3])})", 100.0 * (GLTF_LM_W - 1.0))


def found_by(code: str, scene: Scene, threads: int | None = None) -> list[Finding]:
    """Return what the rule `code`, which asks for no settings, finds in a scene."""
    return [_finding(code, said) for said in RULES[code](Lint(scene, {}, threads))]


def _finding(code: str, said: Said) -> Finding:
    message, effect, severity, about = said
    size = SAME if effect is None else abs(effect)  # what only may be is a warning
    certain = "error" if size >= NOTICEABLE else "warning" if size >= SAME else "info"
    return Finding(code, severity or certain, about, message, effect)


def _said(lint: Lint) -> Iterator[tuple[str, Said]]:
    for code, setting, harmless, effect, severity, message in PLAIN:
        if (value := lint[setting]) != harmless:
            known = effect(value) if callable(effect) else effect
            yield code, Said(message.format(value), known, severity)
    yield from ((code, said) for code, one in RULES.items() for said in one(lint))
    for name, note in light_notes(lint.scene):
        severity = "error" if note.code in CERTAIN else "info"
        severity = "warning" if note.code in POSSIBLE else severity
        yield note.code, Said(note.message, note.effect_percent, severity, name)


def lint(
    scene: Scene,
    settings: Mapping[str, Any],
    threads: int | None = None,
    measured: Mapping[str, float] | None = None,
) -> list[Finding]:
    """Return all findings, the gravest first; `measured` effects [%] by code replace our own."""
    known = measured or {}
    findings = [
        _finding(code, Said(said.message, known[code], None, said.about) if code in known else said)
        for code, said in _said(Lint(scene, settings, threads))
    ]
    found: dict[tuple[str, str], Finding] = {}
    for finding in (*findings, *scene.findings):
        found.setdefault((finding.code, finding.object or finding.message), finding)
    return sorted(found.values(), key=lambda finding: GRAVITY.index(finding.severity))
