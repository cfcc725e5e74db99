"""Lines that were not measured at a place, but are where another line that was measured beside them says.

Separate from `lane_sections`, which takes them as known. Lines of a road keep their distance from each other: where paint is
worn away, the edge of the pavement or other paint beside it tells where it was.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from itertools import combinations

import numpy as np

from linework.arrays import FloatArray, IntArray
from linework.lines.crosscuts import STATION_M
from linework.lines.lane_evidence import Bound

#: Painted lines wobble by 1 to 3 cm: as much differs their distance from each other, at two deviations. [m]
_SAME_DISTANCE_M = 0.06
#: Stations farther than this from each other say nothing about one another. [m]
_REACH_M = 50.0
#: Shortest stretch over which two lines were both measured at a distance that says where one of them is. [m]
_SHORTEST_KEPT_M = 20.0
#: Lines farther from each other are of different roads: two lanes of the widest kind. [m]
_FARTHEST_M = 9.0


def known_by_distance(rows: Sequence[Sequence[Bound]]) -> list[frozenset[int]]:
    """Return for each station the lines that were not measured there, but are where measured ones beside them say.

    The distance to such a line is that over 20 m, within 50 m of the station, at which both were measured. Paint, edges of the
    pavement, rails and walls all keep theirs.

    Parameters
    ----------
    rows
        What crosses the perpendiculars of stations along a road, a metre apart, each from right to left.
    """
    distance_m: dict[tuple[int, int], FloatArray] = {}
    bridged: dict[tuple[int, int], list[tuple[int, int]]] = defaultdict(list)
    for k, here in enumerate(rows):
        for a, b in combinations(here, 2):
            if a.line == b.line or (a.bridged and b.bridged) or b.offset_m - a.offset_m > _FARTHEST_M:
                continue
            pair = a.line, b.line
            if pair not in distance_m:
                distance_m[pair] = np.full(len(rows), np.nan)
            distance_m[pair][k] = b.offset_m - a.offset_m
            if a.bridged or b.bridged:
                bridged[pair].append((k, a.line if a.bridged else b.line))
    found: list[set[int]] = [set() for _ in rows]
    for pair, places in bridged.items():
        at: IntArray = np.array([k for k, _ in places], dtype=np.int64)
        both = distance_m[pair].copy()
        both[at] = np.nan
        is_kept = _kept_m(both, at, distance_m[pair][at]) >= _SHORTEST_KEPT_M
        for (k, line), kept in zip(places, is_kept.tolist(), strict=True):
            if kept:
                found[k].add(line)
    return [frozenset(lines) for lines in found]


def _kept_m(both_m: FloatArray, at: IntArray, distance_m: FloatArray) -> FloatArray:
    """Return over how many metres within reach of stations (n,) two lines were measured at a distance (n,) [m].

    both_m: distance of the two lines at every station, NaN where one of them was not measured. [m]
    """
    reach = int(_REACH_M / STATION_M)
    around = np.pad(both_m, reach, constant_values=np.nan)
    same: IntArray = np.zeros(len(at), dtype=np.int64)
    for step in range(2 * reach + 1):
        same += np.abs(around[at + step] - distance_m) <= _SAME_DISTANCE_M
    return np.asarray(same * STATION_M, dtype=np.float64)
