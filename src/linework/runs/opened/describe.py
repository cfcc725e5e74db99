"""Description of a survey in numbers: extents, heights, densities, intensity, times, and the van's recordings."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from linework.arrays import FloatArray
from linework.crs import describe_crs, has_height
from linework.errors import InputError, LineworkError
from linework.files.images.pair_check import check_pairs
from linework.files.images.series import open_stereo
from linework.files.images.single import no_pairs_message, open_single_cameras
from linework.files.logs.keys import read_events
from linework.files.logs.sensors import read_navigation_logs
from linework.files.remote.address import address_text
from linework.files.store.build import PlannedFile, plan_files
from linework.files.store.facts import FileFacts, StoreFacts
from linework.files.trajectories.of_survey import VanPath, read_van_path, single_on_clock_of
from linework.imaging.rectify import rectifier_of
from linework.imaging.scan_lines import scan_line_spacing_m
from linework.model.camera import Camera
from linework.model.images import StereoSeries
from linework.model.logs import FIX_QUALITIES
from linework.model.survey import Survey
from linework.model.trajectory import Trajectory
from linework.runs.opened.points import OpenedSurvey
from linework.runs.opened.statistics import (
    GAP_S,
    CountedValues,
    PointStatistics,
    TimeSpans,
    points_by_block,
)

#: Gaps that are listed; further ones are counted. [gaps]
MAX_GAPS = 20


def describe_survey(read: OpenedSurvey | None, survey: Survey) -> dict[str, Any]:
    """Return the description of a survey, as a document for people and JSON; None for what it does not have.

    Parameters
    ----------
    read
        Its points in the store, and its trajectory; None if it has no points, or to say only what their headers do.

    Raises
    ------
    InputError
        Nothing in it can be used.
    """
    van = describe_van(survey, with_path=read is None)
    has_points = bool(survey.point_files)
    if not has_points and van.cameras is None and not van.single and not van.logs and van.trajectory is None:
        problem = van.failures[0]["problem"].rstrip(".") if van.failures else "holds nothing that can be used"
        raise InputError(problem, where=survey.name, advice="see the manual for what a survey is made of")
    path = van.trajectory if read is None else read.trajectory
    document = {
        "name": survey.name,
        "crs": {"name": describe_crs(survey.crs), "compound": has_height(survey.crs), "wkt": survey.crs},
        **(_points(read) if read is not None else _headers(survey) if survey.point_files else _NO_POINTS),
        "trajectory": None if path is None else _path(path),
        "cameras": van.cameras,
        "single_cameras": van.single,
        "logs": van.logs,
    }
    document["warnings"] = [*document["warnings"], *van.warnings]
    document["failures"] = [*document["failures"], *van.failures]
    return document


_NO_POINTS: dict[str, Any] = {
    "files": [], "points": 0, "points_rejected": {}, "extent_m": None, "height_m": None, "density_per_m2": None,
    "intensity": None, "time": None, "scan_line_spacing_m": None, "warnings": [], "failures": [],
}  # fmt: skip


def _points(opened: OpenedSurvey) -> dict[str, Any]:
    facts, found = opened.facts, PointStatistics.of(opened.points)
    spacing, why_not = _spacing(opened)
    return {
        "files": [_file(facts_of_file) for facts_of_file in facts.files],
        "points": opened.points.n_points,
        "points_rejected": dict(facts.rejected),
        "extent_m": opened.points.bounds._asdict(),
        "height_m": _quantiles(found.height),
        "density_per_m2": _quantiles(found.density),
        "intensity": _intensity(found.intensity),
        "time": _times(found.times, facts),
        "scan_line_spacing_m": spacing,
        "warnings": [*opened.warnings, *([why_not] if why_not and opened.trajectory is not None else [])],
        "failures": [{"file": address_text(path), "problem": problem} for path, problem in facts.failures],
    }


def _headers(survey: Survey) -> dict[str, Any]:
    """Return what the headers of the point files say; all else would take every byte of them."""
    planned, account = plan_files(survey)
    if not planned:
        raise next(
            iter(account.failures.values()), account.empty or InputError("no points", where=survey.name)
        )
    warnings = [f"{path.name}: {text}" for path, texts in account.warnings.items() for text in texts]
    files = []
    for path, header in ((file.path, file.header) for file in planned):
        warnings += [f"{path.name}: {text}" for text in header.warnings]
        files.append(
            {
                "file": address_text(path), "version": header.version_text, "point_format": header.point_format,
                "points": header.n_points, "used": None, "rejected": {}, "columns": list(header.columns),
            }
        )  # fmt: skip
    return _NO_POINTS | {
        "files": files,
        "points": sum(file.header.n_points for file in planned),
        "extent_m": _stated_extent(planned),
        "warnings": warnings,
        "failures": [
            {"file": address_text(path), "problem": str(error)} for path, error in account.failures.items()
        ],
    }


def _stated_extent(planned: Sequence[PlannedFile]) -> dict[str, float] | None:
    """Return the extent of all files by their headers [m]; None where one states none."""
    boxes = []
    for file in planned:
        low, high = file.header.low, file.header.high
        if low is None or high is None:
            return None
        boxes.append(np.array([*low[:2], *high[:2]]) * file.crs.factors[0])
    west, south = np.min(boxes, axis=0)[:2]
    east, north = np.max(boxes, axis=0)[2:]
    return {"west": float(west), "south": float(south), "east": float(east), "north": float(north)}


def _file(facts: FileFacts) -> dict[str, Any]:
    return {
        "file": address_text(facts.path),
        "version": facts.version,
        "point_format": facts.point_format,
        "points": facts.n_promised,
        "used": facts.n_points,
        "rejected": dict(facts.n_rejected),
        "columns": list(facts.columns),
    }


def _quantiles(values: CountedValues) -> dict[str, float]:
    names = {"lowest": 0.0, "percentile_5": 0.05, "median": 0.5, "percentile_95": 0.95, "highest": 1.0}
    return {name: round(values.quantile(share), 3) for name, share in names.items()}


def _intensity(counted: CountedValues | None) -> dict[str, Any] | None:
    """Return range and bits: 8 if no value is above 255, or if all are multiples of 256 or 257."""
    if counted is None:
        return None
    values = counted.values
    low, high = float(values[0]), float(values[-1])
    scaled = high > 255 and any(not np.any(values % step) for step in (256, 257))
    return {
        "lowest": low,
        "median": counted.quantile(0.5),
        "highest": high,
        "bits": 8 if high <= 255 or scaled else 16,
    }


def _times(times: TimeSpans | None, facts: StoreFacts) -> dict[str, Any] | None:
    if times is None:
        return None
    spans, gaps = times.spans(), times.gaps()
    return {
        "kind": facts.gps_time_kind,
        "start_s": float(spans[0, 0]),
        "end_s": float(spans[-1, 1]),
        "in_order": facts.in_time_order,
        "gap_longer_than_s": GAP_S,
        "n_gaps": len(gaps),
        "gaps": [{"start_s": start, "end_s": end} for start, end in gaps[:MAX_GAPS].tolist()],
    }


def _spacing(opened: OpenedSurvey) -> tuple[float | None, str]:
    """Return the along-track distance of scan lines [m], or why it is not known."""
    try:
        parts = points_by_block(opened.points, with_intensity=False)
        return round(scan_line_spacing_m(parts, opened.trajectory), 4), ""
    except InputError as error:
        return None, error.problem


def _path(trajectory: Trajectory) -> dict[str, Any]:
    steps = np.linalg.norm(np.diff(trajectory.xyz[:, :2], axis=0), axis=1)
    length, duration = float(steps.sum()), float(trajectory.time_s[-1] - trajectory.time_s[0])
    speeds = steps / np.diff(trajectory.time_s)
    return {
        "positions": len(trajectory),
        "start_s": float(trajectory.time_s[0]),
        "end_s": float(trajectory.time_s[-1]),
        "length_m": round(length, 2),
        "mean_speed_mps": round(length / duration, 2),
        "highest_speed_mps": round(float(speeds.max()), 2),
        "longest_step_s": round(float(np.diff(trajectory.time_s).max()), 3),
        "has_attitude": trajectory.attitude_deg is not None,
    }


# What the van recorded besides points, in numbers: cameras and pairs, navigation logs, keys

_T = TypeVar("_T")


@dataclass(slots=True)
class VanRecordings:
    """Descriptions of the recordings; a part that cannot be used does not hide the others.

    Parameters
    ----------
    cameras
        Document for people and JSON; None without pairs of cameras.
    single
        Documents by name: cameras without a partner.
    logs
        Documents by name: gnss, gyro, wheels, events.
    trajectory
        Path of the vehicle's origin, or None.
    warnings, failures
        One line each; failures with the name of the part.
    """

    cameras: dict[str, Any] | None = None
    single: dict[str, dict[str, Any]] = field(default_factory=dict)
    logs: dict[str, dict[str, Any]] = field(default_factory=dict)
    trajectory: Trajectory | None = None
    warnings: list[str] = field(default_factory=list)
    failures: list[dict[str, str]] = field(default_factory=list)

    def tried(self, part: str, read: Callable[[], _T]) -> _T | None:
        """Return what `read` returns, or None if the part cannot be used, which is then a failure."""
        try:
            return read()
        except LineworkError as error:
            self.failures.append({"part": part, "problem": str(error)})
            return None


def describe_van(survey: Survey, *, with_path: bool) -> VanRecordings:
    """Describe cameras, pairs and logs; a few pairs are checked whether their images belong together.

    Parameters
    ----------
    with_path
        Whether to read the trajectory of the survey, too.
    """
    found = VanRecordings(warnings=list(survey.warnings))
    series = found.tried("cameras", lambda: open_stereo(survey))
    if with_path:
        path = found.tried("trajectory", lambda: read_van_path(survey, series)) or VanPath(None, series)
        found.trajectory, series = path.trajectory, path.series
        found.warnings += path.warnings
    if series is not None:
        _add_cameras(series, survey.name, found)
    if survey.single_cameras:
        alone = found.tried("cameras", lambda: open_single_cameras(survey))
        for camera in single_on_clock_of(alone or (), found.trajectory, survey):
            about = _log(survey.settings["cameras"][camera.name]["images"], camera.time_s)
            about |= {"images": about.pop("rows"), "first_image": str(camera.files[0])}
            found.single[camera.name] = about
            found.warnings += camera.warnings
        found.warnings += no_pairs_message(survey)
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
    if content.logs.gnss.quality is not None:
        codes, counts = np.unique(content.logs.gnss.quality, return_counts=True)
        by_name = {FIX_QUALITIES[code]: n for code, n in zip(codes.tolist(), counts.tolist(), strict=True)}
        found.logs["gnss"]["quality"] = by_name


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
