"""Points outside the box that a file's own header states: the header was made up, or the points are damaged."""

from __future__ import annotations

import numpy as np

from linework.arrays import FloatArray
from linework.files.las_header import LasHeader


class HeaderBox:
    """Counts the points of a file outside its header's box; a header without a box states none.

    Parameters
    ----------
    factors
        Metres per unit of the file, in plan and in height.
    """

    def __init__(self, header: LasHeader, factors: tuple[float, float]) -> None:
        horizontal, vertical = factors
        metres = np.array([horizontal, horizontal, vertical])
        is_stated = header.low is not None and header.high is not None
        # Some writers state the box before rounding to the file's steps
        margin = np.abs(header.scales) * metres
        self._low = np.array(header.low) * metres - margin if is_stated else np.full(3, -np.inf)
        self._high = np.array(header.high) * metres + margin if is_stated else np.full(3, np.inf)
        self._n_outside = 0

    def add(self, xyz: FloatArray, low: FloatArray, high: FloatArray) -> None:
        """Count a batch in.

        Parameters
        ----------
        low, high
            (3,) extent of all points up to here, this batch with them: while it is inside, none is looked at.
        """
        if np.all(low >= self._low) and np.all(high <= self._high):
            return
        inside = np.ones(len(xyz), dtype=bool)
        for axis in range(3):
            inside &= (xyz[:, axis] >= self._low[axis]) & (xyz[:, axis] <= self._high[axis])
        self._n_outside += len(xyz) - int(np.count_nonzero(inside))

    def warnings(self, n_points: int) -> tuple[str, ...]:
        """Return what to tell the user, in one line or none.

        Parameters
        ----------
        n_points
            Points that were looked at.
        """
        if not self._n_outside:
            return ()
        return (f"{self._n_outside:,} of {n_points:,} points lie outside the box in its header",)
