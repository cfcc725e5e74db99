"""Whether a survey saw the ground where only the other one has a line, by the points that it has there.

Separate from `epochs`, which knows lines only: points are read here, tile by tile, and nowhere else.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from linework.arrays import FloatArray, IntArray
from linework.evaluation.changes.epoch_stations import EpochStations
from linework.evaluation.changes.misses import LEAST_STRETCH_M
from linework.lines.along import runs_of
from linework.model.grid import Bounds
from linework.model.lines import LineSet
from linework.model.points import Points

#: Kinds that lie on the ground, and show by what the ground beside them is like.
_ON_GROUND = ("lane_marking", "road_boundary", "kerb_top")
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
#: Points are read by tiles of this side. [m]
_TILE_M = 64.0


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


#: Returns for places what `fewest_points` does, of one survey.
LookAtPlaces = Callable[[Places], IntArray]


def fewest_points(
    places: Places, points_in: Callable[[Bounds], Points], advance: Callable[[int, int], None] | None = None
) -> IntArray:
    """Return the fewest points (n,) int64 on either side of a line, or on its paint.

    Parameters
    ----------
    points_in
        Returns all points within bounds.
    advance
        Called with the tiles done and all tiles.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> ground = Points(np.column_stack([rng.uniform(0.0, 10.0, (2000, 2)), np.zeros(2000)]))
    >>> hidden = ground.take(ground.xyz[:, 1] < 5.0)
    >>> at = Places(np.array([[5.0, 4.9, 0.0]]), np.array([[0.0, 1.0]]), np.zeros(1))
    >>> [int(fewest_points(at, lambda area: shown)[0]) for shown in (ground, hidden)]
    [4, 0]
    """
    found = np.zeros(len(places.xyz), dtype=np.int64)
    tiles = np.floor(places.xyz[:, :2] / _TILE_M).astype(np.int64)
    every_tile = np.unique(tiles, axis=0).tolist()
    for n_done, tile in enumerate(every_tile):
        if advance is not None:
            advance(n_done, len(every_tile))
        rows = np.flatnonzero((tiles == tile).all(axis=1))
        reach = float(np.hypot(places.half_m[rows].max() + _BESIDE_M[1], _HALF_M))
        low, high = places.xyz[rows, :2].min(axis=0) - reach, places.xyz[rows, :2].max(axis=0) + reach
        cloud = points_in(Bounds(float(low[0]), float(low[1]), float(high[0]), float(high[1]))).xyz
        if not len(cloud):
            continue
        at = places.xyz[rows, :2] - low
        # Most points of a tile are near no place
        away, _ = cKDTree(at).query(cloud[:, :2] - low, distance_upper_bound=reach)
        cloud = cloud[np.isfinite(away)]
        near = cKDTree(cloud[:, :2] - low).query_ball_point(at, reach) if len(cloud) else [[]] * len(rows)
        for row, own in zip(rows.tolist(), near, strict=True):
            found[row] = _fewest_at(places, row, cloud[own])
    return found


def _fewest_at(places: Places, row: int, cloud: FloatArray) -> int:
    """Return the fewest of the points near a place (k, 3) on either side of its line, or on its paint."""
    (e, n), half_m = places.left[row], places.half_m[row]
    off = cloud - places.xyz[row]
    across, along = off[:, 0] * e + off[:, 1] * n, off[:, 0] * n - off[:, 1] * e
    across = across[(np.abs(along) <= _HALF_M) & (np.abs(off[:, 2]) <= _NEAR_GROUND_M)]
    low, high = half_m + _BESIDE_M[0], half_m + _BESIDE_M[1]
    parts = [(low <= side) & (side <= high) for side in (across, -across)]
    if half_m > 0.0:
        parts.append(np.abs(across) <= half_m)
    return min(int(part.sum()) for part in parts)


def without_unseen(
    stations: EpochStations, lines: LineSet, xyz: FloatArray, look: LookAtPlaces
) -> EpochStations:
    """Return stations of which those without a partner are visible only where the other survey saw the ground.

    Parameters
    ----------
    stations, lines
        Of one survey.
    xyz
        (n, 3) where the stations are in the other survey, after registration. [m, world]
    look
        At the points of the other survey.

    Notes
    -----
    The ground was seen where there are as many points on both sides of the line, and on its paint, as at 99 of 100 places
    where the other survey did find lines of this kind, or five; where it has none of this kind, five. A rail that is new
    hides what is behind it; a marking half of which lies in its shadow is not gone.
    """
    kind = lines.kind[stations.line]
    width_m = np.where(kind == "lane_marking", np.nan_to_num(lines.width_m[stations.line], nan=0.0), 0.0)
    # Where the other survey has a line of another kind in this place, it saw the place
    is_alone = (stations.partner < 0) & (stations.instead < 0) & ~stations.bridged & stations.visible
    is_found = (stations.partner >= 0) & ~stations.partner_bridged
    # Where the other survey has its own line: its place, not that of this one
    shift_m = np.nan_to_num(np.column_stack([stations.left * stations.across_m[:, None], stations.up_m]))
    at = np.where(is_found[:, None], stations.xyz + shift_m, xyz)
    looked = list[tuple[IntArray, IntArray]]()
    for one in _ON_GROUND:
        alone, found = (np.flatnonzero(which & (kind == one)) for which in (is_alone, is_found))
        if len(alone):
            looked.append((alone, found[:: max(-(-len(found) // _MOST_PLACES), 1)]))
    if not looked:
        return stations
    rows = np.unique(np.concatenate([row for pair in looked for row in pair]))
    number = np.zeros(len(kind), dtype=np.int64)
    number[rows] = look(Places(at[rows], stations.left[rows], 0.5 * width_m[rows]))
    visible = stations.visible.copy()
    for alone, found in looked:
        least = _ENOUGH
        if len(found):
            least = min(int(np.quantile(number[found], _SPARSEST, method="lower")), _ENOUGH)
        is_sparse = np.zeros(len(kind), dtype=bool)
        is_sparse[alone] = number[alone] < least
        # A few points less at one place are chance; a line is not parted by less than a stretch that is looked at
        for first, last in runs_of(is_sparse):
            run = np.arange(first, last + 1)
            for own in np.split(run, np.flatnonzero(np.diff(stations.line[run])) + 1):
                if np.ptp(stations.along_m[own]) >= LEAST_STRETCH_M:
                    visible[own] = False
    return replace(stations, visible=visible)
