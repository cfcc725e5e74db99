"""Copy a LAS or LAZ file with other classes and further dimensions; all else in it stays as it is."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import lazrs
import numpy as np

from linework.arrays import AnyArray, BoolArray, Float32Array, FloatArray
from linework.errors import InputError, MachineError
from linework.files.input import open_input
from linework.files.las.batches import RecordSource
from linework.files.las.copy_head import ExtraColumn, copy_head
from linework.files.las.header import LasHeader, read_las_header
from linework.methods.classes.point_class import ASPRS_CLASSES, PointClass, asprs_numbers
from linework.model.tile import LaserGains

#: The number of a point's line, 0 where it belongs to none; and its class, where the point format has no room for it.
LINE_COLUMN = ExtraColumn("line_number", "<u4", "line that the point lies on, 0: none")
CLASS_COLUMN = ExtraColumn("road_class", "u1", "class by LAS 1.4 and from 64 on")
#: Point formats with waveforms: compressors leave those out.
_WITH_WAVEFORMS = (4, 5, 9, 10)
#: The first point format with a byte for the class; noise classes (specification, tables 9 and 17), and bits of the byte
#: that holds class and flags in formats 0 to 5.
_WIDE_CLASSES, _NOISE, _FLAG_BITS = 6, (7, 18), 0xE0
#: Points copied at a time: as many as are decoded at a time.
_BATCH_POINTS = 500_000
#: Returns the class (n,) uint8 and the number of the line (n,) uint32 of points (n, 3) [m] with intensities (n,).
ClassifyBatch = Callable[[FloatArray, Float32Array], tuple[AnyArray, AnyArray]]


@dataclass(frozen=True, slots=True)
class CopiedFile:
    """What became of a file.

    Parameters
    ----------
    counts
        Points by class.
    n_kept
        Points of noise classes and withheld ones, which keep their class.
    left_out
        What of the file is not in its copy.
    """

    counts: dict[PointClass, int]
    n_kept: int
    left_out: tuple[str, ...]


def copy_classified(
    path: Path,
    target: Path,
    factors: tuple[float, float],
    classify: ClassifyBatch,
    advance: Callable[[int], None],
    gains: LaserGains | None = None,
) -> CopiedFile:
    """Write a copy of a file in which points have classes, and the number of their line.

    Parameters
    ----------
    factors
        Metres per unit of the file, in plan and in height.
    advance
        Called with the number of points that are copied.
    gains
        Of the survey's lasers: points are classified by intensities without them, the copy keeps its own.

    Raises
    ------
    InputError
        The file cannot be read, is a classified copy, or holds compressed waveforms.
    MachineError
        The copy cannot be written.

    Notes
    -----
    Point formats 6 to 10 get the numbers of LAS 1.4. Formats 0 to 5 have room for 31 classes, none of which is a road:
    there ground is 2, vegetation 5, all else 1, and the extra dimension ``road_class`` has the numbers of LAS 1.4. The
    format itself is not changed: that would round scan angles and replace the CRS of most files.
    """
    header = read_las_header(path)
    is_wide = header.point_format >= _WIDE_CLASSES
    columns = [LINE_COLUMN] if is_wide else [LINE_COLUMN, CLASS_COLUMN]
    laszip = _laszip_of(path, header, sum(column.n_bytes for column in columns))
    names = dict(ASPRS_CLASSES.values()) if is_wide else {}
    vlr = None if laszip is None else laszip.record_data()
    counts, n_kept = np.zeros(len(PointClass), dtype=np.int64), 0
    with open_input(path) as file, target.open("w+b") as out:
        head, waveforms = copy_head(path, file, header, columns, names, vlr)
        out.write(head.before)
        write, finish = _writer(out, laszip)
        layers = [lazrs.SELECTIVE_DECOMPRESS_ALL]
        source = RecordSource(path, file, header, layers, is_sequential=False)  # type: ignore[arg-type]
        with (
            ThreadPoolExecutor(max_workers=1, thread_name_prefix="decode") as decoding,
            ThreadPoolExecutor(max_workers=1, thread_name_prefix="encode") as encoding,
        ):
            starts = range(0, header.n_points, _BATCH_POINTS)

            def read(start: int) -> AnyArray:
                n = min(_BATCH_POINTS, header.n_points - start)
                return source.read(np.empty(n * header.record_bytes, dtype=np.uint8), start)

            ahead = decoding.submit(read, 0) if len(starts) else None
            written: Future[None] | None = None
            for i, start in enumerate(starts):
                assert ahead is not None
                raw = ahead.result().reshape(-1, header.record_bytes)
                ahead = decoding.submit(read, starts[i + 1]) if i + 1 < len(starts) else None
                classes, line, kept = _classified(raw, header, factors, classify, gains)
                counts += np.bincount(classes[~kept], minlength=len(PointClass))
                n_kept += int(np.count_nonzero(kept))
                copied = _copied(raw, header, classes, line, kept)
                if written is not None:
                    written.result()
                written = encoding.submit(_written, write, copied, target)
                advance(start + len(raw))
            if written is not None:
                written.result()
        _finish(finish, target)
        end = out.seek(0, 2)
        out.write(head.behind)
        out.seek(0)
        out.write(head.finished(end, waveforms))
    found = {kind: int(counts[kind]) for kind in PointClass}
    return CopiedFile(found, n_kept, head.left_out)


def _laszip_of(path: Path, header: LasHeader, n_more: int) -> Any:
    """Return the compressor's settings for a copy, None where it is not compressed."""
    if header.laz is None:
        return None
    if header.point_format in _WITH_WAVEFORMS:
        raise InputError(
            f"point format {header.point_format} has waveforms, which cannot be compressed again", where=path,
            advice="convert it to a plain LAS file, or leave it out",
        )  # fmt: skip
    from linework.files.las.header import RECORD_BYTES

    n_extra = header.record_bytes - RECORD_BYTES[header.point_format] + n_more
    return lazrs.LazVlr.new_for_compression(header.point_format, n_extra)


