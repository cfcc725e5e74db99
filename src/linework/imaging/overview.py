"""Reduction of images for overviews that keeps thin lines, and windows for close-ups."""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

import numpy as np

from linework.arrays import AnyArray, Float32Array
from linework.model.grid import Image

#: Half length of the stretch of road on whose median cell a close-up is centred. [m]
STRETCH_M = 2.0


class ImageWindow(NamedTuple):
    """Half-open ranges of rows and columns of an image."""

    row0: int
    row1: int
    col0: int
    col1: int


def reduced(
    values: AnyArray, n_max: int, keep: Literal["largest", "smallest"] = "largest"
) -> tuple[Float32Array, int]:
    """Return an image (rows, cols) of at most `n_max` rows and columns, float32, and the side of its blocks in cells.

    A block keeps its largest (smallest) value, so that a line one cell wide remains; it is NaN only where all its
    cells are. The image may extend up to one block beyond the south and east edge of the original.

    >>> reduced(np.array([[1.0, 5.0, 2.0]]), 2)[0].tolist()
    [[5.0, 2.0]]
    """
    n_rows, n_cols = values.shape
    factor = max(1, math.ceil(max(n_rows, n_cols) / n_max))
    if factor == 1:
        return values.astype(np.float32), 1
    join = np.fmax if keep == "largest" else np.fmin
    # Row block by row block: no second copy of a large image
    out = np.empty((math.ceil(n_rows / factor), math.ceil(n_cols / factor)), dtype=np.float32)
    starts = np.arange(0, n_cols, factor)
    for i in range(len(out)):
        rows = join.reduce(values[i * factor : (i + 1) * factor], axis=0)
        out[i] = join.reduceat(rows, starts)
    return out, factor


def close_ups(density: Image, width_m: float, height_m: float, n_max: int = 3) -> tuple[ImageWindow, ...]:
    """Return up to `n_max` windows along the occupied cells, as many as hardly overlap.

    They are at the middles of n parts of equal area along the longer axis of the cells, each centred across on the
    median cell there, so that they lie on the road whatever is scattered beside it.
    """
    grid = density.grid
    rows, cols = np.nonzero(density.values)
    if len(rows) == 0:
        return ()
    # A sample of the cells suffices for places
    every = max(1, len(rows) // 100_000)
    rows, cols = rows[::every], cols[::every]
    east, south = cols * grid.cell_width_m, rows * grid.cell_height_m
    along, size = (east, width_m) if east.std() >= south.std() else (south, height_m)
    length = np.quantile(along, 0.95) - np.quantile(along, 0.05)
    n = int(np.clip(length / size, 1, n_max))
    n_rows = min(grid.n_rows, max(1, round(height_m / grid.cell_height_m)))
    n_cols = min(grid.n_cols, max(1, round(width_m / grid.cell_width_m)))
    windows = []
    for middle in np.quantile(along, (np.arange(n) + 0.5) / n, method="nearest"):
        beside = np.abs(along - middle) < STRETCH_M
        row0 = int(np.clip(np.median(rows[beside]) - n_rows / 2, 0, grid.n_rows - n_rows))
        col0 = int(np.clip(np.median(cols[beside]) - n_cols / 2, 0, grid.n_cols - n_cols))
        windows.append(ImageWindow(row0, row0 + n_rows, col0, col0 + n_cols))
    return tuple(windows)
