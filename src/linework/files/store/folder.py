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
from linework.files.store.layout import POINTS_SUFFIX, words_of_run
from linework.kernels.store import order as kernels
from linework.kernels.store.columns import checksums_of_columns, settle_by_columns
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

        Points of files without times get the time 0. Further columns are read where `columns` has room for them.

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
            if len(columns.further):
                behind = offset + 8 * words_of_run(b - a, has_time)
                self._read_run(number, behind, [column[a:b].data for column in columns.further])
        damaged = first_damaged(*columns.part(ends[-1]), starts, rows["has_time"], rows["checksum"])
        if damaged < 0 and len(columns.further):
            wrong = checksums_of_columns(columns.further, starts) != rows["column_sum"]
            damaged = int(np.argmax(wrong)) if wrong.any() else -1
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
    n_further
        Number of further columns to read.
    """

    def __init__(self, n: int, n_further: int = 0) -> None:
        self.keys = np.empty(n, np.uint64)
        #: The bits of float64
        self.times = np.empty(n, np.uint64)
        self.intensities = np.empty(n, np.uint16)
        #: (n_further, n), the bits of float32
        self.further = np.empty((n_further, n), np.uint32)

    def keep_inside(self, n: int, box: IntArray, floors: AnyArray) -> int:
        """Move the wanted ones of the first `n` points to the front, and return their number.

        Parameters
        ----------
        box, floors
            As `linework.kernels.store.order.keep_inside` takes them.
        """
        keys, times, intensities = self.part(n)
        if not len(self.further):
            return int(kernels.keep_inside(keys, times, intensities, box, floors))
        # The kernel moves numbers in the place of times: by them everything else is moved
        numbers = np.arange(n, dtype=np.uint64)
        m = int(kernels.keep_inside(keys, numbers, intensities, box, floors))
        times[:m] = times[numbers[:m]]
        self.further[:, :m] = self.further[:, numbers[:m]]
        return m

    def part(self, n: int) -> tuple[AnyArray, AnyArray, AnyArray]:
        """Return the first `n` keys, times and intensities."""
        return self.keys[:n], self.times[:n], self.intensities[:n]


class Output:
    """Columns of the points to return, filled block by block."""

    def __init__(self, n: int, with_time: bool, with_intensity: bool, names: tuple[str, ...] = ()) -> None:
        self._with_time, self._with_intensity, self._names = with_time, with_intensity, names
        self._xyz = np.empty((n, 3))
        self._times = np.empty(n if with_time else 0, np.uint64)
        self._intensities = np.empty(n if with_intensity else 0, np.float32)
        self._further = np.empty((len(names), n), np.uint32)
        self._n = 0

    def add(
        self, columns: PointBuffers, n: int, in_order: tuple[AnyArray, AnyArray] | None, corner: IntArray
    ) -> None:
        """Add the first `n` points of a block, in the given order of keys and numbers."""
        keys, times, intensities = columns.part(n)
        keys, order = (keys, _AS_THEY_COME) if in_order is None else in_order
        out = self._xyz, self._times, self._intensities
        kernels.unpack_points(keys, times, intensities, order, corner, out, self._n)
        for to, column in zip(self._further, columns.further, strict=True):
            to[self._n : self._n + n] = column[:n] if in_order is None else column[order]
        self._n += n

    def points(self, crs: str) -> Points:
        """Return the points added so far, which are in a CRS."""
        return Points(
            self._filled(self._xyz),
            intensity=self._filled(self._intensities) if self._with_intensity else None,
            time_s=self._filled(self._times).view(np.float64) if self._with_time else None,
            crs=crs,
            columns={
                name: self._filled(column).view(np.float32)
                for name, column in zip(self._names, self._further, strict=True)
            },
        )

    def _filled(self, column: AnyArray) -> AnyArray:
        """Return the filled part; copied where most of the buffer is unused, to free it."""
        part = column[: self._n]
        return part.copy() if 2 * self._n < len(column) else part


class Scratch:
    """Buffers for sorting a block."""

    def __init__(self, n: int) -> None:
        self._room = [np.empty(n, dtype) for dtype in (np.uint64, np.int32) * 2]

    def sorted(self, columns: PointBuffers, n: int) -> tuple[AnyArray, AnyArray]:
        """Return the keys of the first `n` points in canonical order and the number of each."""
        part = columns.part(n)
        keys, order, more_keys, more_order = (column[:n] for column in self._room)
        room = keys, order, more_keys, more_order
        kernels.sort_points(*part, room)
        if len(columns.further):
            settle_by_columns(*part[1:], columns.further, room)
        return keys, order
