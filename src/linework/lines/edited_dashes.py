"""The dashes that a dashed line lacks, where those that are there say that they belong."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from linework.arrays import BoolArray, FloatArray
from linework.errors import UsageError
from linework.lines.edited_bridge import foot_along
from linework.model.lines import LineSet

#: A dash is whole if it is this near the length that most have, and belongs where the rhythm says to within this. [m]
WHOLE_M = 0.25
#: So many dashes show a rhythm.
LEAST_DASHES = 4
#: A painter keeps the phase over so many metres without a dash, not further.
LONGEST_GAP_M = 60.0


@dataclass(frozen=True, slots=True)
class Rhythm:
    """Where dashes are along a line.

    Parameters
    ----------
    middle_m
        (k,) ascending: middles of the dashes that are there, along the line. [m]
    period_m, dash_m
        From middle to middle; length of one.
    """

    middle_m: FloatArray
    period_m: float
    dash_m: float


def with_missing_dashes(line: LineSet, dashes: LineSet) -> LineSet:
    """Return the dashes that a line lacks.

    Parameters
    ----------
    line
        A single dashed line.
    dashes
        Those that are there.

    Returns
    -------
    LineSet
        New lines of kind "lane_marking_dash", all bridged: the rhythm says where they belong, nobody measured them.

    Raises
    ------
    UsageError
        There are too few to show a rhythm, or none is missing.
    """
    rhythm = rhythm_of(line, dashes)
    if rhythm is None:
        raise UsageError(
            f"{len(dashes)} dashes show no rhythm", where="dashes", advice="draw some of them first"
        )
    middles = missing_middles(rhythm, _along(line.xyz)[-1])
    if len(middles) == 0:
        raise UsageError("no dash is missing", where="dashes", advice="choose another line")
    return _dashes_at(line, dashes, middles[:, None] + np.array([-0.5, 0.5]) * rhythm.dash_m)


def dashes_by_paint(line: LineSet, dashes: LineSet, spans: FloatArray) -> tuple[LineSet, LineSet]:
    """Return the dashes of a line that go, and those that come, where the paint along it shows where they are.

    Parameters
    ----------
    line
        A single line.
    dashes
        Those that are there.
    spans
        (k, 2) where along the line each begins and ends [m], as `dashes_in_paint` finds them.

    Notes
    -----
    A dash that is there and whole stays, and one that somebody judged; pieces of a dash give way to the whole of it. What
    comes is bridged: many dashes together say where it is, it was not seen itself.

    Raises
    ------
    UsageError
        None is missing.
    """
    comes, goes = lacking(line, dashes, spans)
    if not comes.any():
        raise UsageError("no dash is missing", where="dashes", advice="choose another line")
    return dashes.take(goes), _dashes_at(line, dashes, spans[comes])


def lacking(line: LineSet, dashes: LineSet, spans: FloatArray) -> tuple[BoolArray, BoolArray]:
    """Return which spans along a line (k,) have no dash that stays, and which dashes (n,) give way to theirs."""
    there = _ends_along(line, dashes)
    lap = np.minimum(there[None, :, 1], spans[:, None, 1]) - np.maximum(there[None, :, 0], spans[:, None, 0])
    size = np.diff(spans, axis=1)
    stays = (np.abs(np.diff(there, axis=1)[:, 0] - size) <= WHOLE_M) | (dashes.review != "")
    comes = ~np.any((lap > 0.0) & stays, axis=1)
    return comes, np.any((lap > 0.0) & ~stays & comes[:, None], axis=0)


def rhythm_of(line: LineSet, dashes: LineSet) -> Rhythm | None:
    """Return the rhythm of the dashes along a line, None where they show none."""
    if len(dashes) < LEAST_DASHES:
        return None
    ends = _ends_along(line, dashes)
    length, middle = np.diff(ends, axis=1)[:, 0], ends.mean(axis=1)
    dash_m = float(np.quantile(length, 0.8))
    whole = np.sort(middle[np.abs(length - dash_m) <= WHOLE_M])
    apart = np.diff(whole)
    apart = apart[apart > dash_m]
    if len(apart) < LEAST_DASHES - 1:
        return None
    # The least distance that is common, then the mean over all that are whole numbers of it
    period_m = float(np.quantile(apart, 0.2))
    number = np.rint(apart / period_m)
    fits = (number <= 3) & (np.abs(apart - number * period_m) <= WHOLE_M * np.maximum(number, 1.0))
    if np.count_nonzero(fits) < LEAST_DASHES - 1 or 2 * np.count_nonzero(fits) < len(apart):
        return None
    period_m = float(np.sum(apart[fits]) / np.sum(number[fits]))
    return Rhythm(np.sort(middle), period_m, dash_m) if period_m > dash_m + WHOLE_M else None


def missing_middles(rhythm: Rhythm, length_m: float) -> FloatArray:
    """Return where along a line of a length dashes are missing: their middles [m].

    Between two that are there, a whole number of periods apart, and beyond the first and the last, as far as the
    line goes. Where the phase does not fit (a crossing, another pattern) nothing is missing.
    """
    middle, period = rhythm.middle_m, rhythm.period_m
    found: list[float] = []
    for a, b in zip(middle[:-1].tolist(), middle[1:].tolist(), strict=True):
        n = round((b - a) / period)
        if n >= 2 and b - a <= LONGEST_GAP_M and abs(b - a - n * period) <= 2.0 * WHOLE_M:
            found += [a + k * (b - a) / n for k in range(1, n)]
    for start, way in ((float(middle[0]), -1.0), (float(middle[-1]), 1.0)):
        at = start + way * period
        while 0.5 * rhythm.dash_m - WHOLE_M <= at <= length_m - 0.5 * rhythm.dash_m + WHOLE_M:
            if abs(at - start) > LONGEST_GAP_M:
                break
            found.append(at)
            at += way * period
    return np.sort(np.array(found, dtype=np.float64))


def _dashes_at(line: LineSet, dashes: LineSet, spans: FloatArray) -> LineSet:
    along = _along(line.xyz)
    span = np.clip(spans, 0.0, along[-1])
    xyz = np.stack([np.interp(span, along, column) for column in line.xyz.T], axis=-1)
    n = len(spans)
    return LineSet.from_lines(
        list(xyz),
        crs=line.crs,
        kind=np.full(n, "lane_marking_dash"),
        role=np.full(n, line.role[0]),
        pattern=np.full(n, "dashed"),
        method=np.full(n, "drawn"),
        width_m=np.full(n, float(np.median(dashes.width_m if len(dashes) else line.width_m))),
        bridged=np.ones(2 * n, dtype=np.bool_),
        sigma_xy_m=np.interp(span, along, line.sigma_xy_m).ravel(),
        sigma_z_m=np.interp(span, along, line.sigma_z_m).ravel(),
    )


def _ends_along(line: LineSet, dashes: LineSet) -> FloatArray:
    """Return where along a line dashes begin and end (k, 2) [m]."""
    along = _along(line.xyz)
    ends = [[foot_along(line.xyz, along, dashes.line(i)[k]) for k in (0, -1)] for i in range(len(dashes))]
    return np.sort(np.array(ends, dtype=np.float64).reshape(-1, 2), axis=1)


def _along(xyz: FloatArray) -> FloatArray:
    return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(xyz[:, :2], axis=0).T))])
