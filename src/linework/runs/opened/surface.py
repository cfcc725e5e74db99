"""Road and ground of a whole survey, whatever its size: global passes over tiles of cells, kept on disk.

How far a road reaches, and which of the smooth regions it is, is decided for the survey as a whole: regions are
found in every tile, united across the edges of tiles, and chosen together. So the surface does not depend on how
the survey is split.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from linework.arrays import AnyArray, BoolArray, FloatArray, IntArray
from linework.files.array_file import ARRAY_SUFFIX
from linework.files.output.parts import write_part
from linework.files.store.cell_tiles import (
    SurfaceTiles,
    TileNumber,
    clear_surface,
    read_surface_record,
    write_surface_record,
)
from linework.files.store.read import PointStore
from linework.methods.protocol import Sight, sight_of
from linework.model.grid import Bounds
from linework.model.ground import Ground
from linework.model.trajectory import Trajectory
from linework.processes.executors import Executor, Serial
from linework.processes.own_code import sent_code
from linework.runs.extraction import Failure
from linework.runs.opened import surface_passes as passes
from linework.runs.opened.own_ground import OwnGroundTask, find_own_ground
from linework.runs.opened.surface_cost import check_surface_cost, surface_cost, tiles_with_points
from linework.runs.own import GroundFinder, error_of_fault
from linework.runs.steps import Advance
from linework.surface.aside import RoadAside
from linework.surface.bare_earth import block_sizes
from linework.surface.carry import CoarseGround, halo_cells
from linework.surface.cells import SURFACE_BLOCK_M, CellWindow, path_samples
from linework.surface.choose import Choice, RegionLink
from linework.surface.config import RoadConfig
from linework.surface.heights import SpreadsUnder, UnevenLimits, height_origin, rough_limit_m
from linework.surface.regions import Islands, links_east, links_south
from linework.surface.strays import LoneCells

#: Version of the arrays on disk: surfaces of another version are made again.
_VERSION = 8
#: Side of the pieces in which `SurveySight` reads the surface [m], and the number of pieces it keeps: 2 km of road.
SIGHT_PIECE_M, N_PIECES = 256.0, 32


class SurfaceTiling(NamedTuple):
    """The tiles that the cells are split into; the surface does not depend on them.

    Parameters
    ----------
    n_cells
        Size of a tile, in rows and columns.
    origin
        Cell numbers east and north at which a tile begins.
    """

    n_cells: int
    origin: tuple[int, int] = (0, 0)

    @classmethod
    def for_cells(cls, config: RoadConfig) -> SurfaceTiling:
        """Return the cheapest tiles.

        384 cells of 0.5 m are 3 x 3 blocks of the point store: smaller tiles have more edge to look beyond,
        larger ones more empty cells along a road. Smaller cells look beyond farther in cells; 1200 of them,
        with what is around, take 200 MB.
        """
        return cls(min(max(384, 2 * halo_cells(config)), 1200))


@dataclass(frozen=True, slots=True)
class SurveySurface:
    """Road and ground of a survey, on disk.

    Parameters
    ----------
    tiles
        Where the arrays are.
    cell_m, z0_m
        Size of the cells; local height origin.
    known
        Tiles that have arrays.
    failed
        Tiles without a surface because a pass failed, and why, in one line.
    aside
        How much is road, and how much smooth ground beside it is not.
    """

    tiles: SurfaceTiles
    cell_m: float
    z0_m: float
    known: frozenset[TileNumber]
    failed: Mapping[TileNumber, str]
    aside: RoadAside

    @classmethod
    def open(cls, folder: Path) -> SurveySurface:
        """Open a surface that `make_surface` has made; its arrays are read on demand.

        Raises
        ------
        FileNotFoundError
            There is no surface in the folder.
        """
        record = read_surface_record(folder)
        if record is None or record.get("version") != _VERSION:
            raise FileNotFoundError(f"no surface in {folder}")
        return cls._from(folder, record)

    @classmethod
    def _from(cls, folder: Path, record: Mapping[str, Any]) -> SurveySurface:
        east, north = record["origin"]
        return cls(
            SurfaceTiles(folder, record["n_cells"], (east, north)),
            record["cell_m"],
            record["z0_m"],
            frozenset((e, n) for e, n in record["tiles"]),
            {(e, n): problem for e, n, problem in record["failed"]},
            RoadAside(*record["aside"]),
        )

    @property
    def failures(self) -> tuple[tuple[str, str], ...]:
        """Name of each tile that has no surface, and the problem in one line."""
        return tuple((f"surface e{e}n{n}", problem) for (e, n), problem in sorted(self.failed.items()))

    def over(self, bounds: Bounds) -> Ground:
        """Return road and ground in a rectangle [m, world]: every cell that touches it, the same from any rectangle.

        Heights are NaN in failed tiles, and in a survey without any point.
        """
        window = CellWindow.over(bounds, self.cell_m)
        road_m = np.full(window.shape, np.nan, dtype=np.float32)
        ground_m, kind = road_m.copy(), np.zeros(window.shape, dtype=np.uint8)
        sigma = np.full(window.shape, passes.NOT_KNOWN, dtype=np.uint16)
        out: tuple[AnyArray, ...] = road_m, ground_m, kind, sigma
        coarse: CoarseGround | None = None
        for tile in self.tiles.touching(window):
            at = self.tiles.place(tile, window)
            if tile in self.known:
                for i, to in enumerate(out):
                    to[at] = self.tiles.part(passes.SURFACE, i, tile, window)
            elif tile not in self.failed:
                shared = self.tiles.window(tile).common(window)
                coarse = coarse or CoarseGround(*self.tiles.read_common(passes.COARSE))
                road_m[at] = ground_m[at] = self._far(coarse, shared) if shared else np.nan
        return Ground(
            window.grid(self.cell_m),
            self.z0_m,
            road_m,
            ground_m,
            *passes.is_kind(kind),
            passes.unpacked_sigma(sigma),
        )

    def _far(self, coarse: CoarseGround, window: CellWindow) -> AnyArray:
        """Return the ground in cells far from any ground: the height of the nearest block that has ground."""
        far, rows, cols = coarse.over(window, self.cell_m)
        return np.asarray(far[rows[:, None], cols])


class SurveySight:
    """Visibility in a whole survey: whether road or ground was measured at places (``linework.methods.protocol.Sight``)."""

    def __init__(self, surface: SurveySurface) -> None:
        self._surface = surface
        self._pieces: dict[tuple[int, int], Sight] = {}

    def __call__(self, xy: FloatArray) -> BoolArray:
        """Return (n,) bool for (n, 2) places [m, world]."""
        out = np.zeros(len(xy), dtype=np.bool_)
        number = np.floor(xy / SIGHT_PIECE_M).astype(np.int64)
        if len(number) and (number == number[0]).all():
            # Nearly always, and their sorting takes most of the time
            return self._piece(*number[0].tolist())(xy)
        for east, north in np.unique(number, axis=0).tolist():
            inside = (number[:, 0] == east) & (number[:, 1] == north)
            out[inside] = self._piece(east, north)(xy[inside])
        return out

    def _piece(self, east: int, north: int) -> Sight:
        if (east, north) not in self._pieces:
            while len(self._pieces) >= N_PIECES:
                del self._pieces[next(iter(self._pieces))]
            west, south = east * SIGHT_PIECE_M, north * SIGHT_PIECE_M
            surface = self._surface.over(Bounds(west, south, west + SIGHT_PIECE_M, south + SIGHT_PIECE_M))
            self._pieces[east, north] = sight_of(surface)
        return self._pieces[east, north]


def make_surface(
    store: PointStore | passes.PointSource,
    trajectory: Trajectory | None,
    config: RoadConfig,
    folder: Path,
    executor: Executor,
    advance: Advance,
    *,
    key: str,
    layout: SurfaceTiling | None = None,
    ground: Ground | GroundFinder | None = None,
) -> SurveySurface:
    """Find road and ground of a survey and keep them in a folder; a surface with this `key` there is used.

    Parameters
    ----------
    store
        The survey's points.
    trajectory
        Path of the vehicle; None: every large smooth region of bare earth is road.
    folder
        For the surface alone: other files in it may be removed.
    executor
        Does the tiles of each pass.
    advance
        Called with the number of passes over tiles that are done, and of all.
    key
        Fingerprint of points, trajectory and settings.
    layout
        Tiles of cells; None: the cheapest.
    ground
        Own ground, or a function that returns it, instead of passes: see `linework.runs.opened.own_ground`.

    Raises
    ------
    MachineError
        The folder cannot be written.
    OwnCodeError
        The own function failed.

    Notes
    -----
    A tile whose pass fails has no surface; `SurveySurface.failures` names it, and the next call tries again.
    Memory: one tile in each worker, and here what crosses the edges.
    """
    record = read_surface_record(folder)
    if record and (record.get("version"), record.get("key")) == (_VERSION, key) and not record["failed"]:
        return SurveySurface._from(folder, record)
    layout = layout or SurfaceTiling.for_cells(config)
    clear_surface(folder)
    try:
        making = _Making(store, trajectory, config, SurfaceTiles(folder, *layout), executor, advance)
        known = making.surface() if ground is None else making.own_surface(ground, trajectory)
    except BaseException:
        # Half a surface is useless to the next run, and takes room on a disk that may be full
        with contextlib.suppress(OSError):
            clear_surface(folder)
        raise
    write_surface_record(
        folder,
        {
            "version": _VERSION,
            "key": key,
            "cell_m": config.cell_m,
            "z0_m": making.z0_m,
            "n_cells": layout.n_cells,
            "origin": list(layout.origin),
            "tiles": sorted(known),
            "failed": [[*tile, problem] for tile, problem in sorted(making.failed.items())],
            "aside": list(making.aside),
        },
    )
    return SurveySurface.open(folder)


class _Making:
    """The passes that make one surface."""

    def __init__(
        self,
        store: PointStore | passes.PointSource,
        trajectory: Trajectory | None,
        config: RoadConfig,
        tiles: SurfaceTiles,
        executor: Executor,
        advance: Advance,
    ) -> None:
        self._tiles, self._config, self._executor, self._advance = tiles, config, executor, advance
        self._blocks, counts = store.block_counts
        self.z0_m = _height_origin(store, trajectory, self._blocks, counts)
        self.failed: dict[TileNumber, str] = {}
        self.aside = RoadAside()
        occupied = tiles_with_points(self._blocks, counts, tiles, config, 0)
        reached = tiles_with_points(self._blocks, counts, tiles, config, halo_cells(config))
        cost = surface_cost(occupied.values(), reached.values(), tiles.n_cells, block_sizes(config))
        check_surface_cost(cost, int(counts.sum()), _extent_m(self._blocks), tiles.folder)
        self._occupied, self._reached = list(occupied), list(reached)
        source = store.folder if isinstance(store, PointStore) else store
        self._task = passes.SurfaceTileTask(source, tiles, (0, 0), config, self.z0_m)
        path, islands = path_samples(trajectory, config.cell_m), Islands.of(self._blocks)
        tiles.write_common(passes.PATH, path, passes.path_boxes(path))
        tiles.write_common(passes.ISLANDS, islands.codes, islands.number)

    def surface(self) -> list[TileNumber]:
        """Run all passes; return the tiles that have a surface."""
        # The lowest supported height of every cell, and how much the layer above it spreads
        found = self._run(0, passes.find_heights, self._occupied)
        uneven = UnevenLimits.of(SpreadsUnder.added([under for _, under, _ in found.values()]), self._config)
        self._tiles.write_common(passes.UNEVEN, *uneven.arrays)
        self._task = replace(
            self._task,
            rough_limit_m=rough_limit_m(_added(spreads for spreads, _, _ in found.values()), self._config),
            is_dense=LoneCells.added(lone for _, _, lone in found.values()).is_dense,
        )
        filled = self._run(1, passes.leave_strays_out, [tile for tile, (n, _, _) in found.items() if len(n)])
        # Regions that continue the slope, and looser ones, united across the edges of tiles
        facts = self._run(2, passes.find_regions, filled)
        names = sorted(facts)
        choice = Choice([facts.pop(name) for name in names], self._links(names), self._config.cell_m)
        # The road is under the van; the ground is bare earth, and what roads lie on
        for i, name in enumerate(names):
            self._tiles.write(passes.CHOSEN, name, choice.road_labels(i), choice.ground_labels(i))
        coarse = CoarseGround.added(*self._run(3, passes.coarse_heights, names).values())
        self._tiles.write_common(passes.COARSE, coarse.blocks, coarse.total, coarse.cells)
        # Beyond its edge the road is carried on, and gives way to the ground
        has = self._run(
            4, passes.extend_tile_surface, [tile for tile in self._reached if tile not in self.failed]
        )
        self._advance(self._n_steps, self._n_steps)
        self._tiles.keep_only(passes.SURFACE, passes.COARSE)
        self.aside = RoadAside.added(has[tile][1] for tile in sorted(has))
        return [tile for tile, (is_there, _) in has.items() if is_there]

    def own_surface(self, ground: Ground | GroundFinder, trajectory: Trajectory | None) -> list[TileNumber]:
        """Write the own ground of all tiles that hold points; return those tiles.

        Raises
        ------
        OwnCodeError
            The own function failed: without a ground no line would be right.
        """
        path = None
        if trajectory is not None:
            path = self._tiles.folder / f"own-path{ARRAY_SUFFIX}"
            write_part(trajectory, path)
        sent = None if isinstance(ground, Ground) else sent_code(ground, "ground")
        tasks = [OwnGroundTask(replace(self._task, tile=tile), ground, path, sent) for tile in self._occupied]
        # Your own ground is only resampled: not worth sending
        executor = Serial() if isinstance(ground, Ground) else self._executor
        coarse = {}
        for n, outcome in enumerate(executor.run(find_own_ground, tasks), start=1):
            if outcome.trace:
                raise error_of_fault(Failure("tile", "surface", outcome.problem, outcome.trace))
            tile = outcome.task.surface.tile
            if outcome.receipt is None:
                self.failed[tile] = outcome.problem
            elif len(outcome.receipt.blocks):
                coarse[tile] = outcome.receipt
            self._advance(n, len(tasks))
        far = CoarseGround.added(*(coarse[tile] for tile in sorted(coarse)))
        self._tiles.write_common(passes.COARSE, far.blocks, far.total, far.cells)
        self._tiles.keep_only(passes.SURFACE, passes.COARSE)
        return sorted(coarse)

    def _run(
        self, number: int, work: Callable[[passes.SurfaceTileTask], Any], tiles: Iterable[TileNumber]
    ) -> dict[TileNumber, Any]:
        """Run one pass over tiles, and return their receipts; failures are kept by tile."""
        receipts, done = {}, number * len(self._occupied)
        for outcome in self._executor.run(work, [replace(self._task, tile=tile) for tile in tiles]):
            if outcome.receipt is None:
                self.failed.setdefault(outcome.task.tile, outcome.problem)
            else:
                receipts[outcome.task.tile] = outcome.receipt
            done += 1
            self._advance(done, self._n_steps)
        return receipts

    @property
    def _n_steps(self) -> int:
        return 4 * len(self._occupied) + len(self._reached)

    def _links(self, names: Sequence[TileNumber]) -> list[RegionLink]:
        """Return the regions that are connected across the edges between tiles."""
        number = {name: i for i, name in enumerate(names)}
        links = []
        for (east, north), i in number.items():
            for side, other, find in (
                (("east", "west"), number.get((east + 1, north)), links_east),
                (("south", "north"), number.get((east, north - 1)), links_south),
            ):
                if other is not None:
                    one = passes.edge_cells(self._tiles, names[i], side[0])
                    two = passes.edge_cells(self._tiles, names[other], side[1])
                    links.append(RegionLink(i, other, *find(one, two, self._config)))
        return links


def _height_origin(
    store: PointStore | passes.PointSource, trajectory: Trajectory | None, blocks: IntArray, counts: IntArray
) -> float:
    """Return the height origin [m]: of the path, or without one of the block with the median number of points."""
    if trajectory is not None and len(trajectory):
        return height_origin(trajectory.xyz[:, 2])
    if len(counts) == 0:
        return 0.0
    east, north = (blocks[np.argsort(counts, kind="stable")[len(counts) // 2]] * SURFACE_BLOCK_M).tolist()
    block = Bounds(east, north, east + SURFACE_BLOCK_M, north + SURFACE_BLOCK_M)
    return height_origin(
        store.points(block, ordered=False, with_time=False, with_intensity=False, with_columns=False).xyz[
            :, 2
        ]
    )


def _extent_m(blocks: IntArray) -> tuple[float, float]:
    """Return the extent of blocks east and north [m]."""
    if len(blocks) == 0:
        return 0.0, 0.0
    east, north = ((blocks.max(axis=0) - blocks.min(axis=0) + 1) * SURFACE_BLOCK_M).tolist()
    return east, north


def _added(counts: Iterable[AnyArray]) -> IntArray:
    """Return the sum of counts of different lengths."""
    total = np.zeros(0, dtype=np.int64)
    for part in counts:
        longer = np.zeros(max(len(total), len(part)), dtype=np.int64)
        longer[: len(total)] = total
        longer[: len(part)] += part
        total = longer
    return total
