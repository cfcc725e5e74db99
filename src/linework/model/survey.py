"""Survey: its files and metadata; nothing is opened yet."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from linework.errors import printable


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Survey:
    """A survey as described by its survey.toml, its folder or the files themselves.

    Parameters
    ----------
    name
        Name shown to people.
    root
        Folder that relative paths start from.
    point_files
        Laser files, sorted.
    crs
        WKT2 of the (compound) CRS of everything in the survey, or "local": metres, no place on earth.
    trajectory_file
        Ready-made trajectory, or None.
    trajectory_lever_m
        Position of the described point in the vehicle frame. [m, vehicle]
    trajectory_boresight_deg
        Roll, pitch, heading of the described unit in the vehicle frame. [deg]
    settings
        Content of the survey.toml, or the equivalent of a KITTI folder, for the parts that other modules use
        (cameras, navigation, events).
    settings_file
        The survey.toml, or the calibration file in its place, for messages; None without one.
    warnings
        One line each: what was assumed because no file states it.
    carry
        Names of the further columns that points have, sorted: extra dimensions of the laser files, or their standard
        fields.
    allow_outside
        Whether files that the settings name may lie outside `root`.
    """

    name: str
    root: Path
    point_files: tuple[Path, ...]
    crs: str
    trajectory_file: Path | None = None
    trajectory_lever_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    trajectory_boresight_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)
    settings: Mapping[str, Any] = field(default_factory=dict)
    settings_file: Path | None = None
    warnings: tuple[str, ...] = ()
    carry: tuple[str, ...] = ()
    allow_outside: bool = False

    def __repr__(self) -> str:
        from linework.crs import describe_crs

        n = len(self.point_files)
        parts = [repr(self.name), f"{n} laser file{'' if n == 1 else 's'}" if n else "no laser files"]
        parts += ["trajectory"] if self.trajectory_file is not None else []
        parts += [table for table in ("cameras", "navigation") if table in self.settings]
        return printable(f"Survey({', '.join(parts)}, crs {describe_crs(self.crs)}, in {self.root})")

    @property
    def single_cameras(self) -> tuple[str, ...]:
        """Names of the cameras whose images are in no pair: "video", and "left" or "right" without the other."""
        cameras = self.settings.get("cameras")
        if not isinstance(cameras, Mapping):
            return ()
        is_pair = "left" in cameras and "right" in cameras
        names = ("video",) if is_pair else ("left", "right", "video")
        return tuple(name for name in names if name in cameras)

    @property
    def has_pairs(self) -> bool:
        """Whether stereo pairs are to be made of its images; also where a mistake in [cameras] is to be reported."""
        cameras = self.settings.get("cameras")
        return bool(cameras) and set(cameras) != set(self.single_cameras)  # type: ignore[arg-type]

    def with_trajectory(self, path: Path) -> Survey:
        """Return the survey with another trajectory file, which is of the vehicle's origin.

        Lever arm and boresight belong to the survey's own trajectory and become zero.
        """
        none = (0.0, 0.0, 0.0)
        return replace(self, trajectory_file=path, trajectory_lever_m=none, trajectory_boresight_deg=none)

    def with_cameras(self, cameras: Mapping[str, Any]) -> Survey:
        """Return the survey with the tables [cameras.left] and [cameras.right] of another calibration."""
        both = {**self.settings.get("cameras", {}), **cameras}
        return replace(self, settings={**self.settings, "cameras": both})
