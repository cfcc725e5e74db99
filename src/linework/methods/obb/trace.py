"""A single line by a picked place: which of the tracked lines it is, its companions, and why it ends."""

from __future__ import annotations

from enum import StrEnum

import numpy as np

from linework.arrays import FloatArray
from linework.lines.companions import closes_on_itself, nearest_vertex
from linework.methods.obb.joining import SAME_BOUNDARY_M, SAME_PAINT_BOXES_M
from linework.methods.protocol import Sight
from linework.methods.tracking.boundary_lines import boundary_line_set as boundary_set
from linework.methods.tracking.boundary_lines import smooth_boundaries
from linework.methods.tracking.marking_lines import marking_line_set as marking_set
from linework.methods.tracking.marking_lines import marking_lines
from linework.methods.tracking.track import TrackConfig, track_lines
from linework.model.boxes import BoxForm, BoxSet
from linework.model.lines import LINE_COLUMNS, VERTEX_COLUMNS, LineSet

#: Largest distance of a picked place from its line: the paper's search area. [m]
PICK_M = 0.50
#: Kinds that a line picked as a kind may be tracked as: a short piece of paint is first taken for a bar.
TRACKED_AS = {
    "lane_marking": ("lane_marking", "road_marking_other"),
    "road_boundary": ("road_boundary",),
}
#: Forms of the boxes of each kind.
_FORMS = {
    "lane_marking": (BoxForm.STRIPE,),
    "road_boundary": (BoxForm.KERB, BoxForm.EDGE, BoxForm.BARRIER, BoxForm.CHANGE, BoxForm.CHANNEL),
}
#: Length beyond an end that is checked for measured ground. [m]
_AHEAD_M = 3.0
#: An end within this of a line may belong to the same line, found twice. [m]
_ON_LINE_M = 0.5


class TraceStop(StrEnum):
    """Why a line ends, as users read it."""

    END_OF_DATA = "the points end there"
    FADED = "nothing more of it is seen there, though the ground was measured"
    RING = "the line closes on itself"
    PICKED = "it was picked there"
    INTERRUPTED = "it was interrupted there"


def nearest_line(lines: LineSet, xy: FloatArray, kind: str = "") -> tuple[int, str, float]:
    """Return the line picked by a place (2,), the kind it is picked as, and its distance [m]; -1 without one.

    Parameters
    ----------
    kind
        A key of `TRACKED_AS`, or "" for any.
    """
    best = -1, "", float("inf")
    for picked_as, kinds in TRACKED_AS.items():
        if kind not in ("", picked_as):
            continue
        for i in np.flatnonzero(np.isin(lines.kind, kinds)).tolist():
            distance_m = nearest_vertex(lines[i].xyz[:, :2], xy)[1]
            if distance_m <= PICK_M and distance_m < best[2]:
                best = i, picked_as, distance_m
    return best


def line_piece(one: LineSet, vertices: slice) -> LineSet:
    """Return a piece of a single line, of two vertices at least."""
    columns = {name: getattr(one, name)[vertices] for name in VERTEX_COLUMNS}
    columns |= {name: getattr(one, name) for name in LINE_COLUMNS}
    return LineSet.from_lines([one.xyz[vertices]], crs=one.crs, **columns)


def may_continue(line: FloatArray, other: FloatArray, longest_m: float) -> bool:
    """Return whether another line (k, 3) may continue one (n, 3): an end of it lies ahead, or on the line.

    A quick test with no false negatives, so that few pairs of lines need a closer one.
    """
    tips, outward = end_directions(line)
    for end in other[[0, -1], :2]:
        step = end - tips
        far = np.hypot(*step.T)
        if np.any((far <= longest_m) & (np.sum(step * outward, axis=1) >= 0.5 * far)):
            return True
        if nearest_vertex(line[:, :2], end)[1] <= _ON_LINE_M:
            return True
    return False


