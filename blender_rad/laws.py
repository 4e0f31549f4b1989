# SPDX-License-Identifier: GPL-3.0-or-later
"""The three laws of the lecture, put to the materials of a scene, and what no real surface has.

f(i, r) ≥ 0, f(i, r) = f(r, i), and ∫ f cosθ_r dω_r ≤ 1 of light from any ω_i, as `goniometer`
measures them. Blender's own closures break the last two by construction: that is named, and no
error as long as white surroundings are not outshone.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from .arrays import Floats
from .bsdfs import BSDFS
from .errors import Finding
from .goniometer import ALONE, ANGLES_DEG, DIRECTIONS, Goniometer, Response, Spots, expressions
from .plausible import RANGES, nearest
from .scene import Material, Scene
from .textures import Context, Expression, constant

REFINED, MOST = 4, 2048  # the brightest are looked at again by so many directions
ENERGY = 0.005  # above 1, that is not yet a broken law: the error of so many directions
ASYMMETRY = 1e-4  # likewise, far above rounding
STEEP = 7  # angles up to 60°: there Blender's closures keep the furnace within
OWN = 0.02  # of 1
LOST = "lost energy is given back by the viewer's angle alone"
BACKS = "light that passes counts on facets that it meets from behind"
KNOWN = {
    "ShaderNodeBsdfPrincipled": "layers take from those below by the viewer's angle alone",
    "ShaderNodeBsdfSheen": "the fit of the fibres knows the viewer's angle alone",
    "ShaderNodeBsdfAnisotropic": LOST,
    "ShaderNodeBsdfMetallic": LOST,
    "ShaderNodeBsdfGlass": f"{LOST}; {BACKS}",
    "ShaderNodeBsdfRefraction": BACKS,
}
FLAWED = {"PHONG": "the highlight divides by the light's cosine alone"}
LOSING = {"GGX", "BECKMANN", "ASHIKHMIN_SHIRLEY"}  # distributions that give nothing back
BY_VIEW = {"ShaderNodeFresnel", "ShaderNodeLayerWeight"}
METAL = "ShaderNodeBsdfMetallic"
REFLECTANCES = {
    "ShaderNodeBsdfDiffuse": ("reflectance", "Color"),
    "ShaderNodeBsdfTranslucent": ("reflectance", "Color"),
    METAL: ("reflectance of metal", "Base Color"),
}


@dataclass(frozen=True)
class Judged:
    """A material put to the laws; all but name and findings None where it is not supported."""

    name: str
    supported: bool
    findings: tuple[Finding, ...]
    positive: bool | None = None
    reciprocal: bool | None = None
    energy_conserving: bool | None = None
    max_albedo: float | None = None  # the largest share reflected, of any channel, and where
    max_albedo_angle_deg: float | None = None
    asymmetry: float | None = None  # the largest, of 2
    angles_deg: tuple[float, ...] | None = None
    albedo: Floats | None = None  # (a, 3) mean over the surface by angle of incidence
    furnace: Floats | None = None  # (a, 3) by angle of view


def judge(scene: Scene) -> list[Judged]:
    """Return all materials of a scene with what the laws say, in its order."""
    goniometer = Goniometer(scene)
    return [_judged(goniometer, k, material) for k, material in enumerate(scene.materials)]


def _judged(goniometer: Goniometer, index: int, material: Material) -> Judged:
    missing = [each.feature for each in material.unsupported]
    missing += [c.kind for c in material.closures if c.kind not in BSDFS]
    spots = None if missing else goniometer.spots(index)
    if spots is None:
        unseen = "what Blender alone computes is out of view" if material.measured else "not in use"
        said = "cannot be judged: " + (", ".join(dict.fromkeys(missing)) or unseen)
        return Judged(material.name, False, (Finding("unsupported", "info", material.name, said),))
    return Subject(goniometer, index, material, spots).judged()


@dataclass(frozen=True)
class Subject:
    """A material at spots on its surfaces."""

    goniometer: Goniometer
    index: int
    material: Material
    spots: Spots

    def judged(self) -> Judged:
        count = DIRECTIONS if len(self.spots.hits.instance) > 1 else ALONE
        found = self.goniometer.response(self.spots, ANGLES_DEG, count, 1)
        most, point, angle = self._greatest(found, "albedo", len(ANGLES_DEG))
        asymmetry = float(found.asymmetry.max())
        broken = self._broken(found, most, self._where(point, angle), self._too_bright(point))
        return Judged(
            name=self.material.name,
            supported=True,
            findings=(*broken, *self._implausible()),
            positive=bool(found.least.min() >= 0.0),
            reciprocal=asymmetry < ASYMMETRY,
            energy_conserving=most < 1.0 + ENERGY,
            max_albedo=most,
            max_albedo_angle_deg=ANGLES_DEG[angle],
            asymmetry=asymmetry,
            angles_deg=ANGLES_DEG,
            albedo=found.albedo.mean(axis=0),
            furnace=found.furnace.mean(axis=0),
        )

    def _broken(self, found: Response, most: float, where: str, colours: str) -> Iterator[Finding]:
        """Yield a finding for each law that is broken: where, by how much, and why if known."""
        name, reasons = self.material.name, self._reasons
        flaw = "; ".join(FLAWED[c.kind] for c in self.material.closures if c.kind in FLAWED)
        least = found.least.min(axis=2)
        if least.min() < 0.0:
            said = f"f is {least.min():.3g} sr⁻¹ {self._where(*_place(-least))}: less than no light"
            yield Finding("not-positive", "error", name, said)
        if most >= 1.0 + ENERGY:
            seen, point, angle = self._greatest(found, "furnace", STEEP)
            outshone = seen >= 1.0 + OWN
            said = f"{most:.4g} of the light that arrives {where} leaves"
            if outshone:
                said += f", and {seen:.4g} of a white furnace is seen "
                said += self._where(point, angle)
            ours = outshone or not reasons
            why = colours or flaw or ("nothing shares it out" if ours else reasons)
            severity = "error" if ours else "info"
            yield Finding("gains-energy", severity, name, f"{said}: {why}", 100.0 * (most - 1.0))
        worst = found.asymmetry.max(axis=2)
        if worst.max() >= ASYMMETRY:
            where = self._where(*_place(worst))
            said = f"f(i, r) and f(r, i) are {100.0 * worst.max():.3g} % apart {where}"
            said += f": {flaw or reasons}" if flaw or reasons else ""
            yield Finding("not-reciprocal", "info" if reasons else "error", name, said)

    def _greatest(self, found: Response, name: str, angles: int) -> tuple[float, int, int]:
        """Return the greatest of a response's field, of any channel, and its point and angle.

        The most promising up to the angle are looked at again: noise is not to pass for light.
        """
        values = getattr(found, name)[:, :angles].max(axis=2)
        best = (0.0, 0, 0)
        for index in np.argsort(-np.round(values, 6), axis=None, kind="stable")[:REFINED]:
            p, a = (int(k) for k in np.unravel_index(index, values.shape))
            spot, angle = self.spots.take(np.array([p])), ANGLES_DEG[a : a + 1]
            again = getattr(self.goniometer.response(spot, angle, MOST, 2), name)
            best = max(best, (round(float(again.max()), 9), p, a), key=lambda one: one[0])
        return best

    def _where(self, point: int, angle: int) -> str:
        """Return a point and an angle in words."""
        told = f"at {ANGLES_DEG[angle]:g}°"
        if len(self.spots.hits.instance) == 1:
            return told
        spot = self.spots.take(np.array([point]))
        name = self.goniometer.scene.instances[int(spot.hits.instance[0])].name
        x, y, z = self.goniometer.surface(spot, self.goniometer.front(spot)).point[0]
        return f"{told} on {name} at ({x:.4g}, {y:.4g}, {z:.4g})"

    @property
    def _reasons(self) -> str:
        """Why it breaks laws as far as that is how Blender is made, in words."""
        material, reasons = self.material, dict[str, None]()
        for closure in material.closures:
            losing = closure.settings.get("distribution") in LOSING
            if closure.kind in KNOWN and not (losing and KNOWN[closure.kind] == LOST):
                reasons[KNOWN[closure.kind]] = None
        if {kind for each in expressions(material) for kind, _ in each.kinds} & BY_VIEW:
            reasons["Fresnel and Layer Weight nodes know the viewer's angle alone"] = None
        if material.normal or any(closure.normal for closure in material.closures):
            reasons["bent normals weigh the light's angle, not the viewer's"] = None
        return "by construction, " + "; ".join(reasons) if reasons else ""

    def _too_bright(self, point: int) -> str:
        """Return which colours are above 1 at a point, in words."""
        (context,) = self.goniometer.contexts(self.spots.take(np.array([point])), self.index)
        named = [
            (name, float(expression.evaluate(context).max()))
            for closure in self.material.closures
            for name, expression in closure.inputs.items()
            if name in ("Color", "Base Color") or name.endswith("Tint")
        ]
        return ", ".join(f"{name} is {value:.4g}" for name, value in named if value > 1.0)

    def _implausible(self) -> Iterator[Finding]:
        """Yield a finding for each number that no, or hardly any, measured surface has."""
        name, weights = self.material.name, np.array(self.goniometer.scene.luminance_weights)
        for quantity, socket, values in self._numbers():
            level = values @ weights if values.shape[1] == 3 else values[:, 0]
            low, high = RANGES[quantity]
            for end, out in (("low", level < low), ("high", level > high)):
                if not out.any():
                    continue
                value, share = float(np.mean(level[out])), 100.0 * np.mean(out)
                said = f"{socket} is {value:.3g} on {share:.3g} % of it, where by {quantity}"
                severity = "info" if quantity == "reflectance" and end == "low" else "warning"
                code = f"{quantity.replace(' ', '-').lower()}-{end}"
                yield Finding(code, severity, name, f"{said} {nearest(quantity, value)}")

    def _numbers(self) -> Iterator[tuple[str, str, Floats]]:
        """Yield quantities of `RANGES`, their sockets, and their values (n, 1 or 3)."""
        contexts = list(self.goniometer.contexts(self.spots, self.index))
        material = self.material
        if not material.closures and not material.passes and not material.emits:
            albedo, texture = constant(material.albedo), material.albedo_texture
            albedo = texture + albedo if texture else albedo
            yield "reflectance", "Color", _values(albedo, 3, contexts)
        for closure in material.closures:
            inputs, kind = closure.inputs, closure.kind
            quantity, socket = REFLECTANCES.get(kind, ("", ""))
            if kind == "ShaderNodeBsdfPrincipled":
                metal = _values(inputs["Metallic"], 1, contexts)[:, 0] > 0.5
                colour = _values(inputs["Base Color"], 3, contexts)
                yield "reflectance", "Base Color", colour[~metal]
                yield "reflectance of metal", "Base Color", colour[metal]
            elif socket in inputs:
                yield quantity, socket, _values(inputs[socket], 3, contexts)
            if "IOR" in inputs and kind != METAL:
                yield "IOR", "IOR", _values(inputs["IOR"], 1, contexts)


def _place(values: Floats) -> tuple[int, int]:
    """Return the indices of the greatest of values (p, a)."""
    point, angle = np.unravel_index(np.argmax(values), values.shape)
    return int(point), int(angle)


def _values(expression: Expression, width: int, contexts: list[Context]) -> Floats:
    """Return the values (n, width) of an expression."""
    return np.concatenate(
        [np.broadcast_to(expression.evaluate(c), (len(c.incoming), width)) for c in contexts]
    )
