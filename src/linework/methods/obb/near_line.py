"""The line that passes a place, out of the boxes found so far: what is seen of it while it grows."""

from __future__ import annotations

import numpy as np

from linework.arrays import FloatArray
from linework.methods.obb.boundary_lines import as_lines as boundary_set
from linework.methods.obb.boundary_lines import boundaries
from linework.methods.obb.marking_lines import as_lines as marking_set
from linework.methods.obb.marking_lines import marking_lines
from linework.methods.obb.method import SAME_BOUNDARY_M, SAME_PAINT_M
from linework.methods.obb.trace import PICK_M, TRACKED_AS, nearest_vertex
from linework.methods.obb.track import TrackConfig, track_lines
from linework.methods.sight import Sight
from linework.model.boxes import BoxForm, BoxSet
from linework.model.lines import LineSet

#: What shows a line of each kind.
_FORMS = {
    "lane_marking": (BoxForm.STRIPE,),
    "road_boundary": (BoxForm.KERB, BoxForm.EDGE, BoxForm.BARRIER),
}


def near_line(
    boxes: BoxSet, place: FloatArray, kind: str, config: TrackConfig, seen: Sight
) -> LineSet | None:
    """Return the line nearest to a place (2,), within reach of a pick, smoothed; None if there is none.

    Parameters
    ----------
    boxes, place
        [m, from the survey's local origin]
    kind
        A key of `linework.methods.obb.trace.TRACKED_AS`, or "" for any.
    seen
        Says where road or ground was measured [m, from the local origin].

    Notes
    -----
    By the tracker of `ObbMethod.track`, but only through boxes of one form, and nothing of what lies beside the line
    is looked at: so it takes milliseconds. What the line is, and whether it is one, only the whole of it tells.
    """
    best, best_m = None, PICK_M
    for form_kind in (kind,) if kind else TRACKED_AS:
        for form in _FORMS[form_kind]:
            part = boxes.take(boxes.form == form)
            for line in _lines_near(part, place, form_kind, config, seen):
                apart_m = nearest_vertex(line.xyz[:, :2], place)[1]
                if apart_m <= best_m:
                    best, best_m = line, apart_m
    return best


def _lines_near(
    boxes: BoxSet, place: FloatArray, kind: str, config: TrackConfig, seen: Sight
) -> list[LineSet]:
    """Return the lines through those tracks that pass a place, each by itself."""
    paint = kind == "lane_marking"
    tracks = track_lines(boxes, config, width_m=SAME_PAINT_M if paint else SAME_BOUNDARY_M)
    near = [
        nearest_vertex(boxes.centre[tracks.line(i)[0], :2], place)[1] <= 2.0 * PICK_M
        for i in range(len(tracks))
    ]
    tracks = tracks.take(np.array(near, dtype=np.bool_))
    if paint:
        markings, other = marking_lines(boxes, tracks, seen)
        lines = marking_set([*markings, *other], kind)
    else:
        lines = boundary_set(boundaries(boxes, tracks, seen))
    return [lines.take([i]) for i in range(len(lines))]
