# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings and set-ups that bias a photometric render, each with its effect; a function a rule.

An effect is that on the light of the whole picture, of one light where it is about one. It comes
from the setting's own equation, or from a small picture of our engine with and without. Certain and
at least 1 % is an error, what may be, or is smaller, a warning; the rest is good to know.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .emitters import WORLD_NAME
from .errors import Finding, Severity
from .film import Film
from .inspection import light_notes
from .lights import light_from_record
from .quantities import GLTF_LM_W
from .rendering import Settings, render
from .scene import CLAY_ALBEDO, Scene

Array = NDArray[np.float64]

NOTICEABLE = 1.0  # [%], as `check` tolerates by default
SAME = 0.01  # [%]
SIDE, SAMPLES = 64, 32  # of the small pictures: pixels of the longer side, samples a pixel
GRAVITY = ("error", "warning", "info")
DEFAULT_WORLD = 0.05087609  # Blender's
CERTAIN = {"negative-energy", "unit-scale"}  # notes of lights that are errors whatever the picture
POSSIBLE = {"soft-falloff", "not-normalised", "no-shadow", "spot-cone", "ies-efficacy"}


class Said(NamedTuple):
    """What a rule found; without a severity the effect gives it, as the module says."""

    message: str
    effect_percent: float | None = None
    severity: Severity | None = None
    about: str = ""


