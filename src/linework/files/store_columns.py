"""Room for the points of a tile store on their way from the files to `Points`."""

from __future__ import annotations

import numpy as np

from linework.arrays import AnyArray, IntArray
from linework.kernels import store_order as kernels
from linework.model.points import Points

#: Order of points that are given as they come.
_AS_THEY_COME = np.empty(0, np.int32)


class Columns:
    """Room for the columns of some points, as they lie in the store.

    Parameters
    ----------
    n
        Points that fit.
    """

    def __init__(self, n: int) -> None:
        self.keys = np.empty(n, np.uint64)
        #: The bits of float64
        self.times = np.empty(n, np.uint64)
        self.intensities = np.empty(n, np.uint16)

    def part(self, n: int) -> tuple[AnyArray, AnyArray, AnyArray]:
        """Return the first `n` keys, times and intensities."""
        return self.keys[:n], self.times[:n], self.intensities[:n]


class Output:
    """The columns of the points to return, filled block by block."""

    def __init__(self, n: int, with_time: bool, with_intensity: bool) -> None:
        self._with_time, self._with_intensity = with_time, with_intensity
        self._xyz = np.empty((n, 3))
        self._times = np.empty(n if with_time else 0, np.uint64)
        self._intensities = np.empty(n if with_intensity else 0, np.float32)
        self._n = 0

    def add(
        self,
        part: tuple[AnyArray, AnyArray, AnyArray],
        in_order: tuple[AnyArray, AnyArray] | None,
        corner: IntArray,
    ) -> None:
        """Add the points of a block, in the given order of keys and numbers."""
        keys, times, intensities = part
        keys, order = (keys, _AS_THEY_COME) if in_order is None else in_order
        out = self._xyz, self._times, self._intensities
        kernels.unpack_points(keys, times, intensities, order, corner, out, self._n)
        self._n += len(keys)

    def points(self) -> Points:
        """Return what was added."""
        return Points(
            self._filled(self._xyz),
            self._filled(self._intensities) if self._with_intensity else None,
            self._filled(self._times).view(np.float64) if self._with_time else None,
        )

    def _filled(self, column: AnyArray) -> AnyArray:
        """Return the part that was filled; room that was not needed is given back where it is much."""
        part = column[: self._n]
        return part.copy() if 2 * self._n < len(column) else part


class Scratch:
    """Room to sort a block in."""

    def __init__(self, n: int) -> None:
        self._room = [np.empty(n, dtype) for dtype in (np.uint64, np.int32) * 2]

    def sorted(self, part: tuple[AnyArray, AnyArray, AnyArray]) -> tuple[AnyArray, AnyArray]:
        """Return keys in canonical order and the number of each."""
        keys, order, more_keys, more_order = (column[: len(part[0])] for column in self._room)
        kernels.sort_points(*part, (keys, order, more_keys, more_order))
        return keys, order
