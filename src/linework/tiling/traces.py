"""One line from one picked place, on an opened survey."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass

import numpy as np

from linework.errors import InputError, UsageError
from linework.lines.continued import Gap, continued
from linework.methods.obb import trace
from linework.methods.obb.follow import Stop
from linework.methods.obb.method import ObbMethod
from linework.methods.obb.picks import Surroundings, nearest_that_works, why_not
from linework.methods.obb.search_area import Failure
from linework.methods.obb.trace import PICK_M
from linework.methods.radon.method import CABLE_KINDS, RAIL_KINDS, CableMethod, RailMethod
from linework.model.arrays import FloatArray
from linework.model.grid import Bounds
from linework.model.lines import LineSet
from linework.model.tile import local_origin
from linework.tiling.opened import OpenedSurvey
from linework.tiling.rail_pieces import RailPieces
from linework.tiling.settings import RunSettings
from linework.tiling.sight import SurveySight
from linework.tiling.surfaces import SurveySurface
from linework.tiling.survey_boxes import SurveyBoxes

#: Kinds that a place can be picked on.
PICKED_KINDS = ("lane_marking", "road_boundary", *RAIL_KINDS, *CABLE_KINDS)
#: Lines around a picked place are looked at this far: through the gaps of dashed lines. [m]
AROUND_M = 16.0
#: Beyond the ends of a line boxes are looked for this far to either side of where it leads. [m]
STRIP_M = 4.0
#: A picked line goes on where another is in line with it, over a gap as long as the tracker's longest.
SAME_LINE = Gap(longest_m=32.0, off_deg=1.0, turn_deg=20.0)
#: Something stands at a place, or hangs over it, where points within so much of it are so high over ground. [m]
STANDS_M, STANDS_HIGH_M, HANGS_M, HANGS_HIGH_M = 1.0, (0.2, 2.0), 3.0, (3.5, 100.0)


@dataclass(frozen=True, slots=True)
class TracedLine:
    """A followed line in the survey's CRS, how far the picked place is from it, and why it ends where it does."""

    kind: str
    lines: LineSet
    distance_m: float
    stops: tuple[str, str]


