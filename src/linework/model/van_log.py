"""The van's log: where each image was taken and where each key was pressed."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from linework.arrays import AnyArray, FloatArray, checked


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
