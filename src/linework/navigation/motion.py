"""One motion from whatever sensors there are: gyro and wheels, either alone, or the fixes where wheels fail."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from linework.arrays import FloatArray
from linework.errors import InputError
from linework.model.logs import GnssLog, GyroLog, NavigationLogs
from linework.navigation.dead_reckoning import Motion
from linework.navigation.wheels import WheelTravel, spans_of, valid_wheel_travel

#: Speed from fixes is taken over this to either side. [s]
_SPEED_WINDOW_S = 1.0
#: Fixes that move by more than this and so many sigmas while the wheels stand are no noise. [m]
_MOVED_M, _MOVED_SIGMAS = 1.0, 5.0
#: Fixes of so long before and after a stop are looked at; of each at least so many. [s]
_AROUND_S, _LEAST_FIXES = 10.0, 4
#: Ways are not believed from so long before wheels go blind until so long after: their speed ends at about
#: 1 m/s, which takes a second to brake. [s]
_BLIND_S = 1.0
_NONE = np.zeros((0, 2))


def motion_of(logs: NavigationLogs) -> tuple[Motion, TurnRates | None, tuple[str, ...]]:
    """Return the motion that the logs show, the gyro's noise where there is one, and what was odd.

    Raises
    ------
    InputError
        No gyro and not both wheels: how the van turns between fixes is not known.
    """
    gyro, wheels = logs.gyro, logs.wheels
    if gyro is not None and len(gyro.time_s) < 2:
        raise InputError("fewer than two readings", where="gyro", advice="check the log")
    if wheels is not None and len(wheels.time_s) < 2:
        raise InputError("fewer than two readings", where="wheels", advice="check the log")
    if gyro is None and (wheels is None or wheels.ticks is None):
        raise InputError(
            "neither a gyro nor the counts of two wheels: how the van turns is not known", where="navigation",
            advice="add gyro = FILE, or wheels = FILE with left_ticks and right_ticks",
        )  # fmt: skip
    heading = None
    if gyro is not None and wheels is not None:
        step = 0.5 * np.diff(gyro.time_s) * (gyro.yaw_rate_radps[1:] + gyro.yaw_rate_radps[:-1])
        heading = np.interp(wheels.time_s, gyro.time_s, np.concatenate([[0.0], np.cumsum(step)]))
    ways = (
        _ways_of_fixes(logs.gnss)
        if wheels is None
        else valid_wheel_travel(wheels, logs.tick_m, logs.track_m, heading)
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
    """Take out stops in which the fixes move: sensors of wheels are blind when slow, counters stick."""
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
    """Return how far the fixes move while the wheels stand, 0 where that may be noise or fixes far off, in metres.

    Fixes are compared with those after the stop that are as good as at its place: bad ones do not last.
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
    """Return ways whose speed goes evenly from before a span to after it."""
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
    has_ticks = logs.wheels is not None and logs.wheels.ticks is not None
    return Motion(
        turn_time_s=np.zeros(0), turn_radps=np.zeros(0), tilt_rad=_NONE, no_turn=_NONE,
        way_time_s=ways.time_s, way_m=ways.way_m, no_way=ways.no_way, at_rest=ways.at_rest,
        wheels_apart=ways.apart, tick_m=logs.tick_m if has_ticks else 0.0, track_m=logs.track_m,
    )  # fmt: skip


def _turned_by_wheels(motion: Motion) -> Motion:
    """Return the motion with turn rates by the difference of both wheels."""
    t, step = motion.way_time_s, np.diff(motion.way_m, axis=0)
    rate = (step[:, 0] - step[:, 1]) / motion.track_m / np.diff(t)
    time = np.concatenate([t[:1], 0.5 * (t[1:] + t[:-1]), t[-1:]])
    rate = np.concatenate([rate[:1], rate, rate[-1:]])
    return replace(
        motion, turn_time_s=time, turn_radps=rate, tilt_rad=np.zeros((len(time), 2)), wheels_turn=True
    )


