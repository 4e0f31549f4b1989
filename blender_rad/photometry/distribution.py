# SPDX-License-Identifier: GPL-3.0-or-later
r"""What a photometric file says, in one model: luminous intensity over the sphere.

The luminaire hangs as in its data sheet: +z is up, gamma is measured from the nadir −z, and the
half-planes C turn from +x (C0) towards +y (C90), against the clock seen from above. The axes are
the file's own: IES files have the street side or the lamp's length along C0, EULUMDAT files have
the street side or the lamp's length along C90. Types A and B aim at the nadir, their upward
vertical angles turn to C0 and their rightward horizontal ones to C270 (as Radiance has it).

Every type keeps its own grid: longitudes about a pole and latitudes towards it, so that nothing is
resampled. Only the axes differ:

====  ================  ==============  =====  ======
type  longitude         latitude        pole   zero
====  ================  ==============  =====  ======
C     C                 gamma − 90°     +z     +x
A     horizontal angle  vertical angle  +x     −z
B     vertical angle    horizontal      −y     −z
====  ================  ==============  =====  ======
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..arrays import Bools, Floats
from ..errors import Finding

Kind = Literal["A", "B", "C"]
AXES: dict[Kind, Floats] = {  # rows: longitude 0, longitude 90, pole
    "A": np.array([[0.0, 0, -1], [0, -1, 0], [1, 0, 0]]),
    "B": np.array([[0.0, 0, -1], [1, 0, 0], [0, -1, 0]]),
    "C": np.eye(3),
}
SLACK_DEG = 1e-9  # rounding of angles that come from directions
CUT_STEP_DEG = 0.05


@dataclass(frozen=True)
class Opening:
    """The luminous opening: `shape` and extents [m] along C0–C180, C90–C270 and the vertical."""

    shape: str
    along_c0: float
    along_c90: float
    height: float


@dataclass(frozen=True)
class Distribution:
    """The light of a luminaire; [W/sr] and [W] stand for [cd] and [lm] where `radiometric`."""

    name: str  # as its maker calls it
    format: str  # such as ``LM-63-2002`` or ``EULUMDAT``
    kind: Kind  # says what longitude and latitude are, see the module
    longitude: Floats  # (m,) [deg], rising, two or more; symmetry is unfolded
    latitude: Floats  # (n,) likewise
    intensity: Floats  # (m, n) [cd]
    symmetry: str  # as the file declares it
    opening: Opening
    lamp_flux: float | None = None  # [lm] of all lamps; None where the photometry is absolute
    declared_flux: float | None = None  # [lm] of the luminaire, where the file states it
    downward_fraction: float | None = None  # of the flux, likewise
    input_power: float | None = None  # [W], likewise
    radiometric: bool = False
    tilt: tuple[tuple[float, float], ...] = ()  # [deg], and factor on the flux; not applied
    findings: tuple[Finding, ...] = ()

    def luminous_intensity(self, directions: Floats) -> Floats:
        """Return the luminous intensity (n,) [cd] towards `directions` (n, 3) of any length.

        Bilinear in the angles of the file's grid, 0 outside of it.

        Examples
        --------
        >>> spot = Opening("point", 0.0, 0.0, 0.0)
        >>> around, table = np.array([0.0, 360.0]), np.array([[100.0, 0.0], [100.0, 0.0]])
        >>> half = Distribution("", "", "C", around, np.array([-90.0, 0.0]), table, "axial", spot)
        >>> half.luminous_intensity(np.array([[1.0, 0, -1], [0, 0, 1]])).round(9).tolist()
        [50.0, 0.0]
        """
        x, y, z = AXES[self.kind] @ np.asarray(directions, dtype=np.float64).T
        first = self.longitude[0] - SLACK_DEG
        longitude = first + np.mod(np.degrees(np.arctan2(y, x)) - first, 360.0)
        latitude = np.degrees(np.arctan2(z, np.hypot(x, y)))
        i, u, in_longitude = cells(self.longitude, longitude)
        j, v, in_latitude = cells(self.latitude, latitude)
        table = self.intensity
        low = (1 - v) * table[i, j] + v * table[i, j + 1]
        high = (1 - v) * table[i + 1, j] + v * table[i + 1, j + 1]
        return np.where(in_longitude & in_latitude, (1 - u) * low + u * high, 0.0)

    @cached_property
    def zonal_flux(self) -> Floats:
        r"""The flux of each latitude zone, (n − 1,) [lm].

        Φ = Σ ½(Ī_j + Ī_{j+1}) Δλ (sin φ_{j+1} − sin φ_j): the mean over longitude Ī is linear
        between the table's planes; over a zone it is the mean of both edges. This is the rule of
        the IES handbook and of the trade's programs.
        """
        mean = self._over_longitude
        return 0.5 * (mean[:-1] + mean[1:]) * np.diff(np.sin(np.radians(self.latitude)))

    def luminous_flux(self) -> float:
        """Return the luminous flux [lm], the sum of `zonal_flux`."""
        return float(self.zonal_flux.sum())

    def interpolated_flux(self) -> float:
        r"""Return the flux [lm] of exactly what `luminous_intensity` returns.

        ∫ I cos φ dφ over a zone with I linear in φ is [I sin φ] + ΔI/Δφ · Δcos φ. Coarse steps
        beside a steep peak set it apart from `luminous_flux`.
        """
        mean, phi = self._over_longitude, np.radians(self.latitude)
        slope = np.diff(mean) / np.diff(phi)
        return float((np.diff(mean * np.sin(phi)) + slope * np.diff(np.cos(phi))).sum())

    @cached_property
    def _over_longitude(self) -> Floats:
        """The integral of the table over longitude, (n,) [cd rad]."""
        middle = 0.5 * (self.intensity[:-1] + self.intensity[1:])
        return np.diff(np.radians(self.longitude)) @ middle

    @property
    def peak(self) -> float:
        """The greatest intensity [cd] of the table."""
        return float(self.intensity.max())

    def cut(self, c_deg: float, gamma: Floats) -> Floats:
        """Return the intensity [cd] in the plane C at `gamma` (n,) [deg], negative for C + 180."""
        plane = directions(np.radians([c_deg]), np.radians(gamma - 90.0))[0]
        return self.luminous_intensity(plane)

    def beam_angle_deg(self, c_deg: float, fraction: float = 0.5) -> float | None:
        """Return the full angle [deg] in the plane C where the intensity falls to `fraction`.

        It is taken of the plane's own peak and between the outermost such directions of the
        hemisphere of that peak, down or up; a beam that reaches its rim goes on until it falls.
        0.5 is the beam angle, 0.1 the field angle. None where the plane is dark.
        """
        t = np.linspace(-180.0, 180.0, round(360 / CUT_STEP_DEG) + 1)
        profile = self.cut(c_deg, t)
        peak = int(profile.argmax())
        if profile[peak] <= 0:
            return None
        if abs(t[peak]) > 90:
            profile = np.roll(profile[:-1], len(t) // 2)
            profile = np.append(profile, profile[0])
        level = fraction * profile.max()
        return min(sum(_edge(side * t[::side], profile[::side], level) for side in (1, -1)), 360.0)


def _edge(t: Floats, profile: Floats, level: float) -> float:
    """Return the angle [deg] at which the light falls to `level` for rising t, negative across."""
    last = np.flatnonzero((profile >= level) & (np.abs(t) <= 90 + SLACK_DEG))[-1]
    dark = np.flatnonzero(profile[last:] < level)
    if not len(dark):
        return 180.0
    outer, inner = last + dark[0], last + dark[0] - 1
    return float(np.interp(level, profile[[outer, inner]], t[[outer, inner]]))


def directions(longitude: Floats, latitude: Floats) -> Floats:
    """Return unit vectors (m, n, 3) on the axes of a grid of m by n angles [rad]."""
    u, v = longitude[:, None], latitude[None, :]
    parts = np.cos(v) * np.cos(u), np.cos(v) * np.sin(u), np.sin(v) * np.ones_like(u)
    return np.asarray(np.stack(parts, axis=-1), dtype=np.float64)


def cells(knots: Floats, values: Floats) -> tuple[NDArray[np.intp], Floats, Bools]:
    """Return the cell of `values` (n,) among rising `knots`, the part in it, and whether inside."""
    cell = np.clip(np.searchsorted(knots, values, side="right") - 1, 0, len(knots) - 2)
    part = (values - knots[cell]) / (knots[cell + 1] - knots[cell])
    inside = (values >= knots[0] - SLACK_DEG) & (values <= knots[-1] + SLACK_DEG)
    return cell, np.clip(part, 0.0, 1.0), inside
