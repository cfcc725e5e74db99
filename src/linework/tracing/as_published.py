"""Following a picked line by the method of Kang, Lee and Lee (2023) as published, and what its search area shows.

Separate from `linework.tracing.trace`, which follows lines by linework's own method.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from linework.arrays import FloatArray
from linework.errors import InputError, UsageError, argument, did_you_mean
from linework.files.store.read import PointStore
from linework.methods.kinds import PUBLISHED_KINDS_OF
from linework.model.grid import Bounds
from linework.model.lines import LineSet
from linework.published import obb_2023
from linework.published.bounding_volumes import OBB
from linework.published.intensity_histogram import IntensityHistogram, intensity_histogram
from linework.published.methods import NO_CONFIDENCE, discs_of
from linework.published.obb_2023 import NoBoxError, Obb2023Config, PointsAbout
from linework.runs.opened.points import OpenedSurvey
from linework.tracing.on_ground import piece_toward
from linework.tracing.trace import TracedLine

#: Methods by which a picked line is followed.
TRACE_METHODS = ("auto", "obb-2023")
#: Points are read from the store in windows of this width, each with a margin of the search area. [m]
_WINDOW_M = 32.0


def check_trace_method(method: str) -> None:
    """Refuse a method by which picked lines are not followed.

    Raises
    ------
    UsageError
        The message lists the methods.
    """
    if method not in TRACE_METHODS:
        problem = f"lines are not traced by {method}" + did_you_mean([str(method)], TRACE_METHODS)
        raise UsageError(problem, where=argument("method"), advice=f"choose from {', '.join(TRACE_METHODS)}")


def follow_as_published(
    opened: OpenedSurvey,
    at: tuple[float, float],
    *,
    kind: str,
    toward: tuple[float, float] | None,
    config: Obb2023Config,
) -> TracedLine:
    """Return the line through the search area about a place (east, north) [m, world], followed both ways.

    Parameters
    ----------
    kind
        "lane_marking" or "road_boundary"; "": the one whose box is nearer to the place.

    Raises
    ------
    InputError
        The search area gives no box; the message says which of the paper's failures it is.
    """
    place, points_about = np.array(at), windowed(opened.points, config.radius_m)
    kinds = PUBLISHED_KINDS_OF["obb-2023"]
    if kind and kind not in kinds:
        raise UsageError(
            f"obb-2023 does not find {kind}", where=argument("kind"), advice=f"choose from {', '.join(kinds)}"
        )
    kinds = (kind,) if kind else kinds
    boxes: dict[str, OBB] = {}
    reasons = []
    ranged = config
    for one in kinds:
        try:
            if one == "lane_marking":
                ranged = obb_2023.with_range(points_about, place, config)
            boxes[one] = obb_2023.box_at(points_about, place, one, ranged)
        except NoBoxError as none:
            reasons.append(str(none))
    if not boxes:
        raise InputError(
            f"{'; '.join(dict.fromkeys(reasons))} ({config.radius_m:g} m about {at[0]:.2f},{at[1]:.2f})",
            where=opened.survey.name, advice="pick a place on a line",
        )  # fmt: skip
    nearest = min(boxes, key=lambda one: _offset_m(boxes[one], place))
    found = obb_2023.follow(points_about, boxes[nearest], nearest, ranged)
    if len(found.boxes) < 2:
        raise InputError(
            f"the first box collides with no other: {found.stops[0]}; {found.stops[1]}",
            where=opened.survey.name, advice="choose another search length or search width",
        )  # fmt: skip
    line, stops = _line(found.xyz, nearest, opened.survey.crs), found.stops
    if toward is not None and len(found.xyz) > 2:
        line, stops = piece_toward(line, place, np.array(toward) - place, stops)
    return TracedLine(nearest, line, _offset_m(boxes[nearest], place), stops)


def _line(xyz: FloatArray, kind: str, crs: str) -> LineSet:
    """Return a line of centres of boxes."""
    return LineSet.from_lines(
        [xyz], crs=crs, kind=[kind], method=["obb-2023"], confidence=np.array([NO_CONFIDENCE])
    )


def _offset_m(box: OBB, place: FloatArray) -> float:
    """Return the distance of a place (2,) from the centre line of a box. [m]"""  # noqa: D400
    return abs(float((place - box.centre[:2]) @ box.v[:2]))


def windowed(store: PointStore, radius_m: float) -> PointsAbout:
    """Return a function that gives the points of a store about a place; it keeps the window that it read last."""
    kept: dict[tuple[int, int], PointsAbout] = {}

    def points_about(place: FloatArray) -> tuple[FloatArray, FloatArray | None]:
        window = (int(place[0] // _WINDOW_M), int(place[1] // _WINDOW_M))
        if window not in kept:
            west, south = window[0] * _WINDOW_M, window[1] * _WINDOW_M
            bounds = Bounds(west, south, west + _WINDOW_M, south + _WINDOW_M).grown(radius_m)
            points = store.points(bounds, with_time=False, with_columns=False)
            kept.clear()
            kept[window] = discs_of(points.xyz, points.intensity, radius_m)
        return kept[window](place)

    return points_about


@dataclass(frozen=True, slots=True)
class SearchAreaFound:
    """What a search area shows, step by step.

    Parameters
    ----------
    n_points, n_upright, n_floor
        Points in it; those whose normals stand upright; those on the floor plane.
    histogram
        Of the intensities, with the range of paint that it proposes; None: the points have no intensity.
    failures
        Why it gives no box, by kind; kinds that give one are not in it.
    """

    n_points: int
    n_upright: int
    n_floor: int
    histogram: IntensityHistogram | None
    failures: dict[str, str]

    def as_json(self) -> dict[str, Any]:
        """Return it as JSON has it."""
        document: dict[str, Any] = {
            "points": self.n_points, "upright_normals": self.n_upright, "floor": self.n_floor, "failures": self.failures,
        }  # fmt: skip
        if self.histogram is not None:
            document["intensity"] = {
                "edges": self.histogram.edges.tolist(), "counts": self.histogram.counts.tolist(),
                "proposed": self.histogram.proposed, "separation": self.histogram.separation,
            }  # fmt: skip
        return document

    def as_text(self) -> list[str]:
        """Return it as lines of text: counts, the histogram in bars, the proposed range, and the failures."""
        lines = [
            f"search area: {self.n_points:,} points, {self.n_upright:,} with upright normals, {self.n_floor:,} on the floor"
        ]
        if self.histogram is not None and self.n_points:
            edges, counts = self.histogram.edges[::4], self.histogram.counts.reshape(-1, 4).sum(axis=1)
            lines.append("intensity  points")
            for low, n in zip(edges[:-1], counts, strict=True):
                lines.append(f"{low:9.4g}  {n:6,} {'#' * round(40 * n / counts.max())}")
            proposed = self.histogram.proposed
            lines.append(
                "no range is proposed: the intensities are of one class"
                if proposed is None
                else f"proposed range of paint: {proposed[0]:.4g},{proposed[1]:.4g}"
            )
        return lines + [f"no box of a {kind}: {reason}" for kind, reason in self.failures.items()]


def explain_search_area(store: PointStore, at: tuple[float, float], config: Obb2023Config) -> SearchAreaFound:
    """Return what the search area about a place (east, north) [m, world] shows."""
    place, points_about = np.array(at), windowed(store, config.radius_m)
    xyz, intensity = points_about(place)
    n_upright = n_floor = 0
    if len(xyz) > obb_2023.FEWEST:
        local = xyz - np.append(place, xyz[:, 2].min())
        n_upright = int(np.count_nonzero(obb_2023.is_upright(local, config)))
        try:
            n_floor = int(np.count_nonzero(obb_2023.floor_plane(local, config)))
        except NoBoxError:
            n_floor = 0
    failures = {}
    for kind in PUBLISHED_KINDS_OF["obb-2023"]:
        try:
            obb_2023.box_at(points_about, place, kind, config)
        except NoBoxError as none:
            failures[kind] = str(none)
    histogram = None
    if intensity is not None and len(intensity):
        histogram = intensity_histogram(intensity)
    return SearchAreaFound(len(xyz), n_upright, n_floor, histogram, failures)
