"""Tracking of the laser spot: which points one beam drew without a break, whatever else was recorded meanwhile."""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import Float32Array, FloatArray, Int32Array, IntArray

#: Strings that are open at a time: heads whose pulses are merged, and several returns of a pulse (at most 15 in LAS,
#: of which neighbouring pulses rarely share more than a few).
_OPEN = 8
#: Two points this share of a pulse apart or less are of one pulse: of another head, or another return.
_SAME_PULSE = 0.3
#: The next string of a head: of strings of some points, within the longest time of a turn of profile scanners (10 a
#: second), no farther from it than a van moves in that time, in its direction within 25 degrees.
_LEAST_OF_STRING, _LONGEST_TURN_S, _BESIDE_M, _ALIKE = 4, 0.1, 3.0, 0.9
#: The spot's next place is predicted from its last two, if they are no more than this number of pulses apart.
_PREDICTED = 4.0


@njit(cache=True, nogil=True)
def track_strings(
    time_s: FloatArray, xyz: FloatArray, pulse_s: float, leap_m: float, longest_pulses: float
) -> Int32Array:
    """Return the string of each point, (n,) int32, numbered by their first points.

    A point joins the open string whose last point, or the place predicted from its last two, is nearest, and no
    farther than the leap. Gaps in time alone neither join nor part points: two heads in one stream would cut each other
    to pieces.

    Parameters
    ----------
    time_s
        (n,) float64 [s]: ascending.
    xyz
        (n, 3) float64 [m].
    pulse_s
        Time between two pulses. [s]
    leap_m
        Points of a string are no farther from one another. [m]
    longest_pulses
        Nor later than this number of pulses.
    """
    n = len(time_s)
    string = np.empty(n, dtype=np.int32)
    last, before = np.full(_OPEN, -1), np.full(_OPEN, -1)
    n_strings = 0
    for i in range(n):
        best, nearest, free, oldest = leap_m * leap_m, -1, 0, np.inf
        for k in range(_OPEN):
            j = last[k]
            if j >= 0 and time_s[i] - time_s[j] > longest_pulses * pulse_s:
                last[k] = j = -1
            if j < 0:
                free, oldest = k, -np.inf
                continue
            if time_s[j] < oldest:
                free, oldest = k, time_s[j]
            dt = time_s[i] - time_s[j]
            if dt < _SAME_PULSE * pulse_s:
                continue
            d2 = ahead2 = 0.0
            q = before[k]
            share = 0.0
            if q >= 0 and dt < _PREDICTED * pulse_s and time_s[j] - time_s[q] < _PREDICTED * pulse_s:
                share = dt / (time_s[j] - time_s[q])
            for c in range(3):
                d = xyz[i, c] - xyz[j, c]
                d2 += d * d
                if share > 0.0:
                    d -= share * (xyz[j, c] - xyz[q, c])
                ahead2 += d * d
            if min(d2, ahead2) < best:
                best, nearest = min(d2, ahead2), k
        if nearest >= 0:
            string[i] = string[last[nearest]]
            before[nearest], last[nearest] = last[nearest], i
        else:
            string[i] = n_strings
            n_strings += 1
            before[free], last[free] = -1, i
    return string


@njit(cache=True, nogil=True)
def speed_of_spot(time_s: FloatArray, xyz: FloatArray, sample: IntArray, pulse_s: float) -> FloatArray:
    """Return how fast the spot moved to each sampled point, (k,) float64 [m/s]; NaN where nothing was drawn before.

    From the nearest of the points before it: those of other heads, drawn in between, are farther.

    Parameters
    ----------
    time_s, xyz
        (n,) [s], ascending, and (n, 3) [m].
    sample
        (k,) int64: indices.
    pulse_s
        Time between two pulses. [s]
    """
    speed = np.full(len(sample), np.nan)
    for k in range(len(sample)):
        i = sample[k]
        nearest = np.inf
        for j in range(max(i - _OPEN, 0), i):
            dt = time_s[i] - time_s[j]
            if dt < _SAME_PULSE * pulse_s or dt > _OPEN * pulse_s:
                continue
            d2 = (xyz[i, 0] - xyz[j, 0]) ** 2 + (xyz[i, 1] - xyz[j, 1]) ** 2 + (xyz[i, 2] - xyz[j, 2]) ** 2
            if d2 < nearest:
                nearest, speed[k] = d2, np.sqrt(d2) / dt
    return speed


