"""Statistics of all points of a survey, read from the tile store a block at a time.

Separate from `describe`, which makes a document of them and of everything else that a survey has. They are exact, and
the same whatever the order of the points: values are counted, not sampled. Memory grows with the number of different
values (heights on the lattice of 0.1 mm, intensities, seconds with points), not with the number of points.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from linework.arrays import AnyArray, BoolArray, FloatArray, IntArray
from linework.files.store.layout import STORE_BLOCK_M
from linework.files.store.read import PointStore
from linework.model.grid import Bounds
from linework.model.points import Points

#: Cell in which points are counted for the density: holds several scan lines, shows where the van was near, and divides
#: the blocks of the store. [m]
DENSITY_CELL_M = 1.0
#: Least pause that is a gap: scanners turn at least 10 times a second, so for this long it was off. [s]
GAP_S = 1.0
#: Rows that wait before they are merged: some ten megabytes. [rows]
_MOST_WAITING = 1_000_000


def points_by_block(store: PointStore, *, with_intensity: bool = True) -> Iterator[Points]:
    """Yield the points of each block of a store, without further columns, in no particular order within it."""
    for east, north in (store.block_counts[0] * STORE_BLOCK_M).tolist():
        bounds = Bounds(east, north, east + STORE_BLOCK_M, north + STORE_BLOCK_M)
        yield store.points(bounds, ordered=False, with_intensity=with_intensity, with_columns=False)


@dataclass(slots=True)
class CountedValues:
    """How often each value occurs.

    Examples
    --------
    >>> counted = CountedValues()
    >>> counted.add(np.array([3.0, 1.0, 3.0])); counted.add(np.array([7.0]))
    >>> counted.values.tolist(), counted.counts.tolist(), counted.quantile(0.5)
    ([1.0, 3.0, 7.0], [1, 2, 1], 3.0)
    """

    _parts: list[tuple[FloatArray, IntArray]] = field(default_factory=list)
    _n_waiting: int = 0

    def add(self, values: AnyArray) -> None:
        """Count (n,) values [any unit]."""
        found, counts = np.unique(values, return_counts=True)
        self._parts.append((found.astype(np.float64), counts))
        self._n_waiting += len(found)
        if self._n_waiting > _MOST_WAITING:
            self._merge()

    @property
    def values(self) -> FloatArray:
        """(k,) float64: the different values, ascending."""
        return self._merge()[0]

    @property
    def counts(self) -> IntArray:
        """(k,) int64: how often each occurs."""
        return self._merge()[1]

    def quantile(self, share: float) -> float:
        """Return a quantile, interpolated as `numpy.quantile` does it."""
        ends = np.cumsum(self.counts)
        place = share * (int(ends[-1]) - 1)
        below = int(place)
        low, high = (
            float(self.values[np.searchsorted(ends, min(i, int(ends[-1]) - 1), side="right")])
            for i in (below, below + 1)
        )
        return low + (high - low) * (place - below)

    def _merge(self) -> tuple[FloatArray, IntArray]:
        if len(self._parts) != 1:
            empty = np.zeros(0), np.zeros(0, np.int64)
            values, counts = (np.concatenate(columns) for columns in zip(empty, *self._parts, strict=True))
            different, index = np.unique(values, return_inverse=True)
            total = np.zeros(len(different), np.int64)
            np.add.at(total, index, counts)
            self._parts = [(different, total)]
        self._n_waiting = 0
        return self._parts[0]


@dataclass(slots=True)
class TimeSpans:
    """First and last time in each second with points: pauses longer than that show between them."""

    _parts: list[FloatArray] = field(default_factory=list)
    _n_waiting: int = 0

    def add(self, time_s: FloatArray) -> None:
        """Note (n,) times [s] in any order."""
        in_order = np.sort(time_s)
        self._parts.append(_spans(in_order, in_order))
        self._n_waiting += len(self._parts[-1])
        if self._n_waiting > _MOST_WAITING:
            self._merge()

    def spans(self) -> FloatArray:
        """Return first and last time (k, 2) [s] of every second with points, ascending."""
        return self._merge()

    def gaps(self) -> FloatArray:
        """Return start and end (k, 2) [s] of every pause longer than `GAP_S`.

        >>> spans = TimeSpans()
        >>> spans.add(np.array([5.2, 0.5, 1.5])); spans.add(np.array([2.6]))
        >>> spans.gaps().tolist()
        [[1.5, 2.6], [2.6, 5.2]]
        """
        spans = self._merge()
        pauses = np.column_stack([spans[:-1, 1], spans[1:, 0]])
        gaps: FloatArray = pauses[pauses[:, 1] - pauses[:, 0] > GAP_S]
        return gaps

    def _merge(self) -> FloatArray:
        if len(self._parts) != 1:
            rows = np.concatenate([np.zeros((0, 2)), *self._parts])
            rows = rows[np.argsort(rows[:, 0])]
            self._parts = [_spans(rows[:, 0], rows[:, 1])]
        self._n_waiting = 0
        return self._parts[0]


def _spans(first: FloatArray, last: FloatArray) -> FloatArray:
    """Return the lowest first and the highest last time (k, 2) of each second, of rows in ascending order."""
    seconds = np.floor(first / GAP_S)
    new: BoolArray = np.concatenate([[True], np.diff(seconds) > 0.0])[: len(first)]
    at = np.flatnonzero(new)
    if len(at) == 0:
        return np.zeros((0, 2))
    return np.column_stack([np.minimum.reduceat(first, at), np.maximum.reduceat(last, at)])


@dataclass(frozen=True, slots=True)
class PointStatistics:
    """Statistics of all points.

    Parameters
    ----------
    height, density
        Heights [m]; densities of the cells that have points [points/m2].
    intensity, times
        None where the points have none.
    """

    height: CountedValues
    density: CountedValues
    intensity: CountedValues | None
    times: TimeSpans | None

    @classmethod
    def of(cls, store: PointStore) -> PointStatistics:
        """Read all points of a store once."""
        height, density, intensity, times = CountedValues(), CountedValues(), CountedValues(), TimeSpans()
        has_intensity = has_time = True
        for points in points_by_block(store):
            height.add(points.xyz[:, 2])
            density.add(densities_per_m2(points))
            if points.intensity is None:
                has_intensity = False
            else:
                intensity.add(points.intensity)
            if points.time_s is None:
                has_time = False
            else:
                times.add(points.time_s)
        return cls(height, density, intensity if has_intensity else None, times if has_time else None)


def densities_per_m2(points: Points) -> FloatArray:
    """Return the density of every cell that has points, (n_cells,) [points/m2].

    >>> xyz = np.array([[0.1, 0.1, 0.0], [0.9, 0.9, 0.0], [7.5, 0.5, 0.0]])
    >>> densities_per_m2(Points(xyz)).tolist()
    [2.0, 1.0]
    """
    bounds = points.bounds
    cols = np.floor(points.xyz[:, 0] / DENSITY_CELL_M).astype(np.int64)
    rows = np.floor(points.xyz[:, 1] / DENSITY_CELL_M).astype(np.int64)
    n_rows = int(bounds.height_m / DENSITY_CELL_M) + 2
    _, counts = np.unique((cols - cols.min()) * n_rows + rows - rows.min(), return_counts=True)
    return counts / DENSITY_CELL_M**2