def _writer(out: BinaryIO, laszip: Any) -> tuple[Callable[[AnyArray], object], Callable[[], object]]:
    """Return what writes records, and what is called after the last."""
    if laszip is None:
        return lambda records: out.write(records.data), lambda: None
    compressor = lazrs.ParLasZipCompressor(out, laszip)
    compressor.reserve_offset_to_chunk_table()
    return compressor.compress_many, compressor.done


def _written(write: Callable[[AnyArray], object], records: AnyArray, target: Path) -> None:
    try:
        write(records.reshape(-1))
    except lazrs.LazrsError as error:  # the compressor hides the system's message
        raise MachineError(
            f"cannot be written: {error}", where=target, advice="check for free space"
        ) from error


def _finish(finish: Callable[[], object], target: Path) -> None:
    try:
        finish()
    except lazrs.LazrsError as error:
        raise MachineError(
            f"cannot be written: {error}", where=target, advice="check for free space"
        ) from error


def _classified(
    raw: AnyArray,
    header: LasHeader,
    factors: tuple[float, float],
    classify: ClassifyBatch,
    gains: LaserGains | None,
) -> tuple[AnyArray, AnyArray, BoolArray]:
    """Return class and line of records, and which of them keep the class they have."""
    xyz = np.empty((len(raw), 3))
    horizontal, vertical = factors
    for axis, factor in enumerate((horizontal, horizontal, vertical)):
        column = xyz[:, axis]
        np.multiply(_field(raw, 4 * axis, "<i4"), header.scales[axis], out=column)
        column += header.offsets[axis]
        if factor != 1.0:
            column *= factor
    intensity = _field(raw, 12, "<u2").astype(np.float32)
    if gains is not None and gains.column in header.columns:
        of_laser, laser = header.columns[gains.column], np.empty(len(raw), dtype=np.float32)
        of_laser.values(_field(raw, of_laser.offset, of_laser.dtype), laser)
        intensity = gains.evened(intensity, laser)
    classes, line = classify(xyz, intensity)
    if header.point_format >= _WIDE_CLASSES:
        kept = np.isin(raw[:, 16], _NOISE) | (raw[:, 15] & 4 != 0)
    else:
        kept = (raw[:, 15] & 31 == _NOISE[0]) | (raw[:, 15] & 128 != 0)
    return classes, line, kept


def _copied(raw: AnyArray, header: LasHeader, classes: AnyArray, line: AnyArray, kept: BoolArray) -> AnyArray:
    """Return the records of the copy, (n, bytes) uint8."""
    is_wide, old = header.point_format >= _WIDE_CLASSES, header.record_bytes
    out = np.empty((len(raw), old + LINE_COLUMN.n_bytes + (0 if is_wide else 1)), dtype=np.uint8)
    out[:, :old] = raw
    wide = asprs_numbers(_WIDE_CLASSES)[classes]
    if is_wide:
        out[:, 16] = np.where(kept, raw[:, 16], wide)
    else:
        flags = raw[:, 15] & _FLAG_BITS
        out[:, 15] = np.where(kept, raw[:, 15], flags | asprs_numbers(header.point_format)[classes])
        out[:, -1] = np.where(kept, raw[:, 15] & ~np.uint8(_FLAG_BITS), wide)
    numbers = np.where(kept, 0, line).astype("<u4")
    out[:, old : old + LINE_COLUMN.n_bytes] = numbers.view(np.uint8).reshape(-1, LINE_COLUMN.n_bytes)
    return out


def _field(raw: AnyArray, first: int, dtype: str) -> AnyArray:
    """Return a field of records (n, bytes) as numbers (n,)."""
    size = np.dtype(dtype).itemsize
    return np.ascontiguousarray(raw[:, first : first + size]).view(dtype).reshape(-1)


def check_copy(path: Path, n_points: int) -> None:
    """Raise if a copy does not read back: header, records, and the chunks of its points.

    Raises
    ------
    MachineError
        It has another number of points, or a chunk table that is not that of its chunks.
    """
    header = read_las_header(path)
    if header.n_points != n_points or (header.laz is not None and n_points and not header.laz.is_sound):
        raise MachineError("the copy does not read back", where=path, advice="check the disk")
