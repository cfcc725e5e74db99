"""One line from one picked place, on an opened survey."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass, replace

import numpy as np

from linework.errors import InputError, UsageError
from linework.methods.obb.follow import Step, Stop
from linework.methods.obb.method import ObbMethod
from linework.methods.obb.picks import Surroundings, why_not
from linework.methods.obb.trace import PICK_M, Pick, pick_line, trace_line
from linework.methods.radon.method import CABLE_KINDS, RAIL_KINDS, CableMethod, RailMethod
from linework.model.arrays import BoolArray, FloatArray
from linework.model.boxes import BoxForm, BoxSet
from linework.model.grid import Bounds
from linework.model.lines import LineSet
from linework.model.tile import local_origin
from linework.tiling.opened import OpenedSurvey
from linework.tiling.rail_pieces import RailPieces
from linework.tiling.settings import RunSettings
from linework.tiling.sight import SurveySight
from linework.tiling.surfaces import SurveySurface
from linework.tiling.survey_boxes import SurveyBoxes

#: Kinds that a place can be picked on, in the order in which they are tried where none is named.
PICKED_KINDS = ("lane_marking", "road_boundary", *RAIL_KINDS, *CABLE_KINDS)
#: Lines around a picked place are looked at this far: through the gaps of dashed lines. [m]
AROUND_M = 16.0
_FORMS = {
    "lane_marking": (BoxForm.STRIPE,),
    "road_boundary": (BoxForm.KERB, BoxForm.EDGE, BoxForm.BARRIER),
}


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
        self._world_sight = SurveySight(surface)
        store, method = opened.points, ObbMethod(settings.obb)
        self._boxes = {
            kind: SurveyBoxes(store, surface, method.only(kind), forms, self._origin)
            for kind, forms in _FORMS.items()
        }
        rails, cables = RailMethod(settings.radon), CableMethod(settings.radon)
        self._pieces = {
            **dict.fromkeys(RAIL_KINDS, RailPieces(store, surface, rails, self._origin)),
            **dict.fromkeys(CABLE_KINDS, RailPieces(store, surface, cables, self._origin)),
        }

    def trace(
        self, at: tuple[float, float], *, kind: str = "", toward: tuple[float, float] | None = None
    ) -> Generator[Step, None, TracedLine]:
        """Follow the line at a place [m, world]; yield its steps (paint and boundaries), and return it whole.

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
        local = np.asarray(at) - self._origin[:2]
        picks = [pick for k in _FORMS if kind in ("", k) if (pick := self._pick(k, local)) is not None]
        # A wall at the back of a footway bounds no road
        picks = [p for p in picks if p.kind != "road_boundary" or self._bounds_road(p)]
        if picks:
            pick = min(picks, key=lambda p: p.distance_m)
            way = None if toward is None else np.asarray(toward) - np.asarray(at)
            return (yield from self._follow(pick, way))
        for k in PICKED_KINDS:
            if k in self._pieces and kind in ("", k):
                found = self._pieces[k].line_at(np.asarray(at), PICK_M)
                if found is not None and str(found[0].kind[0]) in (kind or k, k):
                    return self._whole(found)
        raise self._refusal(at, local, kind)

    def _pick(self, kind: str, local: FloatArray) -> Pick | None:
        self._boxes[kind].load(local, AROUND_M)
        near = _near(self._boxes[kind].boxes, local, 2.0 * AROUND_M)
        pick = pick_line(
            self._boxes[kind].boxes.take(near), kind, local, self._settings.obb.track, self._seen
        )
        return None if pick is None else replace(pick, box=int(np.flatnonzero(near)[pick.box]))

    def _follow(self, pick: Pick, way: FloatArray | None) -> Generator[Step, None, TracedLine]:
        source = self._boxes[pick.kind]
        traced = yield from trace_line(source, pick, self._settings.obb.track, self._seen, way)
        lines = traced.lines.with_columns(
            xyz=traced.lines.xyz + np.asarray(self._origin), crs=self._opened.survey.crs
        )
        stops = str(traced.stops[0]), str(traced.stops[1])
        return TracedLine(pick.kind, lines, pick.distance_m, stops)

    def _whole(self, found: tuple[LineSet, float]) -> TracedLine:
        lines = found[0].with_columns(crs=self._opened.survey.crs)
        return TracedLine(str(lines.kind[0]), lines, found[1], (str(Stop.FADED), str(Stop.FADED)))

    def _seen(self, xy: FloatArray) -> BoolArray:
        return self._world_sight(xy + self._origin[:2])

    def _bounds_road(self, pick: Pick) -> bool:
        centre = self._boxes[pick.kind].boxes.centre[pick.box, :2]
        return self._surroundings(centre).bounds_road(centre)

    def _surroundings(self, local: FloatArray) -> Surroundings:
        """Return all lines about a place: boundaries tell the carriageway of markings, too."""
        for source in self._boxes.values():
            source.load(local, AROUND_M)
        boxes = [_near_boxes(source.boxes, local) for source in self._boxes.values()]
        path = self._opened.trajectory
        way = None if path is None else path.xyz - np.asarray(self._origin)
        return Surroundings.of(BoxSet.concatenate(boxes), way, self._settings.obb.track)

    def _refusal(self, at: tuple[float, float], local: FloatArray, kind: str) -> InputError:
        """Return why there is no line at a place, and where the nearest one is."""
        near = Bounds(at[0], at[1], at[0], at[1]).grown(AROUND_M)
        points = self._opened.points.points(near, ordered=False, with_time=False, with_intensity=False)
        found = self._surroundings(local)
        wanted = kind if kind in _FORMS else ""
        surface = self._surface.over(near)
        rows, cols = (int(v[0]) for v in surface.grid.to_cell(np.array([at])))
        reason = why_not(
            points.xyz - np.asarray(self._origin), local, found, wanted=wanted,
            is_road=bool(surface.is_road[rows, cols]),
        )  # fmt: skip
        box, distance = found.nearest(local, wanted)
        advice = "pick a place on a line"
        if np.isfinite(distance) and distance <= AROUND_M:
            east, north = found.boxes.centre[box, :2] + self._origin[:2]
            advice = f"the nearest line is {distance:.1f} m away, pick {east:.2f},{north:.2f}"
        return InputError(
            f"{reason or 'no line'} within {PICK_M} m of {at[0]:.2f},{at[1]:.2f}",
            where=self._opened.survey.name, advice=advice,
        )  # fmt: skip


def _near(boxes: BoxSet, local: FloatArray, reach_m: float) -> BoolArray:
    return np.asarray(np.hypot(*(boxes.centre[:, :2] - local).T) <= reach_m)


def _near_boxes(boxes: BoxSet, local: FloatArray) -> BoxSet:
    return boxes.take(_near(boxes, local, 1.5 * AROUND_M))


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
