"""How likely a line is what its kind says, and where it says: within the 10 cm that lines are judged by."""

from __future__ import annotations

import numpy as np
from scipy.special import erf

from linework.arrays import FloatArray

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
