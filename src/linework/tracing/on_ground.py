"""Following a lane marking or a road boundary from a picked place on an opened survey, step by step.

Separate from `trace`, which takes the request and crosses gaps: this follows markings and boundaries by boxes.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass

import numpy as np

from linework.arrays import BoolArray, FloatArray, distance_along
from linework.editing.edits.continued import Gap, continue_lines
from linework.lines.companions import COMPANION_BESIDE_M, companions_of, nearest_vertex
from linework.methods.obb import trace
from linework.methods.obb.method import Obb
from linework.methods.obb.trace import TraceStop, near_line
from linework.methods.protocol import Sight, SurveyContext
from linework.model.grid import Bounds
from linework.model.lines import LineSet
from linework.tracing.boxes import Corridor, SurveyBoxes

#: Radius of the first search around a place: enough of a line to recognise it. [m]
NEAR_PICK_M = 4.0
#: Radius in which the lines around a picked place are found: across the gaps of dashed lines. [m]
PICK_AROUND_M = 16.0
#: Half width of the strip along a line, and beyond its ends, in which boxes are found. [m]
STRIP_M = 4.0
#: While a line grows: half width and length of the strip ahead of its end in which boxes are found. [m]
TIP_M, GROWTH_STEP_M = 1.5, 12.0
#: Places along a grown line that are searched between two steps: 40 m, whose points are read at once. [places]
_AT_ONCE = 10
#: Least advance of an end that counts as growth. [m]
_LEAST_GROWTH_M = 0.5
#: A picked line continues in another that is in line with it, over gaps up to the longest of the tracker.
SAME_LINE = Gap(longest_m=32.0, off_deg=1.0, turn_deg=20.0)
#: Distance from a line within which the path of the vehicle matters to it. [m]
_PATH_M = 100.0

Growth = Generator[LineSet, bool | None, bool]


@dataclass(frozen=True, slots=True)
class GroundSurvey:
    """What following a line on the ground needs of a survey.

    Parameters
    ----------
    origin
        Local origin. [m, world]
    is_visible
        Returns for (n, 2) places [m, world] whether road or ground was measured there.
    path
        (n, 3) positions of the vehicle [m, world], or None.
    """

    boxes: SurveyBoxes
    method: Obb
    origin: tuple[float, float, float]
    is_visible: Sight
    path: FloatArray | None

    def lines(self, corridor: Corridor) -> LineSet:
        """Return all lines in a corridor. [m, world]"""  # noqa: D400
        return self.method.join(corridor.boxes, self._context(corridor))

    def joining(self, corridor: Corridor) -> Generator[None, None, LineSet]:
        """Return what `lines` returns; yield after each step of the method."""
        survey = self._context(corridor)
        now = self.method.begin_join(corridor.boxes, survey)
        for step in self.method.join_steps:
            now = step(now)
            yield
        return self.method.end_join(now, survey)

    def _context(self, corridor: Corridor) -> SurveyContext:
        path = self._path_near(corridor.bounds)
        return SurveyContext(origin=self.origin, is_visible=self.is_visible, path=path)

    def near(self, corridor: Corridor, place: FloatArray, kind: str) -> LineSet | None:
        """Return the line that passes a place (2,) [m, world], as far as it is in the boxes found so far."""
        corner = np.asarray(self.origin[:2])

        def is_visible(xy: FloatArray) -> BoolArray:
            return self.is_visible(xy + corner)

        local = place - corner
        one = near_line(corridor.boxes, local, kind, self.method.config.track, is_visible)
        return None if one is None else one.with_columns(xyz=one.xyz + np.asarray(self.origin))

    def _path_near(self, bounds: Bounds) -> FloatArray | None:
        if self.path is None:
            return None
        near, (x, y) = bounds.grown(_PATH_M), self.path[:, :2].T
        inside = (x >= near.west) & (x <= near.east) & (y >= near.south) & (y <= near.north)
        return np.asarray(self.path[inside]) if inside.any() else None


@dataclass(frozen=True, slots=True)
class GroundPick:
    """A place (2,) [m, world], the kind of line ("": any), and the direction (2,) to follow (None: both)."""

    place: FloatArray
    kind: str = ""
    direction: FloatArray | None = None

    def ends(self, one: LineSet) -> list[int]:
        """Return the ends at which a line is followed: 0 its start, 1 its end."""
        outward = trace.end_directions(one.xyz)[1]
        return [k for k in (0, 1) if self.direction is None or float(outward[k] @ self.direction) > 0.0]


@dataclass(frozen=True, slots=True)
class FollowedLine:
    """A followed line with its companions, its kind, its distance from the place [m], and why it ends."""

    kind: str
    lines: LineSet
    distance_m: float
    stops: tuple[str, str]


def follow_ground(
    ground: GroundSurvey, pick: GroundPick
) -> Generator[LineSet, bool | None, FollowedLine | None]:
    """Follow the line at a place; yield it while it grows, and return it whole; None: there is no line.

    ``send(True)`` stops it: what was followed so far is returned.
    """
    corridor = Corridor(ground.boxes)
    # First as fast as possible: only boxes of the line itself
    grown, is_stopped = yield from _grown(ground, corridor, pick)
    # Then with everything beside it, which decides what the line is and where it ends
    corridor.load(pick.place[None], PICK_AROUND_M)
    if grown is not None:
        along = _every(grown.xyz[:, :2], STRIP_M)
        for first in range(0, len(along), _AT_ONCE):
            corridor.load(along[first : first + _AT_ONCE], STRIP_M)
            # Long lines take a while: the line has not changed, but the user may stop it
            is_stopped = bool((yield grown)) or is_stopped
            if is_stopped:
                break
    one, lines, stop = yield from _whole(ground, corridor, pick, grown)
    is_stopped = is_stopped or stop
    while one is not None and not is_stopped:
        shown = one if grown is None else trace.oriented_like(one, grown)
        is_stopped = bool((yield shown))
        tips, ways = trace.end_directions(one.xyz)
        ahead = np.arange(0.0, SAME_LINE.longest_m + STRIP_M, STRIP_M)[:, None]
        new = [corridor.load(tips[k] + ahead * ways[k], STRIP_M) for k in pick.ends(one) if not is_stopped]
        if not any(new):
            break
        one, lines, is_stopped = yield from _whole(ground, corridor, pick, shown)
    if one is None:
        return None
    one = one if grown is None else trace.oriented_like(one, grown)
    return _followed(ground, pick, one, lines, is_stopped=is_stopped)


def _grown(
    ground: GroundSurvey, corridor: Corridor, pick: GroundPick
) -> Generator[LineSet, bool | None, tuple[LineSet | None, bool]]:
    """Follow a line by its own boxes alone; return it, and whether it was stopped."""
    corridor.load(pick.place[None], NEAR_PICK_M, pick.kind)
    one = ground.near(corridor, pick.place, pick.kind)
    if one is None:
        return None, False
    left = pick.ends(one)
    while True:
        if (yield one):
            return one, True
        for end in list(left):
            longer = _longer(ground, corridor, pick, one, end)
            if longer is None:
                left.remove(end)
            else:
                one = longer
        if not left:
            return one, False


def _longer(
    ground: GroundSurvey, corridor: Corridor, pick: GroundPick, one: LineSet, end: int
) -> LineSet | None:
    """Return a line that is longer at an end: first nearby, then beyond a gap; None: it ends there."""
    kind = str(one.kind[0])
    tips, ways = trace.end_directions(one.xyz)
    for reach_m in (GROWTH_STEP_M, ground.method.config.track.longest_gap_m + STRIP_M):
        ahead = np.arange(0.0, reach_m, TIP_M)[:, None]
        if not corridor.load(tips[end] + ahead * ways[end], TIP_M, kind):
            continue
        new = ground.near(corridor, pick.place, kind)
        if new is None:
            continue
        new = trace.oriented_like(new, one)
        if float((new.xyz[-end, :2] - tips[end]) @ ways[end]) >= _LEAST_GROWTH_M:
            return new
    return None


def _whole(
    ground: GroundSurvey, corridor: Corridor, pick: GroundPick, shown: LineSet | None
) -> Generator[LineSet, bool | None, tuple[LineSet | None, LineSet, bool]]:
    """Return the line at a place with its continuations (None: there is no line), all lines, and whether to stop.

    The line that is `shown` is yielded between the steps, each of which may take a while for a long line.
    """
    steps, is_stopped = ground.joining(corridor), False
    while True:
        try:
            next(steps)
        except StopIteration as end:
            lines: LineSet = end.value
            break
        if shown is not None:
            is_stopped = bool((yield shown)) or is_stopped
    i, kind, _ = trace.nearest_line(lines, pick.place, pick.kind)
    one = None if i < 0 else _gone_on(lines, i).with_columns(kind=np.array([kind]))
    return one, lines, is_stopped


def _gone_on(lines: LineSet, i: int) -> LineSet:
    """Return a line with those that continue it."""
    one, rest = lines.take([i]), np.flatnonzero(lines.kind == lines.kind[i])
    left = [k for k in rest.tolist() if k != i]
    while left:
        for k in left:
            if not trace.may_continue(one.xyz, lines[k].xyz, SAME_LINE.longest_m):
                continue
            joined = continue_lines(one, lines.take([k]), SAME_LINE)
            if len(joined) == 1:
                one, left = joined, [other for other in left if other != k]
                break
        else:
            break
    return one


def _followed(
    ground: GroundSurvey, pick: GroundPick, one: LineSet, lines: LineSet, *, is_stopped: bool
) -> FollowedLine:
    """Return a finished line: cut at the place if it is followed one way, with its companions, and why it ends."""
    distance_m = nearest_vertex(one.xyz[:, :2], pick.place)[1]
    starts, ends = trace.stop_reasons(one.xyz, ground.is_visible)
    if is_stopped and starts is not TraceStop.RING:
        open_ends = pick.ends(one)
        starts, ends = (
            TraceStop.INTERRUPTED if k in open_ends else stop for k, stop in enumerate((starts, ends))
        )
    stops = (str(starts), str(ends))
    if pick.direction is not None:
        one, stops = piece_toward(one, pick.place, pick.direction, stops)
    parts = [
        one,
        *(lines.take(companions_of(lines, one.xyz, name)) for name in COMPANION_BESIDE_M),
    ]
    return FollowedLine(str(one.kind[0]), LineSet.concatenate(parts), distance_m, stops)


def piece_toward(
    one: LineSet, place: FloatArray, direction: FloatArray, stops: tuple[str, str]
) -> tuple[LineSet, tuple[str, str]]:
    """Return the piece of a line from a place (2,) on in a direction (2,), and why it ends."""
    i = min(max(nearest_vertex(one.xyz[:, :2], place)[0], 1), len(one.xyz) - 2)
    ahead = one.xyz[min(i + 4, len(one.xyz) - 1), :2] - one.xyz[max(i - 4, 0), :2]
    if float(ahead @ direction) >= 0.0:
        return trace.line_piece(one, slice(i, None)), (str(TraceStop.PICKED), stops[1])
    return trace.line_piece(one, slice(0, i + 2)), (stops[0], str(TraceStop.PICKED))


def _every(xy: FloatArray, step_m: float) -> FloatArray:
    """Return places (k, 2) along a line (n, 2), at most `step_m` apart [m]."""
    t = distance_along(xy)
    at = np.linspace(0.0, t[-1], int(np.ceil(t[-1] / step_m)) + 1)
    return np.column_stack([np.interp(at, t, column) for column in xy.T])