def _ways_of_fixes(gnss: GnssLog) -> WheelTravel:
    """Return ways by the speed between fixes; how far they are off is left to the filter all the time."""
    time = gnss.time_s
    before, after = np.maximum(time - _SPEED_WINDOW_S, time[0]), np.minimum(time + _SPEED_WINDOW_S, time[-1])
    places = [
        np.stack([np.interp(t, time, column) for column in gnss.xyz[:, :2].T], axis=1)
        for t in (before, after)
    ]
    speed = np.hypot(*(places[1] - places[0]).T) / np.maximum(after - before, 1e-3)
    way = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(time) * (speed[1:] + speed[:-1]))])
    always = np.array([[-np.inf, np.inf]])
    said = "no wheels: ways come from the fixes alone, outages of more than some seconds are not bridged well"
    return WheelTravel(time, np.stack([way, way], axis=1), always, _NONE, apart=False, warnings=(said,))


# Sound turn rates and tilts from the gyros' log, and how noisy they are

#: A pause of the log so long may hide a turn. [s]
_PAUSE_S = 0.5
#: Readings at the end of the gyro's range for so many times running are no measurement.
_SATURATED_RUN = 3
#: Tilts are smoothed over this: bodies sway at 1 to 2 Hz. [s]
_TILT_WINDOW_S = 0.25


@dataclass(frozen=True, slots=True)
class TurnRates:
    """Turn rates and tilts.

    Parameters
    ----------
    time_s, rate_radps
        (n,), clockwise.
    tilt_rad
        (n, 2) roll and pitch, smoothed; zeros without a vertical gyro.
    tilt_sigma_rad
        (2,) noise left in them.
    no_turn
        (k, 2) spans in which the turn is not known. [s]
    noise
        Angular random walk, at most: vibration counts too. [rad/sqrt(s)]
    """

    time_s: FloatArray
    rate_radps: FloatArray
    tilt_rad: FloatArray
    tilt_sigma_rad: FloatArray
    no_turn: FloatArray
    noise: float
    warnings: tuple[str, ...] = ()


def valid_turn_rates(log: GyroLog, at_rest: FloatArray) -> TurnRates:
    """Return what the gyros say.

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
    """Return spans in which the rate stays at the largest value of the log."""
    limit = np.abs(rate).max()
    # What is small is no range's end: a gyro that reads one value all the time stands still
    at_limit = (np.abs(rate) == limit) & (limit > np.radians(5.0))
    runs = spans_of(at_limit, np.arange(len(rate) + 1.0)).astype(np.int64)
    runs = runs[runs[:, 1] - runs[:, 0] >= _SATURATED_RUN]
    # From the last good reading before to the first one after
    first, last = np.maximum(runs[:, 0] - 1, 0), np.minimum(runs[:, 1], len(time) - 1)
    return np.stack([time[first], time[last]], axis=1)


def _random_walk(time: FloatArray, rate: FloatArray, at_rest: FloatArray) -> float:
    """Return the angular random walk from readings at rest, or from what is too quick for a van to turn."""
    dt = float(np.median(np.diff(time)))
    # Third differences lose what a van does; of white noise they have 20 times the variance
    quick = np.median(np.abs(np.diff(rate, 3))) / 0.6745 / np.sqrt(20.0) if len(rate) > 10 else 0.0
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
    # Between the best fibre-optic gyros and the worst that anybody would build into a van
    return float(np.clip(min(found), np.radians(0.02) / 60.0, np.radians(5.0) / 60.0))


def _smoothed(time: FloatArray, tilt: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return tilts smoothed by parabolas over a quarter of a second, and the noise left in them."""
    from scipy.signal import savgol_filter

    dt = float(np.median(np.diff(time)))
    noise = np.median(np.abs(np.diff(tilt, 3, axis=0)), axis=0) / 0.6745 / np.sqrt(20.0)
    width = 2 * int(0.5 * _TILT_WINDOW_S / dt) + 1
    if width < 5 or len(time) < width:
        return tilt, noise
    # The middle of a parabola through n values has 9 / (4 n) of their variance
    return np.asarray(savgol_filter(tilt, width, 2, axis=0)), noise * np.sqrt(9.0 / (4.0 * width))
