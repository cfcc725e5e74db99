"""Was there anything to see: gaps in a line where the ground was measured, and gaps where it was hidden."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from linework.arrays import BoolArray, FloatArray
from linework.model.surface import RoadSurface

#: Says for (n, 2) places [m] whether road or ground was measured there: (n,).
Sight = Callable[[FloatArray], BoolArray]


def sight_of(surface: RoadSurface) -> Sight:
    """Return the sight of a surface: places in the world in a cell of road or ground that was measured."""
    measured, grid = surface.is_road | surface.is_ground, surface.grid

    def seen(xy: FloatArray) -> BoolArray:
        rows, cols = (np.floor(v).astype(np.int64) for v in grid.to_cell(xy))
        inside = (rows >= 0) & (rows < grid.n_rows) & (cols >= 0) & (cols < grid.n_cols)
        out = np.zeros(len(xy), dtype=np.bool_)
        out[inside] = measured[rows[inside], cols[inside]]
        return out

    return seen


def seen_share(seen: Sight, start: FloatArray, end: FloatArray) -> float:
    """Return the share of the straight way between two places, 0 to 1, that was seen."""
    n = max(int(np.hypot(*(end[:2] - start[:2])) / 0.25), 1)
    along = (np.arange(n) + 0.5)[:, None] / n
    return float(np.mean(seen(start[:2] + along * (end[:2] - start[:2]))))
