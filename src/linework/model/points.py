"""Laser points as columns."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from linework.arrays import AnyArray, Float32Array, FloatArray, checked
from linework.model.grid import Bounds


@dataclass(frozen=True, slots=True)
class Points:
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

    xyz: FloatArray
    intensity: Float32Array | None = None
    time_s: FloatArray | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "xyz", checked("xyz", self.xyz, np.float64, (None, 3)))
        n = len(self.xyz)
        if self.intensity is not None:
            object.__setattr__(self, "intensity", checked("intensity", self.intensity, np.float32, (n,)))
        if self.time_s is not None:
            object.__setattr__(self, "time_s", checked("time_s", self.time_s, np.float64, (n,)))

    def __len__(self) -> int:
        return len(self.xyz)

    def take(self, index: AnyArray | slice) -> Points:
        """Return the points chosen by a mask, an index array or a slice."""

        def part(column: Any) -> Any:
            return None if column is None else column[index]

        return Points(self.xyz[index], part(self.intensity), part(self.time_s))

    @property
    def bounds(self) -> Bounds:
        """Extent in plan; an error when there are no points."""
        if len(self) == 0:
            raise ValueError("no points: they have no extent")
        # Column by column: numpy's min(axis=0) over rows of 3 is ten times slower (0.2 s for 4 million points).
        east, north = self.xyz[:, 0], self.xyz[:, 1]
        return Bounds(float(east.min()), float(north.min()), float(east.max()), float(north.max()))
