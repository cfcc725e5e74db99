"""Read the points of any area from the tile store."""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from linework.arrays import AnyArray, IntArray
from linework.errors import MachineError
from linework.files.documents import read_json
from linework.files.store.folder import STORE_ADVICE, Output, PointBuffers, Scratch, StoreFiles
from linework.files.store.layout import (
    BLOCK_STEPS,
    BLOCK_UP_STEPS,
    CELLS_PER_BLOCK,
    HEIGHT_BUCKET_STEPS,
    INDEX_FILE,
    RUNS_FILE,
    STORE_CELL_M,
    STORE_STEPS_PER_M,
    STORE_VERSION,
    Limits,
    RunTable,
    facts_crc32,
    first_step,
)
from linework.model.grid import Bounds, Image
from linework.model.points import Points


class PointStore:
    """The points of a survey on disk; any area can be read in milliseconds. Made by `PointStore.open`.

    Parameters
    ----------
    folder
        Folder of the store.
    facts
        Facts about its points (see `linework.files.store.facts`).
    limits
        Points outside are left out as strays; None: none are.
    table
        The runs with points within the limits, in the order of their blocks.
    """

    def __init__(
        self, folder: Path, facts: Mapping[str, Any], limits: Limits | None, table: RunTable
    ) -> None:
        self.folder = folder
        self.facts = facts
        self.limits = limits
        self._rows = table.rows
        self._extents = _world_extents(table.rows)
        #: Names of the further columns
        self.columns: tuple[str, ...] = tuple(facts.get("columns", ()))
        #: False where any file has no times
        self.has_time = bool(table.rows["has_time"].all() and facts.get("has_time", True))

    @classmethod
    def open(cls, folder: Path) -> PointStore:
        """Open a store; only its index is read.

        Raises
        ------
        MachineError
            The index is missing, damaged, or of another version.
        """
        index, runs = folder / INDEX_FILE, folder / RUNS_FILE
        document = _read_index(index)
        try:
            data = runs.read_bytes()
        except OSError as error:
            raise _unreadable(runs, error.strerror or "missing") from error
        if zlib.crc32(data) != document["runs_crc32"]:
            raise _unreadable(runs, "not what was written (damaged)")
        table = RunTable.from_bytes(data)
        limits = None if document["limits"] is None else Limits(**document["limits"])
        return cls(folder, document["facts"], limits, RunTable(table.rows[table.rows["kept"] > 0]))

    @property
    def n_points(self) -> int:
        """Number of points within the limits."""
        return int(self._rows["kept"].sum())

    @property
    def bounds(self) -> Bounds:
        """Extent in plan of the points within the limits, closed; ValueError when there are none."""
        if not len(self._rows):
            raise ValueError("no points: no extent")
        west, south, east, north = self._extents
        edges = west.min(), south.min(), east.max(), north.max()
        return Bounds(*(int(edge) / STORE_STEPS_PER_M for edge in edges))

    @property
    def block_counts(self) -> tuple[IntArray, IntArray]:
        """(n, 2) int64 numbers (east, north) of the blocks with points, and (n,) int64 points in each.

        Row-major from the south-west; points of all heights are counted together.
        """
        r = self._rows
        plan = np.stack([r["north"], r["east"]], axis=1)
        blocks, index = np.unique(plan, axis=0, return_inverse=True)
        counts = np.zeros(len(blocks), np.int64)
        np.add.at(counts, index.ravel(), r["kept"])
        return np.ascontiguousarray(blocks[:, ::-1].astype(np.int64)), counts

    def count_in(self, bounds: Bounds) -> int:
        """Return an upper bound of the number of points within `bounds`: runs are counted whole."""
        return int(self._rows["kept"][self._touched(_Window.of(bounds))].sum())

    def points(
        self,
        bounds: Bounds | None = None,
        *,
        lowest: Image | None = None,
        above_m: float = 0.0,
        ordered: bool = True,
        with_time: bool = True,
        with_intensity: bool = True,
        with_columns: bool = True,
    ) -> Points:
        """Return the points of an area.

        Parameters
        ----------
        bounds
            Half open; None: all points.
        lowest
            Heights below which points of a cell are left out; NaN, and outside the image: no limit. North-up, its
            cells whole multiples of 0.5 m on their lattice.
        above_m
            Added to `lowest`, which saves making another image.
        ordered
            Whether in canonical order: blocks of 64 m row-major from the south-west, lower blocks first, in each
            block by key (see `linework.files.store.layout`), then by time, intensity and further columns. Else as
            stored.
        with_time, with_intensity, with_columns
            Whether to return times, intensities and further columns, where the store has them.

        Raises
        ------
        MachineError
            A file of the store is missing, cut off or damaged.
        ValueError
            `lowest` is not on such a lattice.

        Notes
        -----
        The result depends neither on the order in which points were written nor on the files and batches they came
        in. Times are returned only where all files have them; times and intensities only where the facts
        `has_time` and `has_intensity` are true. The points are in the CRS that the facts name.
        """
        window = _Window.of(bounds)
        rows = self._rows[self._touched(window)]
        floors = None if lowest is None else Floors(lowest, above_m)
        with_intensity = with_intensity and bool(self.facts.get("has_intensity", True))
        names = self.columns if with_columns else ()
        out = Output(int(rows["kept"].sum()), self.has_time and with_time, with_intensity, names)
        blocks = list(_blocks(rows))
        columns = PointBuffers(max((int(block["count"].sum()) for block in blocks), default=0), len(names))
        scratch = Scratch(len(columns.keys) if ordered else 0)
        with StoreFiles(self.folder) as files:
            for block in blocks:
                n = files.read(block, columns)
                corner = _corner(block)
                box = window.within(corner, self.limits)
                if floors is not None or not _all_inside(block, box):
                    table = Floors.NONE if floors is None else floors.of_block(block[0])
                    n = columns.keep_inside(n, box, table)
                out.add(columns, n, scratch.sorted(columns, n) if ordered else None, corner)
        return out.points(str(self.facts.get("crs", "local")))

    def _touched(self, window: _Window) -> AnyArray:
        west, south, east, north = self._extents
        return (west < window.east) & (east >= window.west) & (south < window.north) & (north >= window.south)


