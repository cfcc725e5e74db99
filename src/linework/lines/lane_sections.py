"""Lanes between neighbouring lines: stretches of road whose bounds stay the same."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, pairwise
from typing import Any, NamedTuple

import numpy as np

from linework.arrays import BoolArray, FloatArray, IntArray
from linework.lines.along import runs_of
from linework.lines.crosscuts import STATION_M, Axis, LinesToCut, cross_cuts
from linework.lines.kept_distance import known_by_distance
from linework.lines.lane_evidence import (
    LANE_LIMITS_M,
    SINGLE_LANE_M,
    TWO_STRIPES_M,
    Beside,
    Bound,
    BoundEvidence,
)
from linework.lines.reference_curve import ReferenceCurve, reference_curve
from linework.lines.within_lanes import patches_within_lanes
from linework.model.lines import LineSet

BOUND_KINDS = ("lane_marking", "road_boundary")
#: What no lane crosses.
_WALLS = ("guardrail", "barrier", "fence")
#: Bounds nearer than this are one bound found twice. [m]
_APART_M = 0.05
#: Shortest road. [m]
_SHORTEST_M = 10.0
#: Least length of a lane whose bounds are both known: one car. [m]
_SHORTEST_LANE_M = 5.0
#: Longest stretch on which neither bound was measured, within a lane: shorter than the mouth of any side street, whose
#: lane of 3 m has corners of 1.5 m at least. Worn paint and parked cars hide both bounds at once over less. It is counted
#: in stations, so that of gaps up to 1 m longer some are carried. [m]
_CARRIED_M = 6.0
#: A lane widens by no more than this per metre: faster is a taper, a bay or another line. [m/m]
_TAPER = 0.1
#: Tapers of lanes that begin or end are 1 in 10 to 1 in 60 (DMRB CD 122, MUTCD 6C); lines along a lane do not converge
#: by more than 1 in 100, taken over this distance. [m/m, m]
_CONVERGING, _TAPER_REACH_M = 0.01, 5.0
#: Largest crossfall, that of the steepest superelevation in design guides (AASHTO: 12 %). Steeper is no one surface.
_STEEPEST = 0.12
#: Painted lines wobble by 1 to 3 cm: at a single station a lane may be as much narrower or wider than the limits of its
#: width along it, at two deviations of both its bounds; along it as much as lines are extracted to. [m]
_WOBBLE_M, _ACCURACY_M = 0.06, 0.02
#: So many standard deviations of a width are less than half the range of widths of lanes: by chance once in 370.
_WIDTH_SIGMAS = 3.0
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
    offset_m, up_m, along_m, sigma_m
        (last - first + 1, b) of each bound: distance from the reference curve, positive to the left; height; distance
        along its line; standard deviation in plan. [m]
    bridged
        (last - first + 1, b) whether the bound was not measured there.
    is_lane
        (b - 1,) whether the space between two bounds is a lane (see `lane_roads`).
    """

    bounds: tuple[int, ...]
    centre: int
    first: int
    last: int
    offset_m: FloatArray
    up_m: FloatArray
    along_m: FloatArray
    sigma_m: FloatArray
    bridged: BoolArray
    is_lane: tuple[bool, ...]


_COLUMNS = ("offset_m", "up_m", "along_m", "sigma_m", "bridged")


@dataclass(frozen=True, slots=True)
class LaneRoad:
    """A road without a break: a reference curve, its stations, and sections one after the other.

    `without_edge_line` are the pairs of bounds, right one first, of which one is the end of the carriageway although the
    paint has an edge line on its other side: there may be one that was not found. `unsettled` has the lines beside which
    paint of another generation lies, and where: which of both counts there is not known.
    """

    curve: ReferenceCurve
    station_m: FloatArray
    sections: tuple[LaneSection, ...]
    without_edge_line: frozenset[tuple[int, int]]
    unsettled: Mapping[int, frozenset[Beside]]


