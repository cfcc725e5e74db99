"""What is done with one tile: load its points and surface, run the methods, keep the lines of its core."""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from linework.files.parts import read_path_part, write_box_part, write_line_part
from linework.files.store_layout import CELL_M
from linework.files.store_read import PointStore
from linework.methods.protocol import BoxMethod, Method
from linework.model.boxes import BoxSet
from linework.model.grid import Image, holds
from linework.model.lines import LineSet
from linework.model.tile import TileData
from linework.model.trajectory import Trajectory
from linework.tiling.plan import Tile
from linework.tiling.seams import inside_core
from linework.tiling.surfaces import SurveySurface


@dataclass(frozen=True, slots=True)
class Job:
    """What is the same for all tiles of a run.

    Parameters
    ----------
    store, surface, trajectory
        Where points, surface and path of the vehicle (or None) are.
    results
        Folder for the lines of each tile.
    origin
        Local origin of the survey [m, world].
    """

    store: Path
    surface: Path
    trajectory: Path | None
    results: Path
    crs: str
    source: str
    origin: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class TileTask:
    """A tile to be worked by a method; `is_whole`: it is the method's only one, and nothing is cut."""

    tile: Tile
    method: Method
    job: Job
    is_whole: bool

    @property
    def name(self) -> str:
        """The kinds that are looked for, and the tile's name."""
        return f"{'+'.join(self.method.kinds)}-{self.tile.tile_id}"

    @property
    def result(self) -> Path:
        """Where its lines go."""
        return self.job.results / f"{self.name}.npz"


@dataclass(frozen=True, slots=True)
class TileReceipt:
    """What came of a tile: points it saw (core and buffer), lines or boxes found, and the hash of its result file."""

    name: str
    n_points: int
    n_lines: int
    seconds: float
    sha256: str

    def as_document(self) -> dict[str, Any]:
        """Return it for the journal."""
        return asdict(self)


def work_tile(task: TileTask) -> TileReceipt:
    """Work a tile and write its lines or boxes; what it needs it opens by its path, so that any process can do it."""
    start = time.perf_counter()
    job, tile, method = task.job, task.tile, task.method
    data = _tile_data(job, tile, method)
    if isinstance(method, BoxMethod):
        boxes = method.detect(data) if len(data.points) else BoxSet.empty()
        boxes = boxes.take(holds(tile.core, boxes.centre + job.origin))
        n_found, sha256 = len(boxes), write_box_part(boxes, task.result)
    else:
        lines = method.extract(data) if len(data.points) else LineSet.empty()
        lines = lines.with_columns(crs=job.crs)
        lines = lines if task.is_whole else inside_core(lines, tile.core)
        n_found, sha256 = len(lines), write_line_part(lines, task.result)
    return TileReceipt(task.name, len(data.points), n_found, time.perf_counter() - start, sha256)


def _tile_data(job: Job, tile: Tile, method: Method) -> TileData:
    """Return what a method sees of a tile."""
    surface = _opened_surface(job.surface).over(tile.extent)
    lowest, above_m = None, 0.0
    # A surface of cells that do not fit into those of the store cannot say which points to pass over
    if np.isfinite(method.least_height_m) and surface.grid.cell_width_m % CELL_M == 0.0:
        lowest, above_m = Image(surface.ground_m, surface.grid), surface.z0_m + method.least_height_m
    points = _opened_store(job.store).points(tile.extent, lowest=lowest, above_m=above_m)
    path = _trajectory(job.trajectory) if job.trajectory else None
    return TileData(tile.tile_id, tile.core, points, path, job.source, surface, job.origin)


# A process works many tiles of one run: what they share stays open
@lru_cache(maxsize=1)
def _opened_store(folder: Path) -> PointStore:
    return PointStore.open(folder)


@lru_cache(maxsize=1)
def _opened_surface(folder: Path) -> SurveySurface:
    return SurveySurface.open(folder)


@lru_cache(maxsize=1)
def _trajectory(path: Path) -> Trajectory:
    return read_path_part(path)
