"""The measures that depend on the tolerance: matched lengths, gaps, pieces, errors at stations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from linework.arrays import FloatArray
from linework.evaluation.match import TIE_M, PieceMatch
from linework.evaluation.stations import Stations
from linework.evaluation.values import ErrorStats, ToleranceScores

#: Least overlap of an extracted line that counts as a piece of a reference line, or half of its own length where
#: that is less [m]: one station, so that running past a joint does not count.
_LEAST_OVERLAP_M = 0.5
#: Tolerance for the ends of dashes [m], where the scan lines are no farther apart.
DASH_END_M = 0.10


@dataclass(frozen=True, slots=True)
class KindMatch:
    """The match of one kind, before a tolerance is applied.

    Parameters
    ----------
    chamfer_ap
        Average precision of whole lines, by threshold [m].
    dash_end_m
        Tolerance for the ends of dashes, no less than the scan-line spacing. [m]
    """

    kind: str
    match: PieceMatch
    stations: Stations
    chamfer_ap: Mapping[float, float | None]
    dash_end_m: float = DASH_END_M


def at_tolerance(parts: Sequence[KindMatch], stations: Stations, b: float) -> ToleranceScores:
    """Return the measures that depend on the tolerance `b` [m]."""
    lengths = np.zeros(7)
    for part in parts:
        m = part.match
        found_e, found_r = (n.distance_m <= b + TIE_M for n in (m.e_nearest, m.r_nearest))
        e_m, r_m, observed_m = m.e_pieces.length_m, m.r_pieces.length_m, m.r_pieces.length_m * m.r_observed
        lengths += [
            e_m[found_e].sum(), e_m[~found_e].sum(), r_m[found_r].sum(), r_m[~found_r].sum(),
            observed_m[found_r].sum(), observed_m[~found_r].sum(), _n_gaps(m, b),
        ]  # fmt: skip
    right, wrong, found, missed, found_observed, missed_observed, n_gaps = (float(v) for v in lengths)
    is_met = stations.offset_m <= b + TIE_M
    in_space = np.concatenate([np.full(len(p.stations), p.match.reference.n_dims == 3) for p in parts])
    return ToleranceScores(
        tolerance_m=b,
        matched_extracted_m=right,
        matched_reference_m=found,
        matched_observed_m=found_observed,
        completeness=ratio(found_observed, found_observed + missed_observed),
        completeness_all=ratio(found, found + missed),
        correctness=ratio(right, right + wrong),
        quality=ratio(right, right + wrong + missed_observed),
        quality_all=ratio(right, right + wrong + missed),
        redundancy=ratio(right - found, right),
        gaps_per_km=ratio(n_gaps, (found_observed + missed_observed) / 1000),
        pieces_per_line=_pieces_per_line([p.match for p in parts], b),
        n_missed=int((~is_met).sum()),
        n_missed_observed=int((~is_met & stations.is_observed).sum()),
        lateral=error_stats(stations.lateral_m[is_met]),
        height=error_stats(stations.height_m[is_met]),
        space=error_stats(stations.offset_m[is_met & in_space], signed=False),
    )


def error_stats(errors_m: FloatArray, *, signed: bool = True, n: int | None = None) -> ErrorStats:
    """Return bias, RMSE, median and 95th percentile of those errors (k,) [m] that are finite.

    >>> error_stats(np.array([0.5, -0.25, np.nan])).bias_m
    0.125
    """
    errors_m = errors_m[np.isfinite(errors_m)]
    if len(errors_m) == 0:
        return ErrorStats()
    return ErrorStats(
        n=len(errors_m) if n is None else n,
        bias_m=float(errors_m.mean()) if signed else None,
        rmse_m=float(np.sqrt(np.mean(errors_m**2))),
        median_m=float(np.median(np.abs(errors_m))),
        p95_m=float(np.percentile(np.abs(errors_m), 95)),
    )


def _n_gaps(m: PieceMatch, b: float) -> int:
    """Return the number of stretches of observed reference without a match; hidden parts do not divide one."""
    line = m.r_pieces.line[m.r_observed]
    is_missed = m.r_nearest.distance_m[m.r_observed] > b + TIE_M
    continues = np.zeros(len(line), dtype=bool)
    continues[1:] = is_missed[:-1] & (line[1:] == line[:-1])
    return int((is_missed & ~continues).sum())


def _pieces_per_line(matches: Sequence[PieceMatch], b: float) -> float | None:
    n_pieces, n_found = 0, 0
    for m in matches:
        found = m.e_nearest.distance_m <= b + TIE_M
        n_r = max(len(m.reference), 1)
        pair, k = np.unique(m.e_pieces.line[found] * n_r + m.e_nearest.line[found], return_inverse=True)
        overlap_m = np.bincount(k, weights=m.e_pieces.length_m[found], minlength=len(pair))
        least_m = np.minimum(_LEAST_OVERLAP_M, m.extracted.length_m[pair // n_r] / 2)
        on_line = pair[overlap_m >= least_m - TIE_M] % n_r
        n_pieces += len(on_line)
        n_found += len(np.unique(on_line))
    return n_pieces / n_found if n_found else None


def ratio(part: float, whole: float) -> float | None:
    """Return part / whole; None where the whole is 0."""
    return part / whole if whole > 0 else None
