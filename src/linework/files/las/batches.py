"""Read the points of a LAS file in batches; the next ones are decoded while one is used."""

from __future__ import annotations

import functools
import io
import operator
import os
from collections import deque
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import lazrs
import numpy as np

from linework.arrays import AnyArray, BoolArray, Float32Array, FloatArray
from linework.errors import InputError
from linework.files.las.columns import LasColumn
from linework.files.las.header import LasHeader
from linework.model.points import FARTHEST_COORDINATE_M

#: Points decoded at a time: about 15 MB of records stay near the caches while they are converted, which
#: measures 5 to 10 % faster than one buffer of 4 million.
BATCH_POINTS = 500_000
#: Largest buffer: a batch of any point format without many extra bytes fits.
_BATCH_BYTES = 32 << 20
#: Buffers decoded ahead: they keep both cores busy while the kernels that write the first points load (0.3 s).
_BUFFERS = 4
#: Chunks decoded in parallel: two per core even out those that take longer.
_CHUNKS_PER_CORE = 2
#: Range of the times of laser points: seconds of a week, GPS seconds, or those less 1e9, from 1980 to 2106. [s]
EARLIEST_S, LATEST_S = -1e9, 4e9
#: Noise classes of the LAS specification (tables 9 and 17).
_NOISE, _HIGH_NOISE = 7, 18


@dataclass(frozen=True, slots=True)
class LasBatch:
    """Some points of a file in file order, none left out yet; overwritten by the next batch.

    Parameters
    ----------
    xyz
        (n, 3) float64 [m].
    intensity
        (n,) uint16.
    time_s
        (n,) float64 [s] as stored, or None where the point format has no time.
    columns
        (k, n) float32: the further columns that were asked for; NaN where the file has none of that name.
    is_noise, is_withheld, is_absurd, is_untimed, is_missing
        (n,) bool: of a noise class; withheld; coordinates outside any projected CRS; a time outside all known epochs; a
        beam that the file says to have no return. None: no such point.
    """

    xyz: FloatArray
    intensity: AnyArray
    time_s: FloatArray | None
    columns: Float32Array
    is_noise: BoolArray | None
    is_withheld: BoolArray | None
    is_absurd: BoolArray | None
    is_untimed: BoolArray | None
    is_missing: BoolArray | None = None

    def __len__(self) -> int:
        return len(self.xyz)


def read_las_batches(
    path: Path,
    header: LasHeader,
    *,
    factors: tuple[float, float] = (1.0, 1.0),
    carry: Sequence[str] = (),
    batch_points: int = BATCH_POINTS,
    is_sequential: bool = False,
) -> Generator[LasBatch, None, None]:
    """Yield all points that the header promises.

    Parameters
    ----------
    factors
        Metres per unit of the file, in plan and in height.
    carry
        Names of the further columns to read.
    batch_points
        Approximate number of points in a batch.
    is_sequential
        Decode one chunk after the other, without the chunk table.

    Raises
    ------
    InputError
        Points are missing or cannot be decoded, or need more memory than there is.

    Notes
    -----
    Decoders release the interpreter lock: a thread fills some buffers while another buffer is converted.
    """
    n_batch = _rounded_batch(header, batch_points)
    further = [header.columns.get(name) for name in carry]
    record = _record_dtype(header, further)
    starts = range(0, header.n_points, n_batch)
    n_buffers = min(_BUFFERS, len(starts))
    buffers = [np.empty(n_batch * header.record_bytes, dtype=np.uint8) for _ in range(n_buffers)]
    columns = _Columns.empty(n_batch, len(carry), has_time=header.has_time)
    with (
        path.open("rb") as file,
        ThreadPoolExecutor(max_workers=1, thread_name_prefix="decode") as pool,
    ):
        layers = [column.layer for column in further if column is not None]
        source = RecordSource(path, file, header, layers, is_sequential=is_sequential)

        def decode(i: int) -> AnyArray:
            n = min(n_batch, header.n_points - starts[i])
            return source.read(buffers[i % n_buffers][: n * header.record_bytes], starts[i])

        try:
            ahead = deque(pool.submit(decode, i) for i in range(n_buffers))
            for i in range(n_buffers, len(starts) + n_buffers):
                batch = _converted(ahead.popleft().result().view(record), header, factors, columns, further)
                # Its buffer is free again
                if i < len(starts):
                    ahead.append(pool.submit(decode, i))
                yield batch
        finally:
            pool.shutdown(wait=False, cancel_futures=True)


