"""Select the stretches of followed chains that are lines: certain enough and long enough.

No decision depends on more of a chain than a few dozen metres about a place, so that the result is the same however
much of a long line a tile holds.
"""

from __future__ import annotations

import numpy as np

from linework.arrays import AnyArray, BoolArray, FloatArray
from linework.kernels.tracking.times import points_near, times_near
from linework.methods.rails.chains import long_runs
from linework.methods.rails.profile import ProfileConfig
from linework.methods.rails.verdict import NodeScores
from linework.model.lines import LineSet
from linework.model.points import Points
from linework.model.tile import UNORDERED, ScannerTiming
from linework.scanlines.crossings import LEAST_CROSSINGS, crossings_in_time
from linework.scanlines.fields import laser_column

#: Tolerance of lengths: nodes are half a metre apart, and limits are whole multiples of that. [m]
SPARE_M = 1e-6
#: Points within this distance of a vertex lie on the line: the face of a beam reaches 0.31 m below its top edge. [m]
TIME_REACH_M = 0.3
#: Score at which a node counts as passed: a margin of 0.5 is at the limit.
_PASSED = 0.5
#: Fewest nodes of a stretch.
_LEAST_NODES = 2


def guardrail_stretches(
    verdict: NodeScores, chainage: FloatArray, config: ProfileConfig
) -> list[tuple[slice, FloatArray]]:
    """Return the runs of nodes that are guardrail, with the score of each node.

    A run starts where it is firm, and continues from there for at most `max_run_on_m` where it is not certain. Two
    runs with no more than that between them are one: the circles followed one sheet from one to the other.

    Parameters
    ----------
    verdict
        Scores of the nodes of one chain.
    chainage
        (n,) distance of the nodes along the chain. [m]
    """
    sure = verdict.guardrail >= _PASSED
    if not sure.any():
        return []
    goes_on = sure | (verdict.goes_on >= _PASSED)
    firm = np.zeros(len(sure), dtype=bool)
    for run in long_runs(goes_on & near_chosen(sure, chainage, config.max_run_on_m), _LEAST_NODES):
        firm[run] = _is_firm(sure[run], verdict.open_[run], chainage[run], config)
    found = long_runs(goes_on & near_chosen(firm, chainage, config.max_run_on_m), _LEAST_NODES)
    whole = _joined(found, chainage, config.max_run_on_m)
    return [(run, np.maximum(verdict.guardrail[run], _PASSED)) for run in whole]


def barrier_stretches(
    verdict: NodeScores, chainage: FloatArray, config: ProfileConfig
) -> list[tuple[slice, FloatArray]]:
    """Return the runs of nodes that are barrier and not guardrail, with the score of each node.

    Parameters as for `guardrail_stretches`.
    """
    sure = np.where(verdict.guardrail < _PASSED, verdict.barrier, 0.0)
    return [
        (run, sure[run])
        for run in long_runs(sure >= _PASSED, _LEAST_NODES)
        if chainage[run][-1] - chainage[run][0] >= config.min_closed_length_m - SPARE_M
    ]


def _is_firm(sure: BoolArray, open_: AnyArray, chainage: FloatArray, config: ProfileConfig) -> BoolArray:
    """Return which nodes of a run are certain and lie in a stretch that is certain over enough of it, (n,) bool.

    A stretch is twice `min_closed_length_m` long, or the whole of a shorter run.
    """
    half = config.min_closed_length_m
    low = np.clip(chainage - half, chainage[0], max(chainage[-1] - 2 * half, chainage[0]))
    first = np.searchsorted(chainage, low - SPARE_M)
    stop = np.searchsorted(chainage, low + 2 * half + SPARE_M, side="right")
    share, n_open = _sums(sure, first, stop) / (stop - first), _sums(open_, first, stop)
    is_open = 2 * n_open >= stop - first
    length = share * (chainage[stop - 1] - chainage[first])
    enough = np.where(is_open, config.min_length_m, config.min_closed_length_m) - SPARE_M
    stands = (share >= config.min_core) & (length >= enough)
    # All nodes of the stretch about each node that passes
    covered = np.zeros(len(sure) + 1, dtype=np.int64)
    np.add.at(covered, first[stands], 1)
    np.add.at(covered, stop[stands], -1)
    return np.asarray(sure & (np.cumsum(covered)[:-1] > 0))


