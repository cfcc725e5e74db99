"""Lane markings out of tracked stripes: solid and dashed lines, their dashes, and what is no line."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import erf

from linework.arrays import BoolArray, FloatArray, IntArray
from linework.methods.protocol import Sight, visible_share
from linework.methods.tracking.pattern import (
    PATCH_M,
    PaintRhythm,
    dashes_of,
    find_rhythm,
    merged_intervals,
    restore_worn_dashes,
)
from linework.methods.tracking.smooth import SmoothLine, smooth_line
from linework.methods.tracking.track import Tracks
from linework.model.boxes import BoxSet
from linework.model.lines import LineSet

#: Paint of two boxes nearer than this is one: search areas stand half a metre apart. [m]
CLOSE_M = 0.30
#: A gap that so worn a line has with less than this chance is its end.
GAP_CHANCE = 0.01
#: Gaps from wear are no longer than this, and gaps that short are never an end. [m]
LONGEST_WORN_M, SHORT_GAP_M = 20.0, 3.0
#: Paint shorter than this that is no dash of a dashed line is an arrow, a bar, a letter: arrows are up to 5 m,
#: 7.5 m where traffic is fast, with 3.5 m of shaft. [m]
LEAST_MARKING_M = 6.0
#: Paint of which less than this is left shows no line: of the most worn ones that are seen 0.3 is.
LEAST_PAINT_SHARE = 0.25
#: A rhythm shows in three dashes; of a line with most of its dashes gone nobody can say that it is one.
LEAST_TRACKED_DASHES, LEAST_DASH_SHARE = 3, 0.5
#: Shorter blobs of paint are stains. [m]
LEAST_BAR_M = 1.0


@dataclass(frozen=True, slots=True)
class SmoothMarking:
    """A smoothed line of paint.

    Parameters
    ----------
    boxes
        (k,) int64: the boxes it was tracked through.
    paint
        (j, 2) float64: intervals of paint along the line. [m]
    rhythm, dashes
        Of a dashed line, and its (j, 2) single dashes [m]; None and no dashes of a solid one.
    width_m
        Of the paint. [m]
    confidence
        0 to 1.
    times_s
        First and last time of its points. [s]
    """

    line: SmoothLine
    boxes: IntArray
    paint: FloatArray
    rhythm: PaintRhythm | None
    dashes: FloatArray
    width_m: float
    confidence: float
    times_s: tuple[float, float]


def marking_lines(
    boxes: BoxSet, tracks: Tracks, seen: Sight
) -> tuple[list[SmoothMarking], list[SmoothMarking]]:
    """Return the lane markings among tracked stripes, and the paint that is none."""
    found: list[SmoothMarking] = []
    for i in range(len(tracks)):
        found += _markings(boxes, tracks.line(i)[0], seen)
    is_line = [_is_dashed(m) if m.rhythm is not None else _is_solid(m.paint) for m in found]
    return [m for m, yes in zip(found, is_line, strict=True) if yes], [
        m for m, yes in zip(found, is_line, strict=True) if not yes
    ]


def _is_dashed(marking: SmoothMarking) -> bool:
    """Return whether enough of the dashes are there that the rhythm asks for."""
    assert marking.rhythm is not None
    expected = 1.0 + float(np.ptp(marking.dashes)) / marking.rhythm.period_m
    return len(marking.dashes) >= LEAST_TRACKED_DASHES and len(marking.dashes) >= LEAST_DASH_SHARE * expected


def _is_solid(paint: FloatArray) -> bool:
    """Return whether paint without a rhythm is long enough, and enough of it is there, for a line."""
    length = float(np.ptp(paint))
    return (
        length >= LEAST_MARKING_M and float((paint[:, 1] - paint[:, 0]).sum()) >= LEAST_PAINT_SHARE * length
    )


def bar_lines(boxes: BoxSet, tracks: Tracks, seen: Sight) -> list[SmoothMarking]:
    """Return the bars among tracked boxes of wide paint: stop lines, crossings."""
    found = [m for i in range(len(tracks)) for m in _markings(boxes, tracks.line(i)[0], seen)]
    return [m for m in found if float(np.ptp(m.paint)) >= LEAST_BAR_M]


def _markings(boxes: BoxSet, box: IntArray, seen: Sight) -> list[SmoothMarking]:
    """Return what a track holds: cut where the line has ended, each piece smoothed."""
    t = boxes.along(box)
    reach = boxes.half_u_m[box]
    paint = merged_intervals(t - reach, t + reach, CLOSE_M)
    rhythm = find_rhythm(paint)
    gap = (t[1:] - reach[1:]) - (t[:-1] + reach[:-1])
    longest = _longest_worn(t, gap) if rhythm is None else _longest_missing(paint, rhythm)
    cuts = [
        k + 1
        for k in np.flatnonzero(gap > longest).tolist()
        if visible_share(seen, boxes.centre[box[k]], boxes.centre[box[k + 1]]) > 0.5
    ]
    pieces = [piece for piece in np.split(box, cuts) if len(piece) >= 2]
    return [_marking(boxes, piece) for piece in pieces]


def _longest_worn(t: FloatArray, gap: FloatArray) -> float:
    """Return the longest gap that wear explains in a solid line of which so much is left. [m]"""  # noqa: D400
    bare = float(gap[(gap > CLOSE_M) & (gap <= LONGEST_WORN_M)].sum())
    far = float(gap[gap > LONGEST_WORN_M].sum())
    gone = min(max(bare / max(t[-1] - far, 1.0), 0.01), 0.99)
    return min(max(PATCH_M * math.log(GAP_CHANCE) / math.log(gone), SHORT_GAP_M), LONGEST_WORN_M)


def _longest_missing(paint: FloatArray, rhythm: PaintRhythm) -> float:
    """Return the longest gap that worn-off dashes explain in a line of which so many are left. [m]"""  # noqa: D400
    dashes = dashes_of(paint, rhythm)
    gap = dashes[1:, 0] - dashes[:-1, 1]
    gone = np.rint((gap + rhythm.dash_m) / rhythm.period_m) - 1.0
    missing = float(gone[gap <= LONGEST_WORN_M + 2.0 * rhythm.period_m].sum())
    share = min(max(missing / (missing + len(dashes)), 0.05), 0.8)
    return rhythm.period_m * (1.0 + math.log(GAP_CHANCE) / math.log(share))


def _marking(boxes: BoxSet, box: IntArray) -> SmoothMarking:
    t = boxes.along(box)
    reach = boxes.half_u_m[box]
    paint = merged_intervals(t - reach, t + reach, CLOSE_M)
    rhythm = find_rhythm(paint)
    line = smooth_line(boxes, box, (-float(paint[0, 0]), float(paint[-1, 1] - t[-1])))
    dashes = np.zeros((0, 2)) if rhythm is None else restore_worn_dashes(dashes_of(paint, rhythm), rhythm)
    return SmoothMarking(
        line, box, paint, rhythm, dashes, 2.0 * float(np.median(boxes.half_v_m[box])),
        confidence_of(boxes.score[box], line.sigma_xy_m), boxes.time_span(box),
    )  # fmt: skip


def bridged_paint_stations(marking: SmoothMarking) -> BoolArray:
    """Return (n,) which stations are on no paint although paint should be there.

    Gaps of a dashed line are its pattern; a dash that is missing altogether is not.
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
    """Return markings as lines of a kind, in local coordinates."""
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
    """Return the single dashes of dashed lines, on their smoothed lines."""
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
    """Return the piece of a line between two stations."""
    inner = np.flatnonzero((line.t_m > start) & (line.t_m < end))
    t = np.concatenate([[start], line.t_m[inner], [end]])

    def at(values: FloatArray) -> FloatArray:
        return np.asarray(np.interp(t, line.t_m, values))

    xyz, normal = (np.column_stack([at(c) for c in values.T]) for values in (line.xyz, line.normal))
    box = np.concatenate([[-1], line.box[inner], [-1]])
    return SmoothLine(t, xyz, normal, at(line.sigma_xy_m), at(line.sigma_z_m), box)


# How likely a line is what its kind says, and where it says: within the 10 cm that lines are judged by

#: Lines are judged within this (docs/evaluation.md). [m]
TOLERANCE_M = 0.10


def confidence_of(score: FloatArray, sigma_m: FloatArray) -> float:
    """Return the confidence of a line, 0 to 1.

    Parameters
    ----------
    score
        (k,) of its boxes, each how sure it is that it is a piece of such a feature.
    sigma_m
        (n,) of its vertices, across. [m]

    Notes
    -----
    A line is wrong where its boxes are wrong together. Neighbouring boxes share half of their points: of the
    many boxes of a line two are counted as independent. Measured: docs/methods/obb.md.

    >>> round(confidence_of(np.array([0.8, 0.8]), np.array([0.01])), 3)
    0.96
    """
    is_one = 1.0 - (1.0 - float(np.mean(score))) ** 2
    is_near = float(np.mean(erf(TOLERANCE_M / (np.sqrt(2.0) * np.maximum(sigma_m, 1e-6)))))
    return is_one * is_near