@dataclass(frozen=True, slots=True)
class _Window:
    """A rectangle in plan in steps, half open."""

    west: int
    south: int
    east: int
    north: int

    @classmethod
    def of(cls, bounds: Bounds | None) -> _Window:
        edges = (-np.inf, -np.inf, np.inf, np.inf) if bounds is None else bounds
        return cls(*(first_step(edge) for edge in edges))

    def within(self, corner: IntArray, limits: Limits | None) -> IntArray:
        """Return west, east, south, north, low, high from a block's corner, as kernels take them."""
        low, high = 0, BLOCK_UP_STEPS
        if limits is not None:
            low = limits.low * HEIGHT_BUCKET_STEPS - int(corner[2])
            high = limits.high * HEIGHT_BUCKET_STEPS - int(corner[2])
        east, north = int(corner[0]), int(corner[1])
        return np.array(
            [self.west - east, self.east - east, self.south - north, self.north - north, low, high]
        )


def _blocks(rows: AnyArray) -> Iterator[AnyArray]:
    """Yield the runs of one block after the other."""
    if len(rows):
        new = np.zeros(len(rows), np.bool_)
        for name in ("east", "north", "up"):
            new[1:] |= rows[name][1:] != rows[name][:-1]
        yield from np.split(rows, np.flatnonzero(new))


def _corner(block: AnyArray) -> IntArray:
    """Return a block's corner in steps."""
    numbers = np.array([block["east"][0], block["north"][0], block["up"][0]], np.int64)
    corner: IntArray = numbers * np.array([BLOCK_STEPS, BLOCK_STEPS, BLOCK_UP_STEPS])
    return corner


def _all_inside(block: AnyArray, box: IntArray) -> bool:
    """Return whether all points of a block's runs lie in the box, so that none needs to be tested."""
    return bool(
        block["west"].min() >= box[0]
        and block["east_most"].max() < box[1]
        and block["south"].min() >= box[2]
        and block["north_most"].max() < box[3]
        and np.array_equal(block["kept"], block["count"])
    )


def _world_extents(rows: AnyArray) -> tuple[IntArray, IntArray, IntArray, IntArray]:
    """Return west, south, east, north of the runs, closed, in steps."""
    east, north = (rows[name].astype(np.int64) * BLOCK_STEPS for name in ("east", "north"))
    return (
        east + rows["west"],
        north + rows["south"],
        east + rows["east_most"],
        north + rows["north_most"],
    )


