"""What a survey saw of the ground at places on lines, and whether it saw it where only the other survey has a line.

Separate from `epochs`, which knows lines only: points are read here, tile by tile, and nowhere else.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace

import numpy as np
from scipy.spatial import cKDTree

from linework.arrays import BoolArray, FloatArray, IntArray
from linework.evaluation.changes.epoch_stations import EpochStations, height_differs
from linework.evaluation.changes.misses import LEAST_STRETCH_M
from linework.lines.along import runs_of
from linework.model.grid import Bounds
from linework.model.lines import LineSet
from linework.model.points import Points

#: Kinds that lie on the ground, and show by what the ground beside them is like; and kinds that stand on it.
ON_GROUND, STANDING = ("lane_marking", "road_boundary", "kerb_top"), ("guardrail", "barrier", "fence")
#: What stands is this near to its line across, from this far below its upper edge to that above it: a beam is 0.3 m high.
#: What is beside it, however far below, lies up to this far off. [m]
_THICK_M, _UPPER_M, _BESIDE_IT_M = 0.15, (-0.3, 0.05), 0.6
#: Markings of which no width is known are as wide as most. [m]
_USUAL_WIDTH_M = 0.12
#: What is beside a line, from this far off its edge to that; and half of the length that is looked at: stations are 1 m
#: apart. [m]
_BESIDE_M, _HALF_M = (0.05, 0.35), 0.5
#: Ground beside a line is this near to it in height: kerbs are up to 0.2 m high. [m]
_NEAR_GROUND_M = 0.3
#: Of the places where a survey found lines it has fewer points at this share of them. [share]
_SPARSEST = 0.01
#: Points that are enough, however many the survey has beside its own lines, all of them near the van perhaps: their mean
#: is known to half of a point's deviation.
_ENOUGH = 5
#: Places that say how many points a survey has beside lines of a kind: one in a hundred is one of the five sparsest.
_MOST_PLACES = 500
#: Stations of a stretch, as much as half of those that are compared have; and most places at which a line that both surveys
#: found elsewhere, or of another form, is looked at.
STRETCH, _MOST_DIFFERING = 8, 20_000
#: Points are read by tiles of this side. [m]
_TILE_M = 64.0
#: A profile across a line: how far it reaches to either side, and its steps. Kerbs and paint are 0.1 to 0.3 m wide. [m]
_PROFILE_M, PROFILE_STEP_M = 0.5, 0.05
N_STEPS = round(2.0 * _PROFILE_M / PROFILE_STEP_M)
#: Middles of the steps. [m]
STEP_PLACES_M = (np.arange(N_STEPS) + 0.5) * PROFILE_STEP_M - _PROFILE_M


@dataclass(frozen=True, slots=True)
class Places:
    """Places on lines.

    Parameters
    ----------
    xyz, left
        (n, 3) place [m, world], (n, 2) unit vector to the left of the line.
    half_m
        (n,) half of the width of the paint; 0 for an edge. [m]
    """

    xyz: FloatArray
    left: FloatArray
    half_m: FloatArray


def marking_places(lines: LineSet, n: int) -> Places:
    """Return about n places on lane markings, in the middle of pieces between vertices, or one in each piece of fewer."""
    first, last = [], []
    for number in np.flatnonzero(lines.kind == "lane_marking").tolist():
        first.append(lines[number].xyz[:-1])
        last.append(lines[number].xyz[1:])
    a, b = (np.concatenate([np.zeros((0, 3)), *ends]) for ends in (first, last))
    some = slice(None, None, max(len(a) // n, 1))
    a, b = a[some], b[some]
    ahead = (b - a)[:, :2] / np.maximum(np.linalg.norm((b - a)[:, :2], axis=1), 1e-9)[:, None]
    return Places((a + b) / 2, np.stack([-ahead[:, 1], ahead[:, 0]], axis=1), np.zeros(len(a)))


@dataclass(frozen=True, slots=True)
class GroundAtPlaces:
    """What the points of a survey show of the ground around places on lines.

    Parameters
    ----------
    fewest
        (n,) fewest points on either side of the line, or on its paint.
    number
        (n, N_STEPS) points of 1 m of line by their distance across it, from right to left.
    sums
        (n, 4, N_STEPS) sums of their heights above the place [m], of their brightness, and of the squares of both.
    half_m
        (n,) half of the width of the paint; 0 for an edge. [m]
    upper, below
        (n,) points of what stands there, below its upper edge, and of what lies beside and below that.
    """

    fewest: IntArray
    number: IntArray
    sums: FloatArray
    half_m: FloatArray
    upper: IntArray
    below: IntArray

    def at(self, rows: IntArray) -> GroundAtPlaces:
        """Return what is shown at some of the places."""
        return GroundAtPlaces(*(getattr(self, field.name)[rows] for field in fields(self)))


#: Returns for places what `look_at_ground` does, of one survey.
LookAtPlaces = Callable[[Places], GroundAtPlaces]


def look_at_ground(
    places: Places, points_in: Callable[[Bounds], Points], advance: Callable[[int, int], None] | None = None
) -> GroundAtPlaces:
    """Return what the points show of the ground around places.

    Parameters
    ----------
    points_in
        Returns all points within bounds; those without intensities have no brightness.
    advance
        Called with the tiles done and all tiles.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> ground = Points(np.column_stack([rng.uniform(0.0, 10.0, (2000, 2)), np.zeros(2000)]))
    >>> hidden = ground.take(ground.xyz[:, 1] < 5.0)
    >>> at = Places(np.array([[5.0, 4.9, 0.0]]), np.array([[0.0, 1.0]]), np.zeros(1))
    >>> [int(look_at_ground(at, lambda area: shown).fewest[0]) for shown in (ground, hidden)]
    [4, 0]
    """
    n = len(places.xyz)
    found = GroundAtPlaces(
        np.zeros(n, dtype=np.int64), np.zeros((n, N_STEPS), dtype=np.int64), np.zeros((n, 4, N_STEPS)), places.half_m,
        *np.zeros((2, n), dtype=np.int64),
    )  # fmt: skip
    tiles = np.floor(places.xyz[:, :2] / _TILE_M).astype(np.int64)
    every_tile = np.unique(tiles, axis=0).tolist()
    for n_done, tile in enumerate(every_tile):
        if advance is not None:
            advance(n_done, len(every_tile))
        rows = np.flatnonzero((tiles == tile).all(axis=1))
        aside = max(float(places.half_m[rows].max()) + _BESIDE_M[1], _PROFILE_M, _BESIDE_IT_M)
        reach = float(np.hypot(aside, _HALF_M))
        low, high = places.xyz[rows, :2].min(axis=0) - reach, places.xyz[rows, :2].max(axis=0) + reach
        points = points_in(Bounds(float(low[0]), float(low[1]), float(high[0]), float(high[1])))
        if not len(points):
            continue
        at = places.xyz[rows, :2] - low
        # Most points of a tile are near no place
        away, _ = cKDTree(at).query(points.xyz[:, :2] - low, distance_upper_bound=reach)
        points = points.take(np.isfinite(away))
        near = (
            cKDTree(points.xyz[:, :2] - low).query_ball_point(at, reach) if len(points) else [[]] * len(rows)
        )
        value = np.zeros(len(points)) if points.intensity is None else points.intensity.astype(np.float64)
        for row, own in zip(rows.tolist(), near, strict=True):
            across, up, bright = _beside_place(places, row, points.xyz[own], value[own])
            away, is_high = np.abs(across), up > _UPPER_M[0]
            found.upper[row] = np.count_nonzero(is_high & (up < _UPPER_M[1]) & (away <= _THICK_M))
            found.below[row] = np.count_nonzero(~is_high & (away <= _BESIDE_IT_M))
            on_ground = np.abs(up) <= _NEAR_GROUND_M
            across, up, bright = across[on_ground], up[on_ground], bright[on_ground]
            found.fewest[row] = _fewest_at(across, float(places.half_m[row]))
            step = np.floor((across + _PROFILE_M) / PROFILE_STEP_M).astype(np.int64)
            inside = (step >= 0) & (step < N_STEPS)
            step, up, bright = step[inside], up[inside], bright[inside]
            found.number[row] = np.bincount(step, minlength=N_STEPS)
            for k, weights in enumerate((up, bright, up**2, bright**2)):
                found.sums[row, k] = np.bincount(step, weights=weights, minlength=N_STEPS)
    return found


def _beside_place(
    places: Places, row: int, cloud: FloatArray, value: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return distance across, height above the place and brightness of the points (k, 3) beside 1 m of line."""
    e, n = places.left[row]
    off = cloud - places.xyz[row]
    across, along = off[:, 0] * e + off[:, 1] * n, off[:, 0] * n - off[:, 1] * e
    kept = np.abs(along) <= _HALF_M
    # In an order of their own, so that sums are the same however the points are read
    order = np.lexsort((value[kept], off[kept, 2], across[kept]))
    return across[kept][order], off[kept, 2][order], value[kept][order]


