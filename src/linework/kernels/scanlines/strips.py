"""Lines of airborne scanners: where the spot falls back across the strip, or turns."""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import BoolArray, FloatArray, Int32Array

#: Pulses on either side over which the spot's motion is taken, to see that it turns: leaves move single points.
_AROUND = 6


@njit(cache=True, nogil=True)
def mean_motion(time_s: FloatArray, xyz: FloatArray, longest_s: float) -> tuple[float, float, float, float]:
    """Return the mean motion between successive pulses as a unit vector, and its double angle as one.

    The length of the first is 1 where the spot always moves the same way, 0 where it moves to and fro; of the second 1
    where it always moves along one line.

    Parameters
    ----------
    time_s, xyz
        (n,) [s], ascending, and (n, 3) [m].
    longest_s
        Pulses that follow later than this do not count. [s]
    """
    sx = sy = cc = ss = 0.0
    n = 0
    for i in range(len(time_s) - 1):
        dt = time_s[i + 1] - time_s[i]
        dx, dy = xyz[i + 1, 0] - xyz[i, 0], xyz[i + 1, 1] - xyz[i, 1]
        d = np.hypot(dx, dy)
        if dt <= 0.0 or dt > longest_s or d == 0.0:
            continue
        dx, dy = dx / d, dy / d
        sx += dx
        sy += dy
        cc += dx * dx - dy * dy
        ss += 2.0 * dx * dy
        n += 1
    n = max(n, 1)
    return sx / n, sy / n, cc / n, ss / n


@njit(cache=True, nogil=True)
def cuts_of_strips(
    time_s: FloatArray,
    xyz: FloatArray,
    direction: tuple[float, float],
    to_and_fro: bool,
    pulse_s: float,
    pause_pulses: float,
    fall_m: float,
) -> FloatArray:
    """Return when each line of an airborne scanner begins, (m,) float64 [s].

    Parameters
    ----------
    time_s, xyz
        (n,) [s], ascending, and (n, 3) [m].
    direction
        Unit vector of the spot's motion.
    to_and_fro
        The mirror swings: a line begins where the spot turns. Otherwise it begins where the spot falls back, after a
        pause, or by far.
    pulse_s
        Time between two pulses. [s]
    pause_pulses
        A fall after a longer pause begins a line, whatever it measures. [pulses]
    fall_m
        A longer fall begins a line, pause or not: farther than leaves and ground of one direction lie apart. [m]
    """
    cuts = [time_s[0]]
    n, forward = len(time_s), 0
    for i in range(1, n):
        dt = time_s[i] - time_s[i - 1]
        if dt <= 0.0:
            continue
        moved = (xyz[i, 0] - xyz[i - 1, 0]) * direction[0] + (xyz[i, 1] - xyz[i - 1, 1]) * direction[1]
        if not to_and_fro:
            if moved < -fall_m or (moved < 0.0 and dt > pause_pulses * pulse_s):
                cuts.append(time_s[i - 1] + 0.5 * dt)
            continue
        last = min(i + _AROUND, n - 1)
        while time_s[last] - time_s[i] > pause_pulses * pulse_s:
            last -= 1
        ahead = (xyz[last, 0] - xyz[i, 0]) * direction[0] + (xyz[last, 1] - xyz[i, 1]) * direction[1]
        if ahead == 0.0:
            continue
        now = 1 if ahead > 0.0 else -1
        if forward != 0 and now != forward:
            # It turned in the pause, outside of what the points cover, or half way to where it is back across the strip
            turned = i if dt > pause_pulses * pulse_s else i + (last - i) // 2
            cuts.append(0.5 * (time_s[turned - 1] + time_s[turned]))
        forward = now
    return np.array(cuts)


@njit(cache=True, nogil=True)
def cuts_of_flags(time_s: FloatArray, flag: Int32Array, is_edge: BoolArray, longest_s: float) -> FloatArray:
    """Return when each line begins by the flags of a file, (m,) float64 [s].

    Parameters
    ----------
    time_s
        (n,) float64 [s]: ascending.
    flag
        (n,) int32: direction of the mirror; a line begins where it changes.
    is_edge
        (n,) bool: last point of a line.
    longest_s
        A longer pause begins a line. [s]
    """
    cuts = [time_s[0]]
    edge_at = -np.inf
    for i in range(1, len(time_s)):
        dt = time_s[i] - time_s[i - 1]
        if is_edge[i - 1]:
            edge_at = time_s[i - 1]
        if dt > 0.0 and (flag[i] != flag[i - 1] or dt > longest_s or edge_at == time_s[i - 1]):
            cuts.append(time_s[i - 1] + 0.5 * dt)
    return np.array(cuts)
