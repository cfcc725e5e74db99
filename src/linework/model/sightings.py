"""Sightings: points on lines measured in stereo pairs, as columns."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from linework.arrays import AnyArray, FloatArray
from linework.model.columns import Columns, column, filled_column


@dataclass(frozen=True, slots=True, kw_only=True)
class Sightings(Columns):
    """n points on lines, each measured in both images of one pair; ordered by pair, line, and distance, nearest first.

    Parameters
    ----------
    xyz
        (n, 3) float64 [m, vehicle at the time of the pair].
    pair
        (n,) int64: number of the pair (`ImagePair.number`).
    line
        (n,) int64: number of the line in that pair, from 0.
    col, row, disparity
        (n,) float64 [pixels, rectified left image]: where it was measured.
    sigma_px
        (n,) float64 [pixels]: standard deviation of `col`, across the line, from the image noise.
    sigma_disparity_px
        (n,) float64 [pixels].
    width_m
        (n,) float64 [m]: width of the paint; NaN where it is not a stripe.
    contrast
        (n,) float64 [grey values]: paint over the road beside it, or the step across an edge.
    score
        (n,) float64, 0 to 1: how certain it is that this is such a line.
    """

    xyz: FloatArray = column(np.float64, 3)
    pair: AnyArray = filled_column(np.int64, 0)
    line: AnyArray = filled_column(np.int64, 0)
    col: FloatArray = filled_column(np.float64, np.nan)
    row: FloatArray = filled_column(np.float64, np.nan)
    disparity: FloatArray = filled_column(np.float64, np.nan)
    sigma_px: FloatArray = filled_column(np.float64, np.nan)
    sigma_disparity_px: FloatArray = filled_column(np.float64, np.nan)
    width_m: FloatArray = filled_column(np.float64, np.nan)
    contrast: FloatArray = filled_column(np.float64, np.nan)
    score: FloatArray = filled_column(np.float64, 1.0)

    def with_pair(self, number: int) -> Sightings:
        """Return the sightings as those of another pair."""
        return replace(self, pair=np.full(len(self), number, dtype=np.int64))
