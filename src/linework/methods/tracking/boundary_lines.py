"""Road boundaries and kerb tops from tracked boundary boxes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from linework.arrays import BoolArray, FloatArray, IntArray
from linework.kernels.boundaries.evenness import WINDOW_M
from linework.kernels.cables.fit import MAD
from linework.kernels.tracking.track import SHARED
from linework.methods.protocol import Sight, visible_share
from linework.methods.tracking.arrangement import FACING_M
from linework.methods.tracking.fitted import LEAST_BOUNDARY_SCORE, SHARED_EDGE
from linework.methods.tracking.marking_lines import confidence_of
from linework.methods.tracking.neighbours import LineAxis
from linework.methods.tracking.smooth import SmoothLine, smooth_line, smooth_value
from linework.methods.tracking.track import Tracks
from linework.model.boxes import BoxForm, BoxSet
from linework.model.lines import LineSet

#: Longest gap of a boundary on ground that was measured: dropped kerbs of drives are up to 6 m wide, with ramps of 1 m
#: on either side and a box missing at each; mouths of streets are 11 m wide and more from kerb to kerb. [m]
LONGEST_DROP_M = 10.0
#: Shortest boundary: tree pits, drains and objects on the road are shorter. [m]
LEAST_BOUNDARY_M = 4.0
#: Shortest edge without a kerb: patches of asphalt are shorter. [m]
LEAST_PAVEMENT_EDGE_M = 8.0
#: Stations in a gap without a box longer than this count as bridged. [m]
UNMEASURED_M = 1.5
#: Chance that a channel ends its carriageway where nothing but the fall of the ground says so: lanes that drain to their
#: middle, parking strips and drives have channels as well. The simulated roads have none of these, so that this is an
#: estimate, kept below what overrules other lines. [1]
CHANNEL_IS_EDGE = 0.8
#: Unevenness over some metres at which a road is as likely as open land, and classes of ISO 8608 between the two: public
#: roads are of class A to C, land that is driven over of E to G. The figure is what is left of class D (1024e-6 m3 at 0.1
#: cycles/m, alike in all directions) in the windows of `linework.kernels.boundaries.evenness`. [m]
POOR_ROAD_M, CLASSES_APART = 0.0066, 4.0
#: Density of the random walk of a kerb's height and width: they change by 2 cm over ten metres. [m]
STEP_CHANGE = 0.02**2 / 10.0
#: Noise of the ground behind a step over that of the floor before it, from which on it is no stone or paving: three
#: quarters of its variance, and more, are then of its own, as floor and stone are measured by the same scanner at the same
#: range. Kerbs with grass close behind have up to 1.7 (the real motorway here-a22).
ROUGH_BEHIND = 2.0
#: Why boxes make no boundary.
SHORT = "short: patches and objects are as long"
LESS_LIKELY = "less likely an edge than even ground"
#: Names of the forms of boxes, as lines have them.
FORMS = {BoxForm.KERB: "kerb", BoxForm.EDGE: "edge", BoxForm.BARRIER: "barrier"} | dict.fromkeys(
    (BoxForm.CHANGE, BoxForm.CHANNEL), "edge"
)


@dataclass(frozen=True, slots=True)
class SmoothBoundary:
    """A smoothed boundary.

    Parameters
    ----------
    line
        The foot of the step, or the edge.
    top
        The top edge of the step at the same stations; NaN where there is none.
    boxes
        (k,) int64: the boxes it was tracked through.
    form
        kerb, edge or barrier.
    height_m
        (n,) float64 [m]: height of the step at each station.
    confidence
        0 to 1: that there is such an edge.
    times_s
        First and last time of its points. [s]
    scores, contrasts, rougher
        (k,) float64: those of the boxes.
    on_road
        Chance that the ground on its carriageway's side is road rather than open land, by its evenness alone; 1 for
        kerbs, which are built.
    """

    line: SmoothLine
    top: SmoothLine
    boxes: IntArray
    form: str
    height_m: FloatArray
    confidence: float
    times_s: tuple[float, float]
    scores: FloatArray
    contrasts: FloatArray
    rougher: FloatArray
    on_road: float


def facing(boxes: BoxSet, path: Sequence[LineAxis]) -> BoxSet:
    """Return boxes turned so that the nearest place of the vehicle's path within `FACING_M` lies on their left.

    Where there is none, either side may be the carriageway's: the more even one counts.
    """
    left, right = boxes.uneven_m2, boxes.uneven_right_m2
    either = np.fmin(left, right)
    if not path or len(boxes) == 0:
        return replace(boxes, uneven_m2=either)
    xy = np.concatenate([axis.xy for axis in path])
    distance, nearest = cKDTree(xy).query(boxes.centre[:, :2], distance_upper_bound=FACING_M)
    near = np.isfinite(distance)
    step = xy[np.where(near, nearest, 0)] - boxes.centre[:, :2]
    turned = near & (boxes.u[:, 0] * step[:, 1] - boxes.u[:, 1] * step[:, 0] < 0.0)
    sign = np.where(turned, -1.0, 1.0)
    contrast = np.where(turned, 1.0 / boxes.contrast, boxes.contrast)
    return replace(
        boxes, u=boxes.u * sign[:, None], height_m=boxes.height_m * sign, contrast=contrast,
        uneven_m2=np.where(turned, right, np.where(near, left, either)),
        uneven_right_m2=np.where(turned, left, right),
    )  # fmt: skip


def smooth_boundaries(boxes: BoxSet, tracks: Tracks, visible: Sight) -> list[SmoothBoundary]:
    """Return the boundaries among tracked boxes, each with the carriageway to its left.

    Parameters
    ----------
    boxes
        Of one form: kerbs, edges or barriers.
    visible
        Whether road or ground was measured at places [m, local].
    """
    pieces = _all_pieces(boxes, tracks, visible)
    return [_boundary(boxes, piece) for piece in pieces if not _why_no_line(boxes, piece)]


def unlikely_boundaries(boxes: BoxSet, tracks: Tracks, visible: Sight) -> list[tuple[SmoothBoundary, str]]:
    """Return the pieces of some length among tracked boxes that make no boundary by themselves, and why."""
    found = [(piece, _why_no_line(boxes, piece)) for piece in _all_pieces(boxes, tracks, visible)]
    return [
        (_boundary(boxes, piece), why)
        for piece, why in found
        if why and boxes.along(piece)[-1] >= LEAST_BOUNDARY_M
    ]


def _all_pieces(boxes: BoxSet, tracks: Tracks, visible: Sight) -> list[IntArray]:
    """Return the boxes of each piece, in the direction in which most of them see the carriageway to their left."""
    found: list[IntArray] = []
    for i in range(len(tracks)):
        box, sense = tracks.line(i)
        found += _pieces(boxes, box if sense.sum() >= 0 else box[::-1], visible)
    return found


def _why_no_line(boxes: BoxSet, box: IntArray) -> str:
    """Return why boxes make no line, by its length and, without a kerb, by their scores; "" where they do."""
    is_kerb = boxes.form[box[0]] == BoxForm.KERB
    if boxes.along(box)[-1] < (LEAST_BOUNDARY_M if is_kerb else LEAST_PAVEMENT_EDGE_M):
        return SHORT
    return "" if is_kerb or np.mean(boxes.score[box]) >= LEAST_BOUNDARY_SCORE else LESS_LIKELY


def _pieces(boxes: BoxSet, box: IntArray, visible: Sight) -> list[IntArray]:
    """Return the boxes of a track, cut where the boundary has ended."""
    gap = np.diff(boxes.along(box))
    cuts = [
        k + 1
        for k in np.flatnonzero(gap > LONGEST_DROP_M).tolist()
        if visible_share(visible, boxes.centre[box[k]], boxes.centre[box[k + 1]]) > 0.5
    ]
    return [piece for piece in np.split(box, cuts) if len(piece) >= 3]


def _boundary(boxes: BoxSet, box: IntArray) -> SmoothBoundary:
    """Return the boundary through boxes (k,), of the form that most of their score has."""
    reach = float(boxes.half_u_m[box[0]]), float(boxes.half_u_m[box[-1]])
    form = int(np.argmax(np.bincount(boxes.form[box], weights=boxes.score[box], minlength=len(BoxForm))))
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
    on_road = 1.0 if form == BoxForm.KERB else chance_of_road(boxes, box)
    if form == BoxForm.CHANNEL:
        confidence *= CHANNEL_IS_EDGE
    return SmoothBoundary(
        line, top, box, FORMS[BoxForm(form)], height[0], confidence, boxes.time_span(box),
        boxes.score[box], boxes.contrast[box], boxes.rougher[box], on_road,
    )  # fmt: skip


def form_by_ground(boundary: SmoothBoundary) -> SmoothBoundary:
    """Return a boundary as an edge where it was taken for a kerb and grass or soil lies behind its step.

    Notes
    -----
    By the median over its boxes of the noise behind the step over that before it: a kerb has stone or paving behind
    it, as smooth as the carriageway, a verge is rough whatever its height.
    """
    measured = boundary.rougher[np.isfinite(boundary.rougher)]
    if boundary.form != FORMS[BoxForm.KERB] or len(measured) == 0 or np.median(measured) < ROUGH_BEHIND:
        return boundary
    return replace(boundary, form=FORMS[BoxForm.EDGE])


def chance_of_road(boxes: BoxSet, box: IntArray) -> float:
    """Return how likely the ground to the left of boxes (k,) is road rather than open land, 0 to 1; 1 if it is not known.

    Notes
    -----
    By the median of their unevenness. Roads and land each have a class of ISO 8608 that is normally distributed, with a
    standard deviation of one class, to which that of the median adds; windows that overlap count once.
    """
    known = boxes.uneven_m2[box[np.isfinite(boxes.uneven_m2[box])]]
    middle = float(np.median(known)) if len(known) else 0.0
    if middle <= 0.0:
        return 1.0
    windows = max(float(boxes.along(box)[-1]) / WINDOW_M, 1.0)
    sigma = 1.25 * MAD * float(np.median(np.abs(known - middle))) / math.sqrt(windows)
    # A class has four times the variance of the one before
    worse = math.log(middle / POOR_ROAD_M**2, 4.0)
    of_class = sigma / max(middle, POOR_ROAD_M**2) / math.log(4.0)
    return 1.0 / (1.0 + math.exp(CLASSES_APART * worse / (1.0 + of_class**2)))


def step_down(boundary: SmoothBoundary) -> SmoothBoundary:
    """Return a boundary whose road lies on the upper side of its step: the edge of a pavement above its verge.

    It runs along the top of the step, with the carriageway to its left, and its height is negative.
    """
    foot, top = _reversed(boundary.line), _reversed(boundary.top)
    has_top = bool(np.isfinite(top.xyz).all())
    return SmoothBoundary(
        top if has_top else foot, foot, boundary.boxes[::-1], FORMS[BoxForm.EDGE], -boundary.height_m[::-1],
        boundary.confidence, boundary.times_s, boundary.scores[::-1], boundary.contrasts[::-1],
        boundary.rougher[::-1], boundary.on_road,
    )  # fmt: skip


def _reversed(line: SmoothLine) -> SmoothLine:
    """Return a line that runs the other way."""
    return SmoothLine(
        line.t_m[-1] - line.t_m[::-1] + line.t_m[0], line.xyz[::-1], -line.normal[::-1], line.sigma_xy_m[::-1],
        line.sigma_z_m[::-1], line.box[::-1],
    )  # fmt: skip


def bridged_boundary_stations(line: SmoothLine) -> BoolArray:
    """Return which stations lie in gaps without a box, (n,) bool."""
    measured = line.t_m[line.is_measured]
    after = np.searchsorted(measured, line.t_m, side="left")
    before = np.maximum(after - 1, 0)
    after = np.minimum(after, len(measured) - 1)
    width = measured[after] - measured[before]
    return np.asarray(~line.is_measured & (width > UNMEASURED_M))


def boundary_line_set(found: Sequence[SmoothBoundary]) -> LineSet:
    """Return boundaries as lines [m, local]."""
    lines = _line_set(found, "road_boundary", [b.line for b in found])
    return lines.with_columns(confidence=lines.confidence * np.array([b.on_road for b in found]))


def top_lines(found: Sequence[SmoothBoundary]) -> LineSet:
    """Return the top edges of the kerbs among boundaries [m, local]."""
    kerbs = [b for b in found if b.form == "kerb" and np.isfinite(b.top.xyz).all()]
    return _line_set(kerbs, "kerb_top", [b.top for b in kerbs])


def edge_lines(found: Sequence[tuple[SmoothBoundary, str]]) -> LineSet:
    """Return edges beside boundaries as lines, each with its role [m, local]."""
    lines = [edge for edge, _ in found]
    roles = np.array([role for _, role in found], dtype=np.str_)
    return _line_set(lines, "edge_other", [edge.line for edge in lines]).with_columns(role=roles)


def _line_set(found: Sequence[SmoothBoundary], kind: str, lines: Sequence[SmoothLine]) -> LineSet:
    """Return boundaries as lines of a kind, with these places."""
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
