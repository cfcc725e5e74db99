"""Errors of values that lines carry: height, width, clearance."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from linework.evaluation.match import TIE_M, Match
from linework.evaluation.tolerance import error_stats
from linework.evaluation.values import ErrorStats

#: Per-line values that are compared where both lines have them.
ATTRIBUTES = ("height_m", "width_m", "clearance_m")


def attribute_errors(matches: Sequence[Match], name: str, tolerance_m: float) -> ErrorStats:
    """Return the errors of a per-line attribute, over the matched length where both lines have it.

    `n` counts extracted lines.
    """
    errors, n = [np.zeros(0)], 0
    for m in matches:
        i = np.flatnonzero(m.e_nearest.distance_m <= tolerance_m + TIE_M)
        e_line, r_line = m.e_pieces.line[i], m.e_nearest.line[i]
        error = getattr(m.extracted.lines, name)[e_line] - getattr(m.reference.lines, name)[r_line]
        errors.append(error)
        n += len(np.unique(e_line[np.isfinite(error)]))
    return error_stats(np.concatenate(errors), n=n)
