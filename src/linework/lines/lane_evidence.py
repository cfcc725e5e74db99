"""What speaks for and against lines as bounds of lanes, from all places where they lie side by side.

Separate from `lane_sections`, which looks at one station at a time.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence, Set
from itertools import combinations, pairwise
from typing import NamedTuple

import numpy as np

from linework.arrays import FloatArray
from linework.lines.along import runs_of
from linework.lines.crosscuts import STATION_M
from linework.lines.within_lanes import PaintDistances, PaintRow
from linework.model.lines import LineSet

#: Widths of the spaces between bounds that belong to a road: below are gutters and double lines, above are squares. [m]
LANE_LIMITS_M = (2.2, 6.0)
#: Shorter paint along a road, as measured, is as often a bay, a bus stop, letters or an arrow as the bound of a lane. Paint
#: that continues counts as a whole: over a gap that hides it, no longer than the paint on both its sides together, and at
#: the same distance from the road to within two widths of a line. [m]
_SHORTEST_BOUND_M = 20.0
_CONTINUES_M, _SAME_OFFSET_M = 50.0, 0.3
#: The lines of a double line are nearer than this. [m]
_DOUBLE_M = 1.0
#: Paint beside other paint: farther apart than a double line of two 0.15 m stripes with a gap of 0.2 m, and nearer than
#: the narrowest cycle lane (1.25 m, German ERA). The shorter is a stray where its role is unknown. Up to the width of a
#: lane the shorter may bound a cycle lane, or lie within a lane (patches, letters): its pieces count one by one, those
#: that were joined to one line as well. [m]
STRAY_PAINT_M = (0.5, 1.2)
#: Stripes of a double line are this far apart (decision 83). So is older paint from the line that replaced it. [m]
TWO_STRIPES_M = (0.15, 0.5)
#: Lines that were shifted together are as far from the older ones, to within twice the width of a line. [m]
_SAME_SHIFT_M = 0.3
#: Wear comes in patches of this length, so that as many places of a line are worn independently [m]; a line that is worn
#: more than the one beside it by this many standard deviations is older: by chance once in 370 pairs.
_PATCH_M, _OLDER_SIGMAS = 2.5, 3.0
#: As rare, as the logarithm of odds.
_OLDER_LOG_ODDS = 5.9
#: Fewest bare places of a worn stripe: what one car hides, or a hole in the data, is one or two.
_LEAST_BARE = 3
#: Lines with a lower confidence are more likely none than one.
_LIKELY = 0.5
#: A road's only line is its middle. Where one of its sides is wider than the other by this, something has room beside the
#: lane that is no part of it, or its end was found elsewhere: a cyclist takes 1.0 m, a footway 1.5 m and a parked car 1.8 m
#: at least (Germany's RASt 06). [m]
_STRIP_M = 1.0
#: Lanes of a carriageway differ by this at most (3.75 and 3.25 m, Germany's RAA); hard shoulders are narrower. [m]
_LANES_ALIKE_M = 0.5
#: Widths of a lane: what a car of 1.8 m needs with 0.2 m on both sides, and from twice that on there is room for two
#: rows of vehicles, as where the line between two lanes is worn away. [m]
SINGLE_LANE_M = (2.2, 4.4)


class Bound(NamedTuple):
    """A line where it crosses a perpendicular: its number, offset, height, distance along it [m], sigma [m], flag."""

    line: int
    offset_m: float
    up_m: float
    along_m: float
    sigma_m: float
    bridged: bool


class Beside(NamedTuple):
    """Where along a line other paint lies beside it, and how far from it [m]."""

    begin_m: float
    end_m: float
    apart_m: float


class _Pairs:
    """Paint 0.15 to 0.5 m beside other paint: the stripes of a double line, or two generations of paint.

    A road has one double line, in its middle; who paints anew beside what is there does so with all lines of the road.
    Two pairs at one station are therefore two generations of paint. Wear alone does not tell: of a double line one stripe
    may be worn away by those who cut a bend.
    """

    def __init__(self) -> None:
        #: Whether each of two lines is bridged, station by station.
        self.bridged: dict[tuple[int, int], list[tuple[bool, bool]]] = defaultdict(list)
        #: Distance along each of two lines, and of both from each other, by number of the station. [m]
        self._places: dict[tuple[int, int], list[tuple[int, float, float, float]]] = defaultdict(list)
        self._station = 0
        self._here: list[tuple[float, float]] = []
        self._n_stations = {"one": 0, "two": 0, "shifted": 0}

    def add(self, a: Bound, b: Bound) -> None:
        """Take in two lines at this station."""
        first, second = sorted((a, b))
        apart_m = abs(b.offset_m - a.offset_m)
        self.bridged[first.line, second.line].append((first.bridged, second.bridged))
        self._places[first.line, second.line].append((self._station, first.along_m, second.along_m, apart_m))
        self._here.append((0.5 * (a.offset_m + b.offset_m), apart_m))

    def next_station(self) -> None:
        """Close this station."""
        if self._here:
            places = sorted(self._here)
            others = [k for k in range(1, len(places)) if places[k][0] - places[k - 1][0] > _DOUBLE_M]
            sizes = [apart_m for _, apart_m in places]
            is_shifted = len(others) > 1 and max(sizes) - min(sizes) < _SAME_SHIFT_M
            self._n_stations["shifted" if is_shifted else "two" if others else "one"] += 1
        self._here = []
        self._station += 1

    def beside(self, a: int, b: int) -> list[tuple[int, Beside]]:
        """Return for each of two lines the stretches on which it lies beside the other, and how far from it."""
        if (a, b) not in self._places:
            return []
        places = np.array(self._places[a, b])
        stretches = np.split(places, np.flatnonzero(np.diff(places[:, 0]) > 1) + 1)
        return [
            (line, Beside(float(own[:, side].min()), float(own[:, side].max()), float(own[:, 3].mean())))
            for own in stretches
            for line, side in ((a, 1), (b, 2))
        ]

    @property
    def are_many(self) -> bool:
        """Whether at most stations with a pair there is another one beside it."""
        return self._n_stations["two"] + self._n_stations["shifted"] > self._n_stations["one"]

    @property
    def are_shifted(self) -> bool:
        """Whether at most stations with a pair there are three as wide as each other: all lines, and the same aside."""
        return 2 * self._n_stations["shifted"] > sum(self._n_stations.values())


class BoundEvidence:
    """Pairs of lines that bound no lane, by what there is at all stations so far.

    Between paint and the end of the carriageway is a lane only where the paint is no edge line: outside of these are
    shoulders and parking strips. A role alone does not tell, since a line beside a wide shoulder is taken for a centre
    line: it is double, or dashed, or the only line of paint.
    """

    def __init__(self, lines: LineSet) -> None:
        self._is_paint = lines.kind == "lane_marking"
        has_role = np.isin(lines.role, ("centre", "lane"))
        self._is_dashed = has_role & (lines.pattern == "dashed")
        self._is_double = has_role & lines.double
        self._may_be_alone = has_role
        self._is_edge = lines.role == "edge"
        self._pattern = lines.pattern
        self._is_unlikely = lines.confidence < _LIKELY
        self._is_kerb = lines.form == "kerb"
        self._is_unknown = self._is_paint & (lines.role == "")
        self._length_m = lines.length_m
        self._measured_m, self._longest_m = _measured_m(lines)
        self._size = _sizes(lines, self._measured_m)
        #: Lines that are no bounds: what is beside them bounds lanes as if they were not there.
        self.strays: set[int] = set()
        #: Where lines have paint of another generation beside them, either of which may be the one that counts.
        self.unsettled: dict[int, set[Beside]] = defaultdict(set)
        #: Lines with paint beside them that is no second stripe of theirs: that they are double says nothing of their role.
        self._beside_others: set[int] = set()
        #: Paint beside longer paint, nearer than a lane is wide: its pieces count one by one.
        self._in_strip: set[int] = set()
        self._accompanied: set[int] = set()
        self._beside_edge: set[int] = set()
        self._continued_by: dict[int, set[int]] = defaultdict(set)
        self._inside: dict[tuple[int, int], set[int]] = defaultdict(set)
        self._with_strip: set[tuple[int, int]] = set()
        self._shoulders: set[tuple[int, int]] = set()

    def paint(self, rows: Sequence[Sequence[Bound]]) -> PaintDistances:
        """Return the paint among what crosses the perpendiculars of a road."""
        return PaintDistances(
            [
                [
                    PaintRow(row.line, row.offset_m, row.bridged, bool(self._may_be_alone[row.line]))
                    for row in here
                    if self._is_paint[row.line]
                ]
                for here in rows
            ]
        )

    def add(self, rows: Sequence[Sequence[Bound]], patches: Sequence[Set[int]]) -> None:
        """Take in what crosses the perpendiculars of a road, and which of it are patches within lanes."""
        beside: Counter[int] = Counter()
        in_strip: Counter[int] = Counter()
        third: Counter[int] = Counter()
        pairs, wide = _Pairs(), _Pairs()
        self._add_paint_that_continues(rows)
        self._add_sides(rows)
        for here, within in zip(rows, patches, strict=True):
            # Once a station, however many lines are beside it
            shorter_here: set[int] = set()
            near_here: set[int] = set()
            for i, j in combinations(range(len(here)), 2):
                a, b = here[i], here[j]
                apart = b.offset_m - a.offset_m
                are_paint = bool(self._is_paint[a.line] and self._is_paint[b.line])
                if are_paint and _DOUBLE_M < apart <= LANE_LIMITS_M[1]:
                    self._accompanied |= {a.line, b.line}
                    self._beside_edge |= {
                        x.line for x, y in ((a, b), (b, a)) if self._may_be_edge(x.line, y.line)
                    }
                if are_paint and STRAY_PAINT_M[0] < apart < LANE_LIMITS_M[0]:
                    shorter = min((a.line, b.line), key=lambda i: (i not in within, self._size[i]))
                    shorter_here.add(shorter)
                    if apart < STRAY_PAINT_M[1]:
                        near_here.add(shorter)
                        wide.add(a, b)
                if are_paint and TWO_STRIPES_M[0] <= apart <= TWO_STRIPES_M[1]:
                    pairs.add(a, b)
                # Paint and a boundary with other paint between them: an edge line, which may be worn away elsewhere
                is_mixed = bool(self._is_paint[a.line]) != bool(self._is_paint[b.line])
                if is_mixed:
                    paint = a if self._is_paint[a.line] else b
                    self._inside[a.line, b.line] |= {
                        c.line
                        for c in here[i + 1 : j]
                        if self._is_paint[c.line] and abs(c.offset_m - paint.offset_m) > _DOUBLE_M
                    }
            third.update(self._third_lines(here))
            pairs.next_station()
            wide.next_station()
            in_strip.update(shorter_here)
            beside.update(near_here)
        # For most of its length: where roads part, lines run together for a short while
        self._in_strip |= {line for line, n in in_strip.items() if self._is_most_of(line, n)}
        self.strays |= {
            line for line, n in beside.items() if self._is_unknown[line] and self._is_most_of(line, n)
        }
        self.strays |= {line for line, n in third.items() if self._is_most_of(line, n)}
        older = self._older_paint(pairs)
        self.strays |= older
        self._beside_others |= {
            line for pair in pairs.bridged if self._are_generations(*pair, pairs) for line in pair
        }
        doubtful = [(pairs, pair) for pair in pairs.bridged if self._are_generations(*pair, pairs)]
        doubtful += [(wide, pair) for pair in wide.bridged if wide.are_shifted]
        for of, both in doubtful:
            shorter = min(both, key=lambda i: self._size[i])
            if self._is_most_of(shorter, len(of.bridged[both])) and not older & set(both):
                # Where they part they are nearer to each other than farther on
                for line, beside_it in (*pairs.beside(*both), *wide.beside(*both)):
                    self.unsettled[line].add(beside_it)

    def unsettled_m(self, bound: Bound) -> float:
        """Return how far beside a line at a place paint of another generation is that may count in its stead [m]."""
        return unsettled_at_m(self.unsettled.get(bound.line, ()), bound.along_m)

    def _third_lines(self, here: Sequence[Bound]) -> set[int]:
        """Return the shortest of three lines of paint within a metre, at a station.

        A double line has two stripes: the third is older paint, a scraped line or a joint.
        """
        paint = [row for row in here if self._is_paint[row.line]]
        found: set[int] = set()
        for a, b, c in zip(paint, paint[1:], paint[2:], strict=False):
            # One stripe that was found twice is none beside another
            nearest_m = min(b.offset_m - a.offset_m, c.offset_m - b.offset_m)
            if nearest_m < TWO_STRIPES_M[0] or c.offset_m - a.offset_m > _DOUBLE_M:
                continue
            if len({a.line, b.line, c.line}) < 3:
                continue
            found.add(min((a.line, b.line, c.line), key=lambda i: self._size[i]))
        return found

    def _are_generations(self, a: int, b: int, pairs: _Pairs) -> bool:
        """Return whether two lines beside each other are no double line: there are more pairs, or it is an edge line."""
        return pairs.are_many or bool(self._is_edge[a] or self._is_edge[b])

    def _older_paint(self, pairs: _Pairs) -> set[int]:
        """Return the lines 0.15 to 0.5 m beside one that is less worn: older paint, where new was put beside it.

        What a car or a hole in the data hides of one stripe is in one or two places; worn paint is patchy. Who paints anew does
        so with all lines of a road: how worn both sets are where that is certain tells of the others.
        """
        undecided, older, newer = [], [], []
        found: set[int] = set()
        for (a, b), flags in pairs.bridged.items():
            share = np.mean(flags, axis=0)
            worn, whole = (a, b) if share[0] > share[1] else (b, a)
            if not self._are_generations(a, b, pairs) or not self._is_most_of(worn, len(flags)):
                continue
            n_patches = len(flags) * STATION_M / _PATCH_M
            sigma = np.sqrt(2.0 * share.mean() * (1.0 - share.mean()) / n_patches)
            bare = np.array(flags)[:, 0 if worn == a else 1]
            n_bare = int(np.count_nonzero(np.diff(bare.astype(np.int8), prepend=0) == 1))
            if n_bare >= _LEAST_BARE and np.ptp(share) > _OLDER_SIGMAS * sigma:
                found.add(worn)
                older.append((n_patches * share.max(), n_patches))
                newer.append((n_patches * share.min(), n_patches))
            else:
                undecided.append((worn, whole, n_patches * float(np.ptp(share))))
        if older:
            # One patch more of each, as none may be worn by chance
            worn_share, whole_share = (
                (1.0 + sum(worn for worn, _ in of)) / (2.0 + sum(n for _, n in of)) for of in (older, newer)
            )
            per_patch = np.log(worn_share / whole_share * (1.0 - whole_share) / (1.0 - worn_share))
            found |= {
                worn
                for worn, whole, more in undecided
                if whole not in found and more * per_patch > _OLDER_LOG_ODDS
            }
        return found

    def _is_inner(self, line: int) -> bool:
        """Return whether a line is known to have a lane on both its sides: dashed, or a double line."""
        is_double = bool(self._is_double[line]) and line not in self._beside_others
        return bool(self._is_dashed[line]) or is_double

    def _is_most_of(self, line: int, n_stations: int) -> bool:
        return n_stations * STATION_M > 0.5 * float(self._length_m[line])

    def _add_paint_that_continues(self, rows: Sequence[Sequence[Bound]]) -> None:
        """Take in which paint begins behind other paint, at the same distance from the road."""
        first: dict[int, tuple[int, float]] = {}
        last: dict[int, tuple[int, float]] = {}
        for k, here in enumerate(rows):
            for row in here:
                if self._is_paint[row.line]:
                    first.setdefault(row.line, (k, row.offset_m))
                    last[row.line] = (k, row.offset_m)
        for a, (end, offset_m) in last.items():
            for b, (begin, other_m) in first.items():
                most_m = min(_CONTINUES_M, float(self._measured_m[a] + self._measured_m[b]))
                if 0 < (begin - end) * STATION_M <= most_m and abs(other_m - offset_m) <= _SAME_OFFSET_M:
                    self._continued_by[a].add(b)
                    self._continued_by[b].add(a)

    def _add_sides(self, rows: Sequence[Sequence[Bound]]) -> None:
        """Take in which spaces between paint and the end of the carriageway are wider than those opposite, or shoulders."""
        widths: dict[tuple[int, bool], dict[tuple[int, int], list[float]]] = defaultdict(
            lambda: defaultdict(list)
        )
        lanes: dict[tuple[int, bool], list[float]] = defaultdict(list)
        for here in rows:
            for right, left in pairwise(here):
                width = left.offset_m - right.offset_m
                if bool(self._is_paint[right.line]) != bool(self._is_paint[left.line]):
                    is_left = bool(self._is_paint[right.line])
                    paint = right.line if is_left else left.line
                    widths[paint, is_left][right.line, left.line].append(width)
                elif self._is_paint[right.line] and LANE_LIMITS_M[0] <= width <= LANE_LIMITS_M[1]:
                    lanes[right.line, True].append(width)
                    lanes[left.line, False].append(width)
        for (paint, is_left), pairs in widths.items():
            beside = lanes.get((paint, not is_left))
            if beside and self._pattern[paint] == "solid":
                least_m = float(np.median(beside)) - _LANES_ALIKE_M
                narrow = {pair for pair, listed in pairs.items() if np.median(listed) < least_m}
                self._shoulders |= {pair for pair in narrow if not self._is_kerb[list(pair)].any()}
            opposite = [width for listed in widths.get((paint, not is_left), {}).values() for width in listed]
            if opposite:
                most_m = float(np.median(opposite)) + _STRIP_M
                self._with_strip |= {pair for pair, listed in pairs.items() if np.median(listed) > most_m}

    def _is_short(self, line: int) -> bool:
        """Return whether too little of a line, with the paint that continues it, was measured to bound a lane.

        Of a boundary too: where it is bridged, nothing says where the lane ends.
        """
        if line in self._in_strip:
            return float(self._longest_m[line]) < _SHORTEST_BOUND_M
        whole = (line, *self._continued_by[line])
        return sum(float(self._measured_m[one]) for one in whole) < _SHORTEST_BOUND_M

    def without_edge_line(self, bounds: Iterable[tuple[int, ...]]) -> frozenset[tuple[int, int]]:
        """Return the pairs of bounds of a paint with an edge line on its other side only, and no kerb, right one first.

        Who paints an edge line on one side may have done so on the other, where it was not found.
        """
        pairs = {pair for lines in bounds for pair in pairwise(lines)}
        return frozenset(pair for pair in pairs if self._may_lack_edge_line(pair))

    def _may_lack_edge_line(self, pair: tuple[int, int]) -> bool:
        return (
            any(line in self._beside_edge for line in pair)
            and sum(bool(self._is_paint[line]) for line in pair) == 1
            and not any(self._is_kerb[line] for line in pair)
        )

    def _may_be_edge(self, paint: int, other: int) -> bool:
        """Return whether the other of two lines of a lane is an edge line, or may be: solid, beside a dashed one.

        Of a carriageway whose other half is hidden it is not seen which of its lines is which.
        """
        return bool(
            self._is_edge[other] or (self._pattern[paint] == "dashed" and self._pattern[other] == "solid")
        )

    def has(self, pair: tuple[int, int]) -> bool:
        """Return whether two neighbouring lines bound no lane."""
        paint = [line for line in pair if self._is_paint[line]]
        if any(self._is_unlikely[line] for line in pair) or pair in self._shoulders:
            return True
        if any(self._is_short(line) for line in paint) or self._inside.get(pair, set()) - self.strays:
            return True
        if len(paint) != 1:
            return not paint
        # Where an edge line may be missing, a short edge of the pavement says as little as short paint
        if self._may_lack_edge_line(pair) and any(self._is_short(line) for line in pair):
            return True
        if paint[0] not in self._accompanied:
            return pair in self._with_strip or not (self._may_be_alone[paint[0]] or self._is_inner(paint[0]))
        return not self._is_inner(paint[0])


def unsettled_at_m(beside: Iterable[Beside], along_m: float) -> float:
    """Return the largest distance of paint that lies beside a line at a place along it, to within a station [m]."""
    return max(
        (one.apart_m for one in beside if one.begin_m - STATION_M <= along_m <= one.end_m + STATION_M),
        default=0.0,
    )


def _measured_m(lines: LineSet) -> tuple[FloatArray, FloatArray]:
    """Return the length over which each line was measured, and that of its longest stretch without a gap, (m,) each [m]."""
    step_m = np.hypot(*np.diff(lines.xyz[:, :2], axis=0).T)
    owner = lines.line_of_vertex
    is_measured = (owner[1:] == owner[:-1]) & ~lines.bridged[1:] & ~lines.bridged[:-1]
    whole_m, longest_m = np.zeros(len(lines)), np.zeros(len(lines))
    for first, last in runs_of(is_measured):
        run_m = float(step_m[first : last + 1].sum())
        whole_m[owner[first]] += run_m
        longest_m[owner[first]] = max(longest_m[owner[first]], run_m)
    return whole_m, longest_m


def _sizes(lines: LineSet, measured_m: FloatArray) -> list[tuple[float, float, list[list[float]]]]:
    """Return what orders lines by length: of lines as long as each other by what was measured, then by their ends."""
    # A tenth of a millimetre is no difference
    lengths = zip(np.round(lines.length_m, 4).tolist(), np.round(measured_m, 4).tolist(), strict=True)
    spans = pairwise(lines.offsets.tolist())
    return [
        (*both, sorted(lines.xyz[[a, b - 1]].tolist())) for both, (a, b) in zip(lengths, spans, strict=True)
    ]
