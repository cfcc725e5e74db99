"""What the van's navigation sensors logged: GNSS fixes, gyros, wheel counters."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from linework.arrays import AnyArray, FloatArray, checked


def _check_times(name: str, time_s: FloatArray) -> None:
    if len(time_s) and np.any(np.diff(time_s) <= 0):
        raise ValueError(f"{name}: times must be strictly increasing")


@dataclass(frozen=True, slots=True)
class GnssLog:
    """Fixes of the antenna.

    Parameters
    ----------
    time_s
        (n,) float64 [s], strictly increasing.
    xyz
        (n, 3) float64 [m, world].
    sigma_m
        (n, 3) float64 [m]: east, north, up, as the receiver says.
    """

    time_s: FloatArray
    xyz: FloatArray
    sigma_m: FloatArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "time_s", checked("time_s", self.time_s, np.float64, (None,)))
        for name in ("xyz", "sigma_m"):
            value = checked(name, getattr(self, name), np.float64, (len(self.time_s), 3))
            object.__setattr__(self, name, value)
        _check_times("GNSS", self.time_s)


@dataclass(frozen=True, slots=True)
class GyroLog:
    """The directional gyro, and the vertical gyro where there is one.

    Parameters
    ----------
    time_s
        (n,) float64 [s], strictly increasing.
    yaw_rate_radps
        (n,) float64 [rad/s]: positive clockwise seen from above, as headings grow.
    roll_pitch_rad
        (n, 2) float64 [rad]: right side down, nose up positive; or None.
    """

    time_s: FloatArray
    yaw_rate_radps: FloatArray
    roll_pitch_rad: FloatArray | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "time_s", checked("time_s", self.time_s, np.float64, (None,)))
        n = len(self.time_s)
        rate = checked("yaw_rate_radps", self.yaw_rate_radps, np.float64, (n,))
        object.__setattr__(self, "yaw_rate_radps", rate)
        if self.roll_pitch_rad is not None:
            tilt = checked("roll_pitch_rad", self.roll_pitch_rad, np.float64, (n, 2))
            object.__setattr__(self, "roll_pitch_rad", tilt)
        _check_times("gyro", self.time_s)


@dataclass(frozen=True, slots=True)
class WheelLog:
    """Running counts of the two counted wheels, or the speed.

    Parameters
    ----------
    time_s
        (n,) float64 [s], strictly increasing.
    ticks
        (n, 2) float64: running counts left and right, unwrapped; or None.
    speed_mps
        (n,) float64 [m/s]; or None. One of the two is given.
    """

    time_s: FloatArray
    ticks: FloatArray | None = None
    speed_mps: FloatArray | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "time_s", checked("time_s", self.time_s, np.float64, (None,)))
        n = len(self.time_s)
        if (self.ticks is None) == (self.speed_mps is None):
            raise ValueError("wheels: either ticks or speed_mps")
        if self.ticks is not None:
            object.__setattr__(self, "ticks", checked("ticks", self.ticks, np.float64, (n, 2)))
        if self.speed_mps is not None:
            speed = checked("speed_mps", self.speed_mps, np.float64, (n,))
            object.__setattr__(self, "speed_mps", speed)
        _check_times("wheels", self.time_s)


@dataclass(frozen=True, slots=True, kw_only=True)
class NavigationLogs:
    """All logs of a drive, and what is known of the vehicle.

    Parameters
    ----------
    tick_m
        Nominal travel of one wheel count. [m]
    track_m
        Between the two counted wheels. [m]
    gnss_lever_m
        Antenna in the vehicle frame. [m]
    """

    gnss: GnssLog
    gyro: GyroLog | None = None
    wheels: WheelLog | None = None
    tick_m: float = 0.02
    track_m: float = 1.5
    gnss_lever_m: tuple[float, float, float] = (0.0, 0.0, 0.0)


# The van's log: where each image was taken and where each key was pressed


@dataclass(frozen=True, slots=True, kw_only=True)
class LoggedPlaces:
    """n moments of a drive and where the van was at each, in time order.

    Parameters
    ----------
    time_s
        (n,) float64 [s].
    xyz
        (n, 3) float64 [m, world].
    heading_deg
        (n,) float64 [deg]: of the vehicle, clockwise from grid north.
    chainage_m
        (n,) float64 [m]: distance driven since the trajectory began.
    """

    time_s: FloatArray
    xyz: FloatArray
    heading_deg: FloatArray
    chainage_m: FloatArray

    def __post_init__(self) -> None:
        n = len(self.time_s)
        for name, shape in (("time_s", (n,)), ("xyz", (n, 3)), ("heading_deg", (n,)), ("chainage_m", (n,))):
            object.__setattr__(self, name, checked(name, getattr(self, name), np.float64, shape))

    def __len__(self) -> int:
        return len(self.time_s)

    @classmethod
    def empty(cls) -> LoggedPlaces:
        """Return no places."""
        none = np.zeros(0)
        return cls(time_s=none, xyz=np.zeros((0, 3)), heading_deg=none, chainage_m=none)


@dataclass(frozen=True, slots=True, kw_only=True)
class Photos:
    """Stereo pairs and where they were taken: the projection centre of the left camera.

    Parameters
    ----------
    number
        (n,) int64: of each pair (`ImagePair.number`).
    left, right
        The files.
    """

    places: LoggedPlaces = field(default_factory=LoggedPlaces.empty)
    number: AnyArray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    left: tuple[Path, ...] = ()
    right: tuple[Path, ...] = ()

    def __len__(self) -> int:
        return len(self.places)


@dataclass(frozen=True, slots=True, kw_only=True)
class Events:
    """Keys that the operator pressed, with a note, and where the vehicle's origin was."""

    places: LoggedPlaces = field(default_factory=LoggedPlaces.empty)
    key: tuple[str, ...] = ()
    note: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.places)


@dataclass(frozen=True, slots=True, kw_only=True)
class VanLog:
    """All that a drive logged by place.

    Parameters
    ----------
    photos, events
        None where the survey has none; empty where none could be placed.
    root
        Folder of the survey: files are named from there.
    crs
        WKT2 of the places, or "local".
    warnings
        One line each: what could not be placed.
    """

    photos: Photos | None
    events: Events | None
    root: Path
    crs: str
    warnings: tuple[str, ...] = ()