@njit(cache=True, nogil=True)
def share_interleaved(string: Int32Array) -> float:
    """Return the share of points, in time order, that stand in the pattern A B A B of two strings drawn at once."""
    n, found = len(string), 0
    for i in range(n - 3):
        a, b = string[i], string[i + 1]
        if a != b and string[i + 2] == a and string[i + 3] == b:
            found += 1
    return found / max(n - 3, 1)


@njit(cache=True, nogil=True)
def time_back_at_place(
    time_s: FloatArray, xyz: FloatArray, sample: IntArray, pulse_s: float, near_m: float, longest_s: float
) -> FloatArray:
    """Return how long after each sampled point the spot was there again, (k,) float64 [s]; NaN where it was not.

    The spot leaves the sphere of `near_m` around the point, and the time counts to where it comes nearest once it is
    back in it: one turn of the mirror, for the vehicle moves less than that in a turn.

    Parameters
    ----------
    time_s, xyz
        (n,) [s], ascending, and (n, 3) [m].
    sample
        (k,) int64: indices.
    pulse_s
        Time between two pulses. [s]
    near_m
        Radius. [m]
    longest_s
        How far ahead to look. [s]
    """
    n = len(time_s)
    back = np.full(len(sample), np.nan)
    for k in range(len(sample)):
        i = sample[k]
        left, nearest = False, near_m * near_m
        # Seconds at the full rate of the pulses, if nothing is missing
        for j in range(i + 1, n):
            dt = time_s[j] - time_s[i]
            if dt > longest_s:
                break
            d2 = (xyz[j, 0] - xyz[i, 0]) ** 2 + (xyz[j, 1] - xyz[i, 1]) ** 2 + (xyz[j, 2] - xyz[i, 2]) ** 2
            if not left:
                left = d2 > 4.0 * near_m * near_m and dt > 10.0 * pulse_s
            elif d2 < nearest:
                nearest, back[k] = d2, dt
            elif d2 > near_m * near_m and back[k] == back[k]:
                break
    return back


@njit(cache=True, nogil=True)
def next_strings(
    order: IntArray,
    time_s: FloatArray,
    xyz: FloatArray,
    string: Int32Array,
    direction: Float32Array,
    n_strings: int,
) -> IntArray:
    """Return the string that the same head drew one turn after each string, (n_strings,) int64; -1: none found.

    It is the first one later that passes near the middle of the string in about its direction: another head's strings
    cross it.

    Parameters
    ----------
    order
        (n,) int64: points by device and time.
    time_s, xyz, string, direction
        Of all points, in any order.
    """
    n = len(order)
    count = np.zeros(n_strings, dtype=np.int64)
    for i in range(n):
        count[string[order[i]]] += 1
    passed = np.zeros(n_strings, dtype=np.int64)
    found = np.full(n_strings, -1, dtype=np.int64)
    for i in range(n):
        p = order[i]
        own = string[p]
        passed[own] += 1
        if count[own] < _LEAST_OF_STRING or passed[own] != count[own] // 2:
            continue
        nearest, longest = _BESIDE_M**2, _LONGEST_TURN_S
        for j in range(i + 1, n):
            q = order[j]
            dt = time_s[q] - time_s[p]
            if dt > longest or dt < 0.0:
                break
            if string[q] == own:
                continue
            d2 = 0.0
            for c in range(3):
                d2 += (xyz[p, c] - xyz[q, c]) ** 2
            if d2 < nearest:
                # NaN, of strings of one point, is no direction
                if direction[p, 0] * direction[q, 0] + direction[p, 1] * direction[q, 1] > _ALIKE:
                    nearest, found[own] = d2, string[q]
                    # It may still come nearer, but it is not the turn after this one
                    longest = min(longest, 1.5 * dt)
    return found
