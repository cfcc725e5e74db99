"""Sound turn rates and tilts from the gyros' log, and how noisy they are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from linework.arrays import FloatArray
from linework.model.logs import GyroLog
from linework.navigation.wheels import spans_of

#: A pause of the log so long may hide a turn. [s]
_PAUSE_S = 0.5
#: Readings at the end of the gyro's range for so many times running are no measurement.
_SATURATED_RUN = 3
#: Tilts are smoothed over this: bodies sway at 1 to 2 Hz. [s]
_TILT_WINDOW_S = 0.25


@dataclass(frozen=True, slots=True)
class Turns:
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


def sound_turns(log: GyroLog, at_rest: FloatArray) -> Turns:
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
    return Turns(
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
