"""What laser points show of the ends of dashes: the outermost one that is paint, and those beyond it.

Separate from `dash_lengths`, which draws conclusions from them: points are read here, tile by tile.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from linework.arrays import BoolArray, FloatArray, IntArray, distance_along
from linework.evaluation.chainage.paint_points import (
    LEAST_BESIDE,
    PAINT_REACH_M,
    PIECE_CHORD_M,
    SAME_LOOK_S,
    TILE_M,
    PointsOnChords,
    beside_paint,
    points_on_chords,
)
from linework.lines.dashes import dashes_along, dashes_by_marking
from linework.model.columns import Columns, column
from linework.model.grid import Bounds
from linework.model.lines import LineSet
from linework.model.points import Points

#: Points from the outermost bright one on that are kept: so many dark ones in a row on paint mean that a patch is gone.
N_BEYOND = 12
#: Dashes are looked at this far beyond the ends of their lines, and to the middle of the gap at most. [m]
_BEYOND_M = 1.0
#: Points this near to the sides of the paint are blurred by the spot of the beam. [m]
_BLURRED_M = 0.02


@dataclass(frozen=True, slots=True)
class DashEnds(Columns):
    """What points show at both ends of dashes of which whole paint is known.

    Parameters
    ----------
    line
        (k,) int64: number of the marking; its dashes in the order of `dashes_along`.
    begin, end
        (k, N_BEYOND) places along the marking of the outermost point on paint, and of those beyond it, outwards; NaN where
        no more were looked at. [m]
    n_pairs, n_bright
        (k,) int64: points beside a bright one, along the dash, and how many of these are bright too.
    """

    line: IntArray = column(np.int64)
    begin: FloatArray = column(np.float64, N_BEYOND)
    end: FloatArray = column(np.float64, N_BEYOND)
    n_pairs: IntArray = column(np.int64)
    n_bright: IntArray = column(np.int64)


class _Dash(NamedTuple):
    """A dash of a marking: its ends and vertices along it (n,) [m], these (n, 3) [m, world], and what is needed to tell paint."""

    line: int
    ends_m: tuple[float, float]
    along_m: FloatArray
    vertices: FloatArray
    half_m: float
    least_ratio: float


def ends_of_dashes(
    lines: LineSet,
    least_ratios: Mapping[int, float],
    points_in: Callable[[Bounds], Points],
    advance: Callable[[int, int], None] | None = None,
) -> DashEnds:
    """Return what the points show at the ends of all dashes of markings whose paint is known.

    Parameters
    ----------
    least_ratios
        By the number of the marking, the least brightness of paint as a ratio to that of the road beside.
    points_in
        Returns all points within bounds.
    advance
        Called with the tiles done and all tiles.
    """
    dashes = list(_dashes(lines, least_ratios))
    if not dashes:
        return DashEnds.empty()
    middle = np.stack([one.vertices[len(one.vertices) // 2, :2] for one in dashes])
    tiles = np.floor(middle / TILE_M).astype(np.int64)
    found, order = [], []
    every_tile = np.unique(tiles, axis=0).tolist()
    for n_done, tile in enumerate(every_tile):
        if advance is not None:
            advance(n_done, len(every_tile))
        rows = np.flatnonzero((tiles == tile).all(axis=1)).tolist()
        found.append(_ends_in_tile([dashes[row] for row in rows], points_in))
        order += rows
    # As the dashes are listed: by marking, and along it
    return DashEnds.concatenate(found).take(np.argsort(order, kind="stable"))


def _dashes(lines: LineSet, least_ratios: Mapping[int, float]) -> Iterator[_Dash]:
    """Yield the dashes of markings whose paint is known, each with its line from gap to gap."""
    for _, line, ends in dashes_by_marking(lines):
        if line not in least_ratios:
            continue
        xyz = lines[line].xyz
        along = distance_along(xyz[:, :2])
        dashes = dashes_along(xyz, ends)
        # Half-way to the neighbours
        half_way = 0.5 * (dashes[:-1, 1] + dashes[1:, 0])
        low = np.maximum(dashes[:, 0] - _BEYOND_M, np.concatenate([[-np.inf], half_way]))
        high = np.minimum(dashes[:, 1] + _BEYOND_M, np.concatenate([half_way, [np.inf]]))
        for k, (a, b) in enumerate(zip(low.tolist(), high.tolist(), strict=True)):
            n = max(round((b - a) / PIECE_CHORD_M), 1)
            at = np.linspace(a, b, n + 1)
            yield _Dash(
                line, (float(dashes[k, 0]), float(dashes[k, 1])), at, _on_line(xyz, along, at),
                0.5 * float(lines.width_m[line]), least_ratios[line],
            )  # fmt: skip


def _on_line(xyz: FloatArray, along: FloatArray, at: FloatArray) -> FloatArray:
    """Return places (n, 3) at distances along a line, straight on beyond its ends."""
    inside = np.clip(at, 0.0, along[-1])
    place = np.stack([np.interp(inside, along, c) for c in xyz.T], axis=1)
    for end, (a, b) in (((at < 0.0), (0, 1)), ((at > along[-1]), (-1, -2))):
        ahead = xyz[a] - xyz[b]
        place[end] += np.abs(at - inside)[end, None] * ahead / max(float(np.linalg.norm(ahead[:2])), 1e-9)
    return np.asarray(place)


def _ends_in_tile(dashes: list[_Dash], points_in: Callable[[Bounds], Points]) -> DashEnds:
    """Return what the points of one tile show."""
    reach = max(one.half_m for one in dashes) + PAINT_REACH_M
    every = np.concatenate([one.vertices[:, :2] for one in dashes])
    low, high = every.min(axis=0) - reach, every.max(axis=0) + reach
    points = points_in(Bounds(float(low[0]), float(low[1]), float(high[0]), float(high[1])))
    chords = np.concatenate([np.stack([one.vertices[:-1], one.vertices[1:]], axis=1) for one in dashes])
    first = np.concatenate([one.along_m[:-1] for one in dashes])
    owner = np.repeat(np.arange(len(dashes)), [len(one.vertices) - 1 for one in dashes])
    on = points_on_chords(points, chords, reach)
    s = first[on.chord] + on.along_m
    order = np.lexsort((on.brightness, on.across_m, s, owner[on.chord]))
    bounds = np.searchsorted(owner[on.chord][order], np.arange(len(dashes) + 1))
    found = [
        _ends_of(one, s[order[a:b]], on.take(order[a:b]))
        for one, (a, b) in zip(dashes, pairwise(bounds.tolist()), strict=True)
    ]
    begin, end, n_pairs, n_bright = (list(values) for values in zip(*found, strict=True))
    return DashEnds(
        line=np.array([one.line for one in dashes]), begin=np.stack(begin), end=np.stack(end),
        n_pairs=np.array(n_pairs), n_bright=np.array(n_bright),
    )  # fmt: skip


def _ends_of(dash: _Dash, s: FloatArray, on: PointsOnChords) -> tuple[FloatArray, FloatArray, int, int]:
    """Return what `DashEnds` has of one dash: points by their place along the marking (n,) ascending."""
    begin_m, end_m = dash.ends_m
    ratio = _ratios(on, dash.half_m)
    core = (np.abs(on.across_m) <= max(dash.half_m - _BLURRED_M, 0.5 * dash.half_m)) & np.isfinite(ratio)
    s, is_bright = s[core], ratio[core] >= dash.least_ratio
    behind = s > 0.5 * (begin_m + end_m)
    own = is_bright[(s >= begin_m) & (s <= end_m)]
    both = int(np.count_nonzero(own[1:] & own[:-1]))
    n_pairs = int(np.count_nonzero(own[1:]) + np.count_nonzero(own[:-1]))
    return (
        -_outermost(-s[~behind][::-1], is_bright[~behind][::-1]),
        _outermost(s[behind], is_bright[behind]),
        n_pairs,
        2 * both,
    )


def _outermost(outward_m: FloatArray, is_bright: BoolArray) -> FloatArray:
    """Return the place of the outermost bright point and of those beyond it, (N_BEYOND,) with NaN for those that are not there."""
    bright = np.flatnonzero(is_bright)
    found = np.full(N_BEYOND, np.nan)
    if len(bright):
        there = outward_m[bright[-1] : bright[-1] + N_BEYOND]
        found[: len(there)] = there
    return found


def _ratios(on: PointsOnChords, half_m: float) -> FloatArray:
    """Return the brightness of points (n,) as ratios to the road beside, look by look; NaN where too little of it was hit."""
    ratio = np.full(len(on), np.nan)
    order = np.argsort(on.time_s, kind="stable")
    for look in np.split(order, np.flatnonzero(np.diff(on.time_s[order]) > SAME_LOOK_S) + 1):
        across, value = on.across_m[look], on.brightness[look]
        road = np.concatenate([beside_paint(side * across - half_m, value) for side in (1.0, -1.0)])
        level = float(np.median(road)) if len(road) >= LEAST_BESIDE else 0.0
        if level > 0.0:
            ratio[look] = value / level
    return ratio
