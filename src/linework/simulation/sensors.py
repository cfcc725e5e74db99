"""Grades of navigation sensors: how well receivers, gyros and wheel counters measure."""

from __future__ import annotations

from dataclasses import dataclass, field


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
    """

    gnss: GnssGrade
    gyro: GyroGrade | None
    tilt: TiltGrade | None = field(default_factory=TiltGrade)
    wheels: WheelGrade | None = field(default_factory=WheelGrade)
    gnss_lever_m: tuple[float, float, float] = (0.6, -0.2, 1.9)
    track_m: float = 1.5


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