def _rounded_batch(header: LasHeader, batch_points: int) -> int:
    """Return the number of points to decode at a time: whole chunks if they fit, enough for all cores."""
    largest = max(_BATCH_BYTES // header.record_bytes, 1)
    chunk = header.laz.chunk_size if header.laz is not None else 0
    batch = min(batch_points, largest)
    if 0 < chunk <= batch:
        n_chunks = batch // chunk
        if batch_points == BATCH_POINTS:
            n_chunks = max(n_chunks, _CHUNKS_PER_CORE * (os.cpu_count() or 1))
        batch = min(n_chunks, largest // chunk) * chunk
    return min(batch, header.n_points)


def _record_dtype(header: LasHeader, further: Sequence[LasColumn | None]) -> np.dtype[Any]:
    """Return the dtype with the offsets of the fields in use (specification tables 7 to 17)."""
    fields = {"x": ("<i4", 0), "y": ("<i4", 4), "z": ("<i4", 8), "intensity": ("<u2", 12)}
    if header.point_format >= 6:
        fields |= {"flags": ("u1", 15), "class": ("u1", 16), "time": ("<f8", 22)}
    else:
        fields |= {"class": ("u1", 15)}
        if header.has_time:
            fields |= {"time": ("<f8", 20)}
    fields |= {f"further {i}": (column.dtype, column.offset) for i, column in enumerate(further) if column}
    return np.dtype({
        "names": list(fields), "formats": [f for f, _ in fields.values()],
        "offsets": [o for _, o in fields.values()], "itemsize": header.record_bytes,
    })  # fmt: skip


@dataclass(frozen=True, slots=True)
class _Columns:
    """Buffers for the columns of a batch, reused for every batch."""

    xyz: FloatArray
    intensity: AnyArray
    time_s: FloatArray | None
    further: Float32Array

    @classmethod
    def empty(cls, n: int, n_further: int, *, has_time: bool) -> _Columns:
        time_s = np.empty(n) if has_time else None
        # NaN stays where a file has no column of a name
        further = np.full((n_further, n), np.nan, np.float32)
        return cls(np.empty((n, 3)), np.empty(n, dtype=np.uint16), time_s, further)


def _converted(
    records: AnyArray,
    header: LasHeader,
    factors: tuple[float, float],
    columns: _Columns,
    further: Sequence[LasColumn | None],
) -> LasBatch:
    n = len(records)
    xyz, intensity = columns.xyz[:n], columns.intensity[:n]
    horizontal, vertical = factors
    for axis, (name, factor) in enumerate(zip("xyz", (horizontal, horizontal, vertical), strict=True)):
        column = xyz[:, axis]
        np.multiply(records[name], header.scales[axis], out=column)
        column += header.offsets[axis]
        if factor != 1.0:
            column *= factor
    intensity[:] = records["intensity"]
    time, is_untimed = None, None
    if columns.time_s is not None:
        time = columns.time_s[:n]
        time[:] = records["time"]
        # NaN compares false; the two extremes cost less than a mask
        if not (time.min() >= EARLIEST_S and time.max() <= LATEST_S):
            is_untimed = ~((time >= EARLIEST_S) & (time <= LATEST_S))
    for i, found in enumerate(further):
        if found is not None:
            found.values(records[f"further {i}"], columns.further[i, :n])
    return LasBatch(
        xyz, intensity, time, columns.further[:, :n],
        *_noise_and_withheld(records, header.point_format), _absurd(xyz, header, factors), is_untimed,
    )  # fmt: skip


def _noise_and_withheld(records: AnyArray, point_format: int) -> tuple[BoolArray | None, BoolArray | None]:
    """Return (n,) bool: points of a noise class, and points that are withheld; None where there is none."""
    classes = records["class"]
    noise: BoolArray
    withheld: BoolArray
    if point_format >= 6:
        noise = (classes == _NOISE) | (classes == _HIGH_NOISE)
        withheld = records["flags"] & 4 != 0
    else:  # class in the low 5 bits, withheld in the top one
        noise, withheld = classes & 31 == _NOISE, classes & 128 != 0
    return noise if noise.any() else None, withheld if withheld.any() else None


def _absurd(xyz: FloatArray, header: LasHeader, factors: tuple[float, float]) -> BoolArray | None:
    """Return (n,) bool: coordinates outside any projected CRS; not tested where the header excludes them."""
    reach = max(2.0**31 * abs(s) + abs(o) for s, o in zip(header.scales, header.offsets, strict=True))
    if reach * max(factors) < FARTHEST_COORDINATE_M:
        return None
    bad: BoolArray = np.any(np.abs(xyz) >= FARTHEST_COORDINATE_M, axis=1)
    return bad if bad.any() else None


#: Chunk size that marks chunks of variable size (COPC).
_VARIABLE_CHUNKS = 0xFFFFFFFF


class RecordSource:
    """Point records of one file, plain or decompressed, read in order into buffers.

    Parameters
    ----------
    layers
        Parts of a compressed file that are unpacked beside the usual ones, as lazrs numbers them.
    """

    def __init__(
        self,
        path: Path,
        file: io.BufferedReader,
        header: LasHeader,
        layers: Sequence[int] = (),
        *,
        is_sequential: bool,
    ) -> None:
        self._path, self._file, self._header, self._layers = path, file, header, layers
        self._is_sequential = is_sequential
        self._fill: Callable[[AnyArray], None] | None = None

    def read(self, view: AnyArray, start: int) -> AnyArray:
        """Fill a byte buffer with the records from point `start` on, and return it."""
        try:
            self._fill = self._fill or self._filler()
            self._fill(view)
        except (KeyboardInterrupt, SystemExit):
            raise
        except MemoryError:
            raise
        except BaseException as error:  # lazrs panics are not Exceptions
            n = len(view) // self._header.record_bytes
            raise InputError(
                f"points {start:,} to {start + n:,} of {self._header.n_points:,} cannot be decoded (cut off or"
                " damaged)",
                where=self._path,
                advice="copy the file again, or leave it out",
            ) from error
        return view

    def _filler(self) -> Callable[[AnyArray], None]:
        """Return a function that fills a byte buffer with the next records."""
        laz, offset = self._header.laz, self._header.point_offset
        self._file.seek(offset)
        if laz is None:
            return self._fill_plain
        usual = (
            lazrs.SELECTIVE_DECOMPRESS_XY_RETURNS_CHANNEL, lazrs.SELECTIVE_DECOMPRESS_Z,
            lazrs.SELECTIVE_DECOMPRESS_INTENSITY, lazrs.SELECTIVE_DECOMPRESS_GPS_TIME,
            lazrs.SELECTIVE_DECOMPRESS_CLASSIFICATION, lazrs.SELECTIVE_DECOMPRESS_FLAGS,
        )  # fmt: skip
        selection = lazrs.DecompressionSelection(functools.reduce(operator.or_, (*usual, *self._layers)))
        if laz.is_sound and not self._is_sequential:
            return lazrs.ParLasZipDecompressor(self._file, laz.vlr, selection).decompress_many  # type: ignore[no-any-return]
        source: io.BufferedIOBase = self._file
        # This decoder reads the chunk table even without needing it, and that table may have killed a decoder;
        # only for chunks of variable size it is needed
        if laz.table_offset is not None and laz.chunk_size != _VARIABLE_CHUNKS:
            source = io.BufferedReader(_WithoutChunkTable(self._file, laz.table_offset), 1 << 20)
            source.seek(offset)
        return lazrs.LasZipDecompressor(source, laz.vlr, selection).decompress_many  # type: ignore[no-any-return]

    def _fill_plain(self, view: AnyArray) -> None:
        if self._file.readinto(view.data) != len(view):
            raise EOFError("cut off")


class _WithoutChunkTable(io.RawIOBase):
    """A view of a file in which the chunk table is empty."""

    def __init__(self, file: io.BufferedReader, table_offset: int) -> None:
        self._file, self._table_offset = file, table_offset

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def seek(self, offset: int, whence: int = 0, /) -> int:
        return self._file.seek(offset, whence)

    def readinto(self, buffer: Any, /) -> int:
        at, view = self._file.tell(), memoryview(buffer).cast("B")
        n = self._file.readinto(view)
        first, last = max(self._table_offset - at, 0), min(self._table_offset + 8 - at, n)
        if first < last:
            view[first:last] = bytes(last - first)
        return n
