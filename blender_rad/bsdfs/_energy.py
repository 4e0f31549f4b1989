# SPDX-License-Identifier: GPL-3.0-or-later
"""Light that single reflections by rough faces lose, and how Cycles gives it back.

E(ρ, μ) = ∫ f |cosθ_i| dω_i of white GGX faces at roughness ρ = √α and μ = cosθ_o, and its mean
Ē = 2 ∫ E μ dμ. Multiscatter GGX divides the lobe by E, and darkens it for facets of mean
reflectance F̄ by what more reflections lose (Kulla and Conty, Revisiting Physically Based Shading,
2017). Over visible normals m, with Λ of Smith's masking, E is a mean:

    reflecting    E = ⟨K⟩,  K = (1 + Λ(o)) / (1 + Λ(o) + Λ(i)) for i_z > 0, else 0
    glass         E = ⟨F K(reflected i) + (1 − F) K(refracted i)⟩

Cycles looks E up in tables, linearly in ρ, μ and z = F(0)^¼ of the index of refraction; the bend
of the lines is part of its pictures, so the nodes are the same here, worked out at first use.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from itertools import product

import numpy as np

from ._base import Array
from ._fresnel import Dielectric, index_of, normal_reflectance
from ._microfacet import ggx_masking, visible_normals

MEANS, WEIGHTS = np.polynomial.legendre.leggauss(12)
LEAST = 1e-4  # in place of roughness, cosine and z of 0, as in Cycles' tables
Tables = tuple[Array, Array]


Term = Callable[[float, Array, Array, Array], Array]


def _tables(nodes: int, term: Term, normals: tuple[int, int] = (987, 610)) -> Tables:
    """Return the mean of term(α, o_z, o·m, m_z) by (ρ, μ), and its mean over μ by (ρ,).

    The lattice of facets is made of neighbours among Fibonacci's numbers, denser where they graze.
    """
    count, step = normals
    place = np.arange(count) + 0.5
    left = place / count
    u = np.stack([1.0 - left**3, place * step / count % 1.0], axis=1)
    share = left**2 / np.sum(left**2)
    grid = np.clip(np.linspace(0.0, 1.0, nodes), LEAST, 1.0)
    mu = np.concatenate([grid, 0.5 * (1.0 + MEANS)])[:, None]
    wo = np.stack([np.sqrt(1.0 - mu**2), np.zeros_like(mu), mu], axis=-1)
    table = np.empty((nodes, len(mu)))
    for row, alpha in enumerate(np.square(grid)):
        m = visible_normals(u, wo, np.asarray(alpha), np.asarray(alpha))
        table[row] = term(alpha, mu, np.sum(wo * m, axis=-1), m[..., 2]) @ share
    return table[:, :nodes], table[:, nodes:] @ (WEIGHTS * mu[nodes:, 0])


def _kept(alpha: float, out: Array, back: Array) -> Array:
    """Return K at o_z and i_z."""
    tangents = (1.0 / np.maximum(z * z, 1e-30) - 1.0 for z in (out, back))
    own, other = (ggx_masking(alpha**2 * square) for square in tangents)
    return (1.0 + own) / (1.0 + own + other)


def _reflected(alpha: float, out: Array, seen: Array, up: Array) -> Array:
    back = 2.0 * seen * up - out
    return (back > 0.0) * _kept(alpha, out, back)


@lru_cache(maxsize=1)
def reflecting() -> Tables:
    """Return E (ρ, μ) and Ē (ρ,) of faces that reflect everything."""
    return _tables(32, _reflected)


def _index(node: int) -> float:
    """Return η at a node of z, 1 and up, in Cycles' precision."""
    return float(np.float32(index_of(np.array(np.clip(node / 15.0, LEAST, 0.99) ** 4))))


def _reflectance(ior: float, cosine: Array) -> Array:
    """Return F (μ, m) at o·m."""
    return Dielectric(np.full(cosine.size, ior)).reflectance(cosine.ravel()).reshape(cosine.shape)


