"""Laser points as columns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from linework.arrays import Float32Array, FloatArray
from linework.model.columns import Columns, column, optional_column
from linework.model.grid import Bounds


@dataclass(frozen=True, slots=True)
class Points(Columns):
    """Laser points in the survey's CRS, columns of equal length, in file order.

    Parameters
    ----------
    xyz
        (n, 3) float64 [m, world]: east, north, up.
    intensity
        (n,) float32, as recorded, or None where the survey has none.
    time_s
        (n,) float64 [s], the survey's clock, or None.
    """

    xyz: FloatArray = column(np.float64, 3)
    intensity: Float32Array | None = optional_column(np.float32)
    time_s: FloatArray | None = optional_column()

    @property
    def bounds(self) -> Bounds:
        """Extent in plan [m, world].

        Raises
        ------
        ValueError
            There are no points.
        """
        if len(self) == 0:
            raise ValueError("no points: no extent")
        # Column by column: numpy's min(axis=0) over rows of 3 is ten times slower (0.2 s for 4 million points).
        east, north = self.xyz[:, 0], self.xyz[:, 1]
        return Bounds(float(east.min()), float(north.min()), float(east.max()), float(north.max()))
