"""Along-track distance between successive scan lines, from the times of the points."""

from __future__ import annotations

import numpy as np

from linework.arrays import BoolArray, FloatArray
from linework.errors import InputError
from linework.model.points import Points
from linework.model.trajectory import Trajectory

#: Half width of the strip about the path whose points are looked at [m]: a profile scanner passes it in
#: well under half a turn, so the points of one line are a burst in time with a long pause after it.
HALF_STRIP_M = 2.0
#: Points so high above the path are branches and bridges, a second burst per turn [m].
OVERHEAD_PATH_M = 1.0
#: A pause between scan lines is at least so many times as long as the median step within one. A profile
#: scanner that measures n points per turn leaves about n / 2 (hundreds; tens where points were thinned
#: out); points that come at random split into halves that differ by 6.
PAUSE_RATIO = 15.0
#: Fewer lines than this are no measurement.
MIN_LINES = 10


def scan_line_spacing_m(points: Points, trajectory: Trajectory | None) -> float:
    """Return the mean along-track distance of successive scan lines [m].

    Lines of two scanners count each where they pass the road one after the other, as one where they pass it
    at the same time. Stops and gaps in the data (distances over three times the median, or none) are left
    out.

    Raises
    ------
    InputError
        When points have no time, there is no trajectory, they do not overlap in time, or the times show no
        separate scan lines.

    Notes
    -----
    Points near the path are seen once per turn of a profile scanner: sorted by time they are bursts with
    pauses between. Steps in time are split into the two kinds where their logarithms part best, each burst
    is one line, and its place is that of the path at its middle time.
    """
    advice = "give the cell along the road in metres"
    if points.time_s is None or trajectory is None or len(trajectory) < 2:
        raise InputError("the scan-line spacing needs times of the points and a trajectory", advice=advice)
    inside = (points.time_s >= trajectory.time_s[0]) & (points.time_s <= trajectory.time_s[-1])
    time_s = points.time_s[inside]
    times = np.unique(time_s[_near_path(points.xyz[inside], time_s, trajectory)])
    if len(times) < 2 * MIN_LINES:
        raise InputError(f"only {len(times)} points near the path to measure scan lines on", advice=advice)
    new_line = _pauses(np.diff(times))
    starts = np.flatnonzero(np.concatenate([[True], new_line]))
    ends = np.concatenate([starts[1:], [len(times)]]) - 1
    if len(starts) < MIN_LINES:
        raise InputError("the times of the points show no separate scan lines", advice=advice)
    chainage = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(trajectory.xyz[:, :2], axis=0).T))])
    steps = np.diff(np.interp(0.5 * (times[starts] + times[ends]), trajectory.time_s, chainage))
    moving = steps[steps > 0.001]
    if len(moving) < MIN_LINES - 1:
        raise InputError("the van stands still: no scan-line spacing", advice=advice)
    return float(moving[moving <= 3.0 * np.median(moving)].mean())


def _near_path(xyz: FloatArray, time_s: FloatArray, trajectory: Trajectory) -> BoolArray:
    """Return which points lie in the strip about the path where it was at their time, and not overhead."""
    east, north, up = (np.interp(time_s, trajectory.time_s, trajectory.xyz[:, axis]) for axis in range(3))
    leg = np.clip(np.searchsorted(trajectory.time_s, time_s, side="right") - 1, 0, len(trajectory) - 2)
    heading = np.diff(trajectory.xyz[:, :2], axis=0)[leg]
    length = np.maximum(np.hypot(heading[:, 0], heading[:, 1]), 1e-9)
    offset = (heading[:, 0] * (xyz[:, 1] - north) - heading[:, 1] * (xyz[:, 0] - east)) / length
    near: BoolArray = (np.abs(offset) < HALF_STRIP_M) & (xyz[:, 2] < up + OVERHEAD_PATH_M)
    return near


def _pauses(steps_s: FloatArray) -> BoolArray:
    """Return which steps in time are pauses between scan lines: Otsu's split of their logarithms."""
    log = np.sort(np.log(steps_s))
    n = np.arange(1, len(log))
    total = np.cumsum(log)
    low, high = total[:-1] / n, (total[-1] - total[:-1]) / (len(log) - n)
    best = int(np.argmax(n * (len(log) - n) * (high - low) ** 2))
    within, between = np.median(log[: best + 1]), np.median(log[best + 1 :])
    if between - within < np.log(PAUSE_RATIO):
        raise InputError(
            "the times of the points show no separate scan lines",
            advice="give the cell along the road in metres",
        )
    is_pause: BoolArray = steps_s > np.exp(0.5 * (log[best] + log[best + 1]))
    return is_pause
