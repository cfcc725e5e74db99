"""Lowest heights of square blocks of cells, found once for each tile, by which wide surroundings are looked at."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from linework.arrays import AnyArray, Float32Array, IntArray
from linework.kernels.cells import blocks as kernels
from linework.surface.cells import CellWindow

#: Planes in which blocks are kept: their lowest heights, and the numbers of their cells.
N_BLOCK_PLANES = kernels.N_LOW + 1
#: Cells that support a lowest one: two stray cells of a block have about the same height by chance, three do not.
_N_SUPPORT = 2


@dataclass(frozen=True, slots=True)
class BlockHeights:
    """Lowest heights of blocks of cells, counted from the zero of the cells: the same blocks in every window.

    Parameters
    ----------
    size
        Side of a block. [cells]
    window
        The blocks, in numbers of blocks.
    lowest
        (n_rows, n_cols, 6) float32 lowest heights of the cells of each block, ascending; infinite where there are no
        more. [m]
    known
        (n_rows, n_cols) int32 cells of each block that have a height.
    """

    size: int
    window: CellWindow
    lowest: Float32Array
    known: AnyArray

    @classmethod
    def of(cls, window: CellWindow, height: Float32Array, size: int) -> BlockHeights:
        """Return the blocks that the cells of a window are in, without what lies outside of it.

        Parameters
        ----------
        window
            The cells.
        height
            (n_rows, n_cols) float32; NaN in empty cells. [m]

        Examples
        --------
        >>> heights = np.array([[4.0, 3.0, np.nan]], dtype=np.float32)
        >>> found = BlockHeights.of(CellWindow(1, 6, 1, 3), heights, 2)
        >>> found.window, found.lowest[..., 0].tolist(), found.known.tolist()
        (CellWindow(west=0, south=3, n_rows=1, n_cols=2), [[4.0, 3.0]], [[1, 1]])
        """
        own = blocks_over(window, size)
        lowest, known = kernels.lowest_of_blocks(
            np.ascontiguousarray(height),
            own.north * size - window.north,
            window.west - own.west * size,
            size,
            *own.shape,
        )
        return cls(size, own, lowest, known)

    @classmethod
    def united(cls, size: int, window: CellWindow, parts: Iterable[BlockHeights]) -> BlockHeights:
        """Return the blocks of a window, in numbers of blocks, put together from windows of which none has a cell of another."""
        lowest = np.full((*window.shape, kernels.N_LOW), np.float32(np.inf))
        known = np.zeros(window.shape, dtype=np.int32)
        for part in parts:
            shared = window.common(part.window)
            if shared:
                to, at = window.part(shared), part.window.part(shared)
                both = np.concatenate([lowest[to], part.lowest[at]], axis=-1)
                lowest[to] = np.sort(both, axis=-1)[..., : kernels.N_LOW]
                known[to] += part.known[at]
        return cls(size, window, lowest, known)

    @classmethod
    def of_planes(cls, size: int, window: CellWindow, planes: Sequence[AnyArray]) -> BlockHeights:
        """Return the blocks whose `planes` these are."""
        return cls(size, window, np.stack(planes[:-1], axis=-1), planes[-1])

    @property
    def planes(self) -> tuple[AnyArray, ...]:
        """(n_rows, n_cols) each: the lowest heights, from the lowest on, and the known cells."""
        return (*np.moveaxis(self.lowest, -1, 0), self.known)

    def lowest_supported(self, step_m: float) -> Float32Array:
        """Return the lowest height of each block, (n_rows, n_cols) float32 [m]; infinite without any.

        A cell with stray points alone lies below all others: up to three are passed over unless two of the block are at
        most a step higher. Blocks of one or two cells have the lower one.
        """
        lowest: Float32Array = kernels.supported_lowest(self.lowest, step_m, _N_SUPPORT)
        return lowest


def blocks_over(window: CellWindow, size: int) -> CellWindow:
    """Return the blocks that cells of a window are in, in numbers of blocks.

    >>> blocks_over(CellWindow(-1, 4, 4, 2), 4)
    CellWindow(west=-1, south=1, n_rows=1, n_cols=2)
    """
    west, south = window.west // size, window.south // size
    east, north = -(-window.east // size), -(-window.north // size)
    return CellWindow(west, south, north - south, east - west)


def places_in_blocks(blocks: CellWindow, size: int, window: CellWindow) -> tuple[IntArray, IntArray]:
    """Return the row (n_rows,) and the column (n_cols,) of the block, among these blocks, of each cell of a window.

    >>> [at.tolist() for at in places_in_blocks(CellWindow(0, 0, 2, 2), 4, CellWindow(3, 2, 3, 2))]
    [[0, 1, 1], [0, 1]]
    """
    rows = blocks.north - 1 - (window.north - 1 - np.arange(window.n_rows)) // size
    return rows, (window.west + np.arange(window.n_cols)) // size - blocks.west
