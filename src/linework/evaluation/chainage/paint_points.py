"""What laser points show on and beside markings: brightness as ratios to the road beside, piece by piece.

Separate from `paint_along`, which draws conclusions from them: points are read here, tile by tile, and nowhere else.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from linework.arrays import BoolArray, FloatArray, IntArray, distance_along
from linework.lines.dashes import dashes_by_marking
from linework.model.columns import Columns, column
from linework.model.grid import Bounds
from linework.model.lines import LineSet
from linework.model.points import Points

#: Length of a piece, and of the chords that follow it through bends: 0.3 cm off the curve at a radius of 10 m. [m]
_PIECE_M, PIECE_CHORD_M = 2.0, 0.5
#: Inner part of the width of paint that is looked at: the edges are blurred by the spot of the beam. [share]
CORE_SHARE = 0.5
#: What is beside paint, from this far off its edge to that: a spot on the road is some 2 cm, and farther away wheels,
#: joints and the end of the pavement make it another road than that under the paint. [m]
_BESIDE_M = (0.06, 0.16)
#: Points are looked at this far off the edges of paint. [m]
PAINT_REACH_M = 0.36
#: Points of the road are this near to the line in height: legs, cars and kerbs are higher. [m]
_NEAR_ROAD_M = 0.06
#: Sides whose brightness varies by this much more than that of the other are not all road. [ratio]
_UNEVEN = 1.5
#: Fewest points beside a piece that give the brightness of the road.
LEAST_BESIDE = 8
#: Points later than this belong to another look: another head, or another pass, with a brightness of its own. Scan lines
#: are 5 to 20 ms apart. [s]
SAME_LOOK_S = 0.05
#: Steps of a profile across, and how far it reaches beyond the edges of the paint. [m]
STEP_ACROSS_M, _BEYOND_M = 0.02, 0.2
#: Ratios are counted in steps of 5 %, from 0.1 to 20: paint is 1.3 to 10 times as bright as road.
_RATIO_STEP, _LEAST_RATIO, N_RATIOS = 0.05, 0.1, 107
#: Points are read by tiles of this side. [m]
TILE_M = 64.0


@dataclass(frozen=True, slots=True)
class PaintPieces(Columns):
    """What is on and beside pieces of markings.

    Parameters
    ----------
    line
        (p,) int64: number of the marking.
    xy, length_m, width_m
        (p, 2) middle [m, world], (p,) length of the piece and width of its marking. [m]
    on, beside
        (p, N_RATIOS) int64: points in the core of the paint, and beside it on the road, by their ratio to the
        brightness of the road beside; see `ratio_of_bin`. All zero where the road beside was not hit.
    road, n_looks
        (p,) brightness of the road beside, as it was recorded: the geometric mean of the looks, and int64: how many these
        are. Pieces of a marking that are seen in as many looks, and are near to each other, are seen alike.
    road_sigma
        (p,) relative standard deviation of the brightness of the road: half of what both sides differ by, the noise of
        their medians, and the steps in which brightness was recorded.
    n_clipped
        (p,) int64: points in the core of the paint that are as bright as a scanner can record. Zero where the road beside
        has no noise, as such paint has none either.
    area_m2
        (p,) area of the core. [m^2]
    across_m, across_sigma_m
        (p,) measured width of the paint and its standard deviation [m]; NaN where a part of the profile was not hit.
    """

    line: IntArray = column(np.int64)
    xy: FloatArray = column(np.float64, 2)
    length_m: FloatArray = column()
    width_m: FloatArray = column()
    on: IntArray = column(np.int64, N_RATIOS)
    beside: IntArray = column(np.int64, N_RATIOS)
    road: FloatArray = column()
    n_looks: IntArray = column(np.int64)
    road_sigma: FloatArray = column()
    n_clipped: IntArray = column(np.int64)
    area_m2: FloatArray = column()
    across_m: FloatArray = column()
    across_sigma_m: FloatArray = column()


def ratio_of_bin() -> FloatArray:
    """Return the ratio in the middle of each bin, (N_RATIOS,)."""
    return np.asarray(_LEAST_RATIO * np.exp(np.log1p(_RATIO_STEP) * (np.arange(N_RATIOS) + 0.5)))


def paint_pieces(
    lines: LineSet, points_in: Callable[[Bounds], Points], advance: Callable[[int, int], None] | None = None
) -> PaintPieces:
    """Return what the points show on all lane markings that have a width; of dashed ones, on the dashes found.

    Parameters
    ----------
    points_in
        Returns all points within bounds, with intensities; those without have no paint.
    advance
        Called with the tiles done and all tiles.
    """
    numbers, pieces = [], []
    for number, vertices in _painted(lines):
        whole = _pieces_of(vertices)
        numbers += [number] * len(whole)
        pieces += whole
    if not pieces:
        return PaintPieces.empty()
    middles = _middles(pieces)
    tiles = np.floor(middles / TILE_M).astype(np.int64)
    found = []
    every_tile = np.unique(tiles, axis=0).tolist()
    for n_done, tile in enumerate(every_tile):
        if advance is not None:
            advance(n_done, len(every_tile))
        rows = np.flatnonzero((tiles == tile).all(axis=1)).tolist()
        here, whose = [pieces[row] for row in rows], np.array([numbers[row] for row in rows])
        found.append(_looked_at(here, whose, lines.width_m[whose], points_in))
    return PaintPieces.concatenate(found)


def _painted(lines: LineSet) -> Iterator[tuple[int, FloatArray]]:
    """Yield number and vertices (k, 3) of each stretch that should be painted."""
    dashed = set(np.flatnonzero(lines.pattern == "dashed").tolist())
    for _, number, ends in dashes_by_marking(lines):
        if np.isfinite(lines.width_m[number]):
            line = lines[number].xyz
            nearest = cKDTree(line[:, :2])
            for dash in ends:
                z = line[nearest.query(dash)[1], 2]
                yield number, np.column_stack([dash, z])
    for number in np.flatnonzero((lines.kind == "lane_marking") & np.isfinite(lines.width_m)).tolist():
        if number not in dashed:
            yield number, lines[number].xyz


def _pieces_of(vertices: FloatArray) -> list[FloatArray]:
    """Return a line cut into pieces of equal length, about `_PIECE_M`, each with vertices every half metre."""
    along = distance_along(vertices[:, :2])
    if along[-1] < PIECE_CHORD_M:
        return []
    n = max(round(along[-1] / _PIECE_M), 1)
    per_piece = max(round(along[-1] / n / PIECE_CHORD_M), 1)
    at = np.linspace(0.0, along[-1], n * per_piece + 1)
    even = np.stack([np.interp(at, along, c) for c in vertices.T], axis=1)
    return [even[a : a + per_piece + 1] for a in range(0, n * per_piece, per_piece)]


def _middles(pieces: list[FloatArray]) -> FloatArray:
    """Return the middle (p, 2) of each piece."""
    return np.stack([(one[(len(one) - 1) // 2, :2] + one[len(one) // 2, :2]) / 2 for one in pieces])


def _looked_at(
    pieces: list[FloatArray], line: IntArray, width_m: FloatArray, points_in: Callable[[Bounds], Points]
) -> PaintPieces:
    """Return what the points of one tile show."""
    reach = 0.5 * float(width_m.max()) + PAINT_REACH_M
    every = np.concatenate(pieces)
    low, high = every[:, :2].min(axis=0) - reach, every[:, :2].max(axis=0) + reach
    points = points_in(Bounds(float(low[0]), float(low[1]), float(high[0]), float(high[1])))
    chords = np.concatenate([np.stack([piece[:-1], piece[1:]], axis=1) for piece in pieces])
    owner = np.repeat(np.arange(len(pieces)), [len(piece) - 1 for piece in pieces])
    on_chords = points_on_chords(points, chords, reach)
    piece, across = owner[on_chords.chord], on_chords.across_m
    value, time_s = on_chords.brightness, on_chords.time_s
    order = np.lexsort((value, across, time_s, piece))
    bounds = np.searchsorted(piece[order], np.arange(len(pieces) + 1))
    on, beside = np.zeros((2, len(pieces), N_RATIOS), dtype=np.int64)
    road, road_sigma = np.zeros((2, len(pieces)))
    n_looks, n_clipped = np.zeros((2, len(pieces)), dtype=np.int64)
    step, brightest = _recorded(value)
    across_m = np.full((2, len(pieces)), np.nan)
    looks: list[list[_Look]] = []
    for i, (a, b) in enumerate(pairwise(bounds.tolist())):
        here = order[a:b]
        parts = np.split(here, np.flatnonzero(np.diff(time_s[here]) > SAME_LOOK_S) + 1)
        looks.append([_look_across(across[part], value[part], 0.5 * width_m[i]) for part in parts])
    sides = {
        number: _sides_of_road([look for i in np.flatnonzero(line == number).tolist() for look in looks[i]])
        for number in np.unique(line).tolist()
    }
    for i, own in enumerate(looks):
        half = 0.5 * width_m[i]
        found = [ratios for look in own if (ratios := _as_ratios(look, *sides[int(line[i])])) is not None]
        if not found:
            continue
        q, ratio, plain = (np.concatenate([ratios[k] for ratios in found]) for k in range(3))
        road[i], n_looks[i] = np.exp(np.mean(np.log([ratios[4] for ratios in found]))), len(found)
        noise = math.hypot(*(ratios[5] for ratios in found)) / len(found)
        both_sides = float(np.mean([ratios[3] for ratios in found]))
        road_sigma[i] = math.hypot(both_sides, noise, step / (math.sqrt(12.0) * road[i]))
        here = order[bounds[i] : bounds[i + 1]]
        if noise > 0.0:
            n_clipped[i] = np.count_nonzero(
                value[here[np.abs(across[here]) <= CORE_SHARE * half]] == brightest
            )
        on[i] = _counted(ratio[np.abs(q) <= CORE_SHARE * half])
        beside[i] = _counted(plain)
        across_m[:, i] = _width_across(q, ratio, half)
    length = np.array([float(np.linalg.norm(np.diff(one[:, :2], axis=0), axis=1).sum()) for one in pieces])
    return PaintPieces(
        line=line, xy=_middles(pieces), length_m=length, width_m=width_m, on=on, beside=beside, road=road,
        n_looks=n_looks, road_sigma=road_sigma, n_clipped=n_clipped, area_m2=length * CORE_SHARE * width_m,
        across_m=across_m[0], across_sigma_m=across_m[1],
    )  # fmt: skip


def _recorded(value: FloatArray) -> tuple[float, float]:
    """Return the least step in which brightness was recorded, 0 where it has none, and the greatest that was."""
    levels = np.unique(value)
    return (float(np.diff(levels).min()) if len(levels) > 1 else 0.0), float(levels[-1]) if len(
        levels
    ) else 0.0


@dataclass(frozen=True, slots=True)
class PointsOnChords(Columns):
    """Points on the road on and beside chords of lines.

    Parameters
    ----------
    chord
        (n,) int64: number of the chord.
    along_m, across_m
        (n,) distance from its beginning along it, and across, positive to the left. [m]
    brightness, time_s
        (n,) intensity, and time [s], 0 where it is not known.
    """

    chord: IntArray = column(np.int64)
    along_m: FloatArray = column()
    across_m: FloatArray = column()
    brightness: FloatArray = column()
    time_s: FloatArray = column()


def points_on_chords(points: Points, chords: FloatArray, reach: float) -> PointsOnChords:
    """Return the points on the road that are nearest to each of some chords (c, 2, 3) [m], no farther off than `reach`."""
    if points.intensity is None or not len(points):
        return PointsOnChords.empty()
    middle, half = chords.mean(axis=1), 0.5 * (chords[:, 1] - chords[:, 0])
    length = np.linalg.norm(half[:, :2], axis=1)
    tree = cKDTree(middle[:, :2])
    away, nearest = tree.query(points.xyz[:, :2], distance_upper_bound=reach + float(length.max()))
    near = np.flatnonzero(np.isfinite(away))
    chord = nearest[near]
    shift = points.xyz[near] - middle[chord]
    ahead = half[chord, :2] / length[chord, None]
    along = np.einsum("ij,ij->i", shift[:, :2], ahead)
    across = ahead[:, 0] * shift[:, 1] - ahead[:, 1] * shift[:, 0]
    up = shift[:, 2] - along * half[chord, 2] / length[chord]
    kept = (np.abs(along) <= length[chord]) & (np.abs(across) <= reach) & (np.abs(up) <= _NEAR_ROAD_M)
    brightness = points.intensity[near[kept]].astype(np.float64)
    time_s = np.zeros(len(brightness)) if points.time_s is None else points.time_s[near[kept]]
    return PointsOnChords(chord[kept], along[kept] + length[chord[kept]], across[kept], brightness, time_s)


class _Look(NamedTuple):
    """What one look shows across a piece: distances [m] and brightness, and that of the road on either side."""

    across: FloatArray
    value: FloatArray
    beside: tuple[FloatArray, FloatArray]


def _look_across(across: FloatArray, value: FloatArray, half_m: float) -> _Look:
    return _Look(across, value, (beside_paint(across - half_m, value), beside_paint(-across - half_m, value)))


def beside_paint(off_m: FloatArray, value: FloatArray) -> FloatArray:
    """Return the brightness of the points beside paint on one side, by their distance from its edge; of few, the nearest."""
    reach = np.flatnonzero((off_m >= _BESIDE_M[0]) & (off_m <= PAINT_REACH_M))
    near = reach[off_m[reach] <= _BESIDE_M[1]]
    if len(near) < LEAST_BESIDE:
        near = reach[np.argsort(off_m[reach], kind="stable")[:LEAST_BESIDE]]
    return value[near]


def _sides_of_road(looks: list[_Look]) -> tuple[BoolArray, float]:
    """Return which sides of a marking are road (left, right), and how much brighter the left one is than the right one.

    Chosen for all looks together, so that all refer to the same road. Road is even; across the edge of a pavement are two
    materials. A side that was hardly hit is what another marking left of it, bright by the blurred edge of its paint.
    """
    is_hit = np.array([[len(there) >= LEAST_BESIDE for there in look.beside] for look in looks])
    n = np.array([[len(there) for there in look.beside] for look in looks]).sum(axis=0)
    level, uneven = np.full((2, len(looks), 2), np.nan)
    for i, k in np.argwhere(is_hit).tolist():
        low, middle, high = np.percentile(looks[i].beside[k], (10.0, 50.0, 90.0))
        level[i, k], uneven[i, k] = middle, (high - low) / max(middle, 1e-9)
    is_road = is_hit.any(axis=0) & (2 * n >= n.max())
    usual = np.array([np.nanmedian(uneven[:, k]) if is_road[k] else np.inf for k in (0, 1)])
    is_road &= usual <= _UNEVEN * usual.min()
    both = is_hit.all(axis=1) & (level > 0.0).all(axis=1)
    return is_road, float(np.median(level[both, 0] / level[both, 1])) if both.any() else 1.0


def _as_ratios(
    look: _Look, is_road: BoolArray, brighter: float
) -> tuple[FloatArray, FloatArray, FloatArray, float, float, float] | None:
    """Return distances across, ratios to the road, those of the road, its deviation, brightness and noise; None without road.

    The road under a marking is between those on both sides: it may be brighter on one, where wheels have polished the
    other or it was laid anew. So its brightness is the mean of both, each point beside relative to its own side, and half
    of their difference its deviation. Of a side that was not hit the brightness follows from the other.
    """
    is_hit = np.array([len(there) >= LEAST_BESIDE for there in look.beside])
    used = np.flatnonzero(is_road & is_hit).tolist()
    level = [float(np.median(look.beside[k])) for k in used]
    if not used or min(level) <= 0.0:
        return None
    road = float(np.mean(level))
    if is_road.all() and len(used) == 1:
        road *= 0.5 * (1.0 + (1.0 / brighter if used[0] == 0 else brighter))
    plain = np.concatenate([look.beside[k] / own for k, own in zip(used, level, strict=True)])
    every = [float(np.median(look.beside[k])) for k in np.flatnonzero(is_hit).tolist()]
    noise = math.hypot(*(_median_sigma(look.beside[k]) for k in used)) / len(used)
    return look.across, look.value / road, plain, 0.5 * (max(every) - min(every)) / road, road, noise / road


def _median_sigma(value: FloatArray) -> float:
    """Return the standard deviation of the median of values that are normally distributed but for a few."""
    low, high = np.percentile(value, (25.0, 75.0))
    return 1.2533 * float(high - low) / 1.349 / math.sqrt(len(value))


def bins_of_factor(factor: FloatArray) -> IntArray:
    """Return by how many bins a ratio changes that is multiplied by a factor."""
    return np.asarray(np.rint(np.log(factor) / np.log1p(_RATIO_STEP))).astype(np.int64)


def _counted(ratio: FloatArray) -> IntArray:
    at = np.floor(np.log(np.maximum(ratio / _LEAST_RATIO, 1.0)) / np.log1p(_RATIO_STEP))
    return np.bincount(np.clip(at, 0, N_RATIOS - 1).astype(np.int64), minlength=N_RATIOS)


def _width_across(across: FloatArray, ratio: FloatArray, half_m: float) -> tuple[float, float]:
    """Return the width of paint and its standard deviation [m]; NaN where a step of the profile was not hit.

    The area of the profile above the line from the road on one side to that on the other, by its height in the core:
    neither the spot of the beam nor the noise shifts it, as both change neither area nor height.
    """
    reach = half_m + _BEYOND_M
    n = int(np.ceil(2 * reach / STEP_ACROSS_M))
    place = (np.arange(n) + 0.5) * STEP_ACROSS_M - reach
    at = np.floor((across + reach) / STEP_ACROSS_M).astype(np.int64)
    inside = (at >= 0) & (at < n)
    count = np.bincount(at[inside], minlength=n)
    if not count.all():
        return float("nan"), float("nan")
    profile = np.bincount(at[inside], weights=ratio[inside], minlength=n) / count
    left, right = (place > half_m + _BESIDE_M[0]), (place < -half_m - _BESIDE_M[0])
    ends = float(profile[left].mean()), float(profile[right].mean())
    outer = float(place[left].mean())
    above = profile - (ends[1] + (ends[0] - ends[1]) * (place + outer) / (2 * outer))
    core, painted = np.abs(place) <= CORE_SHARE * half_m, ~left & ~right
    height = float(np.average(above[core], weights=count[core]))
    if height <= 0.0:
        return float("nan"), float("nan")
    width = float(above[painted].sum() * STEP_ACROSS_M) / height
    noise = np.where(core, _deviation(ratio, across, 0.0, CORE_SHARE * half_m),
                     _deviation(ratio, across, half_m + _BESIDE_M[0], reach))  # fmt: skip
    area_sigma = STEP_ACROSS_M * float(np.sqrt(np.sum((noise**2 / count)[painted])))
    height_sigma = float(np.sqrt(np.mean(noise[core] ** 2) / count[core].sum()))
    # Where the sides differ it is not known where the one ends and the other begins
    step = 0.5 * abs(ends[0] - ends[1]) * (half_m + _BESIDE_M[0])
    return width, float(np.sqrt(area_sigma**2 + (width * height_sigma) ** 2 + step**2)) / height


def _deviation(ratio: FloatArray, across: FloatArray, low: float, high: float) -> float:
    """Return the standard deviation of the ratios of points between two distances."""
    return float(np.std(ratio[(np.abs(across) >= low) & (np.abs(across) <= high)]))