def oriented_like(one: LineSet, before: LineSet) -> LineSet:
    """Return a single line in the direction of an earlier version of it, most of which it covers."""
    ends = before.xyz[[0, -1], :2]
    i, k = (nearest_vertex(one.xyz[:, :2], end)[0] for end in ends)
    if i < k or (i == k and float((one.xyz[-1, :2] - one.xyz[0, :2]) @ (ends[1] - ends[0])) >= 0.0):
        return one
    columns = {name: getattr(one, name)[::-1] for name in VERTEX_COLUMNS}
    return one.with_columns(xyz=one.xyz[::-1], **columns)


def end_directions(line: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the ends (2, 2) [m] of a line (n, 3), start first, and the outward unit vectors (2, 2) there."""
    away = np.hypot(*(line[:, :2] - line[0, :2]).T), np.hypot(*(line[:, :2] - line[-1, :2]).T)
    first = line[int(np.argmax(away[0] >= min(_AHEAD_M, away[0].max()))), :2]
    last = line[len(line) - 1 - int(np.argmax(away[1][::-1] >= min(_AHEAD_M, away[1].max()))), :2]
    tips = line[[0, -1], :2]
    outward = tips - np.stack([first, last])
    return tips, outward / np.maximum(np.hypot(*outward.T), 1e-9)[:, None]


def stop_reasons(line: FloatArray, visible: Sight) -> tuple[TraceStop, TraceStop]:
    """Return why a line (n, 3) ends at its start and at its end."""
    tips, outward = end_directions(line)
    if closes_on_itself(line):
        return TraceStop.RING, TraceStop.RING
    start, end = (_stop(tip, ahead, visible) for tip, ahead in zip(tips, outward, strict=True))
    return start, end


def _stop(tip: FloatArray, outward: FloatArray, visible: Sight) -> TraceStop:
    """Return why a line ends at a tip (2,): no measured ground ahead, or nothing on it."""
    left = np.array([-outward[1], outward[0]])
    ahead = tip + np.linspace(0.5, _AHEAD_M, 6)[:, None] * outward
    places = np.concatenate([ahead, ahead + 0.5 * left, ahead - 0.5 * left])
    return TraceStop.FADED if np.mean(visible(places)) > 0.5 else TraceStop.END_OF_DATA


def near_line(
    boxes: BoxSet, place: FloatArray, kind: str, config: TrackConfig, visible: Sight
) -> LineSet | None:
    """Return the smoothed line nearest to a place (2,), within reach of a pick, from the boxes found so far; or None.

    Parameters
    ----------
    boxes, place
        [m, from the survey's local origin]
    kind
        A key of `TRACKED_AS`, or "" for any.
    visible
        Whether road or ground was measured at places [m, from the local origin].

    Notes
    -----
    By the tracker of the method, but only through boxes of one form and without the lines beside it, so it takes
    milliseconds. What the line is, and whether it is one, is decided once it is whole.
    """
    best, best_m = None, PICK_M
    for form_kind in (kind,) if kind else TRACKED_AS:
        for form in _FORMS[form_kind]:
            part = boxes.take(boxes.form == form)
            for line in _lines_near(part, place, form_kind, config, visible):
                apart_m = nearest_vertex(line.xyz[:, :2], place)[1]
                if apart_m <= best_m:
                    best, best_m = line, apart_m
    return best


def _lines_near(
    boxes: BoxSet, place: FloatArray, kind: str, config: TrackConfig, visible: Sight
) -> list[LineSet]:
    """Return the lines of the tracks that pass a place, each as a set of its own."""
    paint = kind == "lane_marking"
    tracks = track_lines(boxes, config, width_m=SAME_PAINT_BOXES_M if paint else SAME_BOUNDARY_M)
    near = [
        nearest_vertex(boxes.centre[tracks.line(i)[0], :2], place)[1] <= 2.0 * PICK_M
        for i in range(len(tracks))
    ]
    tracks = tracks.take(np.array(near, dtype=np.bool_))
    if paint:
        markings, other, _ = marking_lines(boxes, tracks, visible)
        lines = marking_set([*markings, *other], kind)
    else:
        lines = boundary_set(smooth_boundaries(boxes, tracks, visible))
    return [lines.take([i]) for i in range(len(lines))]