def lane_roads(lines: LineSet, *, widths_m: tuple[float, float] = SINGLE_LANE_M) -> list[LaneRoad]:
    """Return the roads whose spaces between lines follow from the lines alone; each space belongs to one road.

    A space is between two neighbouring bounds, 2.2 to 6.0 m apart (or narrower, beside such a one), at least one of them
    paint and at least one of them known, with nothing between: measured, or where the distance says that it keeps from
    another line that was measured there. There are none across junctions, where bounds end.

    A space is a lane where its width is within `widths_m` [m] (its median to 2 cm, at each station to 6 cm) and changes by
    at most 0.1 m/m, with one surface between its bounds, both of which are known on more than 5 m of it. It goes on over up
    to 6 stations at which neither is. Between paint and the end of the carriageway that holds only where the paint is known
    to be a centre or lane line: outside an edge line there are shoulders and parking strips.
    """
    rank = np.array([BOUND_KINDS.index(k) if k in BOUND_KINDS else 9 for k in lines.kind.tolist()])
    roads: list[LaneRoad] = []
    taken: set[tuple[int, int, int]] = set()
    barred = BoundEvidence(lines)
    index = np.flatnonzero(np.isin(lines.kind, (*BOUND_KINDS, *_WALLS)))
    cut = LinesToCut(lines.take(index))
    for i in np.lexsort((-lines.length_m, rank)).tolist():
        if rank[i] == 9 or lines.length_m[i] < _SHORTEST_M:
            continue
        curve = reference_curve(lines[i].xyz[:, :2])
        n = int(curve.length_m)
        station_m = np.linspace(0.0, curve.length_m, n + 1)
        rows = _rows(cut, index, curve, station_m)
        # Along a stray as well: what is beside it is evidence about other lines
        patches = patches_within_lanes(barred.paint(rows), widths_m)
        barred.add(rows, patches)
        if i in barred.strays:
            continue
        rows = [
            [row for row in here if row.line not in barred.strays | within]
            for here, within in zip(rows, patches, strict=True)
        ]
        wedges, carried, known = _wedges(rows, widths_m[0]), _carried(rows), known_by_distance(rows)
        profiles = [
            _profile(lines, here, i, taken, widths_m, carried[k], known[k]) for k, here in enumerate(rows)
        ]
        for first, last in runs_of(np.array([p is not None for p in profiles])):
            if station_m[last] - station_m[first] >= _SHORTEST_M:
                whole = [p for p in profiles[first : last + 1] if p is not None]
                sections = _sections(_settled(whole, first, barred, wedges, widths_m), first, i)
                roads.append(
                    LaneRoad(
                        curve,
                        station_m,
                        sections,
                        barred.without_edge_line(section.bounds for section in sections),
                        {line: frozenset(beside) for line, beside in barred.unsettled.items()},
                    )
                )
                for profile in whole:
                    taken.update(_cells(profile))
    return roads


@dataclass(frozen=True, slots=True)
class _Profile:
    """Bounds at a station, from right to left, which spaces between them are lanes, and which of them are known.

    A bound is known where it was measured, or where another line says that it is (see `known_by_distance`).
    """

    bounds: tuple[Bound, ...]
    is_lane: tuple[bool, ...]
    is_known: tuple[bool, ...]

    @property
    def lines(self) -> tuple[int, ...]:
        return tuple(b.line for b in self.bounds)


def _cells(profile: _Profile) -> list[tuple[int, int, int]]:
    """Return what names the spaces of a profile, whatever road they are part of: two lines, and where along the first."""
    found = []
    for a, b in pairwise(profile.bounds):
        one, other = sorted((a, b))
        found += [(one.line, other.line, int(one.along_m) + step) for step in (-1, 0, 1)]
    return found


def _rows(
    cut: LinesToCut, index: IntArray, curve: ReferenceCurve, station_m: FloatArray
) -> list[list[Bound]]:
    """Return what crosses the perpendicular of each station along the road, from right to left; `index` numbers the lines."""
    xy = curve.places(station_m)
    axis = Axis("", station_m, np.column_stack([xy, np.zeros(len(xy))]), curve.ahead(station_m))
    cuts = cross_cuts(cut, axis)
    cuts = cuts.take(np.flatnonzero(np.abs(cuts.cosine) >= _ALONG_COSINE))
    ends = np.searchsorted(cuts.station, np.arange(len(station_m) + 1)).tolist()
    columns = (index[cuts.line], cuts.offset_m, cuts.up_m, cuts.along_m, cuts.sigma_xy_m, cuts.bridged)
    rows = [Bound(*values) for values in zip(*(column.tolist() for column in columns), strict=True)]
    return [rows[a:b] for a, b in pairwise(ends)]


def _carried(rows: Sequence[Sequence[Bound]]) -> list[set[tuple[int, int]]]:
    """Return for each station the pairs of lines, right one first, neither of which was measured over a short stretch.

    Before and behind it the same two lines were, at least one of both.
    """
    stations: dict[tuple[int, int], list[int]] = defaultdict(list)
    for k, here in enumerate(rows):
        for right, left in combinations(here, 2):
            if not (right.bridged and left.bridged):
                stations[right.line, left.line].append(k)
    found: list[set[tuple[int, int]]] = [set() for _ in rows]
    for pair, places in stations.items():
        for a, b in pairwise(places):
            # What was measured at both ends is no part of the gap
            if (b - a - 1) * STATION_M <= _CARRIED_M:
                for between in found[a + 1 : b]:
                    between.add(pair)
    return found


