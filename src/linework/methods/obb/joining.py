"""The steps that join the boxes of a survey into lane markings and road boundaries.

Each step is a function from `Joining` to `Joining`, so that `Obb.join` runs them all, and
`linework.tracing.on_ground`, which shows a line while it grows, can be stopped between any two of them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from linework.arrays import AnyArray, BoolArray, FloatArray
from linework.kernels.cells.places import BOX_CELL_M
from linework.methods.obb.beside_paint import without_remains, without_strips
from linework.methods.obb.boundary_evidence import (
    evidence_of,
    has_dashes_behind,
    is_joint_of_road,
    may_be_bank,
    shade_of,
)
from linework.methods.obb.candidates import (
    BEHIND,
    EVEN,
    FAINT,
    GUTTER_STONES,
    KERB_BED,
    KERB_STONE,
    OPEN_LAND,
    PIECE,
    WIDE_LAND,
    Candidate,
    candidate_lines,
    left_out,
)
from linework.methods.obb.open_land import weighed_by_width
from linework.methods.protocol import Sight, SurveyContext
from linework.methods.tracking import boundary_lines, marking_lines
from linework.methods.tracking.against_paint import (
    NARROW,
    BrightStrips,
    bare_road,
    is_other_strip,
)
from linework.methods.tracking.arrangement import (
    BEHIND_KERB_M,
    DRIVEN_OVER,
    GUTTER,
    HIDDEN,
    NOTHING_IN_FRONT,
    OUTWEIGHED,
    SEAM_M,
    along_lines,
    behind_boundaries,
    beside_kerb,
    between_kerbs,
    bounds_carriageway,
    has_road_behind,
    is_double,
    outweighed,
    paint_forms,
    roles,
)
from linework.methods.tracking.boundary_lines import SmoothBoundary
from linework.methods.tracking.channels import has_footway_behind, on_channels, within_carriageway
from linework.methods.tracking.edge_roles import edge_roles
from linework.methods.tracking.guides import LEAST_GUIDE_M, by_length, drop_unlikely_pieces, join_along
from linework.methods.tracking.marking_lines import SmoothMarking
from linework.methods.tracking.mouths import Mouths
from linework.methods.tracking.neighbours import AXIS_STATION_M, LineAxis, axes_of_path, half_lane_sides
from linework.methods.tracking.track import TrackConfig, track_lines
from linework.model.boxes import BoxForm, BoxSet
from linework.model.lines import LineSet

#: Boxes this near a line, side by side with it, are of the same feature: paint, and boundaries. [m]
SAME_PAINT_BOXES_M, SAME_BOUNDARY_M = 0.06, 0.15
#: Edges this near a kerb's foot on either side belong to the kerb: gutter, kerb stone and its bed. [m]
KERB_SIDE_M = 1.0
#: Boundaries of at least this confidence overrule paint that contradicts them: there is no paint on grass. [1]
SURE = 0.9
#: Greatest width of a bar of a crossing or a stop line: wider bright areas are not paint. [m]
WIDEST_BAR_M = 1.0
#: Half a lane: from its line to the arrows in its middle (lanes are 2.5 to 4 m wide, the outer ones with a strip beside
#: their line). [m]
HALF_LANE_M = (1.2, 2.2)
#: Edges that were not taken for these reasons may have a role beside a boundary.
MAY_HAVE_ROLE = (KERB_BED, GUTTER, HIDDEN, NOTHING_IN_FRONT, OUTWEIGHED, OPEN_LAND)
#: Kerb stones are brighter than asphalt and up to 0.3 m wide: stripes so far behind a kerb's foot are not paint, nor
#: those this near in front of it, as paint keeps clear of the foot. [m]
KERB_STONE_M, ON_FOOT_M = 0.45, 0.04


@dataclass(frozen=True, slots=True)
class Joining:
    """Boxes of a survey while they are joined to lines; all places are in metres from the survey's local origin.

    Parameters
    ----------
    boxes
        By form, each in order of place.
    is_visible
        Returns for (n, 2) places whether road or ground was measured there.
    path
        Axes along the path of the vehicle.
    kerbs, boundaries
        Kerbs, and all boundaries, kerbs first.
    channels, changes
        Channels to which the ground falls from both sides, and changes of the ground, of which some are boundaries.
    markings, other
        Lane markings, and other paint.
    beside
        Edges that were measured close beside a kerb.
    open_land
        Edges whose carriageway would be open land, by its evenness.
    parallel
        Edges beside the boundaries, each with its role.
    shows_paint
        Whether paint was looked for, and can be seen by the brightness of the points.
    keeps_candidates
        Whether lines are kept that are not taken, and boxes that are explained otherwise are tracked, too.
    candidates
        Lines that were not taken so far.
    """

    boxes: Mapping[BoxForm, BoxSet]
    is_visible: Sight
    path: Sequence[LineAxis]
    config: TrackConfig
    kerbs: Sequence[SmoothBoundary] = ()
    boundaries: Sequence[SmoothBoundary] = ()
    channels: Sequence[SmoothBoundary] = ()
    changes: Sequence[SmoothBoundary] = ()
    markings: Sequence[SmoothMarking] = ()
    other: Sequence[SmoothMarking] = ()
    beside: Sequence[SmoothBoundary] = ()
    open_land: Sequence[SmoothBoundary] = ()
    parallel: Sequence[tuple[SmoothBoundary, str]] = ()
    shows_paint: bool = False
    keeps_candidates: bool = False
    candidates: Sequence[Candidate] = ()


#: One step: what it finds is added to, or left out of, a copy of what it is given.
JoinStep = Callable[[Joining], Joining]


def begin(
    boxes: BoxSet, survey: SurveyContext, config: TrackConfig, *, shows_paint: bool = False, keeps_candidates: bool = False
) -> Joining:  # fmt: skip
    """Return the boxes by form, in an order that does not depend on the tiles that they come from."""
    boxes = boxes.take(np.lexsort((boxes.centre[:, 1], boxes.centre[:, 0], boxes.form)))
    is_visible_in_world = survey.is_visible

    def is_visible(xy: FloatArray) -> BoolArray:
        if is_visible_in_world is None:
            return np.ones(len(xy), dtype=np.bool_)
        return is_visible_in_world(xy + survey.origin[:2])

    path = [] if survey.path is None else axes_of_path(survey.path - np.asarray(survey.origin))
    by_form = {form: boxes.take(boxes.form == form) for form in BoxForm}
    return Joining(
        by_form, is_visible, path, config, shows_paint=shows_paint, keeps_candidates=keeps_candidates
    )


def find_kerbs(now: Joining) -> Joining:
    """Track the boxes of kerbs."""
    now, kerbs = _boundaries(now, now.boxes[BoxForm.KERB])
    return replace(now, kerbs=kerbs, boundaries=kerbs)


def find_edges(now: Joining) -> Joining:
    """Track the boxes of pavement edges that are not part of a kerb."""
    return _with_boundaries(now, BoxForm.EDGE)


def find_barriers(now: Joining) -> Joining:
    """Track the boxes of barriers and walls that are not part of a kerb."""
    return _with_boundaries(now, BoxForm.BARRIER)


def find_changes(now: Joining) -> Joining:
    """Track channels apart from kerbs, and changes of the ground apart from all boundaries, with the path on their left."""
    found = []
    for form, known in ((BoxForm.CHANNEL, now.kerbs), (BoxForm.CHANGE, now.boundaries)):
        boxes = now.boxes[form]
        boxes = boxes.take(~beside_kerb(boxes, axes_of_lines(known), -KERB_SIDE_M, KERB_SIDE_M))
        now, lines = _boundaries(now, boundary_lines.facing(boxes, now.path))
        found.append(lines)
    return replace(now, channels=found[0], changes=found[1])


def face_the_road(now: Joining) -> Joining:
    """Turn the steps whose road lies on their upper side: a verge may be lower than the pavement."""
    if all(b.form != "kerb" for b in now.boundaries):
        return replace(now, kerbs=[], boundaries=list(now.boundaries))
    # What is painted tells on which side of a kerb the road is
    stripes = now.boxes[BoxForm.STRIPE]
    tracks = track_lines(stripes, now.config, width_m=SAME_PAINT_BOXES_M)
    lanes, *_ = marking_lines.marking_lines(stripes, tracks, now.is_visible)
    down = has_road_behind(axes_of_lines(now.boundaries), axes_of_lines(lanes), now.path)
    boundaries = [
        boundary_lines.step_down(b) if yes and b.form == "kerb" else b
        for b, yes in zip(now.boundaries, down, strict=True)
    ]
    return replace(now, kerbs=[b for b in boundaries if b.form == "kerb"], boundaries=boundaries)


def find_paint(now: Joining) -> Joining:
    """Track the boxes of paint: lane markings, solid and dashed, and other paint."""
    kerbs, config = axes_of_lines(_of_stone(now.kerbs)), now.config
    # A stripe that reaches to the foot lies on gutter or kerb stone, however far in front its middle is
    reach_m = now.boxes[BoxForm.STRIPE].half_v_m + ON_FOOT_M
    on_stone = {
        BoxForm.STRIPE: beside_kerb(now.boxes[BoxForm.STRIPE], kerbs, -KERB_STONE_M, reach_m),
        BoxForm.OTHER_PAINT: beside_kerb(now.boxes[BoxForm.OTHER_PAINT], kerbs, -KERB_STONE_M, ON_FOOT_M),
    }
    stripes, blobs = (now.boxes[form].take(~yes) for form, yes in on_stone.items())
    # A strip that is no paint joins no line, and speaks against one that should have paint in its place
    is_strip = is_other_strip(stripes)
    stripes, strips = stripes.take(~is_strip), BrightStrips(stripes.take(is_strip))
    pieces = track_lines(stripes, config, width_m=SAME_PAINT_BOXES_M, least_boxes=1)
    pieces = drop_unlikely_pieces(pieces, stripes.score)
    is_bare = bare_road(now.is_visible, BoxSet.concatenate([stripes, blobs, strips.boxes]))
    # Worn pieces are joined along whole lines, along boundaries and along the path
    whole, *_ = marking_lines.marking_lines(stripes, pieces.with_boxes(3), now.is_visible, strips)
    # Paint is drawn parallel to paint, edges of pavements are ragged, and vans wander
    guides = [*by_length([*axes_of_lines(now.boundaries), *now.path]), *by_length(axes_of_lines(whole))]
    lines = join_along(stripes, pieces, guides, config.longest_gap_m).with_boxes(3)
    blobs = blobs.take(blobs.half_v_m <= 0.5 * WIDEST_BAR_M)
    # Lines end at mouths, where the boundaries beside them are open
    mouths = Mouths(axes_of_lines(now.boundaries), now.is_visible)
    markings, other, unlikely = marking_lines.marking_lines(stripes, lines, is_bare, strips, mouths)
    bars = marking_lines.bar_lines(blobs, track_lines(blobs, config, width_m=SAME_BOUNDARY_M), now.is_visible)
    # Half a lane beside a line, pieces in a row may be arrows: what is bright between them may be letters
    long = [c for c in axes_of_lines(markings) if len(c.xy) * AXIS_STATION_M >= LEAST_GUIDE_M]
    sides = half_lane_sides(axes_of_lines(markings), [*long, *axes_of_lines(now.boundaries)], HALF_LANE_M)
    markings, symbols, rows = marking_lines.without_symbols(stripes, markings, sides, now.is_visible, strips)
    other = [*other, *symbols]
    rails = [m for m in unlikely if m.why_unlikely == NARROW]
    markings, stone = without_strips(markings, axes_of_lines(markings), stripes, rails, axes_of_lines(rails))
    markings, other, remains = without_remains(markings, other, axes_of_lines([*markings, *other]), stripes)
    now = _aside(now, [*stone, *remains])
    if now.keeps_candidates:
        stones = now.boxes[BoxForm.STRIPE].take(on_stone[BoxForm.STRIPE])
        tracks = track_lines(stones, config, width_m=SAME_PAINT_BOXES_M)
        found, *_ = marking_lines.marking_lines(stones, tracks, now.is_visible)
        now = _aside(now, left_out(found, "lane_marking", KERB_STONE))
        now = _aside(now, [Candidate(line, "lane_marking", line.why_unlikely) for line in [*unlikely, *rows]])
    return replace(now, markings=markings, other=[*other, *bars])


def keep_consistent(now: Joining) -> Joining:
    """Drop lines that contradict others: markings off the carriageway, boundaries of none, pieces of other lines."""
    path = now.path
    why, n = ends_of_carriageway(now), len(now.boundaries)
    boundaries = [*now.boundaries, *now.channels, *now.changes]
    edges = left_out(now.beside, "road_boundary", KERB_BED) + left_out(boundaries, "road_boundary", why)
    edges += left_out(now.open_land, "road_boundary", OPEN_LAND)
    known, n_channels = (np.count_nonzero(part == "") for part in (why[:n], why[n : n + len(now.channels)]))
    boundaries = [line for line, reason in zip(boundaries, why, strict=True) if not reason]
    is_change = np.arange(len(boundaries)) >= known
    is_channel = is_change & (np.arange(len(boundaries)) < known + n_channels)
    is_kerb = np.array([b.form == "kerb" for b in boundaries], dtype=np.bool_)
    is_sure = is_kerb | np.array(
        [b.confidence >= SURE and shade_of(b) == 0 for b in boundaries], dtype=np.bool_
    )
    # A channel alone takes no paint, nor does that on its gutter stones take it: what is farther behind was weighed
    takes_paint = is_sure & ~is_channel
    channels = axes_of_lines([b for b, yes in zip(boundaries, is_channel, strict=True) if yes])
    takes_paint[is_channel] = has_footway_behind(channels, axes_of_lines(boundaries[:known]))
    is_sure |= is_channel
    # There is paint on both sides of a line between two kerbs
    is_sure &= ~between_kerbs(axes_of_lines(boundaries), is_kerb)
    # Behind a kerb there is no carriageway over some width but where it is a median's; behind an edge, and what may be a
    # bank, there may be another one, but not close behind; and a change of the ground has a stone beside it at most
    lanes = axes_of_lines(now.markings)
    is_sure &= ~is_joint_of_road(axes_of_lines(boundaries), is_kerb, now.markings, lanes)
    has_yard = is_kerb & ~has_dashes_behind(axes_of_lines(boundaries), now.markings, lanes)
    has_yard &= ~np.array([may_be_bank(b) for b in boundaries], dtype=np.bool_)
    width_m = np.where(has_yard, BEHIND_KERB_M, np.where(is_change, KERB_STONE_M, SEAM_M))
    # What bounds no carriageway, whatever paint there is, does not say what is behind one
    why = bounds_carriageway(axes_of_lines(boundaries), is_kerb, is_sure, lanes, path)
    bounds = is_sure & (why == "")
    behind, is_stone = (
        behind_boundaries(
            lanes, axes_of_lines([b for b, yes in zip(boundaries, which, strict=True) if yes]), width_m[which]
        )
        for which in (bounds & takes_paint, bounds)
    )
    is_gutter = on_channels(lanes, np.array([m.width_m for m in now.markings]), channels)
    why = np.where(behind, BEHIND, np.where(is_gutter, GUTTER_STONES, ""))
    now = _aside(now, left_out(now.markings, "lane_marking", why))
    markings = [m for m, reason in zip(now.markings, why, strict=True) if not reason]
    # A boundary has a carriageway in front of it and none behind it: what may be stone is not in front of what is behind
    paint = [axis for axis, yes in zip(lanes, is_stone | (why != ""), strict=True) if not yes]
    why = bounds_carriageway(axes_of_lines(boundaries), is_kerb, is_sure, paint, path)
    edges += left_out(boundaries, "road_boundary", why)
    boundaries = [b for b, reason in zip(boundaries, why, strict=True) if not reason]
    # What a boundary is called does not change which lines it bears out
    boundaries = boundary_lines.continued([boundary_lines.form_by_ground(b) for b in boundaries])
    if now.shows_paint and _would_show_markings(now.boxes):
        boundaries = weighed_by_width(boundaries, axes_of_lines(boundaries), paint, path)
        wide = [b for b in boundaries if b.on_road < EVEN]
        edges += left_out(wide, "road_boundary", WIDE_LAND)
        boundaries = [b for b in boundaries if b.on_road >= EVEN]
    now = with_parallel_edges(replace(now, boundaries=boundaries), edges)
    # Bars and arrows stand alone: paint that runs along a line is a piece of that line
    lines = [*axes_of_lines(markings), *axes_of_lines(boundaries)]
    is_piece = along_lines(axes_of_lines(now.other), lines, KERB_STONE_M)
    is_faint = np.array([m.confidence < SURE for m in now.other], dtype=np.bool_)
    why = np.where(is_piece, PIECE, np.where(is_faint, FAINT, ""))
    now = _aside(now, left_out(now.other, "road_marking_other", why))
    other = [m for m, reason in zip(now.other, why, strict=True) if not reason]
    return replace(now, markings=markings, other=other)


def _would_show_markings(boxes: Mapping[BoxForm, BoxSet]) -> bool:
    """Return whether markings would be found: points lie close enough, and their brightness varies.

    Most edges were measured in the usual search area, and chance alone makes a stripe or a patch somewhere: files in which all
    points are equally bright have none.
    """
    if not any(len(boxes[form]) for form in (BoxForm.STRIPE, BoxForm.OTHER_PAINT)):
        return False
    half_u_m = np.concatenate([boxes[form].half_u_m for form in (BoxForm.EDGE, BoxForm.CHANGE)])
    return bool(len(half_u_m) and np.median(half_u_m) <= 0.5 * BOX_CELL_M)


def with_parallel_edges(now: Joining, edges: Sequence[Candidate]) -> Joining:
    """Return what is known with those edges that have a role beside a boundary; the others were not taken."""
    lines = [edge.line for edge in edges if isinstance(edge.line, SmoothBoundary)]
    # What is inside the carriageway, and strips of it, have no role outside of it
    has_place = np.array([edge.reason in MAY_HAVE_ROLE for edge in edges], dtype=np.bool_)
    is_wall = np.array([line.form == "barrier" for line in lines], dtype=np.bool_)
    evidence = np.array([evidence_of(line) for line in lines])
    height_m = np.array([np.median(line.height_m) for line in lines])
    is_kerb = np.array([b.form == "kerb" for b in now.boundaries], dtype=np.bool_)
    axes = axes_of_lines(lines)
    found = np.full(len(lines), "", dtype=object)
    at = np.flatnonzero(has_place)
    found[at] = edge_roles(
        [axes[i] for i in at], is_wall[at], height_m[at], evidence[at], axes_of_lines(now.boundaries), is_kerb
    )
    parallel = [(line, role) for line, role in zip(lines, found.tolist(), strict=True) if role]
    rest = [edge for edge, role in zip(edges, found.tolist(), strict=True) if not role]
    return _aside(replace(now, parallel=parallel), rest)


def ends_of_carriageway(now: Joining) -> AnyArray:
    """Return why boundaries, channels and changes of the ground are not ends of the carriageway, (m,) str; "" for ends.

    Boundaries are, but for steps that may be banks and have an edge with more evidence in front of them.
    """
    lines = [*now.boundaries, *now.channels, *now.changes]
    is_boundary = np.arange(len(lines)) < len(now.boundaries)
    is_bank = np.array([may_be_bank(line) for line in lines], dtype=np.bool_)
    known = is_boundary & ~is_bank
    evidence = np.array([evidence_of(line) for line in lines])
    axes = axes_of_lines(lines)
    shades = np.array([shade_of(line) for line in lines], dtype=np.int64)
    is_channel = ~is_boundary & (np.arange(len(lines)) < len(now.boundaries) + len(now.channels))
    lanes = axes_of_lines(now.markings)
    # What carriageway lies on both sides of ends none, and outweighs nothing
    is_inside = is_channel.copy()
    is_inside[is_channel] = within_carriageway([axes[i] for i in np.flatnonzero(is_channel)], lanes, now.path)
    evidence[is_inside] = 0.0
    why = outweighed(axes, evidence, shades, known, is_channel, is_bank, lanes, now.path)
    return np.where(is_inside, DRIVEN_OVER, why)


def line_set(now: Joining) -> LineSet:
    """Return all lines, with the roles and forms that follow from how they lie to one another."""
    taken = _taken(now)
    if not now.keeps_candidates:
        return taken
    return LineSet.concatenate([taken, candidate_lines(now.candidates, taken)])


def _taken(now: Joining) -> LineSet:
    """Return the lines that are taken."""
    lanes, bounds = axes_of_lines(now.markings), axes_of_lines(now.boundaries)
    double = is_double(lanes)
    names = roles(lanes, bounds, now.path, double)
    forms = np.array(paint_forms(axes_of_lines(now.other), [*lanes, *bounds, *now.path]), dtype=np.str_)
    return LineSet.concatenate([
        marking_lines.marking_line_set(now.markings, "lane_marking").with_columns(
            double=double, role=np.array(names, dtype=np.str_)
        ),
        marking_lines.dash_lines(now.markings, names),
        marking_lines.marking_line_set(now.other, "road_marking_other").with_columns(
            form=forms, pattern=np.full(len(now.other), "", dtype=np.str_)
        ),
        boundary_lines.boundary_line_set(now.boundaries),
        boundary_lines.top_lines(now.boundaries),
        boundary_lines.edge_lines(now.parallel),
    ])  # fmt: skip


def axes_of_lines(lines: Sequence[SmoothMarking] | Sequence[SmoothBoundary]) -> list[LineAxis]:
    """Return the axes of lines."""
    return [LineAxis.of(line.line.t_m, line.line.xyz) for line in lines]


def _with_boundaries(now: Joining, form: BoxForm) -> Joining:
    """Track the boxes of one form, without those beside a kerb."""
    boxes = now.boxes[form]
    beside = beside_kerb(boxes, axes_of_lines(_of_stone(now.kerbs)), -KERB_SIDE_M, KERB_SIDE_M)
    now, beds = _boundaries(now, boxes.take(beside))
    now = replace(now, beside=[*now.beside, *beds])
    now, found = _boundaries(now, boxes.take(~beside))
    return replace(now, boundaries=[*now.boundaries, *found])


def _of_stone(kerbs: Sequence[SmoothBoundary]) -> list[SmoothBoundary]:
    """Return the kerbs that are no banks: of gutter, stone and bed, so that nothing else is measured close beside them."""
    return [kerb for kerb in kerbs if not may_be_bank(kerb)]


def _boundaries(now: Joining, boxes: BoxSet) -> tuple[Joining, list[SmoothBoundary]]:
    """Return the boundaries through boxes of one form; those on open land are set aside: they are evidence of no road."""
    tracks = track_lines(boxes, now.config, width_m=SAME_BOUNDARY_M)
    if now.keeps_candidates:
        unlikely = boundary_lines.unlikely_boundaries(boxes, tracks, now.is_visible)
        now = _aside(now, [Candidate(line, "road_boundary", why) for line, why in unlikely])
    found = boundary_lines.smooth_boundaries(boxes, tracks, now.is_visible)
    open_land = [b for b in found if b.on_road < EVEN]
    return replace(now, open_land=[*now.open_land, *open_land]), [b for b in found if b.on_road >= EVEN]


def _aside(now: Joining, candidates: Sequence[Candidate]) -> Joining:
    """Return what is known with further lines that were not taken, if they are kept."""
    return replace(now, candidates=[*now.candidates, *candidates]) if now.keeps_candidates else now
