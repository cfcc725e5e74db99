"""Write the tile store: points as runs of blocks, batch by batch, then the index."""

from __future__ import annotations

import contextlib
import json
import os
import zlib
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from linework.arrays import AnyArray, FloatArray, checked
from linework.errors import MachineError
from linework.files.handles import create_for_writing
from linework.files.output.publish import machine_errors
from linework.files.output.replace import make_durable, replace_file
from linework.files.store.folder import PointBuffers, StoreFiles
from linework.files.store.layout import (
    BLOCK_STEPS,
    BLOCK_UP_STEPS,
    EXTENT_COLUMNS,
    HEIGHT_BUCKET_STEPS,
    INDEX_FILE,
    RUN_DTYPE,
    RUNS_FILE,
    STORE_VERSION,
    Limits,
    RunTable,
    facts_crc32,
    words_of_run,
)
from linework.kernels.store import pack as kernels
from linework.kernels.store.columns import checksums_of_columns, scatter_columns
from linework.kernels.store.pack import extent_of

#: Buckets of heights on either side of 0: coordinates lie within 1e8 m.
_MIDDLE_BUCKET = 2**21
#: No further columns.
_NONE = np.empty((0, 0), np.float32)
#: Points packed at a time: larger batches are split, so that a run can be read in one go.
_MOST_AT_ONCE = 2**22


class StoreWriter:
    """Writes the points of one input file, batch by batch, to `<folder>/<number>.points`.

    Parameters
    ----------
    path
        File to create; its stem is the input file's number. It must not exist.

    Raises
    ------
    MachineError
        The file exists, or cannot be created.

    Notes
    -----
    A batch of 500,000 points takes 18 to 25 ns per point. A run holds the points of a batch in one block, so larger
    batches, and points that are near each other in the file, give fewer and longer runs.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._number = int(path.stem)
        with machine_errors(path):
            self._file = create_for_writing(path)
        self._offset = 0
        self._tables: list[RunTable] = []
        self._has_time: bool | None = None
        self._n_further: int | None = None
        # Costs little memory: only the pages that are written to are allocated
        self._heights = np.zeros(2 * _MIDDLE_BUCKET, np.int64)
        self._low, self._high = 2 * _MIDDLE_BUCKET, -1
        self._keys, self._owners = np.empty(0, np.uint64), np.empty(0, np.int32)
        self._words = np.empty(0, np.uint64)

    @property
    def height_counts(self) -> dict[int, int]:
        """Number of points in each height bucket of 64 m, by bucket number floor(z / 64)."""
        counts = self._heights[self._low : self._high + 1]
        return {int(i) + self._low - _MIDDLE_BUCKET: int(counts[i]) for i in np.flatnonzero(counts)}

    def append(
        self, xyz: FloatArray, intensity: AnyArray, time_s: FloatArray | None, columns: AnyArray = _NONE
    ) -> None:
        """Write a batch of points.

        Parameters
        ----------
        xyz
            (n, 3) float64 [m, world], finite and within 1e8 m.
        intensity
            (n,) uint16.
        time_s
            (n,) float64 [s], or None for all batches of the file.
        columns
            (k, n) float32: the store's further columns in the order of their names, in all batches.

        Raises
        ------
        ValueError
            A coordinate is not finite or is beyond 1e8 m, columns are of different lengths or types, or only some
            batches have times or further columns.
        MachineError
            The disk is full or has failed.
        """
        n = len(xyz)
        xyz = checked("xyz", xyz, np.float64, (n, 3))
        intensity = checked("intensity", intensity, np.uint16, (n,))
        time = checked("time_s", time_s, np.float64, (n,)) if time_s is not None else np.empty(0)
        if self._has_time not in (None, time_s is not None):
            raise ValueError("time_s: None for some batches of a file and given for others")
        self._has_time = time_s is not None
        if self._n_further not in (None, len(columns)):
            raise ValueError(f"columns: {len(columns)}, and {self._n_further} in other batches of the file")
        self._n_further = len(columns)
        columns = checked("columns", columns, np.float32, (None, n)) if len(columns) else columns
        for start in range(0, n, _MOST_AT_ONCE):
            part = slice(start, start + _MOST_AT_ONCE)
            self._append(xyz[part], intensity[part], time[part], columns[:, part])

    def close(self) -> RunTable:
        """Make the file durable and return its runs.

        Raises
        ------
        MachineError
            The disk is full or has failed.
        """
        with machine_errors(self._path):
            self._close()
        make_durable(self._path)
        return RunTable.concatenate(*self._tables)

    def abort(self) -> None:
        """Close the file and remove it."""
        with contextlib.suppress(OSError):
            self._close()
        with contextlib.suppress(OSError):
            self._path.unlink()

    def _close(self) -> None:
        file, self._file = self._file, -1
        if file >= 0:
            os.close(file)

    def _append(self, xyz: AnyArray, intensity: AnyArray, time: AnyArray, columns: AnyArray) -> None:
        keys, owners, codes, counts = self._packed(xyz)
        # Runs in the order of their blocks: neighbours lie side by side on disk
        order = np.argsort(codes)
        codes, counts = codes[order], counts[order]
        n_times = counts if len(time) else np.zeros_like(counts)
        before = words_of_run(counts, len(time) > 0)
        sizes = before + -(-len(columns) * counts // 2)
        starts = np.cumsum(sizes) - sizes
        firsts = np.stack([starts, starts + counts, 4 * (starts + counts + n_times)], axis=1)
        words = self._room(int(sizes.sum()))
        words[starts + before - 1] = words[starts + sizes - 1] = 0
        by_owner = np.empty_like(firsts)
        by_owner[order] = firsts
        kernels.scatter_runs(keys, intensity, time, owners, by_owner, words)
        sums, extents = kernels.describe_runs(words, firsts, counts, len(time) > 0)
        rows = np.zeros(len(codes), RUN_DTYPE)
        rows["file"], rows["has_time"], rows["checksum"] = self._number, len(time) > 0, sums
        rows["east"], rows["north"], rows["up"] = kernels.blocks_of(codes).T
        rows["offset"], rows["count"], rows["kept"] = self._offset + 8 * starts, counts, counts
        if len(columns):
            rows["column_sum"] = self._scattered(columns, owners, order, starts + before, counts, words)
        for name, column in zip(EXTENT_COLUMNS, extents.T, strict=True):
            rows[name] = column
        self._write(words)
        self._tables.append(RunTable(rows))

    @staticmethod
    def _scattered(
        columns: AnyArray,
        owners: AnyArray,
        order: AnyArray,
        starts: AnyArray,
        counts: AnyArray,
        words: AnyArray,
    ) -> AnyArray:
        """Write further columns to the runs, and return the checksum of each run's."""
        by_owner = np.empty((2, len(order)), np.int64)
        by_owner[:, order] = 2 * starts, counts
        halves = words.view(np.uint32)
        scatter_columns(columns.view(np.uint32), owners, by_owner[0], by_owner[1], halves)
        sums = np.empty(len(counts), np.uint64)
        for i, (start, n) in enumerate(zip(starts.tolist(), counts.tolist(), strict=True)):
            run = halves[2 * start : 2 * start + len(columns) * n]
            sums[i] = checksums_of_columns(run.reshape(len(columns), n), np.array([0, n]))[0]
        return sums

    def _packed(self, xyz: AnyArray) -> tuple[AnyArray, AnyArray, AnyArray, AnyArray]:
        """Return the key and block number of each point, and the codes and point counts of the blocks."""
        n = len(xyz)
        if len(self._keys) < n:
            self._keys, self._owners = np.empty(n, np.uint64), np.empty(n, np.int32)
        keys, owners = self._keys[:n], self._owners[:n]
        is_sound, codes, counts, low, high = kernels.pack_points(
            xyz, keys, owners, self._heights, _MIDDLE_BUCKET
        )
        if not is_sound:
            raise ValueError("xyz: a coordinate is not finite, or beyond 1e8 m")
        self._low, self._high = min(self._low, low), max(self._high, high)
        return keys, owners, codes, counts

    def _room(self, n_words: int) -> AnyArray:
        if len(self._words) < n_words:
            self._words = np.empty(n_words, np.uint64)
        return self._words[:n_words]

    def _write(self, words: AnyArray) -> None:
        rest = words.view(np.uint8).data
        with machine_errors(self._path):
            while rest:
                n = os.write(self._file, rest)
                self._offset += n
                rest = rest[n:]


