"""Road boundaries and kerb tops out of tracked boundary boxes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from linework.arrays import BoolArray, FloatArray, IntArray
from linework.kernels.tracking.track import SHARED
from linework.methods.protocol import Sight, visible_share
from linework.methods.tracking.marking_lines import confidence_of
from linework.methods.tracking.smooth import SmoothLine, smooth_line, smooth_value
from linework.methods.tracking.track import Tracks
from linework.model.boxes import BoxForm, BoxSet
from linework.model.lines import LineSet

#: A boundary runs on through dropped kerbs of drives: up to 6 m wide, with ramps of 1 m on either side, and a box
#: short of each; where it is not seen for longer, on ground that was, it has ended: mouths of streets are 11 m and
#: more from kerb to kerb. [m]
LONGEST_DROP_M = 10.0
#: Shorter boundaries are tree pits, drains, edges of things that lie about. [m]
LEAST_BOUNDARY_M = 4.0
#: Without a step there is less to go by: shorter edges are patches. [m]
LEAST_PAVEMENT_EDGE_M = 8.0
#: And boxes that rather are none than one make no line, however many.
LEAST_BOUNDARY_SCORE = 0.5
#: Without a box for longer than this a boundary was not measured. [m]
UNMEASURED_M = 1.5
#: Tufts of grass and a verge's shadow hide a pavement's edge over some metres alike: so many boxes err as one.
SHARED_EDGE = 6.0
#: A kerb's height and width keep still: they change by so much over ten metres, squared, per metre. [m]
STEP_CHANGE = 0.02**2 / 10.0
FORMS = {BoxForm.KERB: "kerb", BoxForm.EDGE: "edge", BoxForm.BARRIER: "barrier"}


@dataclass(frozen=True, slots=True)
class SmoothBoundary:
    """A smoothed boundary.

    Parameters
    ----------
    top
        The top edge of the step at the same stations; NaN where there is none.
    boxes
        (k,) int64: the boxes it was tracked through.
    form
        kerb, edge or barrier.
    height_m
        (n,) float64 [m]: height of the step, per station.
    confidence
        0 to 1.
    times_s
        First and last time of its points. [s]
    """

    line: SmoothLine
    top: SmoothLine
    boxes: IntArray
    form: str
    height_m: FloatArray
    confidence: float
    times_s: tuple[float, float]


def smooth_boundaries(boxes: BoxSet, tracks: Tracks, seen: Sight) -> list[SmoothBoundary]:
    """Return the boundaries among tracked boxes, the carriageway to the left of each."""
    found: list[SmoothBoundary] = []
    for i in range(len(tracks)):
        box, way = tracks.line(i)
        box = box if way.sum() >= 0 else box[::-1]
        pieces = _pieces(boxes, box, seen)
        found += [_boundary(boxes, piece) for piece in pieces if _is_line(boxes, piece)]
    return found


def _is_line(boxes: BoxSet, box: IntArray) -> bool:
    """Return whether boxes are enough for a line: by length, and, without a kerb, by what they say themselves."""
    if boxes.form[box[0]] == BoxForm.KERB:
        return bool(boxes.along(box)[-1] >= LEAST_BOUNDARY_M)
    return bool(
        boxes.along(box)[-1] >= LEAST_PAVEMENT_EDGE_M and np.mean(boxes.score[box]) >= LEAST_BOUNDARY_SCORE
    )


def _pieces(boxes: BoxSet, box: IntArray, seen: Sight) -> list[IntArray]:
    """Return the boxes of a track, cut where the boundary has ended."""
    gap = np.diff(boxes.along(box))
    cuts = [
        k + 1
        for k in np.flatnonzero(gap > LONGEST_DROP_M).tolist()
        if visible_share(seen, boxes.centre[box[k]], boxes.centre[box[k + 1]]) > 0.5
    ]
    return [piece for piece in np.split(box, cuts) if len(piece) >= 3]


def _boundary(boxes: BoxSet, box: IntArray) -> SmoothBoundary:
    reach = float(boxes.half_u_m[box[0]]), float(boxes.half_u_m[box[-1]])
    form = int(np.argmax(np.bincount(boxes.form[box], weights=boxes.score[box], minlength=5)))
    line = smooth_line(boxes, box, reach, SHARED if form == BoxForm.KERB else SHARED_EDGE)
    at = np.maximum(line.box, 0)
    is_form = line.is_measured & (boxes.form[at] == form)
    height = smooth_value(line.t_m, np.where(is_form, boxes.height_m[at], np.nan), STEP_CHANGE)
    top_v = smooth_value(line.t_m, np.where(is_form, boxes.top_v_m[at], np.nan), STEP_CHANGE)
    top = replace(
        line,
        xyz=line.xyz + np.column_stack([top_v[0][:, None] * line.normal, height[0]]),
        sigma_xy_m=np.hypot(line.sigma_xy_m, top_v[1]),
        sigma_z_m=np.hypot(line.sigma_z_m, height[1]),
    )
    confidence = confidence_of(boxes.score[box], line.sigma_xy_m)
    return SmoothBoundary(line, top, box, FORMS[BoxForm(form)], height[0], confidence, boxes.time_span(box))


def bridged_boundary_stations(line: SmoothLine) -> BoolArray:
    """Return (n,) which stations lie in gaps without a box."""
    measured = line.t_m[line.is_measured]
    after = np.searchsorted(measured, line.t_m, side="left")
    before = np.maximum(after - 1, 0)
    after = np.minimum(after, len(measured) - 1)
    width = measured[after] - measured[before]
    return np.asarray(~line.is_measured & (width > UNMEASURED_M))


def boundary_line_set(found: Sequence[SmoothBoundary]) -> LineSet:
    """Return boundaries as lines, in local coordinates."""
    return _line_set(found, "road_boundary", [b.line for b in found])


def top_lines(found: Sequence[SmoothBoundary]) -> LineSet:
    """Return the top edges of kerbs."""
    kerbs = [b for b in found if b.form == "kerb" and np.isfinite(b.top.xyz).all()]
    return _line_set(kerbs, "kerb_top", [b.top for b in kerbs])


def _line_set(found: Sequence[SmoothBoundary], kind: str, lines: Sequence[SmoothLine]) -> LineSet:
    if not found:
        return LineSet.empty()
    return LineSet.from_lines(
        [line.xyz for line in lines],
        kind=[kind] * len(found),
        method=["obb"] * len(found),
        form=[b.form for b in found],
        sigma_xy_m=np.concatenate([line.sigma_xy_m for line in lines]),
        sigma_z_m=np.concatenate([line.sigma_z_m for line in lines]),
        bridged=np.concatenate([bridged_boundary_stations(line) for line in lines]),
        height_m=[float(np.median(b.height_m)) for b in found],
        confidence=[b.confidence for b in found],
        time_start_s=[b.times_s[0] for b in found],
        time_end_s=[b.times_s[1] for b in found],
    )