@lru_cache(maxsize=32)
def clear(node: int) -> Tables:
    """Return E (ρ, μ) and Ē (ρ,) of faces of glass at a node of z, < 0 for η < 1.

    As in Cycles' tables, light counts that rough faces would refract upwards.
    """
    ior = _index(abs(node)) ** float(np.sign(node))

    def term(alpha: float, out: Array, seen: Array, up: Array) -> Array:
        share = _reflectance(ior, seen)
        if ior == 1.0:
            return np.ones_like(seen)
        bent = np.sqrt(np.maximum(1.0 - (1.0 - seen**2) / ior**2, 0.0))
        through = _kept(alpha, out, (seen / ior - bent) * up - out / ior)
        return share * _reflected(alpha, out, seen, up) + (1.0 - share) * through

    return _tables(16, term, (987, 610) if node >= 0 else (2584, 1597))


@lru_cache(maxsize=16)
def remapped(node: int) -> Tables:
    """Return (ρ, μ) the mean of (F − F(0)) / (1 − F(0)) at a node of z, 0 where i leaves below."""
    ior = _index(node)
    start = normal_reflectance(np.array(ior))

    def term(alpha: float, out: Array, seen: Array, up: Array) -> Array:
        above = 2.0 * seen * up > out
        return above * np.clip((_reflectance(ior, seen) - start) / (1.0 - start), 0.0, 1.0)

    return _tables(16, term, (2584, 1597))


def looked_up(table: Array, *at: Array) -> Array:
    """Return a table's values (n,), linear between nodes over [0, 1] in each coordinate (n,)."""
    places = [np.clip(x, 0.0, 1.0) * (size - 1) for x, size in zip(at, table.shape, strict=True)]
    low = [np.minimum(x.astype(np.int64), n - 2) for x, n in zip(places, table.shape, strict=True)]
    found = np.zeros(len(at[0]))
    for corner in product((0, 1), repeat=len(at)):
        near = [1.0 - np.abs(x - k - c) for x, k, c in zip(places, low, corner, strict=True)]
        found += np.prod(near, axis=0) * table[tuple(np.add(low, np.array(corner)[:, None]))]
    return found


def _by_index(tables: Callable[[int], Array], ior: Array, *at: Array) -> Array:
    """Return values (n,) of the tables at the nodes of z, < 0 for η < 1, linear between."""
    place = 15.0 * np.sign(ior - 1.0) * np.minimum(normal_reflectance(ior) ** 0.25, 1.0)
    found = np.zeros(len(ior))
    for node in np.unique([np.floor(place), np.ceil(place)]).astype(int):
        rows = np.flatnonzero(np.abs(place - node) < 1.0)
        share = 1.0 - np.abs(place[rows] - node)
        found[rows] += share * looked_up(tables(node), *(x[rows] for x in at))
    return found


def albedos(cosine: Array, alpha: Array, ior: Array | None = None) -> tuple[Array, Array]:
    """Return E and Ē (n,) at cosθ_o and α = √(α_x α_y), (n,); of glass with indices (n,)."""
    rough = np.sqrt(alpha)
    if ior is None:
        single, mean = reflecting()
        return looked_up(single, rough, cosine), looked_up(mean, rough)
    single = _by_index(lambda z: clear(z)[0], ior, rough, cosine)
    return single, _by_index(lambda z: clear(z)[1], ior, rough)


def compensation(
    cosine: Array, alpha: Array, mean: Array, ior: Array | None = None
) -> tuple[Array, Array]:
    """Return the factor 1/E (n, 1), and the darkening E (1 + F̄ Ē / (1 − F̄ (1 − Ē)) (1 − E)/E).

    Parameters
    ----------
    cosine, alpha : (n,) cosθ_o and √(α_x α_y).
    mean : F̄, (n, 1) or (n, 3); of glass, Cycles takes its colour.
    ior : (n,) of glass.
    """
    single, many = (x[:, None] for x in albedos(cosine, alpha, ior))
    more = mean * many / (1.0 - mean * (1.0 - many))
    return 1.0 / single, single + more * (1.0 - single)


def layer_reflectance(cosine: Array, alpha: Array, ior: Array, f0: Array) -> Array:
    """Return the albedo (n, 3) by which Cycles' dielectric layers, F from `f0` to 1, take light."""
    share = _by_index(lambda z: remapped(abs(z))[0], ior, np.sqrt(alpha), cosine)[:, None]
    return f0 + (1.0 - f0) * share
