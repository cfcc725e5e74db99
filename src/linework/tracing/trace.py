"""One line from one picked place, on an opened survey."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass, replace

import numpy as np

from linework.arrays import FloatArray, distance_along
from linework.editing.edits.continued import PICKED_TWICE, continue_lines
from linework.errors import RefusedPickError, UsageError, argument
from linework.lines.companions import HungWires
from linework.methods.obb import trace
from linework.methods.obb.method import Obb
from linework.methods.obb.picks import PickSurroundings, nearest_trackable_place, refusal_reason
from linework.methods.obb.search_area import NoLineReason
from linework.methods.obb.trace import PICK_M, TraceStop, end_directions, may_continue
from linework.methods.radon.method import CABLE_KINDS, RAIL_KINDS, CableMethod, RailMethod
from linework.model.grid import Bounds
from linework.model.lines import LineSet
from linework.model.tile import local_origin
from linework.runs.opened.points import OpenedSurvey
from linework.runs.opened.surface import SurveySight, SurveySurface
from linework.runs.settings import RunSettings
from linework.tracing.boxes import Corridor, SurveyBoxes
from linework.tracing.medians import partners_of
from linework.tracing.on_ground import PICK_AROUND_M, GroundPick, GroundSurvey, follow_ground, piece_toward
from linework.tracing.rails import RailPieces
from linework.tracing.wires import wires_along

#: Kinds that a place can be picked on.
PICKED_KINDS = ("lane_marking", "road_boundary", *RAIL_KINDS, *CABLE_KINDS)
#: Something stands at a place, or hangs over it, if points within this distance of it are this high above the ground,
#: lowest and highest. [m]
STANDS_WITHIN_M, STANDS_HIGH_M, HANGS_WITHIN_M, HANGS_HIGH_M = 1.0, (0.2, 2.0), 3.0, (3.5, 100.0)
#: Interval to which the path of the vehicle is thinned. [m]
_PATH_STEP_M = 0.25


@dataclass(frozen=True, slots=True)
class TracedLine:
    """A followed line in the survey's CRS, its distance from the picked place [m], and why it ends.

    The line is the first of `lines`; its dashes or the top of its kerb follow.
    """

    kind: str
    lines: LineSet
    distance_m: float
    stops: tuple[str, str]


Trace = Generator[LineSet, bool | None, TracedLine]


class Tracer:
    """Follows lines that are picked on a survey; boxes and tiles that were searched are kept for the next pick.

    Parameters
    ----------
    opened, surface
        The survey's points, and its road and ground.
    """

    def __init__(self, opened: OpenedSurvey, surface: SurveySurface, settings: RunSettings) -> None:
        bounds = opened.points.bounds
        self._opened, self._surface, self._settings = opened, surface, settings
        self._origin = local_origin(bounds.west, bounds.south, surface.z0_m)
        store, method = opened.points, Obb(settings.obb)
        detectors = {kind: method.only(kind) for kind in trace.TRACKED_AS}
        self._ground = GroundSurvey(
            SurveyBoxes(store, surface, detectors, self._origin), method, self._origin, SurveySight(surface),
            None if opened.trajectory is None else _thinned(opened.trajectory.xyz),
        )  # fmt: skip
        self._rails = RailPieces(store, surface, RailMethod(settings.radon), self._origin)
        self._cables = RailPieces(store, surface, CableMethod(settings.radon), self._origin)

    def trace(
        self, at: tuple[float, float], *, kind: str = "", toward: tuple[float, float] | None = None
    ) -> Trace:
        """Follow the line at a place (east, north) [m, world]; yield it while it grows, and return it whole.

        Parameters
        ----------
        kind
            Of `PICKED_KINDS`; "": the nearest of them.
        toward
            Place towards which the line is followed; None: both ways.

        Raises
        ------
        RefusedPickError
            There is no line at the place; the message says why, and where the nearest one is.

        Notes
        -----
        ``send(True)`` stops it: what was followed so far is returned.
        """
        place = np.asarray(at, dtype=np.float64)
        direction = None if toward is None else np.asarray(toward) - place
        pick = GroundPick(place, kind, direction)
        standing = self._standing(pick) if kind not in trace.TRACKED_AS else None
        if kind in ("", *trace.TRACKED_AS):
            found = yield from follow_ground(self._ground, pick)
            if found is not None and (standing is None or found.distance_m <= standing.distance_m):
                return TracedLine(found.kind, self._in_crs(found.lines), found.distance_m, found.stops)
        if standing is None:
            raise self._refusal(place, kind)
        return standing

    def bridge(self, lines: LineSet, end: int, stops: tuple[str, str]) -> Trace:
        """Continue a line (the first of `lines`) beyond the gap at its start (0) or its end (1), as `trace` does.

        The gap is bridged. `stops`: why the line ends.

        Raises
        ------
        RefusedPickError
            No line continues it within reach of `PICKED_TWICE`.
        """
        one, kind = lines.take([0]), str(lines.kind[0])
        way = continuation_beyond(one, end, self._ahead(one, end))
        if way is None:
            tip = trace.end_directions(one.xyz)[0][end]
            raise RefusedPickError(
                f"no {kind.replace('_', ' ')} continues", f"within {PICKED_TWICE.longest_m:.0f} m beyond {tip[0]:.2f},{tip[1]:.2f}",
                where=self._opened.survey.name, advice="pick a place on the line further on",
            )  # fmt: skip
        place, onward = way
        steps = self.trace((place[0], place[1]), kind=kind, toward=(onward[0], onward[1]))
        command: bool | None = None
        while True:
            try:
                command = yield trace.oriented_like(join_over_gap(one, steps.send(command).take([0])), one)
            except StopIteration as stop:
                new: TracedLine = stop.value
                break
        whole = trace.oriented_like(join_over_gap(one, new.lines.take([0])), one)
        far = new.stops[1] if new.stops[0] == str(TraceStop.PICKED) else new.stops[0]
        beside = continue_lines(lines["kerb_top"], new.lines["kerb_top"])
        dashes = [part["lane_marking_dash"] for part in (lines, new.lines)]
        both = LineSet.concatenate([whole, beside, *dashes])
        return TracedLine(kind, self._in_crs(both), 0.0, (far, stops[1]) if end == 0 else (stops[0], far))

    def wires_along(self, wire: FloatArray) -> HungWires | None:
        """Return the wires that hang with a wire (n, 3) [m, world] from pole to pole; None: the points show none there."""
        found = wires_along(self._cables, wire)
        return None if found is None else replace(found, lines=self._in_crs(found.lines))

    def partners_of(self, rail: FloatArray) -> LineSet:
        """Return the lines of the rail or barrier that shares a median with one (n, 3) [m, world]; empty: the points show none."""
        return self._in_crs(partners_of(self._rails, rail, self._ground.path))

    def _in_crs(self, lines: LineSet) -> LineSet:
        return lines.with_columns(crs=self._opened.survey.crs)

    def _ahead(self, one: LineSet, end: int) -> LineSet:
        """Return the lines of the same kind ahead of the end of a line."""
        kind = str(one.kind[0])
        places, reach_m = places_ahead(one, end)
        if kind not in trace.TRACKED_AS:
            pieces = self._rails if kind in RAIL_KINDS else self._cables
            about = pieces.lines_about(places)
            return about.take(about.kind == kind)
        corridor = Corridor(self._ground.boxes)
        corridor.load(places, reach_m)
        lines = self._ground.lines(corridor)
        lines = lines.take(np.isin(lines.kind, trace.TRACKED_AS[kind]))
        return lines.with_columns(kind=np.full(len(lines), kind))

    def _standing(self, pick: GroundPick) -> TracedLine | None:
        """Return the whole guardrail, barrier or cable nearest to a place; None: there is none."""
        place, kind = pick.place, pick.kind
        near = Bounds(*place, *place).grown(HANGS_WITHIN_M)
        points = self._opened.points.points(
            near, ordered=False, with_time=False, with_intensity=False, with_columns=False
        )
        surface = self._surface.over(near)
        rows, cols = (int(v[0]) for v in surface.grid.to_cell(place[None]))
        height = points.xyz[:, 2] - (float(surface.ground_m[rows, cols]) + surface.z0_m)
        apart = np.hypot(*(points.xyz[:, :2] - place).T)
        found = []
        for pieces, kinds, within_m, (low_m, high_m) in (
            (self._rails, RAIL_KINDS, STANDS_WITHIN_M, STANDS_HIGH_M),
            (self._cables, CABLE_KINDS, HANGS_WITHIN_M, HANGS_HIGH_M),
        ):
            is_there = np.any((apart <= within_m) & (height > low_m) & (height < high_m))
            if is_there and kind in ("", *kinds):
                one = pieces.line_at(place, PICK_M)
                if one is not None and kind in ("", str(one[0].kind[0])):
                    found.append(one)
        if not found:
            return None
        line, distance_m = min(found, key=lambda one: one[1])
        stops = (str(TraceStop.FADED), str(TraceStop.FADED))
        if pick.direction is not None:
            line, stops = piece_toward(line, place, pick.direction, stops)
        return TracedLine(str(line.kind[0]), self._in_crs(line), distance_m, stops)

    def _refusal(self, place: FloatArray, kind: str) -> RefusedPickError:
        """Return the error for a place without a line: why, and where the nearest line is."""
        near, local = Bounds(*place, *place).grown(PICK_AROUND_M), place - self._origin[:2]
        points = self._opened.points.points(
            near, ordered=False, with_time=False, with_intensity=False, with_columns=False
        )
        corridor = Corridor(self._ground.boxes)
        corridor.load(place[None], PICK_AROUND_M)
        boxes = corridor.boxes
        boxes = boxes.take(np.hypot(*(boxes.centre[:, :2] - local).T) <= 1.5 * PICK_AROUND_M)
        path = self._ground.path
        way = None if path is None else path - np.asarray(self._origin)
        found = PickSurroundings.of(boxes, way, self._settings.obb.track)
        wanted = kind if kind in trace.TRACKED_AS else ""
        surface = self._surface.over(near)
        rows, cols = (int(v[0]) for v in surface.grid.to_cell(place[None]))
        reason = refusal_reason(
            points.xyz - np.asarray(self._origin), local, found, wanted=wanted,
            is_road=bool(surface.is_road[rows, cols]),
        )  # fmt: skip
        works, advice = nearest_trackable_place(local, found, wanted), "pick a place on a line"
        if reason is None:
            # There is a line, but it does not bound a carriageway: it stands behind another
            reason, works = NoLineReason.NO_ROAD, None
        there = None
        if works is not None:
            away_m, (east, north) = np.hypot(*(works[:2] - local)), works[:2] + self._origin[:2]
            advice = f"the nearest line is {away_m:.1f} m away, pick {east:.2f},{north:.2f}"
            there = float(east), float(north)
        return RefusedPickError(
            str(reason), f"within {PICK_M} m of {place[0]:.2f},{place[1]:.2f}",
            where=self._opened.survey.name, advice=advice, works=there,
        )  # fmt: skip


def _thinned(path: FloatArray) -> FloatArray:
    """Return the positions of a path (n, 3) at intervals of about `_PATH_STEP_M`."""
    along = distance_along(path)
    return np.asarray(path[np.unique(np.floor(along / _PATH_STEP_M), return_index=True)[1]])


def check_pick_kind(kind: str) -> None:
    """Refuse a kind of line that cannot be picked; "" stands for the nearest.

    Raises
    ------
    UsageError
        The message lists the kinds that can be picked.
    """
    if kind not in ("", *PICKED_KINDS):
        raise UsageError(
            f"{kind} cannot be picked", where=argument("kind"), advice=f"choose from {','.join(PICKED_KINDS)}"
        )


# Continuing a line beyond a gap that is too long for the tracker, because the user says that it is one line

#: Interval of the places ahead of an end that are searched, and the radius around the first of them. [m]
_STRIP_M = 4.0
#: Length of a line beyond a gap by which it is recognised. [m]
_BEYOND_M = 12.0
#: Growth of the search radius with the distance ahead, as a line may bend over a gap. [m/m]
_FAN = 0.1
#: Length that a line that was interrupted and its continuation have in common, by which they are joined. [m]
_OVERLAP_M = 3.0


def places_ahead(one: LineSet, end: int) -> tuple[FloatArray, FloatArray]:
    """Return places (n, 2) beyond a line's start (0) or end (1) [m], and the radius (n,) to search around each [m]."""
    tip, way = (part[end] for part in end_directions(one.xyz))
    along = np.arange(0.0, PICKED_TWICE.longest_m + _BEYOND_M, _STRIP_M)
    return tip + along[:, None] * way, _STRIP_M + _FAN * along


