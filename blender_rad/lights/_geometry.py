# SPDX-License-Identifier: GPL-3.0-or-later
"""Irradiance of uniform shapes and sampling of directions, shared by the lights.

All irradiances are for unit radiance, unoccluded, with what lies below the horizon of the receiver
clipped away: E = ∫ max(n·ω, 0) dω over the shape. Arrays of points are (n, 3), those made here by
column (Fortran's order), along which NumPy's loops are several times faster than along three.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ._base import Array

Mask = NDArray[np.bool_]

TINY = 1e-300  # keeps 0/0 out where a point lies exactly on a light; the results stay 0
NEWTON_STEP = 1e-12  # relative; Newton squares it, so that the error left is rounding


def dot(a: Array, b: Array) -> Array:
    """Return the scalar products of rows, (n,); either side may be a single (3,) vector."""
    x, y, z = b.T
    total = a[:, 0] * x
    total += a[:, 1] * y
    total += a[:, 2] * z
    return total


def lattice(n: int) -> Array:
    """Return points (n, 2) that fill the unit square evenly: a golden-ratio lattice."""
    number = np.arange(n)
    return np.stack([(number + 0.5) / n, number * 0.5 * (np.sqrt(5.0) - 1.0) % 1.0], axis=1)


def towards(center: Array, points: Array) -> tuple[Array, Array]:
    """Return unit vectors (n, 3) from the points to `center` and the squared distances (n,)."""
    offset = center - points
    squared = np.maximum(dot(offset, offset), TINY)
    offset /= np.sqrt(squared)[:, None]
    return offset, squared


def one_minus_cos(sin_squared: Array) -> Array:
    """Return 1 - cos a from sin²a for a in [0, π/2], exact for small angles."""
    return sin_squared / (1.0 + np.sqrt(1.0 - sin_squared))


def around(axis: Array, cos: Array, sin: Array, turn: Array) -> Array:
    """Return unit vectors (n, 3) at polar angle (cos, sin) and azimuth 2π·turn about `axis`.

    The frame about the axis (x, y, z), with s = ±1 of z's sign, is (1 - x²/(1+|z|), ...): the
    rotation that takes (0, 0, s) to the axis, which has no singular direction.
    """
    x, y, z = axis[:, 0], axis[:, 1], axis[:, 2]
    b, a = sin_cos(2.0 * np.pi * turn)
    a *= sin
    b *= sin
    across = a * x + b * y
    rest = cos - across / (1.0 + np.abs(z))
    result = np.empty((len(axis), 3), order="F")
    np.add(a, x * rest, out=result[:, 0])
    np.add(b, y * rest, out=result[:, 1])
    np.subtract(cos * z, np.copysign(1.0, z) * across, out=result[:, 2])
    return result


def sin_cos(angle: Array) -> tuple[Array, Array]:
    """Return sin and cos (n,) as 2t/(1 + t²) and 2/(1 + t²) - 1, t the tangent of half the angle.

    NumPy's tangent alone is vectorised: one costs a quarter of a sine and a cosine.
    """
    tan = np.tan(0.5 * angle)
    share = 2.0 / (1.0 + tan * tan)
    return tan * share, share - 1.0


def sample_cone(axis: Array, cone: Array, u: Array) -> Array:
    """Return directions (n, 3) uniform in the cones of 1 - cos(half angle) = `cone` (n,)."""
    drop = cone * u[:, 0]
    return around(axis, 1.0 - drop, np.sqrt(drop * (2.0 - drop)), u[:, 1])


def sample_hemisphere(normals: Array, u: Array) -> tuple[Array, Array]:
    """Return directions (n, 3) of density cos θ/π about `normals`, and cos θ (n,)."""
    cos = np.sqrt(1.0 - u[:, 0])
    return around(normals, cos, np.sqrt(u[:, 0]), u[:, 1]), cos


def cap_irradiance(cos_theta: Array, sin_squared: Array) -> Array:
    """Return the irradiance (n,) of a cone of directions, as of a sphere, a sun or a facing disc.

    Parameters
    ----------
    cos_theta : (n,) cosine between the receiver's normal and the cone's axis.
    sin_squared : (n,) sin²a of the cone's half angle a, up to π/2.

    Notes
    -----
    Whole above the horizon, the projected solid angle is π sin²a cos θ. Where the horizon cuts,
    the projection on the receiver's plane is an ellipse with half axes sin a and sin a cos θ,
    centred at cos a sin θ; it touches the unit circle where the cone meets the horizon. Segment of
    the ellipse plus segment of the circle:

        E = sin²a [cos θ arccos(-cot a cot θ) - cot a √(1 - cos²θ/sin²a)]
            + arctan2(√(1 - cos²θ/sin²a), cot a)
    """
    result = np.pi * sin_squared * np.maximum(cos_theta, 0.0)
    cut = np.flatnonzero(cos_theta * cos_theta < sin_squared)
    if cut.size:
        c, s2 = cos_theta[cut], sin_squared[cut]
        cot = np.sqrt((1.0 - s2) / s2)
        k = np.sqrt(1.0 - c * c / s2)
        sin_theta = np.sqrt(np.maximum(1.0 - c * c, TINY))
        angle = np.arccos(np.clip(-cot * c / sin_theta, -1.0, 1.0))
        result[cut] = s2 * (c * angle - cot * k) + np.arctan2(k, cot)
    return result


def polygon_irradiance(vertices: Array, points: Array, normals: Array) -> Array:
    """Return Lambert's irradiance (n,) of a convex planar polygon (k, 3), signed by its facing.

    It is positive where the points are on the side from which the vertices run clockwise.

    Notes
    -----
    E = ½ Σ Θᵢ n·gᵢ, with Θᵢ the angle that edge i spans at the point and gᵢ the unit normal of
    the plane through edge and point. Edges are cut at the horizon; the gap from where the outline
    dives below it to where it comes up again is closed by an edge in the horizon, whose g is ±n.
    a × b is taken as a × (b - a), with the exact edge, so that far polygons keep their digits.
    """
    k = len(vertices)
    place, normal = np.ascontiguousarray(points.T), np.ascontiguousarray(normals.T)
    corners = [vertex[:, None] - place for vertex in vertices]
    edges = [(vertices[(i + 1) % k] - vertices[i])[:, None] for i in range(k)]
    heights = [dot(normal.T, corner.T) for corner in corners]
    total = np.zeros(len(points))
    for i in range(k):
        total += _edge(corners[i], edges[i], corners[(i + 1) % k], normal)
    highest = np.maximum.reduce(heights)
    total[highest <= 0.0] = 0.0
    cut = np.flatnonzero((np.minimum.reduce(heights) < 0.0) & (highest > 0.0))
    if cut.size:
        total[cut] = _cut_polygon(
            edges,
            [corner.take(cut, axis=1) for corner in corners],
            [height.take(cut) for height in heights],
            normal.take(cut, axis=1),
        )
    return 0.5 * total


def _edge(a: Array, edge: Array, b: Array, normal: Array) -> Array:
    """Return Θ n·g (n,) of the edges from `a` to `b` = `a` + `edge`, all (3, n)."""
    across = np.empty_like(a)
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        np.subtract(a[j] * edge[k], a[k] * edge[j], out=across[i])
    length = np.sqrt(dot(across.T, across.T))
    angle = np.arctan2(length, dot(a.T, b.T))
    angle *= dot(normal.T, across.T)
    angle /= np.maximum(length, TINY)
    return angle


def _cut_polygon(
    edges: list[Array], corners: list[Array], heights: list[Array], normal: Array
) -> Array:
    """Return Σ Θ n·g (n,) of the part above the horizon; arrays are (3, n) and (n,)."""
    k = len(edges)
    total = np.zeros(normal.shape[1])
    dive, rise = np.zeros_like(normal), np.zeros_like(normal)
    for i in range(k):
        below, goes_below = heights[i] < 0.0, heights[(i + 1) % k] < 0.0
        crosses = below != goes_below
        at = heights[i] / np.where(crosses, heights[i] - heights[(i + 1) % k], 1.0)
        start = np.where(below, np.where(crosses, at, 1.0), 0.0)
        end = np.where(goes_below & crosses, at, 1.0)
        a, b = corners[i] + start * edges[i], corners[i] + end * edges[i]
        total += _edge(a, (end - start) * edges[i], b, normal)
        np.copyto(dive, b, where=crosses & goes_below)
        np.copyto(rise, a, where=crosses & below)
    return total + _edge(dive, rise - dive, rise, normal)


def ellipse_irradiance(half: tuple[float, float], offset: Array, normals: Array) -> Array:
    """Return the irradiance (n,) of an ellipse, nan where the horizon cuts it.

    Parameters
    ----------
    half : half axes (a, b) along x and y of the ellipse's frame.
    offset : (n, 3) centre less point, in that frame.
    normals : (n, 3) of the receivers, in that frame.

    Notes
    -----
    With unit radiance the vector irradiance of an elliptic cone with half angles α, β lies on the
    cone's axis and is π sin α sin β. For the cone over the ellipse about (x, y, z), directions
    are ω ∝ M (s, t, 1), s² + t² < 1, with the columns of M the half axes and the offset, and
    K = M diag(1, 1, -1) Mᵀ = diag(a², b², 0) - o oᵀ has the eigenvalues ν₁, ν₂ > 0 > -μ, with
    sin²α sin²β = ν₁ν₂/((ν₁ + μ)(ν₂ + μ)). The secular equation of K at -μ is that of the confocal
    ellipsoid through the point, and the cone's axis is its normal w:

        x²/(a² + μ) + y²/(b² + μ) + z²/μ = 1,    w = (x/(a² + μ), y/(b² + μ), z/μ)
        ν₁ν₂ = (a b z)²/μ,    (ν₁ + μ)(ν₂ + μ) = (a² + μ)(b² + μ) μ |w|²
        E = π a b |z| (n·w) / (μ |w|² √((a² + μ)(b² + μ)))

    For a disc μ solves a quadratic. For an ellipse the root for the disc of the longer half axis
    lies below it, and Newton's steps on the convex left side rise to it without overshooting.
    """
    a2, b2 = half[0] ** 2, half[1] ** 2
    x2, y2, z2 = np.square(offset.T)
    mu = _disc_parameter(max(a2, b2), x2 + y2 + z2, z2)
    if a2 != b2:
        for _ in range(64):
            p, q, r = 1.0 / (a2 + mu), 1.0 / (b2 + mu), 1.0 / mu
            slope = x2 * p * p + y2 * q * q + z2 * r * r
            step = (x2 * p + y2 * q + z2 * r - 1.0) / np.maximum(slope, TINY)
            mu = np.maximum(mu + step, TINY)
            if np.all(np.abs(step) <= NEWTON_STEP * mu):
                break
    w = offset / np.stack([a2 + mu, b2 + mu, mu]).T
    norm = mu * np.sqrt((a2 + mu) * (b2 + mu)) * np.maximum(dot(w, w), TINY)
    result = np.pi * np.sqrt(a2 * b2 * z2) * dot(w, normals) / np.maximum(norm, TINY)
    height = dot(offset, normals)
    reach = np.sqrt(a2 * normals[:, 0] ** 2 + b2 * normals[:, 1] ** 2)
    result[height <= -reach] = 0.0
    result[np.abs(height) < reach] = np.nan
    return result


def _disc_parameter(a2: float, d2: Array, z2: Array) -> Array:
    """Return the larger root (n,) of μ² - (d² - a²) μ - a² z² = 0, without cancellation."""
    b = d2 - a2
    root = np.sqrt(b * b + 4.0 * a2 * z2)
    mu = np.where(b > 0.0, 0.5 * (root + b), 2.0 * a2 * z2 / np.maximum(root - b, TINY))
    return np.maximum(mu, TINY)


def sample_rectangle(
    bounds: tuple[Array, Array, Array, Array], depth: Array, u: Array
) -> tuple[Array, Array, Array]:
    """Return positions x, y (n,) on a rectangle, uniform in solid angle, and the angle (n,) [sr].

    Parameters
    ----------
    bounds : x0, x1, y0, y1, each (n,), of the rectangle in the plane at distance `depth`, with the
        origin at the foot of the point.
    depth : (n,) ≥ 0.

    Notes
    -----
    Ureña, Fajardo and King 2013. With inner angles γᵢ = π/2 + aᵢ the solid angle Σγᵢ - 2π is Σaᵢ,
    which keeps its digits where it is small.
    """
    x0, x1, y0, y1 = bounds
    z2 = np.maximum(depth * depth, TINY)
    sides: list[Array] = [side / np.sqrt(side * side + z2) for side in (-y0, x1, y1, -x0)]
    angles: list[Array] = [np.arcsin(sides[i] * sides[(i + 1) % 4]) for i in range(4)]
    solid_angle: Array = angles[0] + angles[1] + angles[2] + angles[3]
    turn = u[:, 0] * solid_angle - angles[2] - angles[3]
    sin, cos = sin_cos(turn)
    rise = cos * sides[0] + sides[2]
    cos2 = sin * sin / np.maximum(rise * rise + (sides[0] * sin) ** 2, TINY)
    x: Array = np.copysign(np.sqrt(cos2 * z2 / np.maximum(1.0 - cos2, TINY)), sin * rise)
    x = np.minimum(np.maximum(x, x0), x1)
    d2 = x * x + z2
    low, high = y0 / np.sqrt(d2 + y0 * y0), y1 / np.sqrt(d2 + y1 * y1)
    slope = low + u[:, 1] * (high - low)
    y: Array = slope * np.sqrt(d2 / np.maximum(1.0 - slope * slope, TINY))
    y = np.minimum(np.maximum(y, y0), y1)
    return x, y, solid_angle
