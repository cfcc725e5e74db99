"""What the van's GNSS, gyros and wheel counters log of an exact drive."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from linework.arrays import FloatArray
from linework.model.logs import GnssLog, GyroLog, NavigationLogs, WheelLog
from linework.navigation.lever import rotated
from linework.simulation.sensors.drive import Drive


def simulate_logs(
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
    wheels = None if grades.wheels is None else _wheels(drive, grades.wheels, grades, rng)
    return NavigationLogs(
        gnss=GnssLog(gnss.time_s[there], gnss.xyz[there] + np.asarray(origin_m), gnss.sigma_m[there]),
        gyro=gyro,
        wheels=wheels,
        tick_m=0.02 if grades.wheels is None else grades.wheels.tick_m,
        track_m=grades.track_m,
        wheelbase_m=grades.wheelbase_m if grades.counts_front else 0.0,
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


def _wheels(drive: Drive, grade: WheelGrade, van: SensorGrades, rng: np.random.Generator) -> WheelLog:
    """Return running counts; in bends the two wheels run different ways, and those in front the longer ones."""
    time = _times(drive, grade.rate_hz)
    step = np.linalg.norm(np.diff(drive.xyz, axis=0), axis=1)
    turn = -np.diff(drive.yaw_rad)
    counts = []
    for sign, scale in ((1.0, grade.scale_left), (-1.0, grade.scale_right)):
        own = step + sign * 0.5 * van.track_m * turn
        if van.counts_front:
            own = np.hypot(own, van.wheelbase_m * turn)
        path = np.concatenate([[0.0], np.cumsum(own)])
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


# Grades of navigation sensors: how well receivers, gyros and wheel counters measure


@dataclass(frozen=True, slots=True, kw_only=True)
class GnssGrade:
    """A receiver.

    Parameters
    ----------
    white_m, wander_m
        Standard deviations in plan of what changes from fix to fix, and of what wanders; heights are
        `height_factor` times worse. The receiver says the root of the sum of squares.
    wander_s
        Time in which the wandering part forgets itself.
    rate_hz
        Fixes per second.
    outlier_share
        Share of fixes that are off by 10 to 50 sigmas, in runs of up to 3 s.
    clock_offset_s
        How much later than true its stamps are.
    """

    white_m: float
    wander_m: float
    wander_s: float
    rate_hz: float = 5.0
    height_factor: float = 1.7
    outlier_share: float = 0.01
    clock_offset_s: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class GyroGrade:
    """A directional gyro.

    Parameters
    ----------
    drift_deg_h
        What its bias wanders by in an hour; what it starts with is up to some times of it. [deg/h]
    noise_deg_sqrt_h
        Angular random walk. [deg/sqrt(h)]
    scale
        Reads (1 + scale) times the turn rate.
    """

    drift_deg_h: float
    noise_deg_sqrt_h: float
    scale: float = 0.0
    rate_hz: float = 50.0


@dataclass(frozen=True, slots=True, kw_only=True)
class TiltGrade:
    """A vertical gyro: noise per reading, and an error that wanders, in degrees."""

    noise_deg: float = 0.1
    wander_deg: float = 0.3
    wander_s: float = 200.0


@dataclass(frozen=True, slots=True, kw_only=True)
class WheelGrade:
    """Wheel counters: a count per `tick_m` of nominal travel.

    Parameters
    ----------
    scale_left, scale_right
        A wheel travels (1 + scale) times what its counts say.
    slip
        Random walk of the distance: sigma after one metre. [m]
    """

    scale_left: float = 0.0
    scale_right: float = 0.0
    slip: float = 0.003
    tick_m: float = 0.02
    rate_hz: float = 20.0


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorGrades:
    """All sensors of a van and where they are; None: it has none of these.

    Parameters
    ----------
    gnss_lever_m
        Antenna in the vehicle frame.
    track_m
        Between the two counted wheels.
    counts_front, wheelbase_m
        Whether the two front wheels are counted, and how far these are ahead of the rear axle. [m]
    """

    gnss: GnssGrade
    gyro: GyroGrade | None
    tilt: TiltGrade | None = field(default_factory=TiltGrade)
    wheels: WheelGrade | None = field(default_factory=WheelGrade)
    gnss_lever_m: tuple[float, float, float] = (0.6, -0.2, 1.9)
    track_m: float = 1.5
    counts_front: bool = False
    wheelbase_m: float = 3.0


#: Phase measurements to a base station: 2 cm. Half of it multipath and air that change in half a minute.
GNSS_2_CM = GnssGrade(white_m=0.013, wander_m=0.015, wander_s=30.0)
#: Code measurements with corrections: 1 m, nearly all of it slow.
GNSS_1_M = GnssGrade(white_m=0.2, wander_m=0.98, wander_s=150.0, rate_hz=1.0)
#: Directional gyros from the best to the worst that vans carry.
GYROS = (
    GyroGrade(drift_deg_h=1.0, noise_deg_sqrt_h=0.1, scale=0.0003),
    GyroGrade(drift_deg_h=3.0, noise_deg_sqrt_h=0.2, scale=-0.001),
    GyroGrade(drift_deg_h=10.0, noise_deg_sqrt_h=0.5, scale=0.003),
    GyroGrade(drift_deg_h=30.0, noise_deg_sqrt_h=1.0, scale=-0.008),
)
