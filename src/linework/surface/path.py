"""The vehicle's path over the cells: where the road is sure to be."""

from __future__ import annotations

import numpy as np

from linework.arrays import AnyArray, BoolArray, Float32Array, FloatArray
from linework.kernels import regions as kernels
from linework.model.trajectory import Trajectory
from linework.surface.cells import Window

#: The road is under the wheels: so far from the path in plan. [m]
NEAR_M = 1.0
#: Heights of the path over the road are alike within this: a metre less than any bridge is high. [m]
SAME_DROP_M = 1.0
#: A path recorded every second at 130 km/h has steps of 36 m; a longer one leads from one drive to the next. [m]
MAX_STEP_M = 50.0


def path_samples(trajectory: Trajectory | None, cell_m: float) -> FloatArray:
    """Return places (n, 3) on the path, half a cell apart. [m, world]"""  # noqa: D400
    if trajectory is None or len(trajectory) == 0:
        return np.zeros((0, 3))
    step = np.hypot(*np.diff(trajectory.xyz[:, :2], axis=0).T)
    # Jumps have no length, so there is no place on them
    chainage = np.concatenate([[0.0], np.cumsum(np.where(step <= MAX_STEP_M, step, 0.0))])
    at = np.arange(0.0, chainage[-1] + cell_m, cell_m / 2)
    return np.stack([np.interp(at, chainage, trajectory.xyz[:, axis]) for axis in range(3)], axis=-1)


def drops_of_cells(
    path: FloatArray, window: Window, height: Float32Array, smooth: BoolArray, z0_m: float, cell_m: float
) -> tuple[AnyArray, Float32Array]:
    """Return the smooth cells (flat indices (n,)) near the path, and how far below it they are (n, 2) [m].

    Least and largest: a path may pass over a place more than once, at different heights.
    """
    if len(path) == 0:
        return np.zeros(0, dtype=np.int64), np.zeros((0, 2), dtype=np.float32)
    reach = max(round(NEAR_M / cell_m), 1)
    least, most = kernels.drops_below(path, window.west, window.south, height, cell_m, z0_m, reach)
    cells = np.flatnonzero(smooth & ~np.isnan(least))
    return cells, np.stack([least.ravel()[cells], most.ravel()[cells]], axis=-1)


def under_the_wheels(drops: Float32Array) -> BoolArray:
    """Return which of the cells (n,) are road, by how far they lie below the path (n, 2).

    A path may be at the antenna's height: the usual distance below it tells the road from a bridge deck
    overhead, where that is all that was seen.
    """
    if len(drops) == 0:
        return np.zeros(0, dtype=bool)
    usual = np.median(drops[:, 0])
    return np.asarray((np.abs(drops - usual) <= SAME_DROP_M).any(axis=1))