class Tracer:
    """A survey that lines are picked on; what has been found around one pick serves the next.

    Parameters
    ----------
    opened, surface
        The survey's points, and its road and ground.
    """

    def __init__(self, opened: OpenedSurvey, surface: SurveySurface, settings: RunSettings) -> None:
        bounds = opened.points.bounds
        self._opened, self._surface, self._settings = opened, surface, settings
        self._origin = local_origin(bounds.west, bounds.south, surface.z0_m)
        self._seen = SurveySight(surface)
        self._path = None if opened.trajectory is None else opened.trajectory.xyz
        store, self._method = opened.points, ObbMethod(settings.obb)
        self._boxes = SurveyBoxes(store, surface, self._method, self._origin)
        self._rails = RailPieces(store, surface, RailMethod(settings.radon), self._origin)
        self._cables = RailPieces(store, surface, CableMethod(settings.radon), self._origin)

    def trace(
        self, at: tuple[float, float], *, kind: str = "", toward: tuple[float, float] | None = None
    ) -> Generator[LineSet, None, TracedLine]:
        """Follow the line at a place [m, world]; yield it as it grows, and return it whole.

        Parameters
        ----------
        kind
            Of `PICKED_KINDS`; "": the nearest of them.
        toward
            Follow it only from the place towards this one, not both ways.

        Raises
        ------
        InputError
            There is no line at the place: why, and where the nearest one is.
        """
        place = np.asarray(at, dtype=np.float64)
        standing = self._standing(place, kind)
        distance_m = standing[1] if standing else float("inf")
        if kind in ("", *trace.TRACKED_AS):
            self._boxes.load(place[None], AROUND_M)
            lines = self._tracked()
            i, picked_as, apart_m = trace.nearest_line(lines, place, kind)
            if i >= 0 and apart_m < distance_m:
                way = None if toward is None else np.asarray(toward) - place
                return (yield from self._follow(lines, i, (place, picked_as, apart_m), way))
        if standing:
            one, stops = standing[0], (str(Stop.FADED), str(Stop.FADED))
            if toward is not None:
                one, stops = _toward(one, place, np.asarray(toward) - place, stops)
            crs = self._opened.survey.crs
            return TracedLine(str(one.kind[0]), one.with_columns(crs=crs), distance_m, stops)
        raise self._refusal(place, kind)

    def _follow(
        self, lines: LineSet, i: int, picked: tuple[FloatArray, str, float], way: FloatArray | None
    ) -> Generator[LineSet, None, TracedLine]:
        """Find more boxes where the line leads, and track again, until nothing is new there."""
        place, kind, distance_m = picked
        one = self._gone_on(lines, i)
        while True:
            yield one
            tips, ways = trace.leads(one.xyz)
            chosen = [k for k in (0, 1) if way is None or float(ways[k] @ way) > 0.0]
            ahead = np.arange(0.0, SAME_LINE.longest_m + STRIP_M, STRIP_M)[:, None]
            if not self._boxes.load(np.concatenate([tips[k] + ahead * ways[k] for k in chosen]), STRIP_M):
                break
            lines = self._tracked()
            i = trace.nearest_line(lines, place, kind)[0]
            if i < 0:
                break
            one = self._gone_on(lines, i)
        starts, ends = (str(stop) for stop in trace.stops_of(one.xyz, self._seen))
        stops = (starts, ends)
        if way is not None:
            one, stops = _toward(one, place, way, stops)
        one = one.with_columns(kind=np.array([kind]))
        parts = [one, *(lines.take(trace.beside(lines, one.xyz, name)) for name in trace.BESIDE_M)]
        crs = self._opened.survey.crs
        whole = LineSet.concatenate([part.with_columns(crs=crs) for part in parts])
        return TracedLine(kind, whole, distance_m, stops)

    def _tracked(self) -> LineSet:
        """Return all lines through the boxes found so far. [m, world]"""  # noqa: D400
        return self._method.track(self._boxes.boxes, self._origin, self._seen, self._path)

    def _gone_on(self, lines: LineSet, i: int) -> LineSet:
        """Return a line with those that go on where it ends."""
        one, rest = lines.take([i]), np.flatnonzero(lines.kind == lines.kind[i])
        left = [k for k in rest.tolist() if k != i]
        while left:
            ends = one.xyz[[0, -1], :2]
            for k in left:
                apart = lines.line(k)[[0, -1], None, :2] - ends
                if np.hypot(apart[..., 0], apart[..., 1]).min() > SAME_LINE.longest_m:
                    continue
                joined = continued(one, lines.take([k]), SAME_LINE)
                if len(joined) == 1:
                    one, left = joined, [other for other in left if other != k]
                    break
            else:
                break
        return one

    def _standing(self, place: FloatArray, kind: str) -> tuple[LineSet, float] | None:
        """Return the nearest guardrail, barrier or cable at a place, whole, and its distance. [m]"""  # noqa: D400
        near = Bounds(*place, *place).grown(HANGS_M)
        points = self._opened.points.points(near, ordered=False, with_time=False, with_intensity=False)
        surface = self._surface.over(near)
        rows, cols = (int(v[0]) for v in surface.grid.to_cell(place[None]))
        height = points.xyz[:, 2] - (float(surface.ground_m[rows, cols]) + surface.z0_m)
        apart = np.hypot(*(points.xyz[:, :2] - place).T)
        found = []
        for pieces, kinds, within_m, (low_m, high_m) in (
            (self._rails, RAIL_KINDS, STANDS_M, STANDS_HIGH_M),
            (self._cables, CABLE_KINDS, HANGS_M, HANGS_HIGH_M),
        ):
            is_there = np.any((apart <= within_m) & (height > low_m) & (height < high_m))
            if is_there and kind in ("", *kinds):
                one = pieces.line_at(place, PICK_M)
                if one is not None and kind in ("", str(one[0].kind[0])):
                    found.append(one)
        return min(found, key=lambda line: line[1]) if found else None

    def _refusal(self, place: FloatArray, kind: str) -> InputError:
        """Return why there is no line at a place, and where the nearest one is."""
        near, local = Bounds(*place, *place).grown(AROUND_M), place - self._origin[:2]
        points = self._opened.points.points(near, ordered=False, with_time=False, with_intensity=False)
        self._boxes.load(place[None], AROUND_M)
        boxes = self._boxes.boxes
        boxes = boxes.take(np.hypot(*(boxes.centre[:, :2] - local).T) <= 1.5 * AROUND_M)
        way = None if self._path is None else self._path - np.asarray(self._origin)
        found = Surroundings.of(boxes, way, self._settings.obb.track)
        wanted = kind if kind in trace.TRACKED_AS else ""
        surface = self._surface.over(near)
        rows, cols = (int(v[0]) for v in surface.grid.to_cell(place[None]))
        reason = why_not(
            points.xyz - np.asarray(self._origin), local, found, wanted=wanted,
            is_road=bool(surface.is_road[rows, cols]),
        )  # fmt: skip
        works, advice = nearest_that_works(local, found, wanted), "pick a place on a line"
        if reason is None:
            # There is one, but it bounds no carriageway: it stands behind another
            reason, works = Failure.NO_ROAD, None
        if works is not None:
            away_m, (east, north) = np.hypot(*(works[:2] - local)), works[:2] + self._origin[:2]
            advice = f"the nearest line is {away_m:.1f} m away, pick {east:.2f},{north:.2f}"
        return InputError(
            f"{reason} within {PICK_M} m of {place[0]:.2f},{place[1]:.2f}",
            where=self._opened.survey.name, advice=advice,
        )  # fmt: skip


def _toward(
    one: LineSet, place: FloatArray, way: FloatArray, stops: tuple[str, str]
) -> tuple[LineSet, tuple[str, str]]:
    """Return the piece of a line that leads from a place in a direction."""
    i = min(max(trace.nearest_vertex(one.xyz[:, :2], place)[0], 1), len(one.xyz) - 2)
    ahead = one.xyz[min(i + 4, len(one.xyz) - 1), :2] - one.xyz[max(i - 4, 0), :2]
    if float(ahead @ way) >= 0.0:
        return trace.part_of(one, slice(i, None)), (str(Stop.PICKED), stops[1])
    return trace.part_of(one, slice(0, i + 2)), (stops[0], str(Stop.PICKED))


def check_kind(kind: str) -> None:
    """Refuse a kind that no place can be picked on; "" stands for the nearest.

    Raises
    ------
    UsageError
        With what can be chosen.
    """
    if kind not in ("", *PICKED_KINDS):
        raise UsageError(
            f"{kind} cannot be picked", where="--feature", advice=f"choose from {','.join(PICKED_KINDS)}"
        )