def _profile(
    lines: LineSet, rows: Sequence[Bound], centre: int, taken: set[tuple[int, int, int]],
    widths_m: tuple[float, float], carried: set[tuple[int, int]], known: frozenset[int],
) -> _Profile | None:  # fmt: skip
    """Return the bounds to both sides of the line that a road follows, as far as spaces reach; None without any."""
    own = next((j for j, row in enumerate(rows) if row.line == centre and abs(row.offset_m) < 1.0), None)
    if own is None:
        return None
    chosen = [rows[own]]
    is_any = False
    for direction in (1, -1):
        here, j = rows[own], own + direction
        while 0 <= j < len(rows):
            there = rows[j]
            gap = abs(there.offset_m - here.offset_m)
            j += direction
            if gap < _APART_M:
                continue
            kinds = (str(lines.kind[here.line]), str(lines.kind[there.line]))
            is_wide = gap >= min(LANE_LIMITS_M[0], widths_m[0]) - _WOBBLE_M
            one, other = sorted((here, there))
            is_open = (one.line, other.line, int(one.along_m)) not in taken
            right, left = (here, there) if direction == 1 else (there, here)
            is_known = not (here.bridged and there.bridged) or (right.line, left.line) in carried
            is_known = is_known or not known.isdisjoint((here.line, there.line))
            is_known = "lane_marking" in kinds and is_known if is_wide else True
            if (
                kinds[1] in _WALLS
                or gap > LANE_LIMITS_M[1]
                or not is_known
                or not is_open
                or there.line == here.line
            ):
                break
            chosen.insert(len(chosen) if direction == 1 else 0, there)
            is_any = is_any or is_wide
            here = there
    if not is_any or len({row.line for row in chosen}) < len(chosen):
        return None
    are_lanes = (_is_lane(a, b, widths_m) for a, b in pairwise(chosen))
    return _Profile(
        tuple(chosen), tuple(are_lanes), tuple(not row.bridged or row.line in known for row in chosen)
    )


def _is_lane(right: Bound, left: Bound, widths_m: tuple[float, float]) -> bool:
    """Return whether the space between two bounds may be a lane, by its width and its crossfall.

    Where the width may as well be that of no lane, it says nothing.
    """
    width = left.offset_m - right.offset_m
    sigma_right, sigma_left = (0.0 if b.bridged else b.sigma_m for b in (right, left))
    sigma = float(np.hypot(sigma_right, sigma_left))
    is_vague = _WIDTH_SIGMAS * sigma > 0.5 * (widths_m[1] - widths_m[0])
    return (
        widths_m[0] - _WOBBLE_M <= width < widths_m[1] + _WOBBLE_M
        and abs(left.up_m - right.up_m) <= _STEEPEST * width
        and not is_vague
    )


