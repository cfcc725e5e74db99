"""What a survey's van recorded beside points, in numbers: cameras and pairs, navigation logs, keys."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from linework.arrays import FloatArray
from linework.errors import LineworkError
from linework.files.events import read_events
from linework.files.navigation_logs import read_navigation_logs
from linework.files.pair_check import check_pairs
from linework.files.stereo_series import open_stereo
from linework.files.van_path import VanPath, read_van_path
from linework.imaging.rectify import rectifier_of
from linework.model.camera import Camera
from linework.model.images import StereoSeries
from linework.model.survey import Survey
from linework.model.trajectory import Trajectory

_T = TypeVar("_T")


@dataclass(slots=True)
class VanRecordings:
    """What was found; a part that cannot be used keeps no other from being told.

    Parameters
    ----------
    cameras
        As a document for people and JSON; None without cameras.
    logs
        Likewise, by name: gnss, gyro, wheels, events.
    trajectory
        Path of the vehicle's origin, or None.
    warnings, failures
        One line each, and with the part's name.
    """

    cameras: dict[str, Any] | None = None
    logs: dict[str, dict[str, Any]] = field(default_factory=dict)
    trajectory: Trajectory | None = None
    warnings: list[str] = field(default_factory=list)
    failures: list[dict[str, str]] = field(default_factory=list)

    def tried(self, part: str, read: Callable[[], _T]) -> _T | None:
        """Return what `read` gives, or None where the part cannot be used, which is then told."""
        try:
            return read()
        except LineworkError as error:
            self.failures.append({"part": part, "problem": str(error)})
            return None


def describe_van(survey: Survey, *, with_path: bool) -> VanRecordings:
    """Describe cameras, pairs and logs; a few pairs are looked at, whether they are pairs.

    Parameters
    ----------
    with_path
        Whether to read the survey's trajectory, too.
    """
    found = VanRecordings(warnings=list(survey.warnings))
    series = found.tried("cameras", lambda: open_stereo(survey))
    if with_path:
        path = found.tried("trajectory", lambda: read_van_path(survey, series)) or VanPath(None, series)
        found.trajectory, series = path.trajectory, path.series
        found.warnings += path.warnings
    if series is not None:
        _add_cameras(series, survey.name, found)
    if "gnss" in survey.settings.get("navigation", {}):
        _add_logs(survey, found)
    if "file" in survey.settings.get("events", {}):
        file = survey.settings["events"]["file"]
        events = found.tried(file, lambda: read_events(survey.root / file))
        if events is not None:
            found.logs["events"] = _log(file, events.time_s)
            found.warnings += events.warnings
    return found


def _add_cameras(series: StereoSeries, name: str, found: VanRecordings) -> None:
    found.cameras = _cameras(series)
    found.warnings += series.warnings
    check = found.tried("cameras", lambda: check_pairs(series, rectifier_of(series.rig), where=name))
    if check is not None:
        found.warnings += check.warnings
        found.cameras["row_error_px"] = _rounded(check.error_px, 2)


def _cameras(series: StereoSeries) -> dict[str, Any]:
    times = np.array([pair.time_s for pair in series.pairs])
    steps = np.diff(times)
    base = series.rig.right.position_m - series.rig.left.position_m
    return {
        "left": _camera(series.rig.left, series.pairs[0].left),
        "right": _camera(series.rig.right, series.pairs[0].right),
        "base_m": round(float(np.linalg.norm(base)), 4),
        "pairs": len(times),
        "unpaired_images": len(series.unpaired),
        "start_s": float(times[0]),
        "end_s": float(times[-1]),
        "rate_hz": _rounded(1.0 / float(np.median(steps)), 3) if len(steps) else None,
        "longest_pause_s": _rounded(float(steps.max()), 3) if len(steps) else None,
        "row_error_px": None,
    }


def _camera(camera: Camera, first: Path) -> dict[str, Any]:
    return {
        "width": camera.width,
        "height": camera.height,
        "focal_px": round(camera.fx, 3),
        "is_distorted": any(camera.distortion),
        "position_m": np.round(camera.position_m, 4).tolist(),
        "first_image": str(first),
    }


def _add_logs(survey: Survey, found: VanRecordings) -> None:
    named = survey.settings["navigation"]
    content = found.tried("navigation", lambda: read_navigation_logs(survey))
    if content is None:
        return
    found.warnings += content.warnings
    for name, log in (
        ("gnss", content.logs.gnss),
        ("gyro", content.logs.gyro),
        ("wheels", content.logs.wheels),
    ):
        if log is not None:
            found.logs[name] = _log(named[name], log.time_s)


def _log(file: str, time_s: FloatArray) -> dict[str, Any]:
    steps = np.diff(time_s)
    return {
        "file": file,
        "rows": len(time_s),
        "start_s": float(time_s[0]) if len(time_s) else None,
        "end_s": float(time_s[-1]) if len(time_s) else None,
        "rate_hz": _rounded(1.0 / float(np.median(steps)), 3)
        if len(steps) and np.median(steps) > 0
        else None,
        "longest_pause_s": _rounded(float(steps.max()), 3) if len(steps) else None,
    }


def _rounded(value: float, digits: int) -> float | None:
    """Return a number for JSON, which has no NaN."""
    return round(value, digits) if np.isfinite(value) else None
