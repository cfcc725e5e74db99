"""Read points of any place from the tile store."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from linework.errors import MachineError
from linework.files.store_layout import INDEX_FILE, POINTS_SUFFIX, RUNS_FILE, Limits, RunTable
from linework.imaging.raster import cells_of
from linework.model.arrays import IntArray
from linework.model.grid import Bounds, Image
from linework.model.points import Points

_ADVICE = "linework clean removes the store, the next run makes it anew"


class PointStore:
    def __init__(self, folder, facts, limits, table):
        self.folder = folder
        self.facts = facts
        self.limits = limits
        self._rows = table.rows

    @classmethod
    def open(cls, folder: Path) -> PointStore:
        document = json.loads((folder / INDEX_FILE).read_text())
        limits = None if document["limits"] is None else Limits(**document["limits"])
        table = RunTable.load(folder / RUNS_FILE)
        r = table.rows
        if limits is not None:
            table = RunTable(
                r[
                    (r["east"] >= limits.west)
                    & (r["east"] < limits.east)
                    & (r["north"] >= limits.south)
                    & (r["north"] < limits.north)
                ]
            )
        return cls(folder, document["facts"], limits, table)

    @property
    def n_points(self) -> int:
        return int(self._rows["kept"].sum())

    @property
    def bounds(self) -> Bounds:
        r = self._rows
        x, y = r["east"].astype(np.int64) * 640000, r["north"].astype(np.int64) * 640000
        return Bounds(
            float((x + r["west"]).min() / 10000),
            float((y + r["south"]).min() / 10000),
            float((x + r["east_most"]).max() / 10000),
            float((y + r["north_most"]).max() / 10000),
        )

    @property
    def block_counts(self) -> tuple[IntArray, IntArray]:
        r = self._rows
        blocks, index = np.unique(np.stack([r["north"], r["east"]], axis=1), axis=0, return_inverse=True)
        return blocks[:, ::-1].astype(np.int64), np.bincount(index.ravel(), r["kept"]).astype(np.int64)

    def _touched(self, bounds):
        r = self._rows
        if bounds is None:
            return r
        x, y = r["east"].astype(np.int64) * 640000, r["north"].astype(np.int64) * 640000
        return r[
            ((x + r["west"]) / 10000 < bounds.east)
            & ((x + r["east_most"]) / 10000 >= bounds.west)
            & ((y + r["south"]) / 10000 < bounds.north)
            & ((y + r["north_most"]) / 10000 >= bounds.south)
        ]

    def count_in(self, bounds: Bounds) -> int:
        return int(self._touched(bounds)["kept"].sum())

    def points(
        self,
        bounds: Bounds | None = None,
        *,
        lowest: Image | None = None,
        ordered: bool = True,
        with_time: bool = True,
        with_intensity: bool = True,
    ) -> Points:
        blocks, keys, times, ints = (
            [np.zeros((0, 3), np.int64)],
            [np.zeros(0, np.uint64)],
            [np.zeros(0)],
            [np.zeros(0, np.uint16)],
        )
        for row in self._touched(bounds):
            path = self.folder / f"{row['file']}{POINTS_SUFFIX}"
            n = int(row["count"])
            with path.open("rb") as file:
                file.seek(row["offset"])
                data = file.read(n * (18 if row["has_time"] else 10))
            if len(data) < n * (18 if row["has_time"] else 10):
                raise MachineError("shorter than its index says", where=path, advice=_ADVICE)
            keys.append(np.frombuffer(data, np.uint64, n))
            times.append(np.frombuffer(data, np.float64, n, 8 * n) if row["has_time"] else np.zeros(n))
            ints.append(np.frombuffer(data, np.uint16, n, len(data) - 2 * n))
            blocks.append(np.tile(np.array([row["east"], row["north"], row["up"]], np.int64), (n, 1)))
        b, k, t, v = np.concatenate(blocks), np.concatenate(keys), np.concatenate(times), np.concatenate(ints)
        i = k.astype(object) if False else k
        x = ((i >> np.uint64(50)) & np.uint64(127)) * np.uint64(5000) + (
            (i >> np.uint64(24)) & np.uint64(8191)
        )
        y = (i >> np.uint64(57)) * np.uint64(5000) + ((i >> np.uint64(37)) & np.uint64(8191))
        z = i & np.uint64(0xFFFFFF)
        steps = np.stack([x, y, z], axis=1).astype(np.int64) + b * np.array([640000, 640000, 2**24])
        xyz = steps / 10000.0
        keep = np.ones(len(xyz), bool)
        if bounds is not None:
            keep &= (xyz[:, 0] >= bounds.west) & (xyz[:, 0] < bounds.east)
            keep &= (xyz[:, 1] >= bounds.south) & (xyz[:, 1] < bounds.north)
        if self.limits is not None:
            keep &= (steps[:, 2] >= self.limits.low * 640000) & (steps[:, 2] < self.limits.high * 640000)
        if lowest is not None:
            cell = cells_of(Points(xyz), lowest.grid)
            limit = np.where(cell >= 0, lowest.values.ravel()[cell], np.nan)
            keep &= ~(xyz[:, 2] < limit)
        order = np.lexsort((v, t, k, b[:, 2], b[:, 0], b[:, 1]))
        order = order[keep[order]]
        has_time = with_time and bool(self._rows["has_time"].all())
        return Points(
            xyz[order],
            v[order].astype(np.float32) if with_intensity else None,
            t[order] if has_time else None,
        )
