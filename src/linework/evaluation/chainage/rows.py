"""Rows of a report by chainage: samples summed up by interval, side and line."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import chain, pairwise

import numpy as np

from linework.errors import UsageError, argument
from linework.evaluation.chainage.bends import with_bends
from linework.evaluation.chainage.crossings import Crossing, crossings_at
from linework.evaluation.chainage.dash_ends import DashEnds
from linework.evaluation.chainage.dashes_along import dash_samples
from linework.evaluation.chainage.paint_along import paint_samples
from linework.evaluation.chainage.paint_points import PaintPieces
from linework.evaluation.chainage.samples import Sample, clearance_samples, shape_samples, station_samples
from linework.evaluation.chainage.standards import LIMITS, limit_for, rhythm_name, verdict_of
from linework.lines.crosscuts import Axis, cross_cuts
from linework.model.lines import LineSet

#: What is given of the values of each quantity.
STATISTICS = {
    ("marking", "dash_length"): ("mean",),
    ("marking", "gap_length"): ("mean",),
    ("marking", "missing_dashes"): ("sum",),
    ("marking", "remaining_paint"): ("mean", "min"),
    ("marking", "contrast"): ("mean",),
    ("marking", "width"): ("mean",),
    ("guardrail", "top_height"): ("min", "p5", "mean"),
    ("guardrail", "offset_from_line"): ("mean",),
    ("guardrail", "gap"): ("sum",),
    ("barrier", "top_height"): ("min", "p5", "mean"),
    ("barrier", "offset_from_line"): ("mean",),
    ("kerb", "upstand"): ("min", "mean", "max"),
    ("clearance", "clearance"): ("min",),
    ("road", "carriageway_width"): ("mean", "min"),
    ("road", "lane_width"): ("mean", "min"),
    ("road", "crossfall"): ("mean",),
    ("road", "grade"): ("mean",),
    ("road", "curvature"): ("mean",),
}
UNITS = {
    "remaining_paint": "%",
    "contrast": "",
    "crossfall": "%",
    "grade": "%",
    "curvature": "1/m",
    "missing_dashes": "",
}
#: Measured anew at each piece, from its own points: their errors average out.
_EACH_ITS_OWN = ("remaining_paint", "width")
#: An axis is a line too: what is nearer to it than this is on no side. [m]
_ON_AXIS_M = 0.3


@dataclass(frozen=True, slots=True)
class ChainageRow:
    """A value of an interval.

    Parameters
    ----------
    route, from_m, to_m, side
        Where: id of the route, chainages [m], "left", "right" or "axis".
    topic, quantity, statistic, unit, line
        What, and of which line.
    value, sigma
        None where it was hidden; the standard deviation None where it is not known.
    n
        Number of places measured.
    measured_share
        Share of the places where it was measured and not bridged.
    limit_source, verdict
        Source of the limit, and "ok", "below", "above", "unknown" or "".
    """

    route: str
    from_m: float
    to_m: float
    side: str
    topic: str
    quantity: str
    statistic: str
    unit: str
    line: str
    value: float | None
    sigma: float | None
    n: int
    measured_share: float
    limit_source: str
    verdict: str


@dataclass(frozen=True, slots=True)
class ChainageReport:
    """Rows of a report, with the axes and the crossings from which they come."""

    rows: Sequence[ChainageRow]
    axes: Sequence[Axis]
    crossings: Sequence[list[list[Crossing]]]
    every_m: float
    standard: str


def chainage_report(
    lines: LineSet,
    axes: Sequence[Axis],
    *,
    every_m: float = 10.0,
    standard: str = "",
    paint: PaintPieces | None = None,
    dashes: DashEnds | None = None,
) -> ChainageReport:
    """Return what can be measured between lines, by intervals of routes.

    Parameters
    ----------
    every_m
        Length of an interval. [m]
    standard
        One of `LIMITS`, or "" for no limits.
    paint
        What the points show on the markings, for what is left of them; None: not reported.
    dashes
        What the points show at the ends of dashes; None: their lengths are those of the lines.

    Raises
    ------
    UsageError
        An unknown standard, or an interval that is not at least 1 m.
    """
    if standard and standard not in LIMITS:
        raise UsageError(
            f"unknown standard '{standard}'", where=argument("standard"), advice=f"use {', '.join(LIMITS)}"
        )
    if not (math.isfinite(every_m) and every_m >= 1.0):
        raise UsageError(
            f"an interval of {every_m:g} m, at least 1 m", where=argument("every"), advice="use 10"
        )
    rows: list[ChainageRow] = []
    crossings = []
    for axis in axes:
        here = crossings_at(lines, cross_cuts(lines, axis), len(axis.station_m))
        crossings.append(here)
        samples = chain(
            with_bends(station_samples(axis, here)), clearance_samples(lines, axis, here),
            dash_samples(lines, axis, dashes),
            shape_samples(axis), _gap_samples(axis, here),
            paint_samples(lines, axis, paint) if paint is not None else (),
        )  # fmt: skip
        rows += _summed_up(axis, samples, every_m, standard)
    return ChainageReport(rows, axes, crossings, every_m, standard)


#: Longest stretch between two rails of one side that is a gap, and not where rails end: an access or a junction mouth. [m]
_LONGEST_GAP_M = 100.0


def _gap_samples(axis: Axis, crossings: Sequence[list[Crossing]]) -> Iterable[Sample]:
    """Yield the stretches between two rails of one side, at the chainage where they begin."""
    for side in (1, -1):
        has = [
            any(c.kind in ("guardrail", "barrier") and side * c.offset_m > 0 for c in here)
            for here in crossings
        ]
        there = np.flatnonzero(has)
        for a, b in pairwise(there.tolist()):
            length = float(axis.station_m[b] - axis.station_m[a])
            if 1.5 < length <= _LONGEST_GAP_M:
                yield Sample(float(axis.station_m[a]), side * 5.0, "guardrail", "gap", "", length, math.nan)


def _side(offset_m: float) -> str:
    return "axis" if abs(offset_m) < _ON_AXIS_M else "left" if offset_m > 0 else "right"


def _summed_up(axis: Axis, samples: Iterable[Sample], every_m: float, standard: str) -> list[ChainageRow]:
    groups: dict[tuple[int, str, str, str, str], list[Sample]] = defaultdict(list)
    for one in samples:
        interval = math.floor((one.station_m + 1e-9) / every_m)
        groups[interval, one.topic, _side(one.offset_m), one.line, one.quantity].append(one)
    rows = []
    end = float(axis.station_m[-1])
    for (interval, topic, side, line, quantity), listed in sorted(groups.items()):
        known = [one for one in listed if one.value is not None]
        limit = limit_for(standard, topic, quantity)
        for statistic in STATISTICS[topic, quantity]:
            value, sigma = _statistic(statistic, known, own=quantity in _EACH_ITS_OWN)
            rows.append(
                ChainageRow(
                    axis.name, interval * every_m, min((interval + 1) * every_m, max(end, interval * every_m)), side, topic,
                    quantity, statistic, UNITS.get(quantity, "m"), line, value, sigma, len(known),
                    round(len(known) / len(listed), 4), limit.source if limit else "", verdict_of(limit, value),
                )
            )  # fmt: skip
        if quantity == "dash_length" and known and standard:
            rows[-1] = _named_rhythm(
                rows[-1], groups.get((interval, topic, side, line, "gap_length"), []), standard
            )
    return rows


def _named_rhythm(row: ChainageRow, gaps: Sequence[Sample], standard: str) -> ChainageRow:
    """Return the row of the length of dashes with the standard's pattern in place of a limit."""
    values = [one.value for one in gaps if one.value is not None]
    if not values or row.value is None:
        return row
    name = rhythm_name(standard, row.value, float(np.mean(values)))
    return replace(
        row, limit_source=name or "none of the standard's patterns", verdict="ok" if name else "other"
    )


