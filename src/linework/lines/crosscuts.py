"""Cross-cuts: where lines cross the perpendiculars at stations along an axis."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import shapely

from linework.arrays import BoolArray, FloatArray, IntArray, distance_along
from linework.model.columns import Columns, column
from linework.model.lines import LineSet

#: Distance of stations. [m]
STATION_M = 1.0
#: The direction at a station is that of the axis over this distance to both sides: paths and painted lines wobble by
#: 1 to 3 cm, which turns a perpendicular of 10 m by 3 to 6 cm along the road at its end. [m]
_DIRECTION_M = 5.0
#: A line that ends on a perpendicular crosses it, whatever the rounding. [m]
_TOUCH_M = 1e-6
#: Farthest crossing from the axis: a motorway has 30 m from its median to the verge. [m]
REACH_M = 30.0


@dataclass(frozen=True, slots=True)
class Axis:
    """Stations along a route.

    Parameters
    ----------
    name
        Id of the route.
    station_m
        (n,) chainage. [m]
    xyz
        (n, 3) positions. [m, world]
    ahead
        (n, 2) unit directions in plan.
    """

    name: str
    station_m: FloatArray
    xyz: FloatArray
    ahead: FloatArray

    @property
    def left(self) -> FloatArray:
        """(n, 2) unit vectors to the left."""
        return np.column_stack([-self.ahead[:, 1], self.ahead[:, 0]])


def axis_along(name: str, xyz: FloatArray, *, start_m: float = 0.0) -> Axis:
    """Return stations every `STATION_M` along a line.

    Parameters
    ----------
    xyz
        (n, 3) vertices of the line, n >= 2, with a length. [m, world]
    start_m
        Chainage of its first vertex. [m]

    Examples
    --------
    >>> axis = axis_along("A1", np.array([[0.0, 0.0, 5.0], [3.0, 0.0, 8.0]]), start_m=100.0)
    >>> axis.station_m.tolist(), axis.left[0].tolist()
    ([100.0, 101.0, 102.0, 103.0], [-0.0, 1.0])
    """
    along = distance_along(xyz)
    at = np.arange(0.0, along[-1] + 1e-6, STATION_M)

    def places(where: FloatArray) -> FloatArray:
        return np.stack([np.interp(where, along, coordinate) for coordinate in xyz.T], axis=1)

    ahead = places(np.minimum(at + _DIRECTION_M, along[-1])) - places(np.maximum(at - _DIRECTION_M, 0.0))
    ahead = ahead[:, :2] / np.maximum(np.linalg.norm(ahead[:, :2], axis=1, keepdims=True), 1e-12)
    return Axis(name, start_m + at, places(at), ahead)


@dataclass(frozen=True, slots=True)
class CrossCuts(Columns):
    """Crossings of lines with the perpendiculars of an axis, by station and then from right to left.

    Parameters
    ----------
    station, line
        (n,) int64: index of the station and of the line.
    offset_m
        (n,) distance from the axis, positive to the left. [m]
    up_m
        (n,) height of the line. [m]
    sigma_xy_m, sigma_z_m
        (n,) standard deviations. [m]
    along_m
        (n,) distance from the start of the line. [m]
    cosine
        (n,) cosine of the angle between line and axis: near -1 and 1 for lines along the road.
    bridged
        (n,) bool: no measurement here.
    """

    station: IntArray = column(np.int64)
    line: IntArray = column(np.int64)
    offset_m: FloatArray = column()
    up_m: FloatArray = column()
    sigma_xy_m: FloatArray = column()
    sigma_z_m: FloatArray = column()
    along_m: FloatArray = column()
    cosine: FloatArray = column()
    bridged: BoolArray = column(np.bool_)


class LinesToCut:
    """Lines whose segments were sorted into a tree once, for `cross_cuts` along many axes.

    Parameters
    ----------
    lines
        Any lines; a cut of `cross_cuts` names them by their numbers.
    """

    def __init__(self, lines: LineSet) -> None:
        self.lines = lines
        self.owner = lines.line_of_vertex
        self.first = np.flatnonzero(self.owner[:-1] == self.owner[1:])
        self.begin, self.end = lines.xyz[self.first, :2], lines.xyz[self.first + 1, :2]
        self.tree = shapely.STRtree(shapely.linestrings(np.stack([self.begin, self.end], axis=1)))
        spans = pairwise(lines.offsets.tolist())
        self.along_m = np.concatenate([np.zeros(0), *(distance_along(lines.xyz[a:b]) for a, b in spans)])


def cross_cuts(lines: LineSet | LinesToCut, axis: Axis, *, reach_m: float = REACH_M) -> CrossCuts:
    """Return the crossings of lines with the perpendiculars at all stations, up to `reach_m` from the axis [m]."""
    cut = lines if isinstance(lines, LinesToCut) else LinesToCut(lines)
    if not len(cut.first) or not len(axis.station_m):
        return CrossCuts.empty()
    lines, begin, end = cut.lines, cut.begin, cut.end
    reach = axis.left * reach_m
    cuts = shapely.linestrings(np.stack([axis.xyz[:, :2] - reach, axis.xyz[:, :2] + reach], axis=1))
    station, segment = cut.tree.query(cuts, predicate="dwithin", distance=_TOUCH_M)
    step = end[segment] - begin[segment]
    away = axis.xyz[station, :2] - begin[segment]
    ahead = axis.ahead[station]
    across = np.einsum("ij,ij->i", step, ahead)
    # Segments along the perpendicular itself cross it nowhere in particular
    crossing = np.abs(across) > 1e-9
    station, segment, step, away, ahead, across = (
        a[crossing] for a in (station, segment, step, away, ahead, across)
    )
    share = np.clip(np.einsum("ij,ij->i", away, ahead) / across, 0.0, 1.0)
    vertex = cut.first[segment]
    place = begin[segment] + share[:, None] * step
    offset = np.einsum("ij,ij->i", place - axis.xyz[station, :2], axis.left[station])

    def between(values: FloatArray) -> FloatArray:
        return np.asarray(values[vertex] * (1 - share) + values[vertex + 1] * share)

    length = np.hypot(step[:, 0], step[:, 1])
    found = CrossCuts(
        station=station, line=cut.owner[vertex], offset_m=offset, up_m=between(lines.xyz[:, 2]),
        sigma_xy_m=between(lines.sigma_xy_m), sigma_z_m=between(lines.sigma_z_m), along_m=between(cut.along_m),
        cosine=across / np.maximum(length, 1e-12), bridged=lines.bridged[vertex] | lines.bridged[vertex + 1],
    )  # fmt: skip
    found = found.take(np.lexsort((found.line, found.offset_m, found.station)))
    # A crossing at a vertex is one of two segments
    again = (
        (np.diff(found.station) == 0) & (np.diff(found.line) == 0) & (np.diff(found.offset_m) < 2 * _TOUCH_M)
    )
    return found.take(np.flatnonzero(np.concatenate([[True], ~again])[: len(found)]))
