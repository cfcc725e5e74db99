"""What the van's GNSS, gyros and wheel counters log of an exact drive."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from linework.arrays import FloatArray
from linework.model.logs import GnssLog, GyroLog, NavigationLogs, WheelLog
from linework.navigation.lever import rotated
from linework.simulation.drive import Drive
from linework.simulation.sensors import GnssGrade, GyroGrade, SensorGrades, TiltGrade, WheelGrade


def made_logs(
    drive: Drive,
    grades: SensorGrades,
    rng: np.random.Generator,
    *,
    outages_s: Sequence[tuple[float, float]] = (),
    origin_m: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> NavigationLogs:
    """Return the logs of a drive.

    Parameters
    ----------
    outages_s
        From when to when there are no fixes, after the start of the drive.
    origin_m
        World position of the drive's local origin.
    """
    gnss = _gnss(drive, grades.gnss, np.asarray(grades.gnss_lever_m), rng)
    since = gnss.time_s - drive.time_s[0]
    there = np.ones(len(since), dtype=bool)
    for first, last in outages_s:
        there &= (since < first) | (since > last)
    gyro = None if grades.gyro is None else _gyro(drive, grades.gyro, grades.tilt, rng)
    wheels = None if grades.wheels is None else _wheels(drive, grades.wheels, grades.track_m, rng)
    return NavigationLogs(
        gnss=GnssLog(gnss.time_s[there], gnss.xyz[there] + np.asarray(origin_m), gnss.sigma_m[there]),
        gyro=gyro,
        wheels=wheels,
        tick_m=0.02 if grades.wheels is None else grades.wheels.tick_m,
        track_m=grades.track_m,
        gnss_lever_m=grades.gnss_lever_m,
    )


def attitude_deg(drive: Drive) -> FloatArray:
    """Return (n, 3) roll, pitch, heading of a drive [deg]; headings run on without jumps."""
    return np.degrees(np.stack([drive.roll_rad, drive.pitch_rad, np.pi / 2.0 - drive.yaw_rad], axis=1))


def _gnss(drive: Drive, grade: GnssGrade, lever_m: FloatArray, rng: np.random.Generator) -> GnssLog:
    """Return the fixes of the antenna, outliers among them."""
    time = _times(drive, grade.rate_hz)
    antenna = _at(time, drive.time_s, drive.xyz + rotated(attitude_deg(drive), lever_m))
    sigma = np.hypot(grade.white_m, grade.wander_m) * np.array([1.0, 1.0, grade.height_factor])
    size = np.array([1.0, 1.0, grade.height_factor])
    error = size * (
        grade.white_m * rng.normal(size=(len(time), 3))
        + grade.wander_m * _gauss_markov(len(time), 1.0 / grade.rate_hz, grade.wander_s, 3, rng)
    )
    run = max(int(3.0 * grade.rate_hz), 1)
    for start in np.flatnonzero(rng.random(len(time)) < 2.0 * grade.outlier_share / (run + 1)):
        off = rng.normal(size=3)
        off *= rng.uniform(10.0, 50.0) / np.linalg.norm(off)
        error[start : start + rng.integers(1, run + 1)] += off * sigma
    return GnssLog(time + grade.clock_offset_s, antenna + error, np.tile(sigma, (len(time), 1)))


def _gyro(drive: Drive, grade: GyroGrade, tilt: TiltGrade | None, rng: np.random.Generator) -> GyroLog:
    """Return turn rates, each the mean around its time, and tilts."""
    time, dt = _times(drive, grade.rate_hz), 1.0 / grade.rate_hz
    heading = np.interp(
        np.append(time - 0.5 * dt, time[-1] + 0.5 * dt), drive.time_s, np.pi / 2.0 - drive.yaw_rad
    )
    rate = np.diff(heading) / dt
    drift = np.radians(grade.drift_deg_h) / 3600.0
    walk = np.cumsum(rng.normal(size=len(time))) * drift * np.sqrt(dt / 3600.0)
    bias = rng.uniform(-5.0, 5.0) * drift + walk
    noise = np.radians(grade.noise_deg_sqrt_h) / 60.0 / np.sqrt(dt) * rng.normal(size=len(time))
    reading = (1.0 + grade.scale) * rate + bias + noise
    if tilt is None:
        return GyroLog(time, reading)
    exact = _at(time, drive.time_s, np.stack([drive.roll_rad, drive.pitch_rad], axis=1))
    error = tilt.noise_deg * rng.normal(size=(len(time), 2)) + tilt.wander_deg * _gauss_markov(
        len(time), dt, tilt.wander_s, 2, rng
    )
    return GyroLog(time, reading, exact + np.radians(error))


def _wheels(drive: Drive, grade: WheelGrade, track_m: float, rng: np.random.Generator) -> WheelLog:
    """Return running counts; in bends the two rear wheels run different ways."""
    time = _times(drive, grade.rate_hz)
    step = np.linalg.norm(np.diff(drive.xyz, axis=0), axis=1)
    turn = -np.diff(drive.yaw_rad)
    counts = []
    for sign, scale in ((1.0, grade.scale_left), (-1.0, grade.scale_right)):
        path = np.concatenate([[0.0], np.cumsum(step + sign * 0.5 * track_m * turn)])
        run = np.interp(time, drive.time_s, path)
        slip = np.cumsum(np.sqrt(np.abs(np.diff(run, prepend=0.0))) * rng.normal(size=len(run))) * grade.slip
        counts.append(np.floor((run + slip) / (1.0 + scale) / grade.tick_m + rng.uniform(0.0, 1.0)))
    return WheelLog(time, np.stack(counts, axis=1))


def _times(drive: Drive, rate_hz: float) -> FloatArray:
    n = int((drive.time_s[-1] - drive.time_s[0]) * rate_hz) + 1
    return np.asarray(drive.time_s[0] + np.arange(n) / rate_hz)


def _at(time_s: FloatArray, known_s: FloatArray, values: FloatArray) -> FloatArray:
    return np.stack([np.interp(time_s, known_s, column) for column in values.T], axis=1)


def _gauss_markov(n: int, dt: float, time_s: float, width: int, rng: np.random.Generator) -> FloatArray:
    """Return (n, width) of unit variance that forget themselves in `time_s`."""
    keep = np.exp(-dt / time_s)
    from scipy.signal import lfilter

    noise = rng.normal(size=(n, width)) * np.sqrt(1.0 - keep**2)
    noise[0] = rng.normal(size=width)
    return np.asarray(lfilter([1.0], [1.0, -keep], noise, axis=0))