@dataclass(frozen=True)
class Lint:
    """A scene with its settings (see `render_settings`), and what small pictures of it tell."""

    scene: Scene
    settings: Mapping[str, Any]
    threads: int | None = None

    def __getitem__(self, setting: str) -> Any:
        return self.settings.get(setting)

    def picture(self, scene: Scene) -> Film | None:
        """Return a small picture of `scene`, None without a camera."""
        if scene.camera is None:
            return None
        width, height = (max(1, side * SIDE // max(scene.resolution)) for side in scene.resolution)
        small = replace(scene, resolution=(width, height), border=None)
        return render(small, Settings(samples=SAMPLES, threads=self.threads))

    @cached_property
    def film(self) -> Film | None:
        """The scene as it is."""
        return self.picture(self.scene)

    @cached_property
    def luminance(self) -> Array:
        """Radiance of the compared pixels, weighted as luminance, (n,)."""
        if self.film is None:
            return np.zeros(0)
        return self.film.radiance[~self.film.excluded] @ np.array(self.scene.luminance_weights)

    def without(self, **changed: Any) -> dict[str, float]:
        """Return what the scene as it is gives over the `changed` one [%], by light and in all.

        Empty without a camera; all lights together are ``""``.
        """
        if self.film is None or (other := self.picture(replace(self.scene, **changed))) is None:
            return {}
        kept = ~(self.film.excluded | other.excluded)
        pairs = {
            name: (float(self.film.lights[name][kept].sum()), float(layer[kept].sum()))
            for name, layer in other.lights.items()
        }
        pairs[""] = (sum(a for a, _ in pairs.values()), sum(b for _, b in pairs.values()))
        return {name: 100.0 * (a / b - 1.0) for name, (a, b) in pairs.items() if b}

    @property
    def only_glossy(self) -> Severity:
        """How much counts what acts on reflections and glass alone."""
        return "warning" if any(m.unsupported for m in self.scene.materials) else "info"

    @cached_property
    def albedo(self) -> float:
        """Mean albedo by area; what is not plain Lambert counts as clay."""
        total, areas = 0.0, 0.0
        for placed in self.scene.instances:
            mesh, turned = self.scene.meshes[placed.mesh], placed.world_from_object[:3, :3].T
            a, b, c = np.moveaxis((mesh.vertices @ turned)[mesh.triangles], 1, 0)
            area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
            materials = [self.scene.materials[m] for m in placed.materials]
            known = [CLAY_ALBEDO if m.unsupported else np.mean(m.albedo) for m in materials]
            total += float(area @ np.array(known)[np.minimum(mesh.slots, len(known) - 1)])
            areas += float(area.sum())
        return min(total / areas, 1.0) if areas else 0.0


Rule = Callable[[Lint], Iterator[Said]]
RULES: dict[str, Rule] = {}


def rule(code: str) -> Callable[[Rule], Rule]:
    """Return a decorator that makes a function the rule `code`."""
    return lambda function: RULES.setdefault(code, function)


class Plain(NamedTuple):
    """A rule of one setting: what is said of any value but the `harmless` one."""

    code: str
    setting: str
    harmless: object
    message: str
    effect_percent: float | None = None
    severity: Severity | None = None


PLAIN = (
    Plain(
        "engine", "render.engine", "CYCLES", "{} is no path tracer in units of light: take Cycles"
    ),
    Plain(
        "clamp-indirect",
        "cycles.sample_clamp_indirect",
        0.0,
        "indirect clamp {:.4g} cuts bright bounced samples, caustics first; direct light is left: "
        "set it to 0",
    ),
    Plain(
        "fast-gi",
        "cycles.use_fast_gi",
        False,
        "fast GI puts ambient occlusion in the place of, or on top of, the light that bounces: "
        "switch it off",
        severity="error",
    ),
    Plain(
        "denoising",
        "cycles.use_denoising",
        False,
        "the denoiser guesses pixels from their neighbours: switch it off and take more samples",
    ),
    Plain(
        "adaptive-sampling",
        "cycles.use_adaptive_sampling",
        False,
        "the noise threshold ends pixels that have met nothing bright yet, which leaves them too "
        "dark on average: lower it, or switch it off",
    ),
    Plain(
        "pixel-filter",
        "cycles.pixel_filter_type",
        "BOX",
        "filter {} spreads samples over pixels: means stay, edges do not: take Box",
        0.0,
    ),
    Plain(
        "light-threshold",
        "cycles.light_sampling_threshold",
        0.0,
        "light threshold {:.3g} adds noise, no bias (the light tree ignores it)",
        0.0,
    ),
    Plain("time-limit", "cycles.time_limit", 0.0, "{:g} s may end in noise, not in bias", 0.0),
    Plain(
        "compositor",
        "compositor",
        "",
        "the compositor changes the picture ({}): switch it off under Post Processing",
    ),
    Plain(
        "sequencer",
        "sequencer",
        False,
        "the sequencer's strips take the picture's place: switch it off under Post Processing",
        severity="error",
    ),
    Plain(
        "simplify",
        "render.use_simplify",
        False,
        "Simplify cuts subdivisions and textures, and may cull objects: switch it off",
    ),
    Plain(
        "resolution-percentage",
        "render.resolution_percentage",
        100,
        "the picture has {} % of its resolution, and the same light",
        0.0,
    ),
    Plain(
        "material-override",
        "material_override",
        "",
        "the view layer's material {} takes the emission of meshes away, and closes glass and "
        "leaves: clear it",
        severity="error",
    ),
)


def _plain(settings: Mapping[str, Any]) -> Iterator[tuple[str, Said]]:
    for one in PLAIN:
        if (value := settings[one.setting]) != one.harmless:
            yield one.code, Said(one.message.format(value), one.effect_percent, one.severity)


@rule("film-exposure")
def _film_exposure(lint: Lint) -> Iterator[Said]:
    if (factor := lint["cycles.film_exposure"]) != 1.0:
        said = (
            f"film exposure {factor:.4g} multiplies every EXR value: set it to 1, or divide by it"
        )
        yield Said(said, 100.0 * (factor - 1.0))


@rule("view-exposure")
def _view(lint: Lint) -> Iterator[Said]:
    names = ("exposure", "gamma", "view_transform", "look")
    said = ", ".join(f"{name} {lint[f'view_settings.{name}']}" for name in names)
    yield Said(f"the view ({said}) is in PNG and JPEG only, EXR has radiance: measure there", 0.0)


@rule("output-format")
def _output(lint: Lint) -> Iterator[Said]:
    image = "render.image_settings."
    kind, depth = lint[f"{image}file_format"], lint[f"{image}color_depth"]
    if "EXR" not in kind:
        yield Said(f"{kind} holds display colours, cut at white: save OpenEXR of 32 bits", None)
    elif lint[f"{image}exr_codec"] in ("DWAA", "DWAB", "B44", "B44A", "PXR24"):
        yield Said("this EXR codec rounds values: save with ZIP or without compression", None)
    elif depth == "16":
        yield Said("half floats round by up to 0.05 % and end at 65504: save 32 bits", 0.05, "info")


@rule("clamp-direct")
def _clamp_direct(lint: Lint) -> Iterator[Said]:
    limit, light = lint["cycles.sample_clamp_direct"], lint.luminance
    if limit > 0.0:
        lost = np.maximum(light - limit, 0.0).sum() / light.sum() if light.any() else 0.0
        said = "cuts bright samples, and with them light; at least the effect given: set it to 0"
        yield Said(f"direct clamp {limit:.4g} {said}", -100.0 * float(lost) or None)


@rule("bounces")
def _bounces(lint: Lint) -> Iterator[Said]:
    """In a closed room of albedo ρ the light is E Σ ρᵏ: after n bounces ρⁿ⁺¹ of it is missing."""
    count = min(lint["cycles.max_bounces"], lint["cycles.diffuse_bounces"])
    lost = -100.0 * lint.albedo ** (count + 1)
    said = f"{count} diffuse bounces at a mean albedo of {lint.albedo:.2f} lose up to {-lost:.2g} %"
    severity: Severity = "warning" if -lost >= SAME else "info"
    yield Said(f"{said} of the light, if the room is closed: raise both limits", lost, severity)


@rule("glossy-filter")
def _glossy(lint: Lint) -> Iterator[Said]:
    if (blur := lint["cycles.blur_glossy"]) > 0.0:
        said = "blurs bounced reflections, direct light is left: set it to 0"
        yield Said(f"filter glossy {blur:.4g} {said}", None, lint.only_glossy)


@rule("caustics")
def _caustics(lint: Lint) -> Iterator[Said]:
    kinds = [k for k in ("reflective", "refractive") if not lint[f"cycles.caustics_{k}"]]
    if kinds:
        said = "light that glass and metal throw is missing: switch them on"
        yield Said(f"{' and '.join(kinds)} caustics are off, {said}", None, lint.only_glossy)


@rule("working-space")
def _working_space(lint: Lint) -> Iterator[Said]:
    if (space := lint.scene.working_space) != "Linear Rec.709":
        weights = ", ".join(f"{weight:.4f}" for weight in lint.scene.luminance_weights)
        yield Said(f"RGB are {space}: luminance weighs them {weights}, not as Rec.709", 0.0)


@rule("default-world")
def _default_world(lint: Lint) -> Iterator[Said]:
    world, film = lint.scene.world, lint.film
    if not (world.known and np.allclose(world.radiance, DEFAULT_WORLD, rtol=1e-3)):
        return
    said = "Blender's default grey world lights the scene with 0.16 W/m²: make it black if unmeant"
    effect = None
    if film and WORLD_NAME in film.lights:
        parts = {n: float(layer[~film.excluded].sum()) for n, layer in film.lights.items()}
        rest = sum(parts.values()) - parts[WORLD_NAME]
        effect = 100.0 * parts[WORLD_NAME] / rest if rest > 0.0 else None
    yield Said(said, effect, "warning")


@rule("blocked-driver")
def _dark_by_driver(lint: Lint) -> Iterator[Said]:
    blocked = {f.object for f in lint.scene.findings if f.code == "blocked-driver"}
    for record in lint.scene.light_records:
        if {record.name, record.data} & blocked and not record.properties["energy"]:
            said = (
                "its strength is 0, since its driver may not run: bake the driver, or set a value"
            )
            yield Said(said, -100.0, "error", record.data)


@rule("light-linking")
def _linking(lint: Lint) -> Iterator[Said]:
    for one in lint.scene.unsupported:
        if one.feature in ("Light linking", "Shadow catcher", "Holdout"):
            said = "makes light that no real lamp gives: clear it for a photometric render"
            yield Said(f"{one.feature.lower()} {said}", None, "warning", one.name)


@rule("soft-falloff")
def _soft_falloff(lint: Lint) -> Iterator[Said]:
    soft = {li.name: li for li in lint.scene.lights if getattr(li, "soft_falloff", False)}
    soft = {name: light for name, light in soft.items() if getattr(light, "radius", 0.0) > 0.0}
    hard = {name: replace(light, soft_falloff=False) for name, light in soft.items()}  # type: ignore[call-arg]
    swapped = tuple(hard.get(light.name, light) for light in lint.scene.lights)
    for name, effect in (lint.without(lights=swapped) if hard else {}).items():
        if name in hard:
            said = "soft falloff makes it a disc that faces every point: switch it off"
            yield Said(said, effect, None, name)


@rule("area-sheared")
def _sheared(lint: Lint) -> Iterator[Said]:
    """Hold its light against the physical model's: true outline, area and normal."""
    sheared = {light.name for light in lint.scene.lights if "area-sheared" in light.notes}
    records = {r.name: r for r in lint.scene.light_records if r.name in sheared}
    if lint.scene.unit_scale_m != 1.0 or lint.scene.model != "cycles" or not records:
        return
    true = {name: light_from_record(record, "physical") for name, record in records.items()}
    swapped = tuple(true.get(light.name) or light for light in lint.scene.lights)
    for name, effect in lint.without(lights=swapped).items():
        if name in true:
            said = "its axes are askew, and Cycles takes a wrong area: unscale its parent"
            yield Said(said, effect, None, name)


@rule("terminator")
def _terminator(lint: Lint) -> Iterator[Said]:
    offsets = ("terminator_geometry_offset", "terminator_shading_offset")
    placed = lint.scene.instances
    smooth = [i for i in placed if lint.scene.meshes[i.mesh].smooth.any()]
    moved = [i.name for i in smooth if any(getattr(i, name) for name in offsets)]
    if moved:
        plain = tuple(replace(i, **dict.fromkeys(offsets, 0.0)) for i in placed)
        effect = lint.without(instances=plain).get("")
        what = f"shadow terminator offsets of {len(set(moved))} smooth objects, such as {moved[0]},"
        yield Said(f"{what} move light at the shadow's edge: set them to 0", effect, "warning")


@rule("gltf-emission")
def _gltf_emission(lint: Lint) -> Iterator[Said]:
    names = sorted({m.name for m in lint.scene.materials if m.emits or not m.emission_known})
    if names and lint.scene.file.lower().endswith((".gltf", ".glb")):
        said = "glTF emission counts cd/m², Blender takes it for W/(m² sr): divide by 683"
        yield Said(f"{said} ({', '.join(names[:3])})", 100.0 * (GLTF_LM_W - 1.0))


def severity_of(effect_percent: float | None) -> Severity:
    """Return how bad a certain effect is; None is one that may be."""
    if effect_percent is None:
        return "warning"
    size = abs(effect_percent)
    return "error" if size >= NOTICEABLE else "warning" if size >= SAME else "info"


def lint(scene: Scene, settings: Mapping[str, Any], threads: int | None = None) -> list[Finding]:
    """Return all findings, the gravest first."""
    facts = Lint(scene, settings, threads)
    found = [
        Finding(
            code,
            said.severity or severity_of(said.effect_percent),
            said.about,
            said.message,
            said.effect_percent,
        )
        for code, said in (
            *_plain(settings),
            *((code, said) for code, one in RULES.items() for said in one(facts)),
        )
    ]
    for name, note in light_notes(scene):
        severity = "error" if note.code in CERTAIN else "info"
        severity = "warning" if note.code in POSSIBLE else severity
        found.append(Finding(note.code, severity, name, note.message, note.effect_percent))
    first: dict[tuple[str, str], Finding] = {}
    for finding in (*found, *scene.findings):
        first.setdefault((finding.code, finding.object or finding.message), finding)
    return sorted(first.values(), key=lambda finding: GRAVITY.index(finding.severity))