def continuation_beyond(one: LineSet, end: int, lines: LineSet) -> tuple[FloatArray, FloatArray] | None:
    """Return a place (2,) on the nearest line that continues beyond an end, and one further along it; None: no line.

    Parameters
    ----------
    lines
        Lines of the same kind ahead of the end.
    """
    tip, way = (part[end] for part in end_directions(one.xyz))
    best: tuple[float, FloatArray] | None = None
    for i in range(len(lines)):
        other = lines[i].xyz[:, :2]
        ahead_m = (other - tip) @ way
        if ahead_m.max() < PICK_M or not may_continue(one.xyz, lines[i].xyz, PICKED_TWICE.longest_m):
            continue
        if join_over_gap(one, lines.take([i])) is one:
            continue
        beyond = other[ahead_m > -_OVERLAP_M]
        beyond = beyond if (beyond[-1] - beyond[0]) @ way >= 0.0 else beyond[::-1]
        gap_m = float(np.hypot(*(beyond[0] - tip)))
        if len(beyond) > 1 and (best is None or gap_m < best[0]):
            best = gap_m, beyond
    if best is None:
        return None
    # The first vertex may be at an end, which is less certain
    return best[1][min(1, len(best[1]) - 2)], best[1][-1]


def join_over_gap(one: LineSet, new: LineSet) -> LineSet:
    """Return a line with its continuation, the gap bridged; the line alone if the other does not continue it."""
    found = continue_lines(one, new.with_columns(crs=one.crs))
    return found if len(found) == 1 else one


# The refusal of a pick: why no line can be followed from it, and the nearest place that works
