"""Logs of a drive: GNSS fixes, gyros, wheel counters; photos and events with their places."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from linework.arrays import AnyArray, FloatArray
from linework.model.columns import Columns, column, optional_column


def _check_times(name: str, time_s: FloatArray) -> None:
    if len(time_s) and np.any(np.diff(time_s) <= 0):
        raise ValueError(f"{name}: times must be strictly increasing")


#: Kinds of fixes, in the order of RTKLIB's quality flag Q: carrier phases with whole and with float ambiguities,
#: corrections by satellite, by a base, none, precise point positioning; "estimated" is not measured.
FIX_QUALITIES = ("unknown", "fixed", "float", "sbas", "differential", "single", "ppp", "estimated")


@dataclass(frozen=True, slots=True)
class GnssLog(Columns):
    """Fixes of the antenna.

    Parameters
    ----------
    time_s
        (n,) float64 [s], strictly increasing.
    xyz
        (n, 3) float64 [m, world].
    sigma_m
        (n, 3) float64 [m]: east, north, up, as the receiver states them.
    quality
        (n,) int64: kind of each fix, a position in ``FIX_QUALITIES``; None where the log does not state it.
    """

    time_s: FloatArray = column()
    xyz: FloatArray = column(np.float64, 3)
    sigma_m: FloatArray = column(np.float64, 3)
    quality: AnyArray | None = optional_column(np.int64)

    def __post_init__(self) -> None:
        Columns.__post_init__(self)
        _check_times("GNSS", self.time_s)


@dataclass(frozen=True, slots=True)
class GyroLog(Columns):
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

    time_s: FloatArray = column()
    yaw_rate_radps: FloatArray = column()
    roll_pitch_rad: FloatArray | None = optional_column(np.float64, 2)

    def __post_init__(self) -> None:
        Columns.__post_init__(self)
        _check_times("gyro", self.time_s)


@dataclass(frozen=True, slots=True)
class WheelLog(Columns):
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

    time_s: FloatArray = column()
    ticks: FloatArray | None = optional_column(np.float64, 2)
    speed_mps: FloatArray | None = optional_column()

    def __post_init__(self) -> None:
        Columns.__post_init__(self)
        if (self.ticks is None) == (self.speed_mps is None):
            raise ValueError("wheels: expected either ticks or speed_mps")
        _check_times("wheels", self.time_s)


@dataclass(frozen=True, slots=True, kw_only=True)
class NavigationLogs:
    """All navigation logs of a drive, and the vehicle's measures.

    Parameters
    ----------
    tick_m
        Nominal travel of one wheel count. [m]
    track_m
        Between the two counted wheels. [m]
    wheelbase_m
        From the rear axle to the counted wheels, where these are the two front wheels [m]; 0: the rear wheels are
        counted.
    gnss_lever_m
        Antenna in the vehicle frame. [m]
    """

    gnss: GnssLog
    gyro: GyroLog | None = None
    wheels: WheelLog | None = None
    tick_m: float = 0.02
    track_m: float = 1.5
    wheelbase_m: float = 0.0
    gnss_lever_m: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class LoggedPlaces(Columns):
    """n moments of a drive with the van's position at each, in time order.

    Parameters
    ----------
    time_s
        (n,) float64 [s].
    xyz
        (n, 3) float64 [m, world].
    heading_deg
        (n,) float64 [deg]: of the vehicle, clockwise from grid north.
    chainage_m
        (n,) float64 [m]: distance driven from the start of the trajectory.
    """

    time_s: FloatArray = column()
    xyz: FloatArray = column(np.float64, 3)
    heading_deg: FloatArray = column()
    chainage_m: FloatArray = column()


@dataclass(frozen=True, slots=True, kw_only=True)
class Photos:
    """Images and their places, in time order: stereo pairs, and images of cameras without a partner.

    Parameters
    ----------
    places
        Projection centres; of a pair that of the left camera.
    number
        (n,) int64: of each pair (`ImagePair.number`), or of each image of a camera, from 0.
    left, right
        The files of the pairs; of a camera without a partner its image, and None.
    camera
        The camera without a partner that took each, "" for a pair.
    """

    places: LoggedPlaces = field(default_factory=LoggedPlaces.empty)
    number: AnyArray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    left: tuple[Path, ...] = ()
    right: tuple[Path | None, ...] = ()
    camera: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.places)


@dataclass(frozen=True, slots=True, kw_only=True)
class Events:
    """Keys that the operator pressed, with a note, and the vehicle's position then.

    Parameters
    ----------
    span
        "begin" and "end" of the presses that begin and end a stretch, "" of others; empty where no press does.
    """

    places: LoggedPlaces = field(default_factory=LoggedPlaces.empty)
    key: tuple[str, ...] = ()
    note: tuple[str, ...] = ()
    span: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.places)


@dataclass(frozen=True, slots=True, kw_only=True)
class VanLog:
    """Photos and events of a drive with their places.

    Parameters
    ----------
    photos, events
        None where the survey has none; empty where none could be placed.
    root
        Folder of the survey; file names are relative to it.
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
