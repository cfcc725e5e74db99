"""How well lines state their own quality: errors against sigma, correctness against confidence, bridged stretches."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.stats import rankdata

from linework.arrays import BoolArray, FloatArray
from linework.evaluation.match import TIE_M, PieceMatch
from linework.evaluation.stations import Stations
from linework.evaluation.tolerance import KindMatch, error_stats, ratio
from linework.evaluation.values import BridgedScores, Calibration, ConfidenceClass, SigmaTercile

#: Length of the pieces over which confidence is judged [m]: some dashes long, short against most lines.
_JUDGED_PIECE_M = 10.0
#: Classes of confidence in the calibration error: a tenth each, as is usual.
_N_CLASSES = 10


def sigma_terciles(error_m: FloatArray, sigma_m: FloatArray) -> tuple[SigmaTercile, ...]:
    """Return rms(error / sigma) per third of the stations ordered by sigma, smallest first.

    Parameters
    ----------
    error_m, sigma_m
        (k,) [m]; stations without an error or without a positive sigma are omitted.

    Returns
    -------
    tuple of SigmaTercile
        Three; fewer where many sigmas are equal, none for fewer than three stations.

    Examples
    --------
    >>> [t.rms_ratio for t in sigma_terciles(np.array([1.0, -2.0, 6.0]), np.array([1.0, 2.0, 3.0]))]
    [1.0, 1.0, 2.0]
    """
    usable = np.isfinite(error_m) & np.isfinite(sigma_m) & (sigma_m > 0)
    error_m, sigma_m = error_m[usable], sigma_m[usable]
    if len(error_m) < 3:
        return ()
    low, high = np.quantile(sigma_m, [1 / 3, 2 / 3])
    # Equal sigmas stay in one third: where all are equal there is one, not three
    which = (sigma_m > low).astype(np.int64) + (sigma_m > high)
    thirds = []
    for third in (np.flatnonzero(which == i) for i in range(3)):
        if len(third) == 0:
            continue
        ratio = error_m[third] / sigma_m[third]
        thirds.append(
            SigmaTercile(
                n=len(third),
                sigma_low_m=float(sigma_m[third].min()),
                sigma_high_m=float(sigma_m[third].max()),
                rms_ratio=float(np.sqrt(np.mean(ratio**2))),
            )
        )
    return tuple(thirds)


def confidence_calibration(matches: Sequence[PieceMatch], tolerance_m: float) -> Calibration:
    """Return how well the confidence of extracted lines predicts correctness, per piece of about 10 m.

    Lines are divided into equal pieces as close to 10 m as possible; a piece is correct if more than half
    of it is within `tolerance_m` of the reference.
    """
    shares, confidences = [np.zeros(0)], [np.zeros(0)]
    for match in matches:
        share, confidence = _judged_pieces(match, tolerance_m)
        shares.append(share)
        confidences.append(confidence)
    share, confidence = np.concatenate(shares), np.concatenate(confidences)
    usable = np.isfinite(confidence)
    share, confidence = share[usable], confidence[usable]
    if len(share) == 0:
        return Calibration()
    is_correct = share > 0.5 + TIE_M
    classes = _classes(confidence, is_correct)
    return Calibration(
        n_pieces=len(share),
        n_correct=int(is_correct.sum()),
        calibration_error=sum(c.n * abs(c.said - c.was) for c in classes) / len(share),
        auc=_area_under_roc(confidence, is_correct),
        classes=classes,
    )


def _judged_pieces(match: PieceMatch, tolerance_m: float) -> tuple[FloatArray, FloatArray]:
    """Return (k,) the share within tolerance and (k,) the confidence of pieces of about 10 m."""
    chains, pieces = match.extracted, match.e_pieces
    if len(pieces) == 0:
        return np.zeros(0), np.zeros(0)
    n_judged = np.maximum(np.rint(chains.length_m / _JUDGED_PIECE_M), 1).astype(np.int64)
    first = np.cumsum(n_judged) - n_judged
    size_m = chains.length_m / n_judged
    # The middle of a short piece may lie on the border of two judged ones: rounding must not decide
    within = ((pieces.chainage_m + TIE_M) // size_m[pieces.line]).astype(np.int64)
    within = np.minimum(within, n_judged[pieces.line] - 1)
    judged = first[pieces.line] + within
    n = int(n_judged.sum())
    is_match = match.e_nearest.distance_m <= tolerance_m + TIE_M
    matched_m = np.bincount(judged, weights=pieces.length_m * is_match, minlength=n)
    total_m = np.bincount(judged, weights=pieces.length_m, minlength=n)
    has_length = total_m > 0
    confidence = np.repeat(chains.lines.confidence, n_judged)
    return matched_m[has_length] / total_m[has_length], confidence[has_length]


def _classes(confidence: FloatArray, is_correct: BoolArray) -> tuple[ConfidenceClass, ...]:
    which = np.clip((confidence * _N_CLASSES).astype(np.int64), 0, _N_CLASSES - 1)
    return tuple(
        ConfidenceClass(
            n=int(own.sum()), said=float(confidence[own].mean()), was=float(is_correct[own].mean())
        )
        for own in (which == i for i in np.unique(which))
    )


def _area_under_roc(confidence: FloatArray, is_correct: BoolArray) -> float | None:
    n_right, n_wrong = int(is_correct.sum()), int((~is_correct).sum())
    if n_right == 0 or n_wrong == 0:
        return None
    rank_sum = float(rankdata(confidence)[is_correct].sum())
    return (rank_sum - n_right * (n_right + 1) / 2) / (n_right * n_wrong)


def bridged_scores(parts: Sequence[KindMatch], stations: Stations, tolerance_m: float) -> BridgedScores:
    """Return the scores of bridged stretches, and how much of the hidden reference was found.

    Parameters
    ----------
    stations
        The stations of all `parts`.
    tolerance_m
        Distance within which a bridged stretch is right. [m]
    """
    hidden_m, hidden_found_m, bridged_m, right_m = np.zeros(4)
    for m in (part.match for part in parts):
        is_bridged = m.extracted.bridged_at(m.e_pieces.line, m.e_pieces.chainage_m)
        is_right, is_found = (n.distance_m <= tolerance_m + TIE_M for n in (m.e_nearest, m.r_nearest))
        bridged_m += m.e_pieces.length_m[is_bridged].sum()
        right_m += m.e_pieces.length_m[is_bridged & is_right].sum()
        hidden_m += m.r_pieces.length_m[~m.r_observed].sum()
        hidden_found_m += m.r_pieces.length_m[~m.r_observed & is_found].sum()
    over_gaps = stations.take(stations.is_bridged)
    measured = stations.take(~stations.is_bridged & (stations.offset_m <= tolerance_m + TIE_M))
    return BridgedScores(
        hidden_m=float(hidden_m),
        hidden_found_m=float(hidden_found_m),
        bridged_m=float(bridged_m),
        share_right=ratio(float(right_m), float(bridged_m)),
        lateral=error_stats(over_gaps.lateral_m),
        lateral_measured=error_stats(measured.lateral_m),
        sigma_xy=sigma_terciles(over_gaps.lateral_m, over_gaps.sigma_xy_m),
        sigma_z=sigma_terciles(over_gaps.height_m, over_gaps.sigma_z_m),
    )
