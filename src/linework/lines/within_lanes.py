"""Paint within lanes that is none of their lines: patches, letters and seams between two parallel lines.

Lines that were painted along a road keep their distance from each other. What lies between two of them at changing
distances from both is bright for another reason.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np

from linework.arrays import BoolArray, FloatArray, IntArray
from linework.lines.crosscuts import STATION_M

#: Painted lines wobble by 1 to 3 cm: as much differs their distance from each other, at two deviations. [m]
_SAME_DISTANCE_M = 0.06
#: Stations farther than this from each other say nothing about one another. [m]
_REACH_M = 50.0
#: Shortest stretch of measured paint that tells a line from a patch (that of bounds of lanes). [m]
_SHORTEST_LINE_M = 20.0
#: Nearer paint that was measured is the other stripe of a double line, or older paint: other rules judge it. [m]
_BESIDE_M = 0.5


class PaintRow(NamedTuple):
    """Paint where it crosses a perpendicular: number of its line, offset [m], whether bridged, whether an inner line."""

    line: int
    offset_m: float
    bridged: bool
    is_inner: bool


def _is_beside(row: PaintRow, right: PaintRow, left: PaintRow) -> bool:
    return min(row.offset_m - right.offset_m, left.offset_m - row.offset_m) <= _BESIDE_M


class PaintDistances:
    """Distances between measured paint along a road.

    Parameters
    ----------
    rows
        Paint at stations along a road, each from right to left. They are 1 m apart, or up to a tenth more: the length of
        a road, at least 10 m, is divided into as many equal parts as it has whole metres.
    """

    def __init__(self, rows: Sequence[Sequence[PaintRow]]) -> None:
        self.rows = rows
        pairs = [
            (k, b.offset_m - a.offset_m)
            for k, here in enumerate(rows)
            for a, b in combinations([row for row in here if not row.bridged], 2)
        ]
        table: FloatArray = np.array(pairs, dtype=np.float64).reshape(-1, 2)
        station: IntArray = table[:, 0].astype(np.int64)
        self._station = station
        self._distance_m: FloatArray = np.ascontiguousarray(table[:, 1])
        # Pairs are sorted by station: those within reach of each of them lie side by side
        reach = int(_REACH_M / STATION_M)
        each = np.arange(len(rows))
        self._first: list[int] = np.searchsorted(station, each - reach).tolist()
        self._end: list[int] = np.searchsorted(station, each + reach, side="right").tolist()

    def kept_m(self, k: int, distance_m: float) -> float:
        """Return over how many metres within reach of a station some paint has a distance from other paint."""
        near = slice(self._first[k], self._end[k])
        apart = self._distance_m[near]
        is_same: BoolArray = (apart >= distance_m - _SAME_DISTANCE_M) & (
            apart < distance_m + _SAME_DISTANCE_M
        )
        stations = self._station[near][is_same]
        if not len(stations):
            return 0.0
        return (1 + int(np.count_nonzero(np.diff(stations)))) * STATION_M


def patches_within_lanes(paint: PaintDistances, lane_m: tuple[float, float]) -> list[frozenset[int]]:
    """Return for each station the lines that are patches within a lane there.

    A lane is between two lines of paint, of which one is no edge line: of a narrow road with a line in its middle that is
    mostly worn away, both are. They have the same distance over 20 m that were measured within 50 m. Patches keep their
    distance from neither of both as long.

    Parameters
    ----------
    lane_m
        Least and largest width of a lane; where two have room, what lies between may be the line between them. [m]
    """
    widths_m = lane_m[0], min(lane_m[1], 2.0 * lane_m[0])
    return [_patches_at(k, paint, widths_m) for k in range(len(paint.rows))]


def _patches_at(k: int, paint: PaintDistances, widths_m: tuple[float, float]) -> frozenset[int]:
    found: set[int] = set()
    here = paint.rows[k]
    for i, j in combinations(range(len(here)), 2):
        right, left = here[i], here[j]
        width = left.offset_m - right.offset_m
        if j - i < 2 or not widths_m[0] <= width < widths_m[1] or not (right.is_inner or left.is_inner):
            continue
        between = [row for row in here[i + 1 : j] if row.line not in (right.line, left.line)]
        sides = [
            side for row in between for side in (row.offset_m - right.offset_m, left.offset_m - row.offset_m)
        ]
        beside = [row for row in between if not row.bridged and _is_beside(row, right, left)]
        if not between or beside:
            continue
        if paint.kept_m(k, width) < _SHORTEST_LINE_M:
            continue
        if all(paint.kept_m(k, side) < _SHORTEST_LINE_M for side in sides):
            found |= {row.line for row in between}
    return frozenset(found)
