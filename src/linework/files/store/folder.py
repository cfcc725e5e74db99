"""Read the data files of a tile store run by run: a few files open at a time, every byte checked."""

from __future__ import annotations

import os
from collections import OrderedDict
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from linework.arrays import AnyArray, IntArray
from linework.errors import MachineError
from linework.files.handles import open_for_reading, read_at
from linework.files.store.layout import POINTS_SUFFIX
from linework.kernels.store import order as kernels
from linework.kernels.store.order import first_damaged
from linework.model.points import Points

#: Files kept open: a survey may have a thousand, a process often no more than 64.
_MOST_OPEN = 8
STORE_ADVICE = "linework clean removes the store, and the next run rebuilds it"


class StoreFiles:
    """The data files of a store, opened as they are read; use it in a `with` statement.

    Files are read, not mapped: a file that shrinks while it is mapped kills the process, and the memory of a map
    cannot be bounded.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._open: OrderedDict[int, int] = OrderedDict()

    def __enter__(self) -> StoreFiles:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        while self._open:
            os.close(self._open.popitem()[1])

    def read(self, rows: AnyArray, columns: PointBuffers) -> int:
        """Read runs one after the other into `columns`, and return their number of points.

        Points of files without times get the time 0.

        Raises
        ------
        MachineError
            A file is missing, cannot be read, is too short, or holds other bytes than were written.
        """
        starts = np.zeros(len(rows) + 1, np.int64)
        np.cumsum(rows["count"], out=starts[1:])
        ends = starts.tolist()
        places = zip(rows["file"].tolist(), rows["offset"].tolist(), rows["has_time"].tolist(), strict=True)
        keys, times, intensities = (column.data for column in columns.part(ends[-1]))
        for i, (number, offset, has_time) in enumerate(places):
            a, b = ends[i], ends[i + 1]
            if has_time:
                views = [keys[a:b], times[a:b], intensities[a:b]]
            else:
                columns.times[a:b] = 0
                views = [keys[a:b], intensities[a:b]]
            self._read_run(number, offset, views)
        damaged = first_damaged(*columns.part(ends[-1]), starts, rows["has_time"], rows["checksum"])
        if damaged >= 0:
            row = rows[damaged]
            raise MachineError(
                f"{int(row['count']):,} points at byte {int(row['offset']):,} are not what was written (damaged)",
                where=self._path(int(row["file"])),
                advice=STORE_ADVICE,
            )
        return int(ends[-1])

    def _read_run(self, number: int, offset: int, views: list[memoryview]) -> None:
        wanted = sum(view.nbytes for view in views)
        try:
            handle = self._handle(number)
            got = read_at(handle, views, offset)
            if got < wanted:
                got = self._read_on(handle, offset, got, views)
        except OSError as error:
            reason = error.strerror or type(error).__name__
            raise MachineError(
                f"cannot be read: {reason}", where=self._path(number), advice=STORE_ADVICE
            ) from error
        if got < wanted:
            raise MachineError(
                f"{os.fstat(handle).st_size:,} bytes, {offset + wanted:,} are needed (cut off)",
                where=self._path(number),
                advice=STORE_ADVICE,
            )

    def _read_on(self, handle: int, offset: int, got: int, views: list[memoryview]) -> int:
        """Continue after a read that returned less than requested, as some file systems do."""
        while True:
            skip, rest = got, []
            for view in views:
                flat: Any = view.cast("B")
                rest.append(flat[min(skip, len(flat)) :])
                skip = max(0, skip - len(flat))
            n = read_at(handle, [view for view in rest if len(view)], offset + got) if any(rest) else 0
            if n == 0:
                return got
            got += n

    def _handle(self, number: int) -> int:
        if number in self._open:
            self._open.move_to_end(number)
            return self._open[number]
        if len(self._open) >= _MOST_OPEN:
            os.close(self._open.popitem(last=False)[1])
        handle = open_for_reading(self._path(number))
        self._open[number] = handle
        return handle

    def _path(self, number: int) -> Path:
        return self._folder / f"{number}{POINTS_SUFFIX}"


#: Order of points that are returned as stored.
_AS_THEY_COME = np.empty(0, np.int32)


class PointBuffers:
    """Buffers for the columns of points, as stored.

    Parameters
    ----------
    n
        Number of points that fit.
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
    """Columns of the points to return, filled block by block."""

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
        """Return the points added so far."""
        return Points(
            self._filled(self._xyz),
            intensity=self._filled(self._intensities) if self._with_intensity else None,
            time_s=self._filled(self._times).view(np.float64) if self._with_time else None,
        )

    def _filled(self, column: AnyArray) -> AnyArray:
        """Return the filled part; copied where most of the buffer is unused, to free it."""
        part = column[: self._n]
        return part.copy() if 2 * self._n < len(column) else part


class Scratch:
    """Buffers for sorting a block."""

    def __init__(self, n: int) -> None:
        self._room = [np.empty(n, dtype) for dtype in (np.uint64, np.int32) * 2]

    def sorted(self, part: tuple[AnyArray, AnyArray, AnyArray]) -> tuple[AnyArray, AnyArray]:
        """Return keys in canonical order and the number of each."""
        keys, order, more_keys, more_order = (column[: len(part[0])] for column in self._room)
        kernels.sort_points(*part, (keys, order, more_keys, more_order))
        return keys, order