def _fewest_at(across: FloatArray, half_m: float) -> int:
    """Return the fewest of the points near a place on either side of its line, or on its paint."""
    low, high = half_m + _BESIDE_M[0], half_m + _BESIDE_M[1]
    parts = [(low <= side) & (side <= high) for side in (across, -across)]
    if half_m > 0.0:
        parts.append(np.abs(across) <= half_m)
    return min(int(part.sum()) for part in parts)


@dataclass(frozen=True, slots=True)
class GroundAlongLines:
    """The ground at stations of one survey's lines as both surveys show it.

    Parameters
    ----------
    row
        (n,) number of a station among those looked at, -1 of the others.
    own, other
        Of those looked at: what their own survey shows, and what the other one does.
    is_found
        (m,) bool: of those looked at, where both surveys found the same line.
    away_m
        (m,) of those looked at: how far to the left the other survey found the line, where that is more than a step of a
        profile, and it was looked at where this survey has it; else 0. [m]
    """

    row: IntArray
    own: GroundAtPlaces
    other: GroundAtPlaces
    is_found: BoolArray
    away_m: FloatArray


def ground_along(
    stations: EpochStations, lines: LineSet, others: LineSet, xyz: FloatArray,
    looks: tuple[LookAtPlaces, LookAtPlaces],
) -> GroundAlongLines:  # fmt: skip
    """Return the ground where only one survey has a line, or each another form or place of it, and where both agree, at some.

    Parameters
    ----------
    stations, lines, others
        Stations and lines of one survey, and lines of the other one.
    xyz
        (n, 3) where the stations are in the other survey, after registration. [m, world]
    looks
        At the points of this survey, and of the other one.
    """
    kind = lines.kind[stations.line]
    width_m = np.nan_to_num(lines.width_m[stations.line], nan=_USUAL_WIDTH_M)
    width_m = np.where(kind == "lane_marking", np.where(width_m > 0.0, width_m, _USUAL_WIDTH_M), 0.0)
    is_found = (stations.partner >= 0) & ~stations.bridged & ~stations.partner_bridged
    # Where the other survey has its own line: its place, not that of this one
    shift_m = np.nan_to_num(np.column_stack([stations.left * stations.across_m[:, None], stations.up_m]))
    found_at = stations.xyz + shift_m
    away_m = np.where(is_found, np.sum((found_at - xyz)[:, :2] * stations.left, axis=1), 0.0)
    away_m[np.abs(away_m) < PROFILE_STEP_M] = 0.0
    is_moved = away_m != 0.0
    at = np.where((is_found & ~is_moved)[:, None], found_at, xyz)
    form, other_form = lines.form[stations.line], np.append(others.form, "")[stations.partner]
    is_other = is_moved | (is_found & (form != other_form) & (form != "") & (other_form != ""))
    both = np.flatnonzero(is_found & np.isin(kind, ON_GROUND))
    is_other[both] |= height_differs(lines, others, stations, both)
    looked = [np.zeros(0, dtype=np.int64)]
    for one in (*ON_GROUND, *STANDING):
        alone, differs, found = (
            np.flatnonzero(which & (kind == one))
            for which in (_is_alone(stations), is_other, is_found & ~is_other)
        )
        differs = np.concatenate([alone, _some_stretches(differs, _MOST_DIFFERING)])
        if len(differs):
            looked += [differs, _some_stretches(found, _MOST_PLACES)]
    rows = np.unique(np.concatenate(looked))
    row = np.full(len(kind), -1)
    row[rows] = np.arange(len(rows))
    own, other = (
        look(Places(place[rows], stations.left[rows], 0.5 * width_m[rows]))
        for look, place in zip(looks, (stations.xyz, at), strict=True)
    )
    return GroundAlongLines(row, own, other, (is_found & ~is_other)[rows], away_m[rows])