def write_index(
    folder: Path, table: RunTable, facts: Mapping[str, Any], limits: Limits | None = None
) -> None:
    """Write the table of runs and, last, `store.json`; both durable when this returns.

    Parameters
    ----------
    facts
        Facts about the points, as JSON values.
    limits
        Points outside these are left out when the store is read; None: no limits.

    Raises
    ------
    MachineError
        The folder already holds an index, the disk is full or has failed, or the store's files do not match the table.
    """
    if (folder / INDEX_FILE).exists():
        raise MachineError(
            "index already exists", where=folder / INDEX_FILE, advice="write to an empty folder"
        )
    if limits is not None:
        table = kept_within(folder, table, limits)
    runs = table.sorted().to_bytes()
    document = {
        "version": STORE_VERSION,
        "limits": None if limits is None else asdict(limits),
        "runs_crc32": zlib.crc32(runs),
        "facts": dict(facts),
    }
    document["crc32"] = facts_crc32(document)
    text = json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    replace_file(folder / RUNS_FILE, runs)
    replace_file(folder / INDEX_FILE, text.encode())


def kept_within(folder: Path, table: RunTable, limits: Limits) -> RunTable:
    """Return the runs with `kept` and their extents reduced to the limits.

    Only runs that are partly beyond the limits in height are read.

    Raises
    ------
    MachineError
        Such a run cannot be read back as it was written.
    """
    rows = table.rows.copy()
    up = rows["up"].astype(np.int64) * BLOCK_UP_STEPS
    low, high = limits.low * HEIGHT_BUCKET_STEPS - up, limits.high * HEIGHT_BUCKET_STEPS - up
    is_in_plan = (rows["east"] >= limits.west) & (rows["east"] < limits.east)
    is_in_plan &= (rows["north"] >= limits.south) & (rows["north"] < limits.north)
    is_out = ~is_in_plan | (rows["high"] < low) | (rows["low"] >= high)
    rows["kept"] = np.where(is_out, 0, rows["count"])
    reaches_out = ~is_out & ((rows["low"] < low) | (rows["high"] >= high))
    no_floors = np.empty(0, np.int32)
    with StoreFiles(folder) as files:
        for i in np.flatnonzero(reaches_out).tolist():
            columns = PointBuffers(int(rows["count"][i]))
            files.read(rows[i : i + 1], columns)
            box = np.array([0, BLOCK_STEPS, 0, BLOCK_STEPS, low[i], high[i]], np.int64)
            n = columns.keep_inside(len(columns.keys), box, no_floors)
            rows["kept"][i] = n
            if n:
                for name, value in zip(EXTENT_COLUMNS, extent_of(columns.keys[:n]), strict=True):
                    rows[name][i] = value
    return RunTable(rows)
