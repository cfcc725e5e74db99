"""Paint on the carriageway: where it is, and how much of it is left."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from linework.arrays import AnyArray, FloatArray
from linework.simulation.roads.scenario import Marking, Stain, Symbol

#: A beam's spot on the road blurs the paint's edge over this width.
_SPOT_M = 0.015
#: Worn places: long ones (wheels crossing) weigh more than small ones (chips).
_LONG_M, _SMALL_M, _LONG_SHARE = 0.9, 0.05, 0.6


def paint_cover(
    chainage_offset: FloatArray,
    markings: Sequence[Marking],
    seed: int,
    symbols: Sequence[Symbol] = (),
    *,
    edge_m: FloatArray | None = None,
) -> FloatArray:
    """Return the share of paint, 0 to 1, at (n, 2) places on the road.

    Its edges go from 0 to 1 over `edge_m` (n, 2), along the road and across; a beam's spot if not given.
    """
    cover = np.zeros(len(chainage_offset))
    s, q = chainage_offset[:, 0], chainage_offset[:, 1]
    edge_s, edge_q = np.full((2, len(s)), _SPOT_M) if edge_m is None else edge_m.T
    for i, m in enumerate(markings):
        off = q - m.q_m if m.shift_m is None else q - m.q_m - m.shift_m(s)
        near = np.flatnonzero(
            (np.abs(off) < 0.5 * m.width_m + edge_q)
            & (s >= m.start_m - 0.1 - edge_s)
            & (s <= m.end_m + 0.1 + edge_s)
        )
        across = 0.5 * m.width_m - np.abs(off[near])
        along = np.minimum(s[near] - m.start_m, m.end_m - s[near])
        if m.pattern == "dashed":
            along = np.minimum(along, _inside_dash(s[near], m))
        # What is wider than the paint is covered by as much as the paint is wide
        most = np.minimum(m.width_m / edge_q[near], 1.0)
        here = np.clip(across / edge_q[near] + 0.5, 0.0, most) * np.clip(along / edge_s[near] + 0.5, 0.0, 1.0)
        cover[near] = np.maximum(cover[near], here * _left(s[near], q[near], m.wear, seed + 7919 * i))
    for i, symbol in enumerate(symbols):
        inside = np.minimum(
            np.minimum(s - symbol.start_m, symbol.end_m - s),
            np.minimum(q - symbol.right_m, symbol.left_m - q),
        )
        edge = np.maximum(edge_s, edge_q)
        near = np.flatnonzero(inside > -edge)
        here = np.clip(inside[near] / edge[near] + 0.5, 0.0, 1.0)
        left = _left(s[near], q[near], symbol.wear, seed + 104729 * (i + 1))
        cover[near] = np.maximum(cover[near], here * left)
    return cover


def stain_shade(chainage_offset: FloatArray, stains: Sequence[Stain]) -> FloatArray:
    """Return by how much stains change the brightness at (n, 2) places on the road: a factor for each."""
    shade = np.ones(len(chainage_offset))
    order = np.argsort(chainage_offset[:, 0], kind="stable")
    s, q = chainage_offset[order].T
    for stain in stains:
        reach = 0.5 * stain.soft_m
        a, b = np.searchsorted(s, (stain.start_m - reach, stain.end_m + reach))
        near = a + np.flatnonzero((q[a:b] > stain.right_m - reach) & (q[a:b] < stain.left_m + reach))
        inside = np.minimum(
            np.minimum(s[near] - stain.start_m, stain.end_m - s[near]),
            np.minimum(q[near] - stain.right_m, stain.left_m - q[near]),
        )
        shade[order[near]] *= 1.0 + (stain.shade - 1.0) * np.clip(inside / stain.soft_m + 0.5, 0.0, 1.0)
    return shade


def _inside_dash(s: FloatArray, m: Marking) -> FloatArray:
    """Return how far inside the nearest dash each chainage is (negative outside)."""
    period = m.dash_m + m.gap_m
    number = np.floor((s - m.start_m) / period)
    place = s - m.start_m - number * period
    # The start of the next dash is near, too; a last piece under 0.5 m is not painted
    inside = np.where(place > m.dash_m + 0.5 * m.gap_m, place - period, np.minimum(place, m.dash_m - place))
    start = m.start_m + np.where(place > m.dash_m + 0.5 * m.gap_m, number + 1, number) * period
    return np.where(m.end_m - start >= 0.5, inside, -1.0)


def _left(s: FloatArray, q: FloatArray, wear: float, seed: int) -> FloatArray:
    """Return the paint left: `wear` of the area is gone in patches, the rest keeps 85 to 100 %."""
    if wear <= 0.0:
        return np.ones(len(s))
    noise = _LONG_SHARE * smooth_noise(s / _LONG_M, q / 0.5, seed) + (1.0 - _LONG_SHARE) * smooth_noise(
        s / _SMALL_M, q / _SMALL_M, seed + 1
    )
    # Between gone and whole the paint thins out over a small band of the noise
    return np.clip((noise - _gone_below(wear, seed)) / 0.06 + 0.5, 0.05, 1.0)


@lru_cache(maxsize=4096)
def _gone_below(wear: float, seed: int) -> float:
    """Return the value that a share `wear` of the noise is below."""
    line = np.linspace(0.0, 2000.0, 20_001)
    sample = _LONG_SHARE * smooth_noise(line / 0.37, line * 0.0, seed + 2) + (
        1.0 - _LONG_SHARE
    ) * smooth_noise(line / 0.07, line / 0.11, seed + 3)
    return float(np.quantile(sample, wear))


def smooth_noise(x: FloatArray, y: FloatArray, seed: int) -> FloatArray:
    """Return lattice noise, 0 to 1, that depends on place and seed only; smooth between lattice points."""
    i, j = np.floor(x), np.floor(y)
    u, v = x - i, y - j
    u, v = u * u * (3.0 - 2.0 * u), v * v * (3.0 - 2.0 * v)
    corner = [_hashed(i + a, j + b, seed) for a in (0, 1) for b in (0, 1)]
    low, high = corner[0] * (1 - v) + corner[1] * v, corner[2] * (1 - v) + corner[3] * v
    return np.asarray(low * (1 - u) + high * u)


def _hashed(i: FloatArray, j: FloatArray, seed: int) -> FloatArray:
    """Return a value in [0, 1) for each lattice point (the finalising steps of splitmix64)."""
    h: AnyArray = i.astype(np.int64).astype(np.uint64) * np.uint64(0x9E3779B97F4A7C15)
    h = h ^ (j.astype(np.int64).astype(np.uint64) * np.uint64(0xC2B2AE3D27D4EB4F))
    h = h ^ np.uint64((seed * 0x165667B19E3779F9) % 2**64)
    h = (h ^ (h >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    h = (h ^ (h >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    h = h ^ (h >> np.uint64(31))
    return np.asarray((h >> np.uint64(11)).astype(np.float64) / 9007199254740992.0)
