"""Mouths of streets and drives beside a line: boundaries that leave off, or turn away, where its paint does.

Separate from `line_ends`, which weighs whether a line ends in a gap: this tells how rarely the boundaries beside it are open
by chance.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from linework.arrays import BoolArray, FloatArray, IntArray
from linework.methods.protocol import Sight
from linework.methods.tracking.neighbours import AXIS_STATION_M, LineAxis
from linework.methods.tracking.smooth import SmoothLine
from linework.model.boxes import BoxSet

#: Boundaries are looked for this far to both sides of a line: two lanes and a shoulder. [m]
REACH_OF_MOUTHS_M = 10.0
#: They are looked at this far before and behind a gap, every so far, and are where they are nearest to it. [m]
AROUND_M, MOUTH_PLACE_M, BESIDE_GAP_M = 40.0, 1.0, 10.0
#: Length over which a boundary is missed, where it is: what hides it is as long as a car. [m]
HOLE_M = 5.0
#: Fewest places with a boundary before a gap and behind it: else it is not known what should be beside the gap.
LEAST_PLACES = 3
#: Narrowest mouth: a drive for a car. [m]
LEAST_MOUTH_M = 3.0
#: A boundary goes on if it is within this of the place where it should be: at the wheel paths of a drive the kerb of a
#: footway swings by less, and the corner of a street of 5 m radius is beyond it after 3 m. [m]
GOES_ON_M = 1.0
#: Offsets of one boundary before a gap and behind it: carriageways widen at junctions, by less than a lane. [m]
SAME_OFFSET_M = 2.0
#: Boundaries run along a line within 30 degrees: cosine. Beside a place are those so far along the line at most. [m]
_ALONG, ALONG_M = 0.866, 0.75 * AXIS_STATION_M
#: Logarithms of the odds of a dashed line against lines that end at mouths, before the mouths are counted, and of a line
#: that ends where no mouth is, against one that ends at a mouth: 4 and 1 to 20, set by hand on roundabout 17102, 2026-11-29.
RHYTHM_LOG_ODDS, NO_REASON_LOG_ODDS = 1.5, -3.0
#: Fewest stations of boundaries that lead away from the line in a mouth. Where none does, the boundary may be there and not
#: be seen, as the paint.
LEAST_TURNING = 2


class Mouths:
    """Openings of the boundaries beside lines.

    Parameters
    ----------
    bounds
        Axes of boundaries. [m, local]
    visible
        Whether road or ground was measured at places [m, local]: what is hidden is not open.
    """

    def __init__(self, bounds: Sequence[LineAxis], visible: Sight) -> None:
        self._xy = np.concatenate([np.zeros((0, 2)), *(axis.xy for axis in bounds)])
        self._normal = np.concatenate([np.zeros((0, 2)), *(axis.normal for axis in bounds)])
        self._visible = visible
        self._tree = cKDTree(self._xy) if len(self._xy) else None

    def chances(self, boxes: BoxSet, box: IntArray, gaps: IntArray) -> FloatArray:
        """Return how likely a boundary beside each gap of a line would be open if the gap were wear, (g,).

        1 where none is open, or none leads away there. Elsewhere the share of the line around the gap beside which that
        boundary is missing, in pieces of `HOLE_M`, with one more of each kind, as few pieces tell little. Other gaps are no
        part of that line: the mouths of a ring, which has one in each of its gaps, would explain each other.

        Parameters
        ----------
        box
            (k,) int64: the boxes of the line, in order.
        gaps
            (g,) int64: numbers of the boxes before the gaps.
        """
        chance = np.ones(len(gaps))
        if self._tree is None or len(gaps) == 0:
            return chance
        t, xy, reach = boxes.along(box), boxes.centre[box, :2], boxes.half_u_m[box]
        ends = np.column_stack([t[gaps] + reach[gaps], t[gaps + 1] - reach[gaps + 1]])
        for i, (first, last) in enumerate(ends.tolist()):
            before = _places(max(t[0], first - AROUND_M), first)
            within, behind = _places(first, last), _places(last, min(t[-1], last + AROUND_M))
            if min(len(before), len(within), len(behind)) >= LEAST_PLACES:
                at = np.concatenate([before, within, behind])
                place = np.column_stack([np.interp(at, t, xy[:, axis]) for axis in range(2)])
                inside = slice(len(before), len(before) + len(within))
                # Over the gap the line goes on from one side to the other as it bends
                place[inside] = _bridged(place, inside)
                is_gap: BoolArray = np.any((at > ends[:, :1]) & (at < ends[:, 1:]), axis=0)
                chance[i], _ = self._chance(place, inside, ~is_gap)
        return chance

    def log_odds_of_rhythm(self, line: SmoothLine, dashes: FloatArray) -> float:
        """Return the logarithm of the odds of a dashed line against lines of their own that end at mouths.

        Those have a mouth in each of their gaps, or end for no reason. The rhythm of a dashed line knows nothing of mouths:
        that so many lie beside its gaps and so few beside its dashes is chance.

        Parameters
        ----------
        dashes
            (d, 2) intervals along the line, ascending. [m]
        """
        gaps = np.column_stack([dashes[:-1, 1], dashes[1:, 0]])
        if self._tree is None or np.all(gaps[:, 1] - gaps[:, 0] < LEAST_MOUTH_M):
            return math.inf
        in_gaps, n_gaps = self._count_beside(line, gaps)
        if in_gaps == 0:
            return math.inf
        in_dashes, n_dashes = self._count_beside(line, dashes)
        mouths = in_gaps + in_dashes
        ways = sum(
            math.comb(n_gaps, k) * math.comb(n_dashes, mouths - k)
            for k in range(in_gaps, min(mouths, n_gaps) + 1)
        )
        by_chance = math.log(ways) - math.log(math.comb(n_gaps + n_dashes, mouths))
        # Gaps of which nobody knows whether a mouth is beside them count for neither
        return RHYTHM_LOG_ODDS + by_chance - (n_gaps - in_gaps) * NO_REASON_LOG_ODDS

    def _count_beside(self, line: SmoothLine, intervals: FloatArray) -> tuple[int, int]:
        """Return how many intervals along a line (k, 2) [m] have a mouth beside them, and of how many that is known.

        Those at its ends, and short ones, show none; nor do those beside which no boundary is known, or it is hidden.
        """
        mouths, places = 0, 0
        for first, last in intervals.tolist():
            before = _places(max(float(line.t_m[0]), first - AROUND_M), first)
            within, behind = (
                _places(first, last),
                _places(last, min(float(line.t_m[-1]), last + AROUND_M)),
            )
            if min(len(before), len(within), len(behind)) >= LEAST_PLACES:
                at = np.concatenate([before, within, behind])
                place = np.column_stack([np.interp(at, line.t_m, line.xyz[:, axis]) for axis in range(2)])
                inside, anywhere = (
                    slice(len(before), len(before) + len(within)),
                    np.ones(len(at), dtype=np.bool_),
                )
                chance, is_known = self._chance(place, inside, anywhere)
                mouths += chance < 1.0
                places += is_known
        return mouths, places

    def _chance(self, place: FloatArray, inside: slice, is_line: BoolArray) -> tuple[float, bool]:
        """Return what `chances` does for one gap, on the side that speaks most, and whether a boundary is known beside it.

        place: (n, 2) [m]; is_line: (n,) bool, whether it lies in no gap.
        """
        assert self._tree is not None
        along = np.gradient(place, axis=0)
        along /= np.maximum(np.hypot(*along.T), 1e-9)[:, None]
        # All stations of boundaries beside each place
        near = self._tree.query_ball_point(place, math.hypot(REACH_OF_MOUTHS_M, ALONG_M))
        at = np.repeat(np.arange(len(place)), [len(own) for own in near])
        own = np.fromiter((j for some in near for j in some), np.int64, len(at))
        step, u = self._xy[own] - place[at], along[at]
        left = step[:, 1] * u[:, 0] - step[:, 0] * u[:, 1]
        is_beside = (np.abs(np.sum(step * u, axis=1)) <= ALONG_M) & (np.abs(left) <= REACH_OF_MOUTHS_M)
        cosine = np.abs(self._normal[own, 1] * u[:, 0] - self._normal[own, 0] * u[:, 1])
        is_along, turns = is_beside & (cosine >= _ALONG), is_beside & (cosine < _ALONG)
        chances, is_known = [1.0], False
        for side in (1.0, -1.0):
            across = side * left
            offset = np.full(len(place), np.inf)
            # The line may be nearer to its boundary than `GOES_ON_M`: what is on its other side is another one
            is_here = is_along & (across > 0.0)
            np.minimum.at(offset, at[is_here], across[is_here])
            expected = _expected(offset, inside)
            if expected is None:
                continue
            is_bare = np.ones(len(place), dtype=np.bool_)
            is_bare[at[is_here & (np.abs(across - expected[at]) <= GOES_ON_M)]] = False
            normal = side * np.column_stack([-along[:, 1], along[:, 0]])
            is_open = is_bare & self._visible(place + expected[:, None] * normal)
            is_known |= bool(
                np.any(~is_bare[inside]) or _longest_run(is_open[inside]) * MOUTH_PLACE_M >= LEAST_MOUTH_M
            )
            closed = np.flatnonzero(~is_bare)
            first, last = closed[closed < inside.start], closed[closed >= inside.stop]
            if (
                _longest_run(is_open[inside]) * MOUTH_PLACE_M < LEAST_MOUTH_M
                or not len(first)
                or not len(last)
            ):
                continue
            # The opening reaches from the last to the first boundary: the corners of a street are wider than the gap
            in_mouth = (
                (at > first[-1]) & (at < last[0]) & (across > np.maximum(expected[at] - GOES_ON_M, 0.0))
            )
            if len(np.unique(own[turns & in_mouth])) >= LEAST_TURNING:
                around = np.concatenate([is_bare[: first[-1] + 1], is_bare[last[0] :]])
                around = around[np.concatenate([is_line[: first[-1] + 1], is_line[last[0] :]])]
                open_m, seen_m = MOUTH_PLACE_M * np.count_nonzero(around), MOUTH_PLACE_M * len(around)
                chances.append((open_m / HOLE_M + 1.0) / (seen_m / HOLE_M + 2.0))
        return min(chances), is_known


def _expected(offset: FloatArray, inside: slice) -> FloatArray | None:
    """Return the distance [m] at which a boundary should be at each place, None if it is not known beside the gap.

    offset: (n,) distance of the nearest one, inf without any.
    """
    n = round(BESIDE_GAP_M / MOUTH_PLACE_M)
    before, behind = offset[max(inside.start - n, 0) : inside.start], offset[inside.stop : inside.stop + n]
    before, behind = before[np.isfinite(before)], behind[np.isfinite(behind)]
    if min(len(before), len(behind)) < LEAST_PLACES:
        return None
    ends = float(np.median(before)), float(np.median(behind))
    if abs(ends[1] - ends[0]) > SAME_OFFSET_M:
        return None
    places: FloatArray = np.interp(np.arange(len(offset)), (inside.start, inside.stop - 1), ends)
    return places


def _places(first_m: float, last_m: float) -> FloatArray:
    """Return places in the middle of pieces of `MOUTH_PLACE_M` from one distance along a line to another [m]."""
    n = int((last_m - first_m) / MOUTH_PLACE_M)
    places: FloatArray = first_m + (np.arange(n, dtype=np.float64) + 0.5) * MOUTH_PLACE_M
    return places


def _bridged(place: FloatArray, inside: slice) -> FloatArray:
    """Return the places `inside` on the curve that has the line's direction at both ends (Hermite); place: (n, 2) [m]."""
    a, b = inside.start - 1, inside.stop
    length = float(np.hypot(*(place[b] - place[a])))
    slopes = (place[a] - place[max(a - 3, 0)], place[min(b + 3, len(place) - 1)] - place[b])
    u, v = (slope / max(float(np.hypot(*slope)), 1e-9) * length for slope in slopes)
    s = np.linspace(0.0, 1.0, b - a + 1)[1:-1, None]
    weights = (2 * s**3 - 3 * s**2 + 1, s**3 - 2 * s**2 + s, 3 * s**2 - 2 * s**3, s**3 - s**2)
    curve = np.zeros((len(s), 2))
    for weight, vector in zip(weights, (place[a], u, place[b], v), strict=True):
        curve += weight * vector
    return curve


def _longest_run(is_open: BoolArray) -> int:
    """Return the longest run of True.

    >>> _longest_run(np.array([True, False, True, True]))
    2
    """
    ends = np.flatnonzero(np.diff(np.concatenate([[0], is_open.astype(np.int8), [0]])))
    return int(np.max(ends[1::2] - ends[::2], initial=0))


#: Why dashes are lines of their own.
AT_MOUTHS = "end at the mouths beside them: lines of their own, not dashes"
#: Where no boundaries are known.
NO_MOUTHS = Mouths([], lambda xy: np.ones(len(xy), dtype=np.bool_))
