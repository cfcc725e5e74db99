"""Distances of the two wheels from their logs, with wrapped, reset, stuck and reversed counters corrected."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from linework.arrays import BoolArray, FloatArray
from linework.model.logs import WheelLog
from linework.navigation.front_wheels import front_steps, rear_steps

#: Highest speed of a vehicle on a survey. [m/s]
_FASTEST_MPS = 70.0
#: Largest change of speed: full braking is 8 to 10. [m/s^2]
_HARDEST_MPS2 = 20.0
#: Numbers at which counters wrap: 8, 16, 24 and 32 bits. [counts]
_WRAPS = (2.0**8, 2.0**16, 2.0**24, 2.0**32)
#: Time without counts, while the other wheel turns, from which a counter is stuck. [s]
_STUCK_S = 1.0
#: Shortest stop, and the time cut off at both of its ends, where counts are too coarse to show creeping. [s]
_REST_S, _REST_END_S = 1.6, 0.3
#: Window over which counts are smoothed; at full braking a van departs from a parabola by less than a tick in it. [s]
_SMOOTH_S = 0.5
#: Longest pause of the log in which the distance travelled is known. [s]
_PAUSE_S = 2.0
#: Speed below which a speed log reports standstill. [m/s]
_STANDING_MPS = 0.05
#: Mean speed of the other wheel above which a wheel without counts is stuck: even in the tightest turn, the inner wheel
#: travels a third of the distance of the outer one. [m/s]
_OTHER_MPS = 2.0


@dataclass(frozen=True, slots=True)
class WheelTravel:
    """Distances of both wheels.

    Parameters
    ----------
    time_s, way_m
        (n,) times [s], and (n, 2) distances of the left and the right wheel [m].
    no_way, at_rest
        (k, 2) spans in which the distance is not known, and in which the van stands. [s]
    apart
        Whether the wheels are counted separately.
    warnings
        What was corrected.
    """

    time_s: FloatArray
    way_m: FloatArray
    no_way: FloatArray
    at_rest: FloatArray
    apart: bool
    warnings: tuple[str, ...] = ()


def valid_wheel_travel(
    log: WheelLog,
    tick_m: float,
    track_m: float,
    heading_rad: FloatArray | None,
    *,
    wheelbase_m: float = 0.0,
) -> WheelTravel:
    """Return the distances of both wheels, corrected.

    Parameters
    ----------
    heading_rad
        (n,) clockwise heading from the gyro at the times of the log, to replace a stuck wheel [rad]; None: no gyro.
    tick_m, track_m
        Distance travelled per count, and distance between the wheels. [m]
    wheelbase_m
        From the rear axle to the counted front wheels [m]; 0: the rear wheels are counted.
    """
    pauses = spans_of(np.diff(log.time_s) > _PAUSE_S, log.time_s)
    if log.speed_mps is not None:
        step = 0.5 * np.diff(log.time_s) * (log.speed_mps[1:] + log.speed_mps[:-1])
        way = np.concatenate([[0.0], np.cumsum(step)])
        slow = np.abs(log.speed_mps) < _STANDING_MPS
        rest = _long(spans_of(slow[1:] & slow[:-1], log.time_s), _REST_S)
        return WheelTravel(log.time_s, np.stack([way, way], axis=1), pauses, _shorter(rest), apart=False)
    assert log.ticks is not None
    counts, warnings = np.diff(log.ticks, axis=0), []
    for i, name in enumerate(("left", "right")):
        counts[:, i], corrected = _unwrapped(counts[:, i], log.time_s, tick_m, name)
        warnings += corrected
    counts, corrected = _forward(counts)
    warnings += corrected
    bad = np.stack([_jumps(counts[:, i] * tick_m, log.time_s, tick_m) for i in range(2)], axis=1)
    stuck = np.stack([_stuck(counts[:, i], counts[:, 1 - i] * tick_m, log.time_s) for i in range(2)], axis=1)
    for what, where in (("jumps (reset?)", bad), ("is stuck", stuck)):
        for i, name in enumerate(("left", "right")):
            for start, end in spans_of(where[:, i], log.time_s)[:3]:
                warnings.append(f"wheels: the {name} counter {what} from {start:.2f} to {end:.2f} s")
    still = (counts == 0.0).all(axis=1) & ~stuck.any(axis=1)
    rest = _long(spans_of(still, log.time_s), _REST_S)
    turn = np.zeros(len(counts)) if heading_rad is None else np.diff(heading_rad)
    step = _replaced(counts * tick_m, bad | stuck, turn, np.diff(log.time_s), track_m, wheelbase_m)
    way = np.concatenate([np.zeros((1, 2)), np.cumsum(step, axis=0)])
    way = _without_steps(log.time_s, way, tick_m)
    return WheelTravel(log.time_s, way, pauses, _shorter(rest), apart=True, warnings=tuple(warnings))


def _without_steps(time_s: FloatArray, way_m: FloatArray, tick_m: float) -> FloatArray:
    """Return distances (n, 2) smoothed over half a second by parabolas: a count is up to a tick late."""
    from scipy.signal import savgol_filter

    width = 2 * int(0.5 * _SMOOTH_S / float(np.median(np.diff(time_s)))) + 1
    if width < 5 or len(time_s) < width:
        return way_m
    smooth = savgol_filter(way_m, width, 2, axis=0)
    # Differences above a tick come from pauses of the log and hard stops: these are not smoothed
    return np.where(np.abs(smooth - way_m) <= tick_m, smooth, way_m)


def spans_of(is_in: BoolArray, time_s: FloatArray) -> FloatArray:
    """Return the (k, 2) spans [s] of consecutive true steps, given as (n - 1,) bool between (n,) times [s].

    >>> spans_of(np.array([False, True, True, False]), np.arange(5.0)).tolist()
    [[1.0, 3.0]]
    """
    edge = np.diff(np.concatenate([[0], is_in.astype(np.int8), [0]]))
    first, last = np.flatnonzero(edge > 0), np.flatnonzero(edge < 0)
    return np.stack([time_s[first], time_s[last]], axis=1)


def _long(spans: FloatArray, least_s: float) -> FloatArray:
    """Return the spans (k, 2) that last at least `least_s` [s]."""
    return np.asarray(spans[spans[:, 1] - spans[:, 0] >= least_s])


def _shorter(spans: FloatArray) -> FloatArray:
    """Return the spans (k, 2), shortened by `_REST_END_S` at both ends [s]."""
    return np.asarray(spans + np.array([_REST_END_S, -_REST_END_S]))


def _unwrapped(
    counts: FloatArray, time_s: FloatArray, tick_m: float, name: str
) -> tuple[FloatArray, list[str]]:
    """Correct the counts (n - 1,) of a counter that wrapped; return them and messages."""
    most = _FASTEST_MPS * np.diff(time_s) / tick_m + 2.0
    counts, warnings = counts.copy(), []
    for size in _WRAPS:
        for sign in (1.0, -1.0):
            wrapped = (np.abs(counts) > most) & (np.abs(counts + sign * size) <= np.minimum(most, size / 4.0))
            if wrapped.any():
                counts[wrapped] += sign * size
                warnings.append(
                    f"wheels: the {name} counter wraps at {size:,.0f}: corrected {wrapped.sum()} times"
                )
    return counts, warnings


def _forward(counts: FloatArray) -> tuple[FloatArray, list[str]]:
    """Change the sign of counters that count down: vans mostly drive forward."""
    typical = np.sum(np.clip(counts, *np.percentile(counts, (5, 95), axis=0)), axis=0)
    names = [name for name, total in zip(("left", "right"), typical, strict=True) if total < 0.0]
    if not names:
        return counts, []
    corrected = f"wheels: the counts of the {' and the '.join(names)} wheel decrease: sign reversed"
    return counts * np.where(typical < 0.0, -1.0, 1.0), [corrected]


def _jumps(step_m: FloatArray, time_s: FloatArray, tick_m: float) -> BoolArray:
    """Return the steps (n - 1,) bool in which a counter jumps by more than a wheel can turn."""
    from scipy.ndimage import median_filter

    dt = np.diff(time_s)
    speed = step_m / dt
    usual = median_filter(speed, 7, mode="nearest")
    return np.asarray(np.abs(speed - usual) * dt > 3.0 * tick_m + (2.0 + _HARDEST_MPS2 * 3.0 * dt) * dt)


def _stuck(counts: FloatArray, other_m: FloatArray, time_s: FloatArray) -> BoolArray:
    """Return the steps (n - 1,) bool in which a wheel has no counts while the other turns."""
    stuck = np.zeros(len(counts), dtype=bool)
    for start, end in _long(spans_of(counts == 0.0, time_s), _STUCK_S):
        inside = (time_s[:-1] >= start) & (time_s[1:] <= end)
        if other_m[inside].sum() > _OTHER_MPS * (end - start):
            stuck |= inside
    return stuck


def _replaced(
    step_m: FloatArray,
    bad: BoolArray,
    turn_rad: FloatArray,
    dt: FloatArray,
    track_m: float,
    wheelbase_m: float,
) -> FloatArray:
    """Replace bad steps of a wheel using the other wheel and the turn; where both are bad, interpolate the speed."""
    step = step_m.copy()
    for i, sign in ((0, 1.0), (1, -1.0)):
        alone = bad[:, i] & ~bad[:, 1 - i]
        turn = turn_rad[alone]
        other, _ = rear_steps(step_m[alone, 1 - i, None], turn, wheelbase_m)
        step[alone, i] = front_steps(other[:, 0] + sign * (track_m * turn), turn, wheelbase_m)
    both = bad.all(axis=1)
    if both.any() and not both.all():
        good = np.flatnonzero(~both)
        for i in range(2):
            speed = np.interp(np.flatnonzero(both), good, step[good, i] / dt[good])
            step[both, i] = speed * dt[both]
    return step
