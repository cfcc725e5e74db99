"""Which points of a tile store lie within its limits: counted once, when the index is written."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from linework.files.store_columns import Columns
from linework.files.store_files import StoreFiles
from linework.files.store_layout import (
    BLOCK_STEPS,
    BLOCK_UP_STEPS,
    EXTENT_COLUMNS,
    HEIGHT_BUCKET_STEPS,
    Limits,
    RunTable,
)
from linework.kernels.store import extent_of
from linework.kernels.store_order import keep_inside


def kept_within(folder: Path, table: RunTable, limits: Limits) -> RunTable:
    """Return the runs with `kept`, and their extents, as the limits leave them.

    Only runs that reach beyond the limits in height, and not with all of their points, are read.

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
            columns = Columns(int(rows["count"][i]))
            files.read(rows[i : i + 1], columns)
            box = np.array([0, BLOCK_STEPS, 0, BLOCK_STEPS, low[i], high[i]], np.int64)
            n = keep_inside(columns.keys, columns.times, columns.intensities, box, no_floors)
            rows["kept"][i] = n
            if n:
                for name, value in zip(EXTENT_COLUMNS, extent_of(columns.keys[:n]), strict=True):
                    rows[name][i] = value
    return RunTable(rows)
