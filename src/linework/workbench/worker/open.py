"""Requests that open the survey, decoding its points at the first time, and return what the server has to know."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from linework.arrays import FloatArray, distance_along
from linework.crs import LOCAL, describe_crs
from linework.files.store.layout import STORE_BLOCK_M
from linework.model.grid import Bounds
from linework.runs.steps import RunSteps

if TYPE_CHECKING:  # the server needs the facts alone
    from linework.runs.opened.recordings import Recordings
    from linework.workbench.worker.session import SurveySession

#: Distance between vertices of the path, which is drawn but not measured on. [m]
_PATH_STEP_M = 2.0
#: Margin around the path of a survey without points: the road and its verges. [m]
_PATH_MARGIN_M = 30.0
#: Range of heights shown, from the survey's lowest: the road, and what stands beside it. [m]
_HEIGHT_RANGE_M = 30.0


@dataclass(frozen=True, slots=True, kw_only=True)
class SurveyFacts:
    """What the server knows of a survey.

    Parameters
    ----------
    name
        Of the survey, for display.
    crs, crs_name
        WKT2 or "local"; and its name for display.
    root
        Folder of the survey.
    work
        Work folder.
    bounds
        West, south, east, north of the points, or of the path. [m, world]
    middle
        East, north, up of the first view: half-way along the path, else where most points are. [m, world]
    heights
        Lowest and highest height to show. [m, world]
    n_points, n_pairs
        0 where there are none.
    path
        (k, 3) vertices of the van's path [m, world], thinned; none: no trajectory.
    warnings
        One line each, also about recordings that cannot be used.
    """

    name: str
    crs: str
    crs_name: str
    root: str
    work: str
    bounds: tuple[float, float, float, float]
    middle: tuple[float, float, float]
    heights: tuple[float, float]
    n_points: int
    n_pairs: int
    path: tuple[tuple[float, float, float], ...]
    warnings: tuple[str, ...]


def read_folder_and_crs(session: SurveySession) -> tuple[str, str]:
    """Return the survey's folder and the CRS that its files state, which opening the lines needs."""
    return str(session.survey.root), session.survey.crs


def open_in_worker(session: SurveySession) -> SurveyFacts:
    """Open the survey and return its facts.

    Reports ("begin", step, unit), ("advance", done, total) and ("end", step, seconds).

    Raises
    ------
    InputError
        The survey holds nothing that can be used.
    """
    steps = RunSteps(_Reporter(session))
    recordings = session.opened(steps)
    surface = session.surface_with(steps)
    points, stereo, path = recordings.points, recordings.stereo, _path(recordings)
    if points is not None:
        bounds = points.points.bounds
        edges = (bounds.west, bounds.south, bounds.east, bounds.north)
    else:
        low, high = path[:, :2].min(axis=0) - _PATH_MARGIN_M, path[:, :2].max(axis=0) + _PATH_MARGIN_M
        edges = (float(low[0]), float(low[1]), float(high[0]), float(high[1]))
    z0_m = surface.z0_m if surface is not None else float(np.floor(path[:, 2].min()))
    survey = recordings.survey
    return SurveyFacts(
        name=survey.name,
        crs=survey.crs,
        crs_name="local metres" if survey.crs == LOCAL else describe_crs(survey.crs),
        root=str(survey.root),
        work=str(session.work),
        bounds=edges,
        middle=_middle(recordings, path),
        heights=(z0_m, z0_m + _HEIGHT_RANGE_M),
        n_points=points.points.n_points if points else 0,
        n_pairs=len(stereo.pairs) if stereo else 0,
        path=tuple((float(e), float(n), float(u)) for e, n, u in path),
        warnings=(*recordings.warnings, *(f"{what}: {problem}" for what, problem in recordings.problems)),
    )


def _path(recordings: Recordings) -> FloatArray:
    """Return (k, 3) places of the van's path [m, world], one for every `_PATH_STEP_M`."""
    trajectory = recordings.trajectory
    if trajectory is None or len(trajectory) == 0:
        return np.zeros((0, 3))
    xyz = trajectory.xyz
    along = distance_along(xyz)
    first = np.unique(np.floor(along / _PATH_STEP_M), return_index=True)[1]
    return np.asarray(xyz[np.unique(np.r_[first, len(xyz) - 1])])


def _middle(recordings: Recordings, path: FloatArray) -> tuple[float, float, float]:
    """Return a place (east, north, up) [m, world] with points or on the path."""
    place = path[len(path) // 2] if len(path) else np.zeros(3)
    if not len(path) and recordings.points is not None:
        blocks, counts = recordings.points.points.block_counts
        west, south = (blocks[int(np.argmax(counts))] * STORE_BLOCK_M).tolist()
        block = Bounds(west, south, west + STORE_BLOCK_M, south + STORE_BLOCK_M)
        xyz = recordings.points.points.points(
            block, ordered=False, with_time=False, with_intensity=False, with_columns=False
        ).xyz
        # A point, not the mean of all: in a bend that lies beside the road
        place = xyz[int(np.argmin(np.hypot(*(xyz - np.median(xyz, axis=0))[:, :2].T)))]
    return float(place[0]), float(place[1]), float(place[2])


class _Reporter:
    """Watcher of a run's steps that reports them to the caller of the request."""

    def __init__(self, session: SurveySession) -> None:
        self._report: Any = session.report

    def begin(self, step: str, unit: str) -> None:
        """Report that a step begins."""
        self._report(("begin", step, unit))

    def advance(self, done: int, total: int) -> None:
        """Report its progress."""
        self._report(("advance", done, total))

    def end(self, step: str, seconds: float) -> None:
        """Report that it is done."""
        self._report(("end", step, seconds))
