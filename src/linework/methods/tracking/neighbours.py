"""The lines beside a line: its neighbours to the left and to the right, station by station."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from linework.arrays import BoolArray, FloatArray, IntArray, distance_along
from linework.kernels.tracking.beside import stations_beside

#: Distance of the stations at which lines are compared. [m]
AXIS_STATION_M = 2.0
#: Stations of two lines are beside each other if they are no farther apart along the line. [m]
_ALONG_M = 0.75 * AXIS_STATION_M
#: Positions of the vehicle's path farther apart than this are not joined; nearer than this to the one before they are
#: left out, as a standing vehicle has no direction. [m]
_JUMP_M, _STANDING_M = 50.0, 1.0
#: Positions looked at together for the next that is kept: those of some metres, at 100 a second.
_LOOKED_AT = 32
#: Between a boundary and another this far behind it there is room for a footway, and none for a van of 1.8 m. [m]
_FOOTWAY_M = (1.0, 1.8)
#: Lines count as parallel within 30 degrees: cosine.
_PARALLEL = 0.866


@dataclass(frozen=True, slots=True)
class LineAxis:
    """The axis of a line, at stations of about `AXIS_STATION_M`.

    Parameters
    ----------
    xy
        (n, 2) float64 [m, from the survey's local origin].
    normal
        (n, 2) float64: unit vectors to the left.
    """

    xy: FloatArray
    normal: FloatArray

    @classmethod
    def of(cls, t_m: FloatArray, xyz: FloatArray) -> LineAxis:
        """Return the axis of a line with vertices xyz (k, 2 or 3) [m] at distances t_m (k,) [m] along it."""
        n = max(int(np.ceil((t_m[-1] - t_m[0]) / AXIS_STATION_M)), 1)
        edges = np.linspace(t_m[0], t_m[-1], n + 1)
        ends = np.stack([np.interp(edges, t_m, xyz[:, axis]) for axis in range(2)], axis=1)
        step = np.diff(ends, axis=0)
        step /= np.maximum(np.linalg.norm(step, axis=1), 1e-9)[:, None]
        return cls(0.5 * (ends[1:] + ends[:-1]), np.stack([-step[:, 1], step[:, 0]], axis=1))


def axes_of_path(path: FloatArray) -> list[LineAxis]:
    """Return the axes of a vehicle's path (n, 2 or 3) [m, local], cut where it has gaps."""
    kept = places_apart(path[:, :2], _STANDING_M)
    xy = path[kept, :2]
    step = np.hypot(*np.diff(xy, axis=0).T)
    pieces = np.split(np.arange(len(xy)), np.flatnonzero(step > _JUMP_M) + 1)
    t = distance_along(xy)
    return [LineAxis.of(t[piece], xy[piece]) for piece in pieces if len(piece) >= 2]


def places_apart(xy: FloatArray, apart_m: float) -> list[int]:
    """Return the first of places (n, 2) [m], and each that is at least `apart_m` from the one kept before."""
    kept = [0]
    first = 1
    while first < len(xy):
        some = slice(first, first + _LOOKED_AT)
        is_apart = np.hypot(*(xy[some] - xy[kept[-1]]).T) >= apart_m
        if is_apart.any():
            kept.append(first + int(np.argmax(is_apart)))
            first = kept[-1] + 1
        else:
            first += _LOOKED_AT
    return kept


@dataclass(frozen=True, slots=True)
class Neighbours:
    """The lines beside stations of lines, in the order of the stations, hence of the lines.

    Parameters
    ----------
    line, other
        (k,) int64: number of the line, and of the line beside it.
    station
        (k,) int64: number of the station, counted over all lines.
    across_m
        (k,) float64 [m]: offset of the other line, positive to the left.
    facing
        (k,) float64: cosine between the left sides of both.
    """

    line: IntArray
    other: IntArray
    station: IntArray
    across_m: FloatArray
    facing: FloatArray

    @property
    def ends_footway(self) -> BoolArray:
        """Which others stand at the back of a footway behind the line, (k,) bool: with no room for a vehicle between."""
        is_near = (self.across_m < -_FOOTWAY_M[0]) & (self.across_m > -_FOOTWAY_M[1])
        return np.asarray(is_near & (self.facing > 0.0))


def find_neighbours(axes: Sequence[LineAxis], reach_m: float) -> Neighbours:
    """Return every line beside every station, within `reach_m` [m] across and 30 degrees of its direction.

    Each other line is given once per station, where it is nearest.
    """
    xy = np.concatenate([np.zeros((0, 2)), *(c.xy for c in axes)])
    normal = np.concatenate([np.zeros((0, 2)), *(c.normal for c in axes)])
    owner = np.repeat(np.arange(len(axes)), [len(c.xy) for c in axes])
    if len(xy) == 0:
        none = np.zeros(0, dtype=np.int64)
        return Neighbours(none, none, none, np.zeros(0), np.zeros(0))
    pairs = cKDTree(xy).query_pairs(np.hypot(reach_m, _ALONG_M), output_type="ndarray").astype(np.int64)
    most = (_ALONG_M, float(reach_m), _PARALLEL)
    found, how = stations_beside(pairs, owner, xy, normal, most)
    (a, b), (across, facing) = found.T, how.T
    # Of the stations of one other line, the nearest
    order = np.lexsort((np.abs(across), owner[b], a))
    a, b, across, facing = a[order], b[order], across[order], facing[order]
    first = (
        np.concatenate([[True], (np.diff(a) != 0) | (np.diff(owner[b]) != 0)])
        if len(a)
        else np.zeros(0, bool)
    )
    return Neighbours(owner[a[first]], owner[b[first]], a[first], across[first], facing[first])


def half_lane_sides(
    axes: Sequence[LineAxis], lines: Sequence[LineAxis], half_m: tuple[float, float]
) -> IntArray:
    """Return on how many sides of each axis, 0 to 2, one of the lines lies half a lane away along most of it, (m,).

    half_m: least and greatest distance. [m]
    """
    m = len(axes)
    n = find_neighbours([*axes, *lines], half_m[1])
    near = (n.line < m) & (n.other >= m) & (np.abs(n.across_m) >= half_m[0])
    stations = np.array([len(c.xy) for c in axes], dtype=np.int64)
    sides = np.zeros(m, dtype=np.int64)
    for sign in (1.0, -1.0):
        beside = near & (n.across_m * sign > 0.0)
        _, first = np.unique(n.station[beside], return_index=True)
        count = np.bincount(n.line[beside][first], minlength=m)
        sides += 2 * count > stations
    return sides
