"""Lane markings from tracked stripes: solid and dashed lines, single dashes, and paint that is not a line."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import erf

from linework.arrays import BoolArray, FloatArray, IntArray
from linework.methods.protocol import Sight
from linework.methods.tracking.against_paint import (
    ON_STEP,
    BrightStrips,
    chance_of_one_plane,
    why_not_paint,
)
from linework.methods.tracking.fitted import INDEPENDENT_BOXES
from linework.methods.tracking.guides import LEAST_GUIDE_M
from linework.methods.tracking.line_ends import CLOSE_M, SHORT_GAP_M, ends_in_gaps, from_longest_gap
from linework.methods.tracking.line_odds import (
    BARE_ROW,
    POINT_ELSEWHERE,
    SYMBOLS,
    TWO_SIGMAS,
    chance_of_line,
    log_odds_of_bend,
    odds_against_both,
    odds_of_line,
)
from linework.methods.tracking.mouths import AT_MOUTHS, NO_MOUTHS, Mouths
from linework.methods.tracking.pattern import (
    PaintRhythm,
    PatternStretch,
    dashes_of,
    find_stretches,
    merged_intervals,
    restore_worn_dashes,
)
from linework.methods.tracking.smooth import SmoothLine, smooth_line
from linework.methods.tracking.track import Tracks
from linework.model.boxes import BoxSet
from linework.model.lines import LineSet

#: Shortest solid line; shorter paint that is not a dash is an arrow, a bar or a letter: arrows are up to 5 m long,
#: 7.5 m where traffic is fast, with 3.5 m of shaft. [m]
LEAST_MARKING_M = 6.0
#: Smallest share of its length that a solid line has of paint, and a dashed one of its dashes: the most worn ones that
#: are visible have 0.3.
LEAST_PAINT_SHARE = 0.25
#: Fewest pieces of a worn line that has less: arrows come in rows of three or four.
LEAST_ROW = 6
#: Fewest dashes of a dashed line, and smallest share of the dashes that its rhythm expects.
LEAST_TRACKED_DASHES, LEAST_DASH_SHARE = 3, 0.5
#: Shortest bar; shorter paint is a stain. [m]
LEAST_BAR_M = 1.0
#: Lines are judged within this (docs/evaluation.md). [m]
TOLERANCE_M = 0.10
#: Rows of paint that are less likely a line than not are none.
LEAST_LINE_CHANCE = 0.5
#: Without any other bright strip.
NO_STRIPS = BrightStrips(BoxSet.empty())

#: Why what looks like dashes is several lines, which may be short.
OF_THEIR_OWN = (AT_MOUTHS, POINT_ELSEWHERE)


@dataclass(frozen=True, slots=True)
class SmoothMarking:
    """A smoothed line of paint.

    Parameters
    ----------
    line
        Its middle.
    boxes
        (k,) int64: the boxes it was tracked through.
    paint
        (j, 2) float64: intervals of paint along the line. [m]
    rhythm, dashes
        Rhythm of a dashed line and its single dashes (d, 2) [m]; None and (0, 2) for a solid line.
    width_m
        Width of the paint. [m]
    confidence
        0 to 1.
    times_s
        First and last time of its points. [s]
    why_unlikely
        Why it is more likely something else than paint, or "".
    """

    line: SmoothLine
    boxes: IntArray
    paint: FloatArray
    rhythm: PaintRhythm | None
    dashes: FloatArray
    width_m: float
    confidence: float
    times_s: tuple[float, float]
    why_unlikely: str = ""


def marking_lines(
    boxes: BoxSet,
    tracks: Tracks,
    visible: Sight,
    strips: BrightStrips = NO_STRIPS,
    mouths: Mouths = NO_MOUTHS,
) -> tuple[list[SmoothMarking], list[SmoothMarking], list[SmoothMarking]]:
    """Return the lane markings among tracked stripes, the other paint, and long lines that are more likely no paint.

    Parameters
    ----------
    visible
        Whether road or ground was measured at places [m, local], and is bare there if that is known (`bare_road`).
    strips
        Bright strips that are no paint: evidence against lines that should have paint there.
    mouths
        Openings of boundaries: evidence that lines end there.
    """
    lines, other, unlikely = list[SmoothMarking](), list[SmoothMarking](), list[SmoothMarking]()
    for found in _all_markings(boxes, tracks, visible, strips, mouths):
        if found.why_unlikely and float(np.ptp(found.paint)) >= LEAST_MARKING_M:
            unlikely.append(found)
        # What is too bare for a line may be shorter paint in a row; stones are told by their step along the whole line
        is_row = found.why_unlikely in (BARE_ROW, *OF_THEIR_OWN)
        is_whole = found.why_unlikely == ON_STEP or (_is_line(found) and not is_row)
        parts = [found] if is_whole else _without_gaps(boxes, found, visible, strips)
        for m in parts:
            if m.why_unlikely == BARE_ROW:
                other.append(_as_other_paint(boxes, m, strips))
            elif not m.why_unlikely:
                # Between mouths, and around a bend, a line may be short
                (lines if _is_line(m) or found.why_unlikely in OF_THEIR_OWN else other).append(m)
    return lines, other, unlikely


def _is_line(marking: SmoothMarking) -> bool:
    return has_its_dashes(marking) if marking.rhythm is not None else _is_solid(marking.paint)


def without_symbols(
    boxes: BoxSet,
    markings: Sequence[SmoothMarking],
    lane_sides: IntArray,
    visible: Sight,
    strips: BrightStrips = NO_STRIPS,
) -> tuple[list[SmoothMarking], list[SmoothMarking], list[SmoothMarking]]:
    """Return the lines that are more likely lines than symbols in a row, the pieces of the others, and these others.

    Parameters
    ----------
    lane_sides
        (m,) on how many sides of each another line is half a lane away, see `half_lane_sides`.
    """
    lines, pieces, rows = list[SmoothMarking](), list[SmoothMarking](), list[SmoothMarking]()
    for m, sides in zip(markings, lane_sides.tolist(), strict=True):
        chance = chance_of_line(odds_of_line(m.line, m.paint, m.rhythm, m.dashes, visible, sides))
        if sides == 0 or chance >= LEAST_LINE_CHANCE:
            lines.append(m)
        else:
            parts = _without_gaps(boxes, m, visible, strips)
            pieces += [_as_other_paint(boxes, p, strips) for p in parts if p.why_unlikely in ("", BARE_ROW)]
            rows.append(replace(m, why_unlikely=SYMBOLS))
    return lines, pieces, rows


def _without_gaps(
    boxes: BoxSet, marking: SmoothMarking, visible: Sight, strips: BrightStrips
) -> list[SmoothMarking]:
    """Return the pieces of a marking between its gaps that are longer than `SHORT_GAP_M`, each at least two boxes."""
    box = marking.boxes
    t, reach = boxes.along(box), boxes.half_u_m[box]
    cuts = np.flatnonzero((t[1:] - reach[1:]) - (t[:-1] + reach[:-1]) > SHORT_GAP_M) + 1
    if len(cuts) == 0:
        return [marking]
    found = []
    for piece in np.split(box, cuts):
        if len(piece) >= 2:
            t, reach = boxes.along(piece), boxes.half_u_m[piece]
            paint = merged_intervals(t - reach, t + reach, CLOSE_M)
            line = smooth_line(boxes, piece, (-float(paint[0, 0]), float(paint[-1, 1] - t[-1])))
            found.append(_marking(boxes, piece, line, paint, None, visible, strips))
    return found


def _all_markings(
    boxes: BoxSet, tracks: Tracks, visible: Sight, strips: BrightStrips, mouths: Mouths
) -> list[SmoothMarking]:
    return [
        m for i in range(len(tracks)) for m in _markings(boxes, tracks.line(i)[0], visible, strips, mouths)
    ]


def has_its_dashes(marking: SmoothMarking) -> bool:
    """Return whether enough of the dashes that the rhythm expects are there, and enough of their paint."""
    assert marking.rhythm is not None
    expected = 1.0 + float(np.ptp(marking.dashes)) / marking.rhythm.period_m
    painted_m = float((marking.paint[:, 1] - marking.paint[:, 0]).sum())
    return (
        len(marking.dashes) >= LEAST_TRACKED_DASHES
        and len(marking.dashes) >= LEAST_DASH_SHARE * expected
        and painted_m >= LEAST_PAINT_SHARE * expected * marking.rhythm.dash_m
    )


def _is_solid(paint: FloatArray) -> bool:
    """Return whether paint without a rhythm is long and complete enough for a line, or in too many pieces for symbols."""
    length = float(np.ptp(paint))
    share = float((paint[:, 1] - paint[:, 0]).sum()) / max(length, LEAST_MARKING_M)
    is_row = len(paint) >= LEAST_ROW and length >= LEAST_GUIDE_M
    return length >= LEAST_MARKING_M and (share >= LEAST_PAINT_SHARE or is_row)


def bar_lines(boxes: BoxSet, tracks: Tracks, visible: Sight) -> list[SmoothMarking]:
    """Return the bars among tracked boxes of wide paint: stop lines, crossings."""
    found = _all_markings(boxes, tracks, visible, NO_STRIPS, NO_MOUTHS)
    return [m for m in found if float(np.ptp(m.paint)) >= LEAST_BAR_M and not m.why_unlikely]


def _markings(
    boxes: BoxSet, box: IntArray, visible: Sight, strips: BrightStrips, mouths: Mouths
) -> list[SmoothMarking]:
    """Return the markings of a track: smoothed, cut where the line has ended and where its pattern changes."""
    box = from_longest_gap(boxes, box)
    t, reach = boxes.along(box), boxes.half_u_m[box]
    stretches = find_stretches(merged_intervals(t - reach, t + reach, CLOSE_M))
    cuts = ends_in_gaps(boxes, box, stretches, visible, mouths)
    found: list[SmoothMarking] = []
    for first, piece in zip([0, *cuts], np.split(box, cuts), strict=True):
        if len(piece) >= 2:
            found += _by_pattern(boxes, piece, stretches, float(t[first]), visible, strips, mouths)
    return found


def _by_pattern(
    boxes: BoxSet,
    box: IntArray,
    stretches: Sequence[PatternStretch],
    start_m: float,
    visible: Sight,
    strips: BrightStrips,
    mouths: Mouths,
) -> list[SmoothMarking]:
    """Return the markings through boxes (k,) of a track: one smooth line, cut where its pattern changes.

    stretches: of the whole track, along which the boxes begin at `start_m`.

    A piece that is too short to show a pattern has that of its track.
    """
    t = boxes.along(box)
    reach = boxes.half_u_m[box]
    paint = merged_intervals(t - reach, t + reach, CLOSE_M)
    line = smooth_line(boxes, box, (-float(paint[0, 0]), float(paint[-1, 1] - t[-1])))
    own_stretches = find_stretches(paint)
    if all(stretch.rhythm is None for stretch in own_stretches):
        own_stretches = _within(stretches, start_m, paint) or own_stretches
    if len(own_stretches) == 1:
        return [_marking(boxes, box, line, paint, own_stretches[0].rhythm, visible, strips, mouths)]
    found = []
    for stretch in own_stretches:
        own = box[(t >= stretch.start_m) & (t <= stretch.end_m)]
        inside = _paint_of(paint, stretch)
        if len(own) >= 2 and len(inside):
            part = _cut(line, stretch.start_m, stretch.end_m)
            found.append(_marking(boxes, own, part, inside, stretch.rhythm, visible, strips, mouths))
    return found


def _paint_of(paint: FloatArray, stretch: PatternStretch) -> FloatArray:
    """Return the intervals of paint (k, 2) [m] in a stretch, which ends where paint does: by their middles, as ends round."""
    middle = paint.mean(axis=1)
    inside: FloatArray = paint[(middle > stretch.start_m) & (middle < stretch.end_m)]
    return inside


def _within(stretches: Sequence[PatternStretch], start_m: float, paint: FloatArray) -> list[PatternStretch]:
    """Return the stretches of a track that a piece of it has paint (k, 2) in, from its own beginning."""
    first, last = float(paint[0, 0]), float(paint[:, 1].max())
    return [
        replace(s, start_m=max(s.start_m - start_m, first), end_m=min(s.end_m - start_m, last))
        for s in stretches
        if s.start_m - start_m < last and s.end_m - start_m > first
    ]


def _marking(
    boxes: BoxSet,
    box: IntArray,
    line: SmoothLine,
    paint: FloatArray,
    rhythm: PaintRhythm | None,
    visible: Sight,
    strips: BrightStrips,
    mouths: Mouths = NO_MOUTHS,
) -> SmoothMarking:
    """Return the marking through boxes (k,) on a smooth line, with its paint (j, 2) [m]."""
    found = _as_paint(boxes, box, line, paint, rhythm, strips)
    if not _is_line(found):
        return found
    # Of a line what was measured says that it is one, not what was bridged
    odds = odds_of_line(line, paint, rhythm, found.dashes, visible)
    why = found.why_unlikely or (BARE_ROW if chance_of_line(odds) < LEAST_LINE_CHANCE else "")
    if rhythm is not None:
        bend = log_odds_of_bend(line, rhythm, found.dashes)
        odds += bend
        if chance_of_line(odds) < LEAST_LINE_CHANCE:
            why = why or (POINT_ELSEWHERE if bend <= TWO_SIGMAS else BARE_ROW)
        odds = odds_against_both(odds, mouths.log_odds_of_rhythm(line, found.dashes))
    chance = chance_of_line(odds)
    why = why or (AT_MOUTHS if chance < LEAST_LINE_CHANCE else "")
    return replace(found, confidence=found.confidence * chance, why_unlikely=why)


def _as_other_paint(boxes: BoxSet, row: SmoothMarking, strips: BrightStrips) -> SmoothMarking:
    """Return a refused row as the paint that was found, as likely as it is paint, whatever its chance as a line."""
    return _as_paint(boxes, row.boxes, row.line, row.paint, row.rhythm, strips)


def _as_paint(
    boxes: BoxSet,
    box: IntArray,
    line: SmoothLine,
    paint: FloatArray,
    rhythm: PaintRhythm | None,
    strips: BrightStrips,
) -> SmoothMarking:
    """Return what `_marking` does, as likely as it is paint: not judged whether it is one line."""
    dashes = np.zeros((0, 2)) if rhythm is None else restore_worn_dashes(dashes_of(paint, rhythm), rhythm)
    expected = dashes if len(dashes) else np.array([[paint[0, 0], paint[:, 1].max()]])
    against = strips.scores_where(line, boxes.centre[box, :2], expected)
    score, one_plane = np.concatenate([boxes.score[box], against]), chance_of_one_plane(boxes, box)
    width_m = 2.0 * float(np.median(boxes.half_v_m[box]))
    return SmoothMarking(
        line, box, paint, rhythm, dashes, width_m, confidence_of(score, line.sigma_xy_m) * one_plane,
        boxes.time_span(box), why_not_paint(width_m, float(np.mean(score)), one_plane),
    )  # fmt: skip


def bridged_paint_stations(marking: SmoothMarking) -> BoolArray:
    """Return which stations lie in a gap where paint is expected, (n,) bool.

    The gaps of a dashed line are part of its pattern; a dash that is missing altogether is not.
    """
    t = marking.line.t_m
    i = np.searchsorted(marking.paint[:, 0], t, side="right") - 1
    bare = t > marking.paint[np.maximum(i, 0), 1] + CLOSE_M
    if marking.rhythm is None:
        return np.asarray(bare & ~marking.line.is_measured)
    start, end = marking.dashes[:-1, 1], marking.dashes[1:, 0]
    missing = end - start > marking.rhythm.period_m
    k = np.searchsorted(start, t, side="right") - 1
    if len(start) == 0:
        return np.zeros(len(t), dtype=np.bool_)
    inside = (k >= 0) & (t < end[np.maximum(k, 0)]) & missing[np.maximum(k, 0)]
    return np.asarray(inside)


def marking_line_set(markings: Sequence[SmoothMarking], kind: str) -> LineSet:
    """Return markings as lines of a kind [m, local]."""
    if not markings:
        return LineSet.empty()
    return LineSet.from_lines(
        [m.line.xyz for m in markings],
        kind=[kind] * len(markings),
        method=["obb"] * len(markings),
        pattern=["solid" if m.rhythm is None else "dashed" for m in markings],
        sigma_xy_m=np.concatenate([m.line.sigma_xy_m for m in markings]),
        sigma_z_m=np.concatenate([m.line.sigma_z_m for m in markings]),
        bridged=np.concatenate([bridged_paint_stations(m) for m in markings]),
        width_m=[m.width_m for m in markings],
        confidence=[m.confidence for m in markings],
        time_start_s=[m.times_s[0] for m in markings],
        time_end_s=[m.times_s[1] for m in markings],
    )


def dash_lines(markings: Sequence[SmoothMarking], roles: Sequence[str]) -> LineSet:
    """Return the single dashes of dashed lines, on their smoothed lines, with the roles of these (m,) [m, local]."""
    parts: list[SmoothMarking] = []
    names: list[str] = []
    for m, role in zip(markings, roles, strict=True):
        for start, end in m.dashes.tolist():
            whole = np.array([[start, end]])
            parts.append(replace(m, line=_cut(m.line, start, end), paint=whole, rhythm=None))
            names.append(role)
    dashed = np.array(["dashed"] * len(parts), dtype=np.str_)
    lines = marking_line_set(parts, "lane_marking_dash")
    return lines.with_columns(pattern=dashed, role=np.array(names, dtype=np.str_))


def _cut(line: SmoothLine, start: float, end: float) -> SmoothLine:
    """Return the piece of a line between two distances along it [m]."""
    inner = np.flatnonzero((line.t_m > start) & (line.t_m < end))
    t = np.concatenate([[start], line.t_m[inner], [end]])

    def at(values: FloatArray) -> FloatArray:
        return np.asarray(np.interp(t, line.t_m, values))

    xyz, normal = (np.column_stack([at(c) for c in values.T]) for values in (line.xyz, line.normal))
    box = np.concatenate([[-1], line.box[inner], [-1]])
    return SmoothLine(t, xyz, normal, at(line.sigma_xy_m), at(line.sigma_z_m), box)


def confidence_of(score: FloatArray, sigma_m: FloatArray) -> float:
    """Return the confidence of a line, 0 to 1: the chance that it is one, and within 10 cm.

    Parameters
    ----------
    score
        (k,) the chance of each box that it is a piece of such a feature.
    sigma_m
        (n,) standard deviations of its vertices, across. [m]

    Notes
    -----
    A line is wrong where its boxes are wrong together. Neighbouring boxes share half of their points, so two of the
    boxes of a line count as independent. Measured in docs/methods/obb.md.

    >>> round(confidence_of(np.array([0.8, 0.8]), np.array([0.01])), 3)
    0.96
    """
    is_one = 1.0 - (1.0 - float(np.mean(score))) ** INDEPENDENT_BOXES
    is_near = float(np.mean(erf(TOLERANCE_M / (np.sqrt(2.0) * np.maximum(sigma_m, 1e-6)))))
    return is_one * is_near
