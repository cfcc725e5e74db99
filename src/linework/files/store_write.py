"""Write the tile store: points to runs of blocks, batch by batch, and the index over them."""

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

from linework.files.publish import machine_errors
from linework.files.store_layout import (
    INDEX_FILE,
    RUN_DTYPE,
    RUNS_FILE,
    STORE_VERSION,
    Limits,
    RunTable,
)
from linework.kernels import store as kernels
from linework.model.arrays import AnyArray, FloatArray

#: Buckets of heights on either side of 0: coordinates lie within 1e8 m.
_MIDDLE_BUCKET = 2**21


class StoreWriter:
    """Writes the points of one input file, batch by batch, to `<folder>/<number>.points`.

    Parameters
    ----------
    path
        File to make; its name is the file's number. It must not exist.

    Raises
    ------
    MachineError
        The file exists, or cannot be made.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._number = int(path.stem)
        with machine_errors(path):
            self._file = os.open(
                path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0), 0o644
            )
        self._offset = 0
        self._tables: list[RunTable] = []
        self._has_time: bool | None = None
        # Only the pages that are counted in take memory
        self._heights = np.zeros(2 * _MIDDLE_BUCKET, np.int64)
        self._low, self._high = 2 * _MIDDLE_BUCKET, -1
        self._scratch = np.empty(0, np.uint64), np.empty((2, 0), np.int32), np.empty(0, np.uint64)

    @property
    def height_counts(self) -> dict[int, int]:
        """Points per bucket of 64 m of height, by the bucket's number floor(z / 64)."""
        counts = self._heights[self._low : self._high + 1]
        return {int(i) + self._low - _MIDDLE_BUCKET: int(counts[i]) for i in np.flatnonzero(counts)}

    def append(self, xyz: FloatArray, intensity: AnyArray, time_s: FloatArray | None) -> None:
        """Write a batch of points.

        Parameters
        ----------
        xyz
            (n, 3) float64 [m, world], finite and within 1e8 m.
        intensity
            (n,) uint16.
        time_s
            (n,) float64 [s], or None for all batches of the file.

        Raises
        ------
        ValueError
            A coordinate is not finite or too far, or only some batches have times.
        MachineError
            The disk is full, or failed.
        """
        n = len(xyz)
        has_time = time_s is not None
        if self._has_time not in (None, has_time):
            raise ValueError("time_s: None for some batches of a file and given for others")
        self._has_time = has_time
        if n == 0:
            return
        time = np.empty(0) if time_s is None else time_s
        if len(intensity) != n or (has_time and len(time) != n):
            raise ValueError(f"columns of {n}, {len(intensity)} and {len(time)} values")
        keys, (ends, owners), _ = self._room_for(n)
        n_stretches, n_blocks, codes, counts, low, high = kernels.pack_points(
            xyz, keys, ends, owners, self._heights, _MIDDLE_BUCKET
        )
        if n_stretches < 0:
            raise ValueError("xyz: a coordinate is not finite, or farther than 1e8 m")
        self._low, self._high = min(self._low, low), max(self._high, high)
        # Runs in the order of their blocks: neighbours lie side by side on disk
        order = np.argsort(codes)
        counts = counts[order]
        sizes = (10 if not has_time else 18) * counts
        starts = np.concatenate([[0], np.cumsum(-(-sizes // 8))])
        firsts = np.empty((n_blocks, 3), np.int64)
        firsts[:, 0] = starts[:-1]
        firsts[:, 1] = firsts[:, 0] + counts
        firsts[:, 2] = 4 * (firsts[:, 1] + (counts if has_time else 0))
        words = self._room_for_words(int(starts[-1]))
        words[starts[1:] - 1] = 0
        fill = np.empty_like(firsts)
        fill[order] = firsts
        kernels.scatter_runs(keys[:n], intensity, time, ends[:n_stretches], owners[:n_stretches], fill, words)
        rows = np.zeros(n_blocks, RUN_DTYPE)
        extents = np.empty((n_blocks, 6), np.int64)
        sums = np.empty(n_blocks, np.uint64)
        kernels.describe_runs(words, firsts, counts, has_time, sums, extents)
        blocks = kernels.blocks_of(codes[order])
        rows["file"], rows["has_time"], rows["checksum"] = self._number, has_time, sums
        rows["east"], rows["north"], rows["up"] = blocks.T
        rows["offset"], rows["count"], rows["kept"] = self._offset + 8 * starts[:-1], counts, counts
        for i, name in enumerate(("west", "south", "low", "east_most", "north_most", "high")):
            rows[name] = extents[:, i]
        self._write(words)
        self._tables.append(RunTable(rows))

    def close(self) -> RunTable:
        """Make the file durable and return its runs.

        Raises
        ------
        MachineError
            The disk is full, or failed.
        """
        with machine_errors(self._path):
            try:
                os.fsync(self._file)
            finally:
                os.close(self._file)
        return RunTable.concatenate(*self._tables)

    def abort(self) -> None:
        """Close the file and remove it."""
        with contextlib.suppress(OSError):
            os.close(self._file)
        with contextlib.suppress(OSError):
            self._path.unlink()

    def _room_for(self, n: int) -> tuple[AnyArray, AnyArray, AnyArray]:
        keys, stretches, words = self._scratch
        if len(keys) < n:
            keys, stretches = np.empty(n, np.uint64), np.empty((2, n), np.int32)
            self._scratch = keys, stretches, words
        return self._scratch

    def _room_for_words(self, n: int) -> AnyArray:
        keys, stretches, words = self._scratch
        if len(words) < n:
            words = np.empty(n, np.uint64)
            self._scratch = keys, stretches, words
        return words[:n]

    def _write(self, words: AnyArray) -> None:
        rest = memoryview(words).cast("B")
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
        What else is to be known of the store; JSON.
    limits
        Points outside are left out when the store is read; None: none are.

    Raises
    ------
    MachineError
        The disk is full, or failed; or the store's files do not hold what the table says.
    """
    runs = table.sorted().to_bytes()
    document = {
        "version": STORE_VERSION,
        "limits": None if limits is None else asdict(limits),
        "runs_crc32": zlib.crc32(runs),
        "facts": dict(facts),
    }
    text = json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    _write_durably(folder / RUNS_FILE, runs)
    _write_durably(folder / INDEX_FILE, text.encode())


def _write_durably(path: Path, data: bytes) -> None:
    with machine_errors(path), path.open("xb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())