def _statistic(name: str, known: Sequence[Sample], *, own: bool) -> tuple[float | None, float | None]:
    """Return a statistic of values and its standard deviation.

    Errors of neighbouring stations are those of one line and hardly average out: the deviation of a mean is the root
    mean square of theirs; where each has errors of its `own`, it is smaller by the root of their number. Of values without one (dashes) it is that of their mean, from their spread.
    """
    if not known:
        return None, None
    values = np.array([one.value for one in known], dtype=np.float64)
    sigmas = np.array([one.sigma for one in known])
    if name in ("min", "max"):
        i = int(np.argmin(values) if name == "min" else np.argmax(values))
        return float(values[i]), _known(float(sigmas[i]))
    value = float(np.percentile(values, 5.0)) if name == "p5" else float(values.sum())
    if name == "mean":
        value /= len(values)
    if own:
        return value, _known(float(np.sqrt(np.sum(sigmas**2)) / len(sigmas)))
    if np.isfinite(sigmas).any():
        return value, _known(float(np.sqrt(np.nanmean(sigmas**2))))
    spread = (
        float(np.std(values, ddof=1) / math.sqrt(len(values)))
        if len(values) > 1 and name == "mean"
        else math.nan
    )
    return value, _known(spread)


def _known(sigma: float) -> float | None:
    return sigma if math.isfinite(sigma) else None
