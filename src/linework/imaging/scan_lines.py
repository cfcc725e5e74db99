"""Distance between successive scan lines along the path, from the times of the points."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from linework.arrays import BoolArray, FloatArray, distance_along
from linework.errors import InputError
from linework.model.points import Points
from linework.model.trajectory import Trajectory

#: Half width of the strip along the path whose points are used: a profile scanner passes it in well under half a turn,
#: so the points of one line are a burst in time followed by a long pause. [m]
HALF_STRIP_M = 2.0
#: Height above the path of branches and bridges, which would give a second burst per turn. [m]
OVERHEAD_PATH_M = 1.0
#: Smallest ratio of a pause between scan lines to the median step within one. A profile scanner of n points per turn
#: has about n / 2 (hundreds; tens where points were thinned out); random times split into halves that differ by 6.
PAUSE_RATIO = 15.0
#: Fewest scan lines that give a spacing.
MIN_LINES = 10
#: Smallest distance between lines of a moving van [m]; and the largest, as a multiple of the median: gaps in the data.
LEAST_ADVANCE_M, GAP_RATIO = 0.001, 3.0
#: What is needed, and what a user can do where the spacing cannot be measured.
_NEEDS = "the scan-line spacing needs times of the points and a trajectory"
_ADVICE = "give the cell along the road in metres"


def scan_line_spacing_m(points: Points | Iterable[Points], trajectory: Trajectory | None) -> float:
    """Return the mean distance of successive scan lines along the path. [m]

    Points may come in parts, of which the times of those near the path are kept.

    Lines of two scanners count separately where they cross the road one after the other, and as one where they cross it
    at the same time. Stops, and gaps in the data, are left out.

    Raises
    ------
    InputError
        When points have no time, there is no trajectory, they do not overlap in time, the times show no separate scan
        lines, or the van does not move.

    Notes
    -----
    A profile scanner measures points near the path once per turn: sorted by time they are bursts with pauses between.
    Steps in time are split into the two kinds at the best threshold of their logarithms (Otsu); each burst is one line,
    at the position of the path at its middle time.
    """  # noqa: D400
    if trajectory is None or len(trajectory) < 2:
        raise InputError(_NEEDS, advice=_ADVICE)
    parts = [points] if isinstance(points, Points) else points
    times = np.unique(np.concatenate([np.zeros(0), *(_times_near_path(part, trajectory) for part in parts)]))
    if len(times) < 2 * MIN_LINES:
        raise InputError(f"only {len(times)} points near the path to measure scan lines on", advice=_ADVICE)
    new_line = _pauses(np.diff(times))
    starts = np.flatnonzero(np.concatenate([[True], new_line]))
    ends = np.concatenate([starts[1:], [len(times)]]) - 1
    if len(starts) < MIN_LINES:
        raise InputError("the times of the points show no separate scan lines", advice=_ADVICE)
    chainage = distance_along(trajectory.xyz)
    steps = np.diff(np.interp(0.5 * (times[starts] + times[ends]), trajectory.time_s, chainage))
    moving = steps[steps > LEAST_ADVANCE_M]
    if len(moving) < MIN_LINES - 1:
        raise InputError("the van does not move, so there is no scan-line spacing", advice=_ADVICE)
    return float(moving[moving <= GAP_RATIO * np.median(moving)].mean())


def _times_near_path(points: Points, trajectory: Trajectory) -> FloatArray:
    """Return the different times (n,) [s] of the points in the strip along the path."""
    if points.time_s is None:
        raise InputError(_NEEDS, advice=_ADVICE)
    inside = (points.time_s >= trajectory.time_s[0]) & (points.time_s <= trajectory.time_s[-1])
    time_s = points.time_s[inside]
    return np.unique(time_s[_near_path(points.xyz[inside], time_s, trajectory)])


def _near_path(xyz: FloatArray, time_s: FloatArray, trajectory: Trajectory) -> BoolArray:
    """Return (n,) bool: the point is in the strip along the path at its own time, and not overhead."""
    east, north, up = (np.interp(time_s, trajectory.time_s, trajectory.xyz[:, axis]) for axis in range(3))
    leg = np.clip(np.searchsorted(trajectory.time_s, time_s, side="right") - 1, 0, len(trajectory) - 2)
    heading = np.diff(trajectory.xyz[:, :2], axis=0)[leg]
    length = np.maximum(np.hypot(heading[:, 0], heading[:, 1]), 1e-9)
    offset = (heading[:, 0] * (xyz[:, 1] - north) - heading[:, 1] * (xyz[:, 0] - east)) / length
    near: BoolArray = (np.abs(offset) < HALF_STRIP_M) & (xyz[:, 2] < up + OVERHEAD_PATH_M)
    return near


def _pauses(steps_s: FloatArray) -> BoolArray:
    """Return (n,) bool: the step in time is a pause between scan lines, by Otsu's threshold of the logarithms.

    Raises
    ------
    InputError
        When the steps do not split into two kinds.
    """
    log = np.sort(np.log(steps_s))
    n = np.arange(1, len(log))
    total = np.cumsum(log)
    low, high = total[:-1] / n, (total[-1] - total[:-1]) / (len(log) - n)
    best = int(np.argmax(n * (len(log) - n) * (high - low) ** 2))
    within, between = np.median(log[: best + 1]), np.median(log[best + 1 :])
    if between - within < np.log(PAUSE_RATIO):
        raise InputError(
            "the times of the points show no separate scan lines",
            advice=_ADVICE,
        )
    is_pause: BoolArray = steps_s > np.exp(0.5 * (log[best] + log[best + 1]))
    return is_pause
