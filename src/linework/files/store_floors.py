"""Lowest wanted heights of an image, block by block of the tile store."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from linework.arrays import AnyArray
from linework.files.store_layout import BLOCK_UP_STEPS, CELL_M, CELLS_PER_BLOCK, STEPS_PER_M
from linework.model.grid import Image


class Floors:
    """Cuts an image of heights into tables that `linework.kernels.store_order.keep_inside` takes.

    Parameters
    ----------
    image
        (rows, cols) heights [m, world], NaN: no limit. North-up, its cells whole multiples of 0.5 m on
        their lattice, so that a cell of the store lies in one cell of the image.
    above_m
        Added to the heights.

    Raises
    ------
    ValueError
        The image is on no such lattice.
    """

    #: No limits at all.
    NONE: ClassVar[AnyArray] = np.empty(0, np.int32)

    def __init__(self, image: Image, above_m: float = 0.0) -> None:
        grid = image.grid
        per_col, per_row = grid.cell_width_m / CELL_M, grid.cell_height_m / CELL_M
        first_col, top_row = grid.east_m / grid.cell_width_m, grid.north_m / grid.cell_height_m
        # 1e-6 of a cell: the rounding of k * cell and back is 1e-8 of a cell at UTM northings
        apart = [abs(v - round(v)) for v in (per_col, per_row, first_col, top_row)]
        if grid.rotation_deg != 0.0 or max(apart) > 1e-6 or min(per_col, per_row) < 0.5:
            raise ValueError(f"lowest: {grid} is not north-up on a lattice of multiples of {CELL_M} m")
        self._values, self._above_m = image.values, above_m
        self._per_col, self._per_row = round(per_col), round(per_row)
        self._first_col, self._top_row = round(first_col), round(top_row)

    def of_block(self, row: Any) -> AnyArray:
        """Return the (129 * 128,) int32 lowest steps above the corner of the block of a run.

        Cells of images are open to the south: row k of the table holds positions above the k-th line of
        cells of the block, up to and with the next.
        """
        cols = int(row["east"]) * CELLS_PER_BLOCK + np.arange(CELLS_PER_BLOCK)
        cols = cols // self._per_col - self._first_col
        # ceil(northing / cell) is k lines up the block; negated floor division is ceiling
        lines = int(row["north"]) * CELLS_PER_BLOCK + np.arange(CELLS_PER_BLOCK + 1)
        rows = self._top_row + (-lines // self._per_row)
        n_rows, n_cols = self._values.shape
        known = ((rows >= 0) & (rows < n_rows))[:, None] & ((cols >= 0) & (cols < n_cols))
        if not known.any():
            return np.full(known.size, -1, np.int32)
        values = self._values[np.clip(rows, 0, n_rows - 1)[:, None], np.clip(cols, 0, n_cols - 1)]
        heights = np.where(known, values, np.nan).astype(np.float64) + self._above_m
        steps = _first_steps(heights) - float(int(row["up"]) * BLOCK_UP_STEPS)
        # Above the highest possible: nothing is wanted
        limits = np.clip(np.nan_to_num(steps, nan=-1.0), -1, BLOCK_UP_STEPS)
        return limits.astype(np.int32).ravel()


def _first_steps(heights: AnyArray) -> AnyArray:
    """Return the lowest steps whose coordinates are not below the heights (see `store_layout.first_step`)."""
    steps = np.ceil(heights * STEPS_PER_M)
    steps = np.where((steps - 1) / STEPS_PER_M >= heights, steps - 1, steps)
    first: AnyArray = np.where(steps / STEPS_PER_M < heights, steps + 1, steps)
    return first
