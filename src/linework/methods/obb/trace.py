"""From a picked place to one line: the box it means, the line through it, followed both ways."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass

import numpy as np

from linework.methods.obb import boundary_lines, marking_lines
from linework.methods.obb.follow import BoxSource, Step, Stop, follow_ways
from linework.methods.obb.smooth import SmoothLine
from linework.methods.obb.track import TrackConfig, Tracks, track_lines
from linework.methods.sight import Sight
from linework.model.arrays import FloatArray, IntArray
from linework.model.boxes import BoxSet
from linework.model.lines import LineSet

#: Kinds that can be picked, and the width within which boxes beside a line are the same feature. [m]
WIDTH_M = {"lane_marking": 0.06, "road_boundary": 0.15}
#: The paper's search area: a place picked no farther from a line than this means it. [m]
PICK_M = 0.50


@dataclass(frozen=True, slots=True)
class Pick:
    """The line that a place means: a box on it, and how far [m] the place is from it."""

    kind: str
    box: int
    distance_m: float


@dataclass(frozen=True, slots=True)
class Traced:
    """A followed line (with its dashes or its kerb top), and why it ends at its start and at its end."""

    lines: LineSet
    stops: tuple[Stop, Stop]


def pick_line(boxes: BoxSet, kind: str, xy: FloatArray, config: TrackConfig, seen: Sight) -> Pick | None:
    """Return the line nearest to a place among those through the boxes around it; None if none is near enough.

    A place in the gap of a dashed line, or behind a parked car, means the line that goes through it.
    """
    if len(boxes) == 0:
        return None
    tracks = track_lines(boxes, config, width_m=WIDTH_M[kind])
    best: Pick | None = None
    for line in _smoothed(boxes, tracks, kind, seen):
        distance, at = _nearest(line.xyz[:, :2], xy)
        if distance > PICK_M or (best is not None and distance >= best.distance_m):
            continue
        measured = np.flatnonzero(line.box >= 0)
        box = int(line.box[measured[np.argmin(np.abs(line.t_m[measured] - line.t_m[at]))]])
        best = Pick(kind, box, distance)
    return best


def trace_line(
    source: BoxSource, pick: Pick, config: TrackConfig, seen: Sight, toward: FloatArray | None = None
) -> Generator[Step, None, Traced]:
    """Follow the picked line; yield its steps and return it whole, as `extract` would.

    Parameters
    ----------
    toward
        (2,): follow it this way only; None: both ways.
    """
    ways: tuple[float, ...] = (1.0, -1.0)
    if toward is not None:
        ways = (1.0,) if float(toward @ source.boxes.u[pick.box]) >= 0.0 else (-1.0,)
    box, stops = yield from follow_ways(
        source, pick.box, ways, config, width_m=WIDTH_M[pick.kind], seen=seen
    )  # fmt: skip
    boxes = source.boxes
    tracks = Tracks(box, _ways(boxes, box), np.array([0, len(box)], dtype=np.int64))
    if pick.kind == "lane_marking":
        lines, other = marking_lines.marking_lines(boxes, tracks, seen)
        chosen = [m for m in lines if pick.box in m.boxes]
        # A short piece of paint is an arrow or a bar where nobody says what it is: here somebody does
        chosen = chosen or [m for m in other if pick.box in m.boxes]
        found = [
            marking_lines.as_lines(chosen, pick.kind),
            marking_lines.dash_lines(chosen, [""] * len(chosen)),
        ]
    else:
        bounds = [b for b in boundary_lines.boundaries(boxes, tracks, seen) if pick.box in b.boxes]
        found = [boundary_lines.as_lines(bounds), boundary_lines.top_lines(bounds)]
    return Traced(LineSet.concatenate(found), stops)


def _smoothed(boxes: BoxSet, tracks: Tracks, kind: str, seen: Sight) -> list[SmoothLine]:
    if kind == "lane_marking":
        lines, other = marking_lines.marking_lines(boxes, tracks, seen)
        return [m.line for m in (*lines, *other)]
    return [b.line for b in boundary_lines.boundaries(boxes, tracks, seen)]


def _ways(boxes: BoxSet, box: IntArray) -> FloatArray:
    """Return +1 where the line runs along a box's u-axis, -1 where against it."""
    step = np.gradient(boxes.centre[box, :2], axis=0) if len(box) > 1 else boxes.u[box]
    return np.where(np.sum(step * boxes.u[box], axis=1) >= 0.0, 1.0, -1.0)


def _nearest(line: FloatArray, xy: FloatArray) -> tuple[float, int]:
    """Return the distance of a place from a line (n, 2), and the vertex before the nearest point."""
    a, b = line[:-1], line[1:]
    way = b - a
    length2 = np.maximum(np.sum(way * way, axis=1), 1e-12)
    share = np.clip(np.sum((xy - a) * way, axis=1) / length2, 0.0, 1.0)
    distance = np.linalg.norm(a + share[:, None] * way - xy, axis=1)
    i = int(np.argmin(distance))
    return float(distance[i]), i
