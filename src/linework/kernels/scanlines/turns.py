"""Turns of a scanner's mirror: when each one begins, and the points of each line in their order."""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import FloatArray, Int32Array, IntArray

#: Points of one time that are sorted by insertion.
_MOST_TIES = 1000
#: Bins of a turn in which its points are counted; the cut is put where the fewest are within a tenth of a turn.
_PHASES, _ARC = 200, 20
#: Turns from which the first cut is found.
_FIRST_TURNS = 40
#: A cut moves into the largest pause within this share of a turn around where it is expected: mirrors hold their speed to
#: a percent, and the sky is a pause of a third of a turn and more.
_SLACK = 0.2
#: After this number of turns without a point the cut is found afresh.
_LOST_TURNS = 5.0


@njit(cache=True, nogil=True)
def in_order_of_ties(order: IntArray, time_s: FloatArray, xyz: FloatArray) -> bool:
    """Sort points of equal time by x, y and z, in place, and return whether that was done for all.

    The order of the file must not matter. It is for a few points of a time, by insertion: not for more than 1,000.

    Parameters
    ----------
    order
        (n,) int64: points by time.
    """
    n, first = len(order), 0
    while first < n:
        end = first + 1
        while end < n and time_s[order[end]] == time_s[order[first]]:
            end += 1
        if end - first > _MOST_TIES:
            return False
        for i in range(first + 1, end):
            p, j = order[i], i
            while j > first and _before(xyz, p, order[j - 1]):
                order[j] = order[j - 1]
                j -= 1
            order[j] = p
        first = end
    return True


@njit(cache=True, nogil=True)
def cuts_of_turns(time_s: FloatArray, known_s: FloatArray, turn_s: FloatArray) -> FloatArray:
    """Return when each turn of a mirror begins, (m,) float64 [s]; the first at or before the first point.

    Parameters
    ----------
    time_s
        (n,) float64 [s]: points of one head, ascending, n >= 1.
    known_s, turn_s
        (k,) float64 [s]: times, ascending, and how long a turn takes then, k >= 1.

    Notes
    -----
    Between turns the spot crosses the sky or the vehicle: cuts go there, if there is such a pause, so that no line is
    cut on the ground. Where there is none (trees, tunnels) cuts follow the known length of a turn.
    """
    cuts = [0.0]
    cuts.clear()
    n, at, near = len(time_s), 0, 0
    while at < n:
        # Where the fewest points are within a turn, over the first turns
        turn = turn_s[_nearest(known_s, time_s[at], near)]
        count = np.zeros(_PHASES)
        i = at
        while i < n and time_s[i] - time_s[at] < _FIRST_TURNS * turn:
            count[int((time_s[i] - time_s[at]) / turn % 1.0 * _PHASES) % _PHASES] += 1.0
            i += 1
        best, fewest = 0, np.inf
        for phase in range(_PHASES):
            total = 0.0
            for k in range(_ARC):
                total += count[(phase + k) % _PHASES]
            # Centre of a run of equal sums, by counting points a little farther out too
            for k in range(_PHASES // 4):
                total += (
                    1e-3 * (count[(phase - k) % _PHASES] + count[(phase + _ARC + k) % _PHASES]) / (1.0 + k)
                )
            if total < fewest:
                best, fewest = phase, total
        cut = time_s[at] + ((best + 0.5 * _ARC) / _PHASES % 1.0 - 1.0) * turn
        cuts.append(cut)
        while True:
            near = _nearest(known_s, cut, near)
            turn = turn_s[near]
            wanted = cut + turn
            while at < n and time_s[at] < wanted - _SLACK * turn:
                at += 1
            if at == n:
                break
            pause_from = time_s[at - 1] if at > 0 else cut
            widest, middle = 0.0, wanted
            i = at
            while i <= n:
                upto = time_s[i] if i < n else np.inf
                low, high = max(pause_from, wanted - 0.5 * turn), min(upto, wanted + 0.5 * turn)
                if high - low > widest:
                    widest, middle = high - low, 0.5 * (low + high)
                if upto > wanted + _SLACK * turn:
                    break
                pause_from = upto
                i += 1
            # A pause of one in fifty is longer than between pulses, and is worth following
            if widest > 0.02 * turn:
                wanted = min(max(middle, wanted - _SLACK * turn), wanted + _SLACK * turn)
            cut = wanted
            while at < n and time_s[at] < cut:
                at += 1
            if at == n:
                break
            if time_s[at] - cut > _LOST_TURNS * turn:
                break
            cuts.append(cut)
    return np.array(cuts)


@njit(cache=True, nogil=True)
def cuts_of_angles(time_s: FloatArray, angle_deg: FloatArray, fall_deg: float, turn_s: float) -> FloatArray:
    """Return when each line begins, (m,) float64 [s], from where the scan angle falls back, or a turn goes by.

    Parameters
    ----------
    time_s
        (n,) float64 [s]: points of one head, ascending, n >= 1.
    angle_deg
        (n,) float64 [deg]: rising within a line.
    fall_deg
        Falls of less are noise. [deg]
    turn_s
        A pause that is longer begins a line too. [s]
    """
    cuts = [time_s[0]]
    for i in range(1, len(time_s)):
        dt = time_s[i] - time_s[i - 1]
        if dt > 0.0 and (angle_deg[i] < angle_deg[i - 1] - fall_deg or dt > turn_s):
            cuts.append(time_s[i] - 0.5 * min(dt, turn_s))
    return np.array(cuts)


@njit(cache=True, nogil=True)
def turn_of_points(time_s: FloatArray, cuts: FloatArray) -> Int32Array:
    """Return the turn of each point, (n,) int32: the last cut at or before its time; both ascending."""
    turn = np.empty(len(time_s), dtype=np.int32)
    at = 0
    for i in range(len(time_s)):
        while at + 1 < len(cuts) and cuts[at + 1] <= time_s[i]:
            at += 1
        turn[i] = at
    return turn


@njit(cache=True, nogil=True)
def order_by_line(line: Int32Array, order: IntArray, n_lines: int) -> tuple[IntArray, IntArray]:
    """Return points line after line, each in the given order, and where each line begins, (n,) and (m + 1,) int64."""
    start = np.zeros(n_lines + 1, dtype=np.int64)
    n = 0
    for i in order:
        if line[i] >= 0:
            start[line[i] + 1] += 1
            n += 1
    for k in range(n_lines):
        start[k + 1] += start[k]
    at = start[:-1].copy()
    out = np.empty(n, dtype=np.int64)
    for i in order:
        if line[i] >= 0:
            out[at[line[i]]] = i
            at[line[i]] += 1
    return out, start


@njit(cache=True, nogil=True)
def _before(xyz: FloatArray, p: int, q: int) -> bool:
    for c in range(3):
        if xyz[p, c] != xyz[q, c]:
            return bool(xyz[p, c] < xyz[q, c])
    return False


@njit(cache=True, nogil=True)
def _nearest(known_s: FloatArray, time_s: float, at: int) -> int:
    """Return the index of the known time nearest to a time, looking from `at` on."""
    while at + 1 < len(known_s) and abs(known_s[at + 1] - time_s) <= abs(known_s[at] - time_s):
        at += 1
    return at