def _read_index(path: Path) -> dict[str, Any]:
    try:
        document: Any = read_json(path.read_text(encoding="utf-8"), path)
    except OSError as error:
        raise _unreadable(path, error.strerror or "missing") from error
    except ValueError as error:
        raise _unreadable(path, "not what was written (damaged)") from error
    if not isinstance(document, dict) or "version" not in document:
        raise _unreadable(path, "not what was written (damaged)")
    if document["version"] != STORE_VERSION:
        raise _unreadable(path, f"store of version {document['version']}, expected {STORE_VERSION}")
    if document.get("crc32") != facts_crc32(document):
        raise _unreadable(path, "not what was written (damaged)")
    return document


def _unreadable(path: Path, problem: str) -> MachineError:
    return MachineError(problem, where=path, advice=STORE_ADVICE)


class Floors:
    """Cuts an image of heights into tables that `linework.kernels.store.order.keep_inside` takes.

    Parameters
    ----------
    image
        (rows, cols) heights [m, world], NaN: no limit. North-up, its cells whole multiples of 0.5 m on their
        lattice, so that each cell of the store lies in one cell of the image.
    above_m
        Added to the heights.

    Raises
    ------
    ValueError
        The image is not on such a lattice.
    """

    #: No limits at all.
    NONE: ClassVar[AnyArray] = np.empty(0, np.int32)

    def __init__(self, image: Image, above_m: float = 0.0) -> None:
        grid = image.grid
        per_col, per_row = grid.cell_width_m / STORE_CELL_M, grid.cell_height_m / STORE_CELL_M
        first_col, top_row = grid.east_m / grid.cell_width_m, grid.north_m / grid.cell_height_m
        # 1e-6 of a cell: the rounding of k * cell and back is 1e-8 of a cell at UTM northings
        apart = [abs(v - round(v)) for v in (per_col, per_row, first_col, top_row)]
        if grid.rotation_deg != 0.0 or max(apart) > 1e-6 or min(per_col, per_row) < 0.5:
            raise ValueError(f"lowest: {grid} is not north-up on a lattice of multiples of {STORE_CELL_M} m")
        self._values, self._above_m = image.values, above_m
        self._per_col, self._per_row = round(per_col), round(per_row)
        self._first_col, self._top_row = round(first_col), round(top_row)

    def of_block(self, row: Any) -> AnyArray:
        """Return the (129 * 128,) int32 lowest steps above the corner of the block of a run.

        Cells of images are open to the south: row k of the table holds positions above the k-th line of
        cells of the block, up to and with the next.
        """
        cols = int(row["east"]) * CELLS_PER_BLOCK + np.arange(CELLS_PER_BLOCK)
        cols = cols // self._per_col - self._first_col
        # ceil(northing / cell) is k lines up the block; negated floor division is ceiling
        lines = int(row["north"]) * CELLS_PER_BLOCK + np.arange(CELLS_PER_BLOCK + 1)
        rows = self._top_row + (-lines // self._per_row)
        n_rows, n_cols = self._values.shape
        known = ((rows >= 0) & (rows < n_rows))[:, None] & ((cols >= 0) & (cols < n_cols))
        if not known.any():
            return np.full(known.size, -1, np.int32)
        values = self._values[np.clip(rows, 0, n_rows - 1)[:, None], np.clip(cols, 0, n_cols - 1)]
        heights = np.where(known, values, np.nan).astype(np.float64) + self._above_m
        steps = _first_steps(heights) - float(int(row["up"]) * BLOCK_UP_STEPS)
        # A limit above the highest possible step excludes the whole cell
        limits = np.clip(np.nan_to_num(steps, nan=-1.0), -1, BLOCK_UP_STEPS)
        return limits.astype(np.int32).ravel()


def _first_steps(heights: AnyArray) -> AnyArray:
    """Return the lowest steps whose coordinates are not below the heights (see `linework.files.store.layout.first_step`)."""
    steps = np.ceil(heights * STORE_STEPS_PER_M)
    steps = np.where((steps - 1) / STORE_STEPS_PER_M >= heights, steps - 1, steps)
    first: AnyArray = np.where(steps / STORE_STEPS_PER_M < heights, steps + 1, steps)
    return first
