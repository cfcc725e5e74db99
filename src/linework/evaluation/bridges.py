"""Stretches without measurement: how much was bridged, how well, and how much of what is hidden that found."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from linework.evaluation.honesty import sigma_terciles
from linework.evaluation.match import TIE_M
from linework.evaluation.stations import Stations
from linework.evaluation.tolerance import KindMatch, error_stats, ratio
from linework.evaluation.values import BridgedScores


def bridged_scores(parts: Sequence[KindMatch], stations: Stations, tolerance_m: float) -> BridgedScores:
    """Score what lines say of places that they did not measure.

    Parameters
    ----------
    stations
        Those of all `parts`.
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
