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
from linework.methods.tracking.smooth import (
    GRADE_CHANGE,
    SMOOTH_STATION_M,
    SmoothLine,
    smooth_line,
    smooth_value,
)
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
#: Pieces of a boundary found by different signs continue each other where each end leads to the other within this much, and
#: by as much more for a metre between them: the standard deviation of the direction of an end, three times; and where they
#: overlap by less than a search area is long. [m, -, m]
END_OFFSET_M, END_TURN, OVERLAP_M = 0.15, 0.1, 1.0
#: Cosine of the largest turn between them, that of a corner of 7 m over 3 m; and the farthest they are apart. [-, m]
LEAST_END_COSINE, ENDS_APART_M = 0.906, LONGEST_DROP_M + OVERLAP_M
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
        Chance that the ground on its carriageway's side is road rather than open land, by its evenness, in the end
        also by its width without paint; 1 for kerbs, which are built.
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
    By the median over its boxes of the noise behind the step over that before it, if most tell it: a kerb has stone or
    paving behind it, as smooth as the carriageway, a verge is rough whatever its height.
    """
    measured = boundary.rougher[np.isfinite(boundary.rougher)]
    is_known = boundary.form == FORMS[BoxForm.KERB] and 2 * len(measured) > len(boundary.rougher)
    is_verge = is_known and np.median(measured) >= ROUGH_BEHIND
    return replace(boundary, form=FORMS[BoxForm.EDGE]) if is_verge else boundary


def continued(boundaries: Sequence[SmoothBoundary]) -> list[SmoothBoundary]:
    """Return boundaries, those of one form whose ends lead to each other joined into one.

    Notes
    -----
    A pavement's edge is a step here and a change of brightness behind the next bush; boxes of each are tracked by
    themselves. The best pair of ends is joined first, and every end once.
    """
    if not boundaries:
        return []
    starts = cKDTree([b.line.xyz[0, :2] for b in boundaries])
    near = starts.query_ball_point([a.line.xyz[-1, :2] for a in boundaries], ENDS_APART_M)
    pairs = sorted(
        (distance, i, j)
        for i, a in enumerate(boundaries)
        for j in near[i]
        if i != j
        and a.form == boundaries[j].form
        and (a.form != FORMS[BoxForm.KERB] or np.isfinite([a.top.xyz[-1], boundaries[j].top.xyz[0]]).all())
        and (distance := _from_end_to_start(a.line, boundaries[j].line)) < math.inf
    )
    after: dict[int, int] = {}
    before: dict[int, int] = {}
    for _, i, j in pairs:
        if i not in after and j not in before and _last_of(after, j) != i:
            after[i], before[j] = j, i
    found = []
    for i, boundary in enumerate(boundaries):
        if i not in before:
            whole, k = boundary, i
            while k in after:
                k = after[k]
                whole = _joined_boundary(whole, boundaries[k])
            found.append(whole)
    return found


def _last_of(after: dict[int, int], i: int) -> int:
    """Return the last of the boundaries that follow one."""
    while i in after:
        i = after[i]
    return i


def _from_end_to_start(a: SmoothLine, b: SmoothLine) -> float:
    """Return the distance from the end of a to the start of b, offsets counted tenfold [m]; inf where b does not continue a."""
    step = b.xyz[0, :2] - a.xyz[-1, :2]
    ends = a.normal[-1], b.normal[0]
    along = [step[0] * normal[1] - step[1] * normal[0] for normal in ends]
    off = [abs(step @ normal) for normal in ends]
    gap = max(along)
    is_near = min(along) > -OVERLAP_M and gap <= LONGEST_DROP_M
    is_straight = ends[0] @ ends[1] >= LEAST_END_COSINE
    if not (is_near and is_straight) or max(off) > END_OFFSET_M + END_TURN * max(gap, 0.0):
        return math.inf
    return float(abs(gap) + max(off) / END_TURN)


def _joined_boundary(a: SmoothBoundary, b: SmoothBoundary) -> SmoothBoundary:
    """Return two boundaries as one that runs through a, then b."""
    # Up to the start of b, and farther back where it lies beside a, so that the line turns by little
    start, along = b.line.xyz[0, :2], np.array([b.line.normal[0, 1], -b.line.normal[0, 0]])
    off = abs(float((a.line.xyz[-1, :2] - start) @ b.line.normal[0]))
    kept = (a.line.xyz[:, :2] - start) @ along < -off / (2.0 * END_TURN)
    kept |= a.line.t_m < a.line.t_m[-1] - 2.0 * OVERLAP_M
    n = len(kept) if kept.all() else int(np.argmin(kept))
    line = _joined_line(a.line, n, b.line)

    def over_all(left: FloatArray, right: FloatArray) -> FloatArray:
        at = np.interp(line.t_m, line.t_m[[n - 1, n_behind]], [0.0, 1.0])[n:n_behind]
        between = left[n - 1] + np.multiply.outer(at, right[0] - left[n - 1])
        return np.concatenate([left[:n], between, right])

    n_behind = len(line.t_m) - len(b.line.t_m)
    top = replace(
        line,
        xyz=line.xyz + over_all(a.top.xyz - a.line.xyz, b.top.xyz - b.line.xyz),
        sigma_xy_m=np.hypot(
            line.sigma_xy_m, over_all(*(_excess(s.top.sigma_xy_m, s.line.sigma_xy_m) for s in (a, b)))
        ),
        sigma_z_m=np.hypot(
            line.sigma_z_m, over_all(*(_excess(s.top.sigma_z_m, s.line.sigma_z_m) for s in (a, b)))
        ),
    )
    weight = np.array([s.line.t_m[-1] - s.line.t_m[0] for s in (a, b)])
    weight /= weight.sum()
    return SmoothBoundary(
        line, top, np.concatenate([a.boxes, b.boxes]), a.form, over_all(a.height_m, b.height_m),
        float(weight @ [a.confidence, b.confidence]),
        (float(np.fmin(a.times_s[0], b.times_s[0])), float(np.fmax(a.times_s[1], b.times_s[1]))),
        np.concatenate([a.scores, b.scores]), np.concatenate([a.contrasts, b.contrasts]),
        np.concatenate([a.rougher, b.rougher]), float(weight @ [a.on_road, b.on_road]),
    )  # fmt: skip


def _excess(sigma_m: FloatArray, of_line_m: FloatArray) -> FloatArray:
    """Return what a standard deviation of a top has beyond that of its foot, (n,) [m]."""
    return np.asarray(np.sqrt(np.maximum(sigma_m**2 - of_line_m**2, 0.0)))


def _joined_line(a: SmoothLine, n: int, b: SmoothLine) -> SmoothLine:
    """Return the first n stations of a, then those of b, with stations on a cubic between them."""
    step = b.xyz[0] - a.xyz[n - 1]
    gap = float(np.hypot(step[0], step[1]))
    at = np.linspace(0.0, 1.0, max(math.ceil(gap / SMOOTH_STATION_M), 1) + 1)[1:-1, None]
    ends = [
        np.array([line.normal[k, 1], -line.normal[k, 0], 0.0]) * gap + [0.0, 0.0, step[2]]
        for line, k in ((a, n - 1), (b, 0))
    ]
    # Hermite's cubic
    xyz = a.xyz[n - 1] + at**2 * (3.0 - 2.0 * at) * step
    xyz += at * (1.0 - at) ** 2 * ends[0] - at**2 * (1.0 - at) * ends[1]
    normal = (1.0 - at) * a.normal[n - 1] + at * b.normal[0]
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    # Between ends whose directions are known to a third of what is allowed, and whose grades change as roads' do
    away = np.array([END_TURN / 3.0 * gap, math.sqrt(GRADE_CHANGE * gap**3 / 12.0)]) * at * (1.0 - at)
    sigma_xy, sigma_z = (
        np.concatenate(
            [left[:n], np.hypot((1.0 - at[:, 0]) * left[n - 1] + at[:, 0] * right[0], more), right]
        )
        for left, right, more in (
            (a.sigma_xy_m, b.sigma_xy_m, away[:, 0]),
            (a.sigma_z_m, b.sigma_z_m, away[:, 1]),
        )
    )
    start = a.t_m[n - 1]
    return SmoothLine(
        np.concatenate([a.t_m[:n], start + at[:, 0] * gap, start + gap + b.t_m - b.t_m[0]]),
        np.concatenate([a.xyz[:n], xyz, b.xyz]), np.concatenate([a.normal[:n], normal, b.normal]),
        sigma_xy, sigma_z, np.concatenate([a.box[:n], np.full(len(at), -1), b.box]),
    )  # fmt: skip


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


def _height(boundary: SmoothBoundary) -> float:
    """Return the median height of a boundary's step where it is known [m], else NaN."""
    known = boundary.height_m[np.isfinite(boundary.height_m)]
    return float(np.median(known)) if len(known) else math.nan


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
        height_m=[_height(b) for b in found],
        confidence=[b.confidence for b in found],
        time_start_s=[b.times_s[0] for b in found],
        time_end_s=[b.times_s[1] for b in found],
    )
