"""Lines that were not measured at a place, but are where another line that was measured beside them says.

Separate from `lane_sections`, which takes them as known. Lines of a road keep their distance from each other: where paint is
worn away, the edge of the pavement or other paint beside it tells where it was.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

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
#: Lines farther from each other than two wide lanes are of different roads. [m]
_FARTHEST_M = 9.0


def known_by_distance(rows: Sequence[Sequence[Bound]]) -> list[frozenset[int]]:
    """Return for each station the lines that were not measured there, but are where measured ones beside them say.

    Over 20 m within 50 m of the station both lines were measured at the distance that they have there. Paint, edges of the
    pavement, rails, barriers and fences all keep their distance.

    Parameters
    ----------
    rows
        What crosses the perpendiculars of stations along a road, a metre apart, each from right to left.
    """
    places: dict[tuple[int, int], list[_Place]] = defaultdict(list)
    for k, here in enumerate(rows):
        for a, b in combinations(sorted(here), 2):
            apart_m = b.offset_m - a.offset_m
            if (a.bridged and b.bridged) or abs(apart_m) > _FARTHEST_M:
                continue
            places[a.line, b.line].append(
                _Place(k, apart_m, a.line if a.bridged else b.line if b.bridged else -1)
            )
    found: list[set[int]] = [set() for _ in rows]
    for pair, beside in places.items():
        station, distance_m, line = (np.array(column) for column in zip(*beside, strict=True))
        is_bridged = line >= 0
        # What crosses a perpendicular twice has no distance there
        is_twice = pair[0] == pair[1] or len(np.unique(station)) < len(station)
        n_measured = int(np.count_nonzero(~is_bridged))
        if is_twice or not is_bridged.any() or n_measured * STATION_M < _SHORTEST_KEPT_M:
            continue
        both = np.full(station[-1] - station[0] + 1, np.nan)
        both[station[~is_bridged] - station[0]] = distance_m[~is_bridged]
        at, own = station[is_bridged], line[is_bridged]
        is_kept = _kept_m(both, at - station[0], distance_m[is_bridged]) >= _SHORTEST_KEPT_M
        for k, number in zip(at[is_kept].tolist(), own[is_kept].tolist(), strict=True):
            found[k].add(number)
    return [frozenset(lines) for lines in found]


class _Place(NamedTuple):
    """A station, the distance of a second line to the left of a first [m], and which was not measured, -1 for neither."""

    station: int
    distance_m: float
    bridged: int


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
