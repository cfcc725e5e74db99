"""Dashes that are missing: lines with a rhythm that has gaps, and dashed lines with few dashes or none."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.spatial import cKDTree

from linework.arrays import FloatArray, IntArray
from linework.lines.edited_dashes import lacking, missing_middles, rhythm_of
from linework.lines.suspected import LEAST_M, Suspect, box_of, middle_of, stations
from linework.model.lines import LineSet

#: A dash lies within a stripe's width of its line. [m]
ON_LINE_M = 0.10
#: Of a dashed line so much is paint, where no rhythm says it: lane lines have a quarter to a half.
DASH_SHARE = 1.0 / 3.0
#: How likely a line is dashed that nobody says is solid: of a street's lines half are.
MAY_BE_DASHED = 0.5
#: A shorter line shows no rhythm. [m]
LEAST_LINE_M = 40.0


def missing_dashes(lines: LineSet, paint: Mapping[str, FloatArray] | None = None) -> list[Suspect]:
    """Return the dashes that lines lack, all as one thing to look at: one edit adds them.

    Parameters
    ----------
    paint
        By id, where along a line its paint shows dashes, as `dashes_in_paint` finds them. What lines that are not among
        them lack is told by the rhythm of their dashes, or guessed: those said to be solid lack nothing.
    """
    paint = paint or {}
    measured = np.isin(lines.id, np.array(list(paint), dtype=np.str_))
    number = np.flatnonzero((lines.kind == "lane_marking") & ((lines.pattern != "solid") | measured))
    owner = _line_of_dashes(lines, number)
    lacks = np.array(
        [
            _lacking_m(lines.take([i]), lines.take(owner == i), paint.get(str(lines.id[i])))
            for i in number.tolist()
        ]
    )
    some = np.argsort(-lacks, kind="stable")[: np.count_nonzero(lacks >= LEAST_M)]
    if len(some) == 0:
        return []
    bare, missing_m = lines.take(number[some]), float(lacks[some].sum())
    there_m = float(lines.length_m[np.isin(owner, number[some])].sum())
    names = "a line" if len(some) == 1 else f"{len(some)} lines"
    return [
        Suspect(
            type="dashes",
            ids=tuple(bare.id.tolist()),
            kind="lane_marking_dash",
            at=middle_of(bare.line(0)),
            box=box_of(bare.xyz),
            length_m=missing_m,
            confidence=there_m / (there_m + missing_m),
            reason=f"about {missing_m:.0f} m of dashes are missing from {names}",
            proposal="dashes",
        )
    ]


def _lacking_m(line: LineSet, dashes: LineSet, spans: FloatArray | None) -> float:
    """Return how much of its dashes a line is expected to lack. [m]"""  # noqa: D400
    if spans is not None and len(spans):
        return float(np.diff(spans[lacking(line, dashes, spans)[0]], axis=1).sum())
    rhythm, length_m = rhythm_of(line, dashes), float(line.length_m[0])
    if rhythm is not None:
        inside = missing_middles(rhythm, length_m)
        return len(inside) * rhythm.dash_m
    if length_m < LEAST_LINE_M or spans is not None:
        return 0.0
    likely = 1.0 if line.pattern[0] == "dashed" else MAY_BE_DASHED
    return max(likely * DASH_SHARE * length_m - float(dashes.length_m.sum()), 0.0)


def _line_of_dashes(lines: LineSet, markings: IntArray) -> IntArray:
    """Return for every line which marking it is a dash of, -1 for what is none."""
    owner = np.full(len(lines), -1, dtype=np.int64)
    is_dash = lines.kind == "lane_marking_dash"
    if not is_dash.any() or len(markings) == 0:
        return owner
    every = [stations(lines.line(i), ON_LINE_M) for i in markings.tolist()]
    origin = every[0][0]
    tree = cKDTree(np.concatenate(every) - origin)
    middles = np.array([middle_of(lines.line(i)) for i in np.flatnonzero(is_dash).tolist()])
    distance, nearest = tree.query(middles - origin)
    line = np.repeat(markings, [len(places) for places in every])[nearest]
    owner[is_dash] = np.where(distance <= ON_LINE_M, line, -1)
    return owner
