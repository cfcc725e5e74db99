"""What a survey holds, in numbers: extents, heights, densities, intensity, times."""

from __future__ import annotations

from typing import Any

import numpy as np

from linework.arrays import FloatArray
from linework.errors import InputError
from linework.files.crs import describe_crs, has_height
from linework.files.store_facts import FileFacts, StoreFacts
from linework.imaging.scan_lines import scan_line_spacing_m
from linework.model.points import Points
from linework.model.survey import Survey
from linework.model.trajectory import Trajectory
from linework.tiling.describe_van import describe_van
from linework.tiling.survey_read import SurveyRead

#: Density is counted in cells of this size: holds several scan lines, and shows where the van was near. [m]
CELL_M = 1.0
#: A van's scanner turns at least 10 times a second: without a point for this long it was off. [s]
GAP_S = 1.0
#: More gaps than this are counted, not listed.
MAX_GAPS = 20


def describe_survey(read: SurveyRead | None, survey: Survey) -> dict[str, Any]:
    """Return what a survey holds, as a document for people and JSON; None where it does not apply.

    Parameters
    ----------
    read
        Its points and its trajectory; None where it has no points.

    Raises
    ------
    InputError
        There is nothing in it that can be used.
    """
    van = describe_van(survey, with_path=read is None)
    if read is None and van.cameras is None and not van.logs and van.trajectory is None:
        problem = van.failures[0]["problem"].rstrip(".") if van.failures else "holds nothing that can be used"
        raise InputError(problem, where=survey.name, advice="see the manual for what a survey is made of")
    path = van.trajectory if read is None else read.trajectory
    document = {
        "name": survey.name,
        "crs": {"name": describe_crs(survey.crs), "compound": has_height(survey.crs), "wkt": survey.crs},
        **(_NO_POINTS if read is None else _points(read)),
        "trajectory": None if path is None else _path(path),
        "cameras": van.cameras,
        "logs": van.logs,
    }
    document["warnings"] = [*document["warnings"], *van.warnings]
    document["failures"] = [*document["failures"], *van.failures]
    return document


_NO_POINTS: dict[str, Any] = {
    "files": [], "points": 0, "points_rejected": {}, "extent_m": None, "height_m": None, "density_per_m2": None,
    "intensity": None, "time": None, "scan_line_spacing_m": None, "warnings": [], "failures": [],
}  # fmt: skip


def _points(read: SurveyRead) -> dict[str, Any]:
    trajectory, points = read.trajectory, read.points.points
    spacing, why_not = _spacing(points, trajectory)
    return {
        "files": [_file(facts) for facts in read.points.files],
        "points": len(points),
        "points_rejected": dict(read.points.rejected),
        "extent_m": points.bounds._asdict(),
        "height_m": _quantiles(points.xyz[:, 2]),
        "density_per_m2": _quantiles(densities_per_m2(points)),
        "intensity": _intensity(points),
        "time": _times(points, read.points.facts),
        "scan_line_spacing_m": spacing,
        "warnings": [*read.warnings, *([why_not] if why_not and trajectory is not None else [])],
        "failures": [{"file": str(path), "problem": problem} for path, problem in read.points.failures],
    }


def densities_per_m2(points: Points) -> FloatArray:
    """Return the points per square metre of every cell that has any, (n_cells,).

    >>> xyz = np.array([[0.1, 0.1, 0.0], [0.9, 0.9, 0.0], [7.5, 0.5, 0.0]])
    >>> densities_per_m2(Points(xyz)).tolist()
    [2.0, 1.0]
    """
    bounds = points.bounds
    cols = np.floor(points.xyz[:, 0] / CELL_M).astype(np.int64)
    rows = np.floor(points.xyz[:, 1] / CELL_M).astype(np.int64)
    n_rows = int(bounds.height_m / CELL_M) + 2
    _, counts = np.unique((cols - cols.min()) * n_rows + rows - rows.min(), return_counts=True)
    return counts / CELL_M**2


def _file(facts: FileFacts) -> dict[str, Any]:
    return {
        "file": str(facts.path),
        "version": facts.version,
        "point_format": facts.point_format,
        "points": facts.n_promised,
        "used": facts.n_points,
        "rejected": dict(facts.n_rejected),
    }


def _quantiles(values: FloatArray) -> dict[str, float]:
    names = ("lowest", "percentile_5", "median", "percentile_95", "highest")
    found = np.quantile(values, [0.0, 0.05, 0.5, 0.95, 1.0])
    return {name: round(float(value), 3) for name, value in zip(names, found, strict=True)}


def _intensity(points: Points) -> dict[str, Any] | None:
    """Return range and bits: 8 where no value is above 255, or where all are multiples of 256 or 257."""
    if points.intensity is None:
        return None
    low, high = float(points.intensity.min()), float(points.intensity.max())
    scaled = high > 255 and any(not np.any(points.intensity % step) for step in (256, 257))
    return {
        "lowest": low,
        "median": float(np.median(points.intensity)),
        "highest": high,
        "bits": 8 if high <= 255 or scaled else 16,
    }


def _times(points: Points, facts: StoreFacts) -> dict[str, Any] | None:
    if points.time_s is None:
        return None
    times = np.sort(points.time_s)
    at = np.flatnonzero(np.diff(times) > GAP_S)
    gaps = [{"start_s": float(times[i]), "end_s": float(times[i + 1])} for i in at[:MAX_GAPS]]
    return {
        "kind": facts.gps_time_kind,
        "start_s": float(times[0]),
        "end_s": float(times[-1]),
        "in_order": facts.in_time_order,
        "gap_longer_than_s": GAP_S,
        "n_gaps": len(at),
        "gaps": gaps,
    }


def _spacing(points: Points, trajectory: Trajectory | None) -> tuple[float | None, str]:
    """Return the along-track distance of scan lines, or why it is not known."""
    try:
        return round(scan_line_spacing_m(points, trajectory), 4), ""
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
