"""Motion of the van from its sensors: gyro and wheels, either alone, or the fixes where wheels fail.

Separate from `locate`, which positions a drive: this turns the logs of any combination of sensors into distances and
turns.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from linework.arrays import FloatArray
from linework.errors import InputError
from linework.model.logs import GnssLog, GyroLog, NavigationLogs
from linework.navigation.dead_reckoning import Motion
from linework.navigation.front_wheels import turns_of_wheels
from linework.navigation.wheels import WheelTravel, spans_of, valid_wheel_travel

#: Time to either side over which the speed of fixes is taken. [s]
_SPEED_WINDOW_S = 1.0
#: Movement of fixes while the wheels stand that is not noise: more than this [m], plus this many sigmas.
_MOVED_M, _MOVED_SIGMAS = 1.0, 5.0
#: Time before and after a stop whose fixes are used [s], and fewest fixes of each.
_AROUND_S, _LEAST_FIXES = 10.0, 4
#: Margin about a time in which wheels report no speed: they do so below about 1 m/s, which takes a second to brake. [s]
_BLIND_S = 1.0
_NONE = np.zeros((0, 2))


def motion_of(logs: NavigationLogs) -> tuple[Motion, TurnRates | None, tuple[str, ...]]:
    """Return the motion of the logs, the turn rates of a gyro with their noise, and warnings.

    Raises
    ------
    InputError
        When there is neither a gyro nor the counts of two wheels, so that turns between fixes are not known.
    """
    gyro, wheels = logs.gyro, logs.wheels
    if gyro is not None and len(gyro.time_s) < 2:
        raise InputError("fewer than two readings", where="gyro", advice="check the log")
    if wheels is not None and len(wheels.time_s) < 2:
        raise InputError("fewer than two readings", where="wheels", advice="check the log")
    if gyro is None and (wheels is None or wheels.ticks is None):
        raise InputError(
            "neither a gyro nor the counts of two wheels: turns of the van are not known", where="navigation",
            advice="add gyro = FILE, or wheels = FILE with left_ticks and right_ticks",
        )  # fmt: skip
    heading = None
    if gyro is not None and wheels is not None:
        step = 0.5 * np.diff(gyro.time_s) * (gyro.yaw_rate_radps[1:] + gyro.yaw_rate_radps[:-1])
        heading = np.interp(wheels.time_s, gyro.time_s, np.concatenate([[0.0], np.cumsum(step)]))
    ways = (
        _ways_of_fixes(logs.gnss)
        if wheels is None
        else valid_wheel_travel(wheels, logs.tick_m, logs.track_m, heading, wheelbase_m=logs.wheelbase_m)
    )
    ways = _really_standing(ways, logs.gnss)
    motion = _with_ways(ways, logs)
    if gyro is None:
        return _turned_by_wheels(motion), None, ways.warnings
    turns = valid_turn_rates(gyro, ways.at_rest)
    motion = replace(
        motion, turn_time_s=turns.time_s, turn_radps=turns.rate_radps, tilt_rad=turns.tilt_rad,
        no_turn=turns.no_turn,
    )  # fmt: skip
    return motion, turns, (*ways.warnings, *turns.warnings)


def _really_standing(ways: WheelTravel, gnss: GnssLog) -> WheelTravel:
    """Remove stops in which the fixes move: wheel sensors report nothing at low speed, counters stick."""
    standing, moving, said = [], [], []
    for start, end in ways.at_rest:
        moved = _moved(ways, gnss, float(start), float(end))
        if moved == 0.0:
            standing.append((start, end))
            continue
        moving.append((start - _BLIND_S, end + _BLIND_S))
        said.append(f"wheels: they stand still from {start:.1f} to {end:.1f} s while GNSS moves by "
                    f"{moved:.1f} m: not taken for a stop")  # fmt: skip
    no_way = np.concatenate([ways.no_way, np.reshape(moving, (-1, 2))])
    return replace(
        ways, way_m=_bridged(ways.time_s, ways.way_m, np.reshape(moving, (-1, 2))),
        at_rest=np.reshape(standing, (-1, 2)), no_way=no_way[np.argsort(no_way[:, 0], kind="stable")],
        warnings=(*ways.warnings, *said),
    )  # fmt: skip


def _moved(ways: WheelTravel, gnss: GnssLog, start_s: float, end_s: float) -> float:
    """Return the movement of the fixes while the wheels stand [m]; 0 where that may be noise or outliers.

    The fixes at the start of a stop are compared with those after it: outliers do not last.
    """
    third = (end_s - start_s) / 3.0
    near = np.flatnonzero((gnss.time_s > start_s - _AROUND_S) & (gnss.time_s < end_s + _AROUND_S))
    time, xy = gnss.time_s[near], gnss.xyz[near, :2]
    way = np.interp(time, ways.time_s, ways.way_m.mean(axis=1))
    at_start, at_end = np.interp([start_s, end_s], ways.time_s, ways.way_m.mean(axis=1))
    least = _MOVED_M + _MOVED_SIGMAS * float(np.median(gnss.sigma_m[near, :2])) if len(near) else np.inf
    before = (time < start_s + third) & (np.abs(way - at_start) < 0.25 * least)
    after = (time > end_s - third) & (np.abs(way - at_end) < 0.25 * least)
    if min(np.count_nonzero(time[before] < start_s), np.count_nonzero(time[after] > end_s)) == 0:
        return 0.0
    if min(np.count_nonzero(before), np.count_nonzero(after)) < _LEAST_FIXES:
        return 0.0
    moved = float(np.hypot(*(np.median(xy[after], axis=0) - np.median(xy[before], axis=0))))
    return moved if moved > least else 0.0


def _bridged(time_s: FloatArray, way_m: FloatArray, spans: FloatArray) -> FloatArray:
    """Return distances (n, 2) whose speed is interpolated linearly over spans (k, 2)."""
    speed = np.diff(way_m, axis=0) / np.diff(time_s)[:, None]
    middle = 0.5 * (time_s[1:] + time_s[:-1])
    blind = np.zeros(len(middle), dtype=bool)
    for start, end in spans:
        blind |= (middle >= start) & (middle <= end)
    if not blind.any() or blind.all():
        return way_m
    for i in range(2):
        speed[blind, i] = np.interp(middle[blind], middle[~blind], speed[~blind, i])
    return np.concatenate([way_m[:1], way_m[0] + np.cumsum(speed * np.diff(time_s)[:, None], axis=0)])


def _with_ways(ways: WheelTravel, logs: NavigationLogs) -> Motion:
    """Return a motion with distances, without turn rates."""
    has_ticks = logs.wheels is not None and logs.wheels.ticks is not None
    return Motion(
        turn_time_s=np.zeros(0), turn_radps=np.zeros(0), tilt_rad=_NONE, no_turn=_NONE,
        way_time_s=ways.time_s, way_m=ways.way_m, no_way=ways.no_way, at_rest=ways.at_rest,
        wheels_apart=ways.apart, tick_m=logs.tick_m if has_ticks else 0.0, track_m=logs.track_m,
        wheelbase_m=0.0 if logs.wheels is None else logs.wheelbase_m,
    )  # fmt: skip


def _turned_by_wheels(motion: Motion) -> Motion:
    """Return the motion with turn rates from the difference of both wheels."""
    t, step = motion.way_time_s, np.diff(motion.way_m, axis=0)
    rate = turns_of_wheels(step, motion.track_m, motion.wheelbase_m) / np.diff(t)
    time = np.concatenate([t[:1], 0.5 * (t[1:] + t[:-1]), t[-1:]])
    rate = np.concatenate([rate[:1], rate, rate[-1:]])
    return replace(
        motion, turn_time_s=time, turn_radps=rate, tilt_rad=np.zeros((len(time), 2)), wheels_turn=True
    )


def _ways_of_fixes(gnss: GnssLog) -> WheelTravel:
    """Return distances from the speed between fixes; the filter estimates their error throughout."""
    time = gnss.time_s
    before, after = np.maximum(time - _SPEED_WINDOW_S, time[0]), np.minimum(time + _SPEED_WINDOW_S, time[-1])
    places = [
        np.stack([np.interp(t, time, column) for column in gnss.xyz[:, :2].T], axis=1)
        for t in (before, after)
    ]
    speed = np.hypot(*(places[1] - places[0]).T) / np.maximum(after - before, 1e-3)
    way = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(time) * (speed[1:] + speed[:-1]))])
    always = np.array([[-np.inf, np.inf]])
    said = "no wheels: distances come from the fixes alone, outages of more than a few seconds are not bridged well"
    return WheelTravel(time, np.stack([way, way], axis=1), always, _NONE, apart=False, warnings=(said,))


# Valid turn rates and tilts from the log of the gyros, and their noise

#: Pause of the log that may hide a turn. [s]
_PAUSE_S = 0.5
#: Consecutive readings at the end of the gyro's range from which it is saturated.
_SATURATED_RUN = 3
#: Window over which tilts are smoothed: bodies sway at 1 to 2 Hz. [s]
_TILT_WINDOW_S = 0.25
#: Turn rate below which a constant reading is a standing gyro, not the end of its range. [rad/s]
_LEAST_RANGE_RADPS = np.radians(5.0)
#: Median absolute deviation of Gaussian noise over its standard deviation.
_MAD = 0.6745
#: Variance of the third differences of white noise, in its own.
_THIRD_DIFFERENCES = 20.0
#: Range of angular random walks: from the best fibre-optic gyros to the worst built into vans. [rad/sqrt(s)]
_LEAST_WALK, _MOST_WALK = np.radians(0.02) / 60.0, np.radians(5.0) / 60.0


@dataclass(frozen=True, slots=True)
class TurnRates:
    """Valid turn rates and tilts of the gyros.

    Parameters
    ----------
    time_s, rate_radps
        (n,) times [s] and turn rates, clockwise [rad/s].
    tilt_rad
        (n, 2) roll and pitch, smoothed; zeros without a vertical gyro. [rad]
    tilt_sigma_rad
        (2,) remaining noise of them. [rad]
    no_turn
        (k, 2) spans in which the turn is not known. [s]
    noise
        Upper bound of the angular random walk: vibration is included. [rad/sqrt(s)]
    """

    time_s: FloatArray
    rate_radps: FloatArray
    tilt_rad: FloatArray
    tilt_sigma_rad: FloatArray
    no_turn: FloatArray
    noise: float
    warnings: tuple[str, ...] = ()


def valid_turn_rates(log: GyroLog, at_rest: FloatArray) -> TurnRates:
    """Return the valid turn rates and tilts of a log.

    Parameters
    ----------
    at_rest
        (k, 2) spans in which the van stands. [s]
    """
    time, rate, warnings = log.time_s, log.yaw_rate_radps, []
    pauses = spans_of(np.diff(time) > max(_PAUSE_S, 5.0 * float(np.median(np.diff(time)))), time)
    saturated = _saturated(time, rate)
    for start, end in saturated[:5]:
        warnings.append(
            f"gyro: saturated at {np.degrees(np.abs(rate).max()):.1f} deg/s from {start:.2f} to {end:.2f} s"
        )
    tilt, sigma = np.zeros((len(time), 2)), np.zeros(2)
    if log.roll_pitch_rad is not None:
        tilt, sigma = _smoothed(time, log.roll_pitch_rad)
    no_turn = np.concatenate([pauses, saturated])
    return TurnRates(
        time, rate, tilt, sigma, no_turn[np.argsort(no_turn[:, 0], kind="stable")],
        _random_walk(time, rate, at_rest), tuple(warnings),
    )  # fmt: skip


def _saturated(time: FloatArray, rate: FloatArray) -> FloatArray:
    """Return the spans (k, 2) in which the rate stays at the largest value of the log. [s]."""
    limit = np.abs(rate).max()
    # A small limit is not the end of a range: the van stands
    at_limit = (np.abs(rate) == limit) & (limit > _LEAST_RANGE_RADPS)
    runs = spans_of(at_limit, np.arange(len(rate) + 1.0)).astype(np.int64)
    runs = runs[runs[:, 1] - runs[:, 0] >= _SATURATED_RUN]
    # From the last valid reading before to the first one after
    first, last = np.maximum(runs[:, 0] - 1, 0), np.minimum(runs[:, 1], len(time) - 1)
    return np.stack([time[first], time[last]], axis=1)


def _random_walk(time: FloatArray, rate: FloatArray, at_rest: FloatArray) -> float:
    """Return the angular random walk from readings at rest, or from changes too fast for a van. [rad/sqrt(s)]."""
    dt = float(np.median(np.diff(time)))
    # Third differences remove the motion of a van; of white noise they have 20 times the variance
    quick = (
        np.median(np.abs(np.diff(rate, 3))) / _MAD / np.sqrt(_THIRD_DIFFERENCES) if len(rate) > 10 else 0.0
    )
    found = [quick * np.sqrt(dt)]
    bin_s = max(0.5, 2.0 * dt)
    means = []
    for start, end in at_rest:
        inside = rate[(time >= start) & (time <= end)]
        per_bin = max(round(bin_s / dt), 1)
        n = len(inside) // per_bin
        means.append(np.diff(inside[: n * per_bin].reshape(n, per_bin).mean(axis=1)))
    change = np.concatenate(means) if means else np.zeros(0)
    if len(change) >= 10:
        found.append(float(np.sqrt(0.5 * np.mean(change**2) * bin_s)))
    return float(np.clip(min(found), _LEAST_WALK, _MOST_WALK))


def _smoothed(time: FloatArray, tilt: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return tilts (n, 2) smoothed by parabolas over a quarter of a second, and their remaining noise (2,) [rad]."""
    from scipy.signal import savgol_filter

    dt = float(np.median(np.diff(time)))
    noise = np.median(np.abs(np.diff(tilt, 3, axis=0)), axis=0) / _MAD / np.sqrt(_THIRD_DIFFERENCES)
    width = 2 * int(0.5 * _TILT_WINDOW_S / dt) + 1
    if width < 5 or len(time) < width:
        return tilt, noise
    # The centre of a parabola through n values has 9 / (4 n) of their variance
    return np.asarray(savgol_filter(tilt, width, 2, axis=0)), noise * np.sqrt(9.0 / (4.0 * width))