def _some_stretches(rows: IntArray, most: int) -> IntArray:
    """Return rows in stretches of `STRETCH` neighbours, about as many as are asked for, spread evenly over all.

    >>> _some_stretches(np.arange(64), 32).tolist() == [*range(8), *range(16, 24), *range(32, 40), *range(48, 56)]
    True
    """
    every = max(-(-len(rows) // most), 1)
    return np.asarray(rows[(np.arange(len(rows)) // STRETCH) % every == 0], dtype=np.int64)


def _is_alone(stations: EpochStations) -> BoolArray:
    """Return which stations have no line at all in their place; where there is one of another kind, it saw the place."""
    return (stations.partner < 0) & (stations.instead < 0) & ~stations.bridged & stations.visible


def without_unseen(stations: EpochStations, lines: LineSet, ground: GroundAlongLines) -> EpochStations:
    """Return stations of which those without a partner are visible only where the other survey saw the ground.

    Notes
    -----
    The ground was seen where there are as many points on both sides of the line, and on its paint, as at 99 of 100 places
    where the other survey did find lines of this kind, or five; where it has none of this kind, five. A rail that is new
    hides what is behind it; a marking half of which lies in its shadow is not gone. The place of what stands was seen where
    there are points of it, or of what is beside and below it.
    """
    kind, is_alone = lines.kind[stations.line], _is_alone(stations)
    fewest = np.append(ground.other.fewest, 0)[ground.row]
    is_found = np.append(ground.is_found, False)[ground.row]
    visible = stations.visible.copy()
    shows = np.append(ground.other.upper + ground.other.below, 0)[ground.row] > 0
    for one in (*ON_GROUND, *STANDING):
        found = np.flatnonzero(is_found & (kind == one))
        least = _ENOUGH
        if len(found):
            least = min(int(np.quantile(fewest[found], _SPARSEST, method="lower")), _ENOUGH)
        is_unseen = ~shows if one in STANDING else fewest < least
        is_sparse = is_alone & (kind == one) & is_unseen
        # A few points less at one place are chance; a line is not parted by less than a stretch that is looked at
        for first, last in runs_of(is_sparse):
            run = np.arange(first, last + 1)
            for own in np.split(run, np.flatnonzero(np.diff(stations.line[run])) + 1):
                if np.ptp(stations.along_m[own]) >= LEAST_STRETCH_M:
                    visible[own] = False
    return replace(stations, visible=visible)