def _settled(
    profiles: Sequence[_Profile],
    first_station: int,
    barred: BoundEvidence,
    wedges: Mapping[tuple[int, int], set[int]],
    widths_m: tuple[float, float],
) -> list[_Profile]:
    """Return profiles without the lanes that more than one station speaks against.

    These widen too fast, are a wedge in which two lines run together, are between lines that bound none, are no lane if
    it is the older paint beside a bound that counts, or are too short.
    """
    spaces: dict[tuple[int, int], list[_Space]] = defaultdict(list)
    for k, p in enumerate(profiles):
        for j, (a, b) in enumerate(pairwise(p.bounds)):
            is_known = p.is_known[j] and p.is_known[j + 1]
            aside_m = (barred.unsettled_m(a), barred.unsettled_m(b))
            width_m = b.offset_m - a.offset_m
            spaces[a.line, b.line].append(_Space(k, j, width_m, p.is_lane[j], is_known, aside_m))
    kept = [[False] * len(p.is_lane) for p in profiles]
    for pair, places in spaces.items():
        if barred.has(pair):
            continue
        wedge = wedges.get(pair, set())
        is_lane = np.array(
            [
                place.is_lane
                and first_station + place.station not in wedge
                and place.is_settled(widths_m, _WOBBLE_M)
                for place in places
            ]
        )
        for first, last in runs_of(is_lane):
            run = places[first : last + 1]
            cuts = [
                i + 1
                for i, (x, y) in enumerate(pairwise(run))
                if y.station != x.station + 1 or abs(y.width_m - x.width_m) > _TAPER * STATION_M
            ]
            for begin, end in pairwise([0, *cuts, len(run)]):
                middle = sorted(run[begin:end], key=lambda place: place.width_m)[(end - begin) // 2]
                n_known = sum(place.is_known for place in run[begin:end])
                if middle.is_settled(widths_m, _ACCURACY_M) and n_known > _SHORTEST_LANE_M / STATION_M:
                    for place in run[begin:end]:
                        kept[place.station][place.number] = True
    return [replace(p, is_lane=tuple(flags)) for p, flags in zip(profiles, kept, strict=True)]


class _Space(NamedTuple):
    """The space between two lines at a station: which of its spaces, width [m], whether a lane, and its bounds known.

    `aside_m` is how far beside each bound there is paint of another generation, 0 where there is none. [m]
    """

    station: int
    number: int
    width_m: float
    is_lane: bool
    is_known: bool
    aside_m: tuple[float, float]

    def is_settled(self, widths_m: tuple[float, float], within_m: float) -> bool:
        """Return whether either width is that of a lane, within a distance [m], and its place known to half a metre.

        Where both bounds have paint of another generation beside them, one of each may be what lies next to each other.
        """
        aside_m = max(self.aside_m)
        least_m, most_m = widths_m[0] + aside_m - within_m, widths_m[1] - aside_m + within_m
        is_mixed = min(self.aside_m) > 0.0
        return not is_mixed and aside_m <= TWO_STRIPES_M[1] and least_m <= self.width_m < most_m


def _wedges(rows: Sequence[Sequence[Bound]], least_m: float) -> dict[tuple[int, int], set[int]]:
    """Return the stations at which two neighbouring lines run together until they are nearer than a lane is wide."""
    widths: dict[tuple[int, int], list[tuple[int, float]]] = defaultdict(list)
    for k, here in enumerate(rows):
        for a, b in pairwise(here):
            widths[a.line, b.line].append((k, b.offset_m - a.offset_m))
    reach = int(_TAPER_REACH_M / STATION_M)
    found: dict[tuple[int, int], set[int]] = {}
    for pair, places in widths.items():
        flags = np.array([w < least_m - _WOBBLE_M for _, w in places])
        if not flags.any():
            continue
        for order in (slice(None), slice(None, None, -1)):
            w, there = np.array([w for _, w in places])[order], flags[order]
            for k in range(1, len(w)):
                behind = max(k - reach, 0)
                if there[k - 1] and w[k] - w[behind] > _CONVERGING * (k - behind) * STATION_M:
                    there[k] = True
        found[pair] = {k for (k, _), is_wedge in zip(places, flags.tolist(), strict=True) if is_wedge}
    return found


def _sections(known: Sequence[_Profile], first: int, centre: int) -> tuple[LaneSection, ...]:
    """Return the stretches of constant bounds of profiles from a first station on."""
    keys = [(p.lines, p.is_lane) for p in known]
    cuts = [0, *(i for i in range(1, len(keys)) if keys[i] != keys[i - 1]), len(keys)]
    found = []
    for a, b in pairwise(cuts):
        own = known[a:b]
        columns = {name: np.array([[getattr(x, name) for x in p.bounds] for p in own]) for name in _COLUMNS}
        number = own[0].lines
        found.append(
            LaneSection(number, number.index(centre), first + a, first + b - 1, is_lane=own[0].is_lane, **columns)
        )  # fmt: skip
    return _meeting(found)


def _meeting(sections: list[LaneSection]) -> tuple[LaneSection, ...]:
    """Return sections that meet at a station where the bounds of both are known, those without length left out.

    Where a line ends, the next section begins at the last station of the line; where one begins, the section before it
    goes up to that station. Where one ends and another begins, up to a station's distance is carried on.
    """
    met, rows = list(sections), dict[str, Any]()
    for k in range(len(met) - 1):
        a, b = met[k], met[k + 1]
        if set(b.bounds) <= set(a.bounds):
            at = [a.bounds.index(line) for line in b.bounds]
            rows = {name: np.vstack([getattr(a, name)[-1:, at], getattr(b, name)]) for name in _COLUMNS}
            met[k + 1] = replace(b, first=a.last, **rows)
        elif set(a.bounds) <= set(b.bounds):
            at = [b.bounds.index(line) for line in a.bounds]
            rows = {name: np.vstack([getattr(a, name), getattr(b, name)[:1, at]]) for name in _COLUMNS}
            met[k] = replace(a, last=b.first, **rows)
    ends = [*(section.first for section in met[1:]), met[-1].last]
    return tuple(section for section, end in zip(met, ends, strict=True) if end > section.first)
