"""Layout of the tile store on disk: the lattice, the blocks, the packed key, the table of runs.

A coordinate x is the whole number of steps ``rint(x * 10000)`` (halves go to the even step) on one lattice for
the whole world. Steps are counted in blocks of 64 m x 64 m x 1677.7216 m; inside its block a point is one
64-bit key, from the highest bit:

    cell row (7) | cell column (7) | y in the cell (13) | x in the cell (13) | z in the block (24)

with cells of 0.5 m counted from the block's south-west corner. A run is the points of one block from one
batch, column after column: n keys (uint64), n times (float64, unless the file has none), n intensities
(uint16), padded with zeros to whole words of 8 bytes; then n values (float32) of each further column of the store,
in the order of their names, padded likewise. All are little-endian. `<number>.points` holds runs only; their
offsets are in the table of runs. This layout is not that of `linework.files.array_file`, because runs are read by the
thousand straight into one buffer, and an array header each would double the number of reads.
"""

from __future__ import annotations

import io
import json
import math
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from linework.arrays import AnyArray
from linework.model.points import FARTHEST_COORDINATE_M

#: Increased whenever files of an older version can no longer be read.
STORE_VERSION = 2
#: Steps per metre; a step of 0.1 mm is a tenth of what the best scanners resolve.
STORE_STEPS_PER_M = 10_000
STORE_STEP_M = 1e-4
#: Size of a block in plan and in height. [m]
STORE_BLOCK_M = 64.0
BLOCK_UP_M = 2**24 / STORE_STEPS_PER_M
BLOCK_STEPS, BLOCK_UP_STEPS = 640_000, 2**24
#: Heights are counted, and limited, in buckets of this size. [m]
HEIGHT_BUCKET_M = 64.0
HEIGHT_BUCKET_STEPS = 640_000
#: Cell of the key [m], and number of cells along a side of a block.
STORE_CELL_M, CELLS_PER_BLOCK = 0.5, 128

RUNS_FILE, INDEX_FILE, POINTS_SUFFIX = "runs.npy", "store.json", ".points"

#: One run. `west` to `high` are its closed extent in steps from the block's corner; `kept` counts the points
#: within the store's limits; `column_sum` is the checksum of the further columns, 0 without any.
RUN_DTYPE = np.dtype(
    [
        ("file", "<i4"), ("east", "<i4"), ("north", "<i4"), ("up", "<i4"),
        ("offset", "<i8"), ("count", "<i8"), ("kept", "<i8"), ("checksum", "<u8"),
        ("west", "<i4"), ("south", "<i4"), ("low", "<i4"),
        ("east_most", "<i4"), ("north_most", "<i4"), ("high", "<i4"),
        ("has_time", "?"), ("column_sum", "<u8"),
    ]
)  # fmt: skip
#: The columns of a run's extent, as `linework.kernels.store.pack.extent_of` returns it.
EXTENT_COLUMNS = ("west", "south", "low", "east_most", "north_most", "high")


def words_of_run(n_points: Any, has_time: Any) -> Any:
    """Return the words of 8 bytes before the further columns of runs: keys, times and intensities."""
    return n_points + n_points * has_time + -(-n_points // 4)


@dataclass(frozen=True, slots=True)
class RunTable:
    """Table of runs: where the points of each block are in the store's files.

    Parameters
    ----------
    rows
        (n,) structured array of `RUN_DTYPE`.
    """

    rows: AnyArray

    def __post_init__(self) -> None:
        if self.rows.dtype != RUN_DTYPE or self.rows.ndim != 1:
            raise ValueError(f"rows: {self.rows.dtype}, expected runs of the store")

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def n_points(self) -> int:
        """Number of points in all runs, including those outside the limits."""
        return int(self.rows["count"].sum())

    @classmethod
    def empty(cls) -> RunTable:
        """Return a table without runs."""
        return cls(np.zeros(0, RUN_DTYPE))

    @classmethod
    def concatenate(cls, *tables: RunTable) -> RunTable:
        """Return the runs of all tables."""
        return cls(np.concatenate([cls.empty().rows, *(table.rows for table in tables)]))

    def sorted(self) -> RunTable:
        """Return the runs block by block, row-major from the south-west, lower blocks first."""
        r = self.rows
        return RunTable(r[np.lexsort((r["offset"], r["file"], r["up"], r["east"], r["north"]))])

    def to_bytes(self) -> bytes:
        """Return the table as an .npy file."""
        buffer = io.BytesIO()
        np.save(buffer, self.rows, allow_pickle=False)
        return buffer.getvalue()

    @classmethod
    def from_bytes(cls, data: bytes) -> RunTable:
        """Return the table from the bytes of `to_bytes`; ValueError for anything else."""
        return cls(np.load(io.BytesIO(data), allow_pickle=False))


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Limits of a survey: points outside are left out as strays. Half open, in whole blocks and buckets.

    Parameters
    ----------
    west, south, east, north
        Numbers of blocks: from `west` up to but not `east`.
    low, high
        Numbers of buckets of `HEIGHT_BUCKET_M`.

    >>> Limits.around(west=500_010.0, south=0.0, low=-1.0, east=500_020.0, north=64.0, high=63.9)
    Limits(west=7812, south=0, east=7813, north=2, low=-1, high=1)
    """

    west: int
    south: int
    east: int
    north: int
    low: int
    high: int

    @classmethod
    def around(
        cls, *, west: float, south: float, low: float, east: float, north: float, high: float
    ) -> Limits:
        """Return the smallest limits that hold a closed box, its edges in metres."""
        return cls(
            west=math.floor(west / STORE_BLOCK_M),
            south=math.floor(south / STORE_BLOCK_M),
            east=math.floor(east / STORE_BLOCK_M) + 1,
            north=math.floor(north / STORE_BLOCK_M) + 1,
            low=math.floor(low / HEIGHT_BUCKET_M),
            high=math.floor(high / HEIGHT_BUCKET_M) + 1,
        )


def facts_crc32(document: Mapping[str, Any]) -> int:
    """Return the CRC-32 of the content of `store.json`, without the CRC itself."""
    # As it will be read back: JSON has neither tuples nor numeric keys
    content = json.loads(json.dumps({key: value for key, value in document.items() if key != "crc32"}))
    return zlib.crc32(json.dumps(content, sort_keys=True).encode())


def first_step(value_m: float) -> int:
    """Return the lowest step whose coordinate is not below `value_m`; the ends of the world for infinite ones.

    Together with the comparison of steps, which is exact, it answers as comparing coordinates would.

    >>> first_step(0.0001), first_step(np.nextafter(0.0001, 1.0)), first_step(-0.00015)
    (1, 2, -1)
    """
    if abs(value_m) > 2 * FARTHEST_COORDINATE_M:
        return int(math.copysign(2 * FARTHEST_COORDINATE_M * STORE_STEPS_PER_M, value_m))
    step = math.ceil(value_m * STORE_STEPS_PER_M)
    while (step - 1) / STORE_STEPS_PER_M >= value_m:
        step -= 1
    while step / STORE_STEPS_PER_M < value_m:
        step += 1
    return step
