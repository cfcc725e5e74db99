"""Scores of single dashes: how many were found, and the errors of their ends.

Separate from the measures of lengths, as dashes are counted one by one.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from linework.arrays import BoolArray, FloatArray, IntArray
from linework.evaluation.match import TIE_M, PieceMatch, first_per_query
from linework.evaluation.tolerance import KindMatch, error_stats, ratio
from linework.evaluation.values import DashScores

DASH_KIND = "lane_marking_dash"
#: Share of a dash that must be covered for it to be found, and observed for it to count at all: half, so that a
#: dash has at most one partner.
_LEAST_DASH_COVER = 0.5


def dash_scores(parts: Sequence[KindMatch], tolerance_m: float) -> DashScores:
    """Return the scores of the dashes of one or more surveys (lines of kind `DASH_KIND`).

    Parameters
    ----------
    parts
        At least one; each with its own tolerance for the ends.
    tolerance_m
        Largest lateral distance of a matched dash. [m]
    """
    n_reference = n_found = n_right = n_within = 0
    errors_m = [np.zeros(0)]
    for part in parts:
        r_line, e_line = paired_dashes(part.match, tolerance_m)
        is_observed = _observed(part.match)
        end_m, is_end_observed = end_errors(part.match, r_line, e_line)
        n_reference += int(is_observed.sum())
        n_found += int(is_observed[r_line].sum())
        n_right += len(e_line)
        n_within += int((np.abs(end_m[is_end_observed]) <= part.dash_end_m + TIE_M).sum())
        errors_m.append(end_m[is_end_observed])
    ends, n_extracted = np.concatenate(errors_m), sum(len(part.match.extracted) for part in parts)
    return DashScores(
        n_reference=n_reference,
        n_found=n_found,
        n_extracted=n_extracted,
        n_right=n_right,
        share_found=ratio(n_found, n_reference),
        share_right=ratio(n_right, n_extracted),
        end_limit_m=float(np.mean([part.dash_end_m for part in parts])),
        share_ends_within=ratio(n_within, len(ends)),
        ends=error_stats(ends),
    )


def paired_dashes(match: PieceMatch, tolerance_m: float) -> tuple[IntArray, IntArray]:
    """Return the paired dashes: (k,) int64 reference lines and (k,) int64 extracted lines.

    A pair is each other's largest overlap, and covers at least half of the reference dash.
    """
    found = match.r_nearest.distance_m <= tolerance_m + TIE_M
    n_e = max(len(match.extracted), 1)
    key = match.r_pieces.line[found] * n_e + match.r_nearest.line[found]
    pair, k = np.unique(key, return_inverse=True)
    overlap_m = np.bincount(k, weights=match.r_pieces.length_m[found], minlength=len(pair))
    r_line, e_line = pair // n_e, pair % n_e
    mutual = np.intersect1d(
        first_per_query(r_line, -overlap_m, e_line), first_per_query(e_line, -overlap_m, r_line)
    )
    kept = mutual[overlap_m[mutual] >= _LEAST_DASH_COVER * match.reference.length_m[r_line[mutual]] - TIE_M]
    return r_line[kept], e_line[kept]


def end_errors(match: PieceMatch, r_line: IntArray, e_line: IntArray) -> tuple[FloatArray, BoolArray]:
    """Return (k, 2) errors of both ends [m], positive outwards, and (k, 2) bool: that end was observed.

    Errors are measured along the chord of the reference dash (k,), which is short against any bend.
    """
    e, r = match.extracted, match.reference
    zero = np.zeros(len(r_line))
    start, end = (r.at(r_line, chainage_m)[:, :2] for chainage_m in (zero, r.length_m[r_line]))
    size_m = np.linalg.norm(end - start, axis=1)
    along = (end - start) / np.maximum(size_m, TIE_M)[:, None]
    places_m = np.stack(
        [
            np.einsum("ij,ij->i", e.at(e_line, chainage_m)[:, :2] - start, along)
            for chainage_m in (zero, e.length_m[e_line])
        ]
    )
    errors_m = np.stack([-places_m.min(axis=0), places_m.max(axis=0) - size_m], axis=1)
    first, last = r.lines.offsets[r_line], r.lines.offsets[r_line + 1] - 1
    return errors_m, np.stack([r.lines.observed[first], r.lines.observed[last]], axis=1)


def _observed(match: PieceMatch) -> BoolArray:
    """Return (m_r,) bool: at least half of the reference dash was observed."""
    length_m = match.r_pieces.length_m * match.r_observed
    observed_m = np.bincount(match.r_pieces.line, weights=length_m, minlength=len(match.reference))
    return np.asarray(
        (match.reference.length_m > 0) & (observed_m >= _LEAST_DASH_COVER * match.reference.length_m - TIE_M)
    )