def _sums(values: AnyArray, first: AnyArray, stop: AnyArray) -> AnyArray:
    """Return the sums of values over ranges first to stop, (n,) int64 each."""
    total = np.concatenate([[0], np.cumsum(values, dtype=np.int64)])
    return np.asarray(total[stop] - total[first])


def near_chosen(chosen: BoolArray, chainage: FloatArray, reach_m: float) -> BoolArray:
    """Return which nodes have a chosen one within `reach_m` along the chain, (n,) bool.

    `chosen` is (n,) bool, `chainage` (n,) [m].
    """
    places = chainage[chosen]
    if not len(places):
        return np.zeros(len(chosen), dtype=bool)
    at = np.searchsorted(places, chainage)
    ahead, behind = places[np.minimum(at, len(places) - 1)], places[np.maximum(at - 1, 0)]
    away = np.minimum(np.abs(ahead - chainage), np.abs(behind - chainage))
    return np.asarray(away <= reach_m + SPARE_M)


def _joined(found: list[slice], chainage: FloatArray, gap_m: float) -> list[slice]:
    """Return the runs with those joined that are no more than a gap apart."""
    whole: list[slice] = []
    for run in found:
        if whole and chainage[run.start] - chainage[whole[-1].stop - 1] <= gap_m + SPARE_M:
            whole[-1] = slice(whole[-1].start, run.stop)
        else:
            whole.append(run)
    return whole


def with_times(lines: LineSet, points: Points) -> LineSet:
    """Return the lines with the time span of the points on them, where they have none.

    Parameters
    ----------
    points
        The points that the lines were extracted from; without times the lines are returned as they are.

    Notes
    -----
    Points count within `TIME_REACH_M` of a vertex, in space: the ground below and branches above do not.

    Examples
    --------
    >>> xyz = np.array([[0.0, 0.1, 0.0], [1.0, 0.0, 0.2], [0.5, 0.0, 3.0]])
    >>> line = LineSet.from_lines([np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])])
    >>> timed = with_times(line, Points(xyz, time_s=np.array([7.0, 9.0, 11.0])))
    >>> timed.time_start_s.tolist(), timed.time_end_s.tolist()
    ([7.0], [9.0])
    """
    open_ = np.isnan(lines.time_start_s)
    owner = lines.line_of_vertex
    chosen = open_[owner]
    if points.time_s is None or not chosen.any():
        return lines
    start, end = times_near(
        points.xyz, points.time_s, lines.xyz[chosen], owner[chosen], len(lines), TIME_REACH_M
    )
    return lines.with_columns(
        time_start_s=np.where(open_, start, lines.time_start_s),
        time_end_s=np.where(open_, end, lines.time_end_s),
    )


def drawn_often(lines: LineSet, points: Points, scanner: ScannerTiming) -> LineSet:
    """Return the lines that at least three scan lines drew; one alone, or two beside each other, draw a line on anything.

    Parameters
    ----------
    points
        The points that the lines were extracted from; where their times do not tell scan lines, all lines are returned.
    """
    if points.time_s is None or scanner.kind == UNORDERED or not len(lines):
        return lines
    line, point = points_near(points.xyz, lines.xyz, lines.line_of_vertex, TIME_REACH_M)
    name = laser_column(points)
    order = np.argsort(line, kind="stable")
    own = np.split(point[order], np.searchsorted(line[order], np.arange(1, len(lines))))
    laser = points.columns[name] if name else None
    drawn = [
        crossings_in_time(points.time_s[i], points.xyz[i], None if laser is None else laser[i], scanner)
        for i in own
    ]
    # Where times tell nothing (NaN) nothing is left out
    return lines.take(~(np.array(drawn) < LEAST_CROSSINGS))
