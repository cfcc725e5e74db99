"""Lanes between neighbouring lines: stretches of road whose bounds stay the same."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from linework.arrays import FloatArray
from linework.lines.along import runs_of
from linework.lines.crosscuts import Axis, cross_cuts
from linework.lines.reference_curve import ReferenceCurve, reference_curve
from linework.model.lines import LineSet

BOUND_KINDS = ("lane_marking", "road_boundary")
#: What no lane crosses.
_WALLS = ("guardrail", "barrier", "fence")
#: Widths of a lane: below are gutters, double lines and cycle tracks, above are squares and bays. [m]
LANE_LIMITS_M = (2.2, 6.0)
#: Bounds nearer than this are one bound found twice. [m]
_APART_M = 0.05
#: Shortest road. [m]
_SHORTEST_M = 10.0
#: Lines that turn more than 25 degrees from the road do not bound a lane.
_ALONG_COSINE = 0.9


@dataclass(frozen=True, slots=True)
class LaneSection:
    """A stretch of a road on which the bounds are the same lines.

    Parameters
    ----------
    bounds
        (b,) index of each bound's line, from right to left.
    centre
        Which of them the road follows.
    first, last
        Stations at which it begins and ends.
    offset_m, up_m
        (last - first + 1, b) distance from the reference curve, positive to the left, and height of each bound. [m]
    is_lane
        (b - 1,) whether the space between two bounds is as wide as a lane, and has paint on one side at least.
    """

    bounds: tuple[int, ...]
    centre: int
    first: int
    last: int
    offset_m: FloatArray
    up_m: FloatArray
    is_lane: tuple[bool, ...]


@dataclass(frozen=True, slots=True)
class LaneRoad:
    """A road without a break: a reference curve, its stations, and sections one after the other."""

    curve: ReferenceCurve
    station_m: FloatArray
    sections: tuple[LaneSection, ...]


def lane_roads(lines: LineSet) -> list[LaneRoad]:
    """Return the roads whose lanes follow from the lines alone; each lane belongs to one road.

    A lane is between two neighbouring bounds, at least one of them paint and at least one of them measured, 2.2 to 6.0 m
    apart, with nothing between. There are no lanes across junctions, where bounds end.
    """
    rank = np.array([BOUND_KINDS.index(k) if k in BOUND_KINDS else 9 for k in lines.kind.tolist()])
    roads: list[LaneRoad] = []
    taken: set[tuple[int, int, int]] = set()
    for i in np.lexsort((-lines.length_m, rank)).tolist():
        if rank[i] == 9 or lines.length_m[i] < _SHORTEST_M:
            continue
        curve = reference_curve(lines[i].xyz[:, :2])
        n = int(curve.length_m)
        station_m = np.linspace(0.0, curve.length_m, n + 1)
        profiles = _profiles(lines, i, curve, station_m, taken)
        for first, last in runs_of(np.array([p is not None for p in profiles])):
            if station_m[last] - station_m[first] >= _SHORTEST_M:
                sections = _sections(profiles, first, last, i)
                roads.append(LaneRoad(curve, station_m, sections))
                for k in range(first, last + 1):
                    taken.update(_cells(profiles[k]))
    return roads


@dataclass(frozen=True, slots=True)
class _Profile:
    """Bounds at a station, from right to left: lines, offsets, heights, distances along their lines."""

    lines: tuple[int, ...]
    offset_m: tuple[float, ...]
    up_m: tuple[float, ...]
    along_m: tuple[float, ...]
    is_lane: tuple[bool, ...]


def _cells(profile: _Profile | None) -> list[tuple[int, int, int]]:
    """Return what names the spaces of a profile, whatever road they are part of: two lines, and where along the first."""
    if profile is None:
        return []
    pairs = list(zip(profile.lines, profile.along_m, strict=True))
    found = []
    for (a, along_a), (b, along_b) in pairwise(pairs):
        one, other = min(a, b), max(a, b)
        at = int(along_a if one == a else along_b)
        found += [(one, other, at + step) for step in (-1, 0, 1)]
    return found


def _profiles(
    lines: LineSet,
    centre: int,
    curve: ReferenceCurve,
    station_m: FloatArray,
    taken: set[tuple[int, int, int]],
) -> list[_Profile | None]:
    """Return the bounds at each station, None where there is no lane."""
    xy = curve.places(station_m)
    axis = Axis("", station_m, np.column_stack([xy, np.zeros(len(xy))]), curve.ahead(station_m))
    near = lines.take(np.flatnonzero(np.isin(lines.kind, (*BOUND_KINDS, *_WALLS))))
    index = np.flatnonzero(np.isin(lines.kind, (*BOUND_KINDS, *_WALLS)))
    cuts = cross_cuts(near, axis)
    cuts = cuts.take(np.flatnonzero(np.abs(cuts.cosine) >= _ALONG_COSINE))
    rows_at = np.searchsorted(cuts.station, np.arange(len(station_m) + 1))
    found: list[_Profile | None] = []
    for k in range(len(station_m)):
        rows = [
            (int(index[cuts.line[r]]), float(cuts.offset_m[r]), float(cuts.up_m[r]), float(cuts.along_m[r]), bool(cuts.bridged[r]))
            for r in range(rows_at[k], rows_at[k + 1])
        ]  # fmt: skip
        own = [j for j, row in enumerate(rows) if row[0] == centre and abs(row[1]) < 1.0]
        found.append(_profile(lines, rows, own[0], taken) if own else None)
    return found


_Row = tuple[int, float, float, float, bool]


def _profile(
    lines: LineSet, rows: Sequence[_Row], own: int, taken: set[tuple[int, int, int]]
) -> _Profile | None:
    """Return the bounds to both sides of one of the lines that cross a perpendicular, as far as lanes reach."""
    chosen, lanes = [rows[own]], []
    for direction in (1, -1):
        here, j = rows[own], own + direction
        while 0 <= j < len(rows):
            there = rows[j]
            gap = abs(there[1] - here[1])
            j += direction
            if gap < _APART_M:
                continue
            kinds = (str(lines.kind[here[0]]), str(lines.kind[there[0]]))
            is_lane = gap >= LANE_LIMITS_M[0]
            one, other = sorted((here, there))
            is_open = (one[0], other[0], int(one[3])) not in taken
            is_known = "lane_marking" in kinds and not (here[4] and there[4]) if is_lane else True
            if (
                kinds[1] in _WALLS
                or gap > LANE_LIMITS_M[1]
                or not is_known
                or not is_open
                or there[0] == here[0]
            ):
                break
            if direction == 1:
                chosen.append(there)
                lanes.append(is_lane)
            else:
                chosen.insert(0, there)
                lanes.insert(0, is_lane)
            here = there
    if not any(lanes) or len({row[0] for row in chosen}) < len(chosen):
        return None
    number, offset, up, along, _ = zip(*chosen, strict=True)
    return _Profile(number, offset, up, along, tuple(lanes))


def _sections(
    profiles: Sequence[_Profile | None], first: int, last: int, centre: int
) -> tuple[LaneSection, ...]:
    """Return the stretches of constant bounds between two stations."""
    known = [p for p in profiles[first : last + 1] if p is not None]
    keys = [(p.lines, p.is_lane) for p in known]
    cuts = [0, *(i for i in range(1, len(keys)) if keys[i] != keys[i - 1]), len(keys)]
    found = []
    for a, b in pairwise(cuts):
        own = known[a:b]
        found.append(
            LaneSection(
                own[0].lines, own[0].lines.index(centre), first + a, first + b - 1,
                np.array([p.offset_m for p in own]), np.array([p.up_m for p in own]), own[0].is_lane,
            )
        )  # fmt: skip
    return _meeting(found)


def _meeting(sections: list[LaneSection]) -> tuple[LaneSection, ...]:
    """Return sections that meet at a station where the bounds of both are known, those without length left out.

    Where a line ends, the next section begins at the last station of the line; where one begins, the section before it
    goes up to that station. Where one ends and another begins, up to a station's distance is carried on.
    """
    met = list(sections)
    for k in range(len(met) - 1):
        a, b = met[k], met[k + 1]
        if set(b.bounds) <= set(a.bounds):
            columns = [a.bounds.index(line) for line in b.bounds]
            met[k + 1] = replace(
                b, first=a.last, offset_m=np.vstack([a.offset_m[-1:, columns], b.offset_m]),
                up_m=np.vstack([a.up_m[-1:, columns], b.up_m]),
            )  # fmt: skip
        elif set(a.bounds) <= set(b.bounds):
            columns = [b.bounds.index(line) for line in a.bounds]
            met[k] = replace(
                a, last=b.first, offset_m=np.vstack([a.offset_m, b.offset_m[:1, columns]]),
                up_m=np.vstack([a.up_m, b.up_m[:1, columns]]),
            )  # fmt: skip
    ends = [*(section.first for section in met[1:]), met[-1].last]
    return tuple(section for section, end in zip(met, ends, strict=True) if end > section.first)
