"""Own ground of a survey: a user's function, evaluated on fixed pieces of the surface, or heights given as a whole.

Separate from `surface_passes`, which finds road and ground: here a function of the user does, one tile at a time.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from linework.errors import OwnCodeError
from linework.files.output.parts import read_path_part
from linework.files.store.read import PointStore
from linework.model.ground import Ground
from linework.model.trajectory import Trajectory
from linework.processes.own_code import SentCode, call_own
from linework.runs.opened import surface_passes as passes
from linework.runs.own import GroundFinder
from linework.surface.carry import CoarseGround

#: Margin of points around a piece that an own function is given with it: a truck's length, so that it can tell the
#: road beside one from its roof. [m]
OWN_GROUND_MARGIN_M = 24.0


@dataclass(frozen=True, slots=True)
class OwnGroundTask:
    """One tile of the surface whose ground is the user's.

    Parameters
    ----------
    surface
        Tile, points, cells and zero of heights.
    ground
        The ground, or the function that returns it.
    path
        File of the vehicle's path; None: there is none.
    sent
        The function as bytes for other processes, made once for a run; None: the ground is given as a whole.
    """

    surface: passes.SurfaceTileTask
    ground: Ground | GroundFinder
    path: Path | None
    sent: SentCode | None = None

    def __reduce__(self) -> tuple[Any, ...]:
        """Return how another process makes the same task; a function goes as bytes."""
        return _task_of, (self.surface, self.sent or self.ground, self.path)


def _task_of(
    surface: passes.SurfaceTileTask, ground: Ground | GroundFinder | SentCode, path: Path | None
) -> OwnGroundTask:
    return OwnGroundTask(surface, ground.load() if isinstance(ground, SentCode) else ground, path)


def find_own_ground(task: OwnGroundTask) -> CoarseGround:
    """Write the own ground of a tile; return its mean heights in blocks of 64 m, none if no point lies in the tile.

    Tiles lie on a lattice that depends on the settings of the surface only, and the function is given all points of
    the tile and of a margin of `OWN_GROUND_MARGIN_M` around it, in one order: how a run is split has no influence.

    Raises
    ------
    OwnCodeError
        The function failed, or returned something else.
    """
    surface = task.surface
    window, cell_m = surface.tiles.window(surface.tile), surface.config.cell_m
    bounds, ground = window.bounds(cell_m), task.ground
    source = _opened(surface.source) if isinstance(surface.source, Path) else surface.source
    points = source.points(
        bounds.grown(OWN_GROUND_MARGIN_M),
        ordered=True,
        with_time=True,
        with_intensity=True,
        with_columns=True,
    )
    east, north = points.xyz[:, 0], points.xyz[:, 1]
    inside = (east >= bounds.west) & (east < bounds.east) & (north >= bounds.south) & (north < bounds.north)
    if not inside.any():
        return CoarseGround.added()
    if not isinstance(ground, Ground):
        path = None if task.path is None else _path(task.path)
        ground = call_own(ground, "ground", points, path)
        if not isinstance(ground, Ground):
            raise OwnCodeError(
                f"returned {type(ground).__name__}, expected a linework.Ground", where="ground"
            )
    own = ground.on_grid(window.grid(cell_m), surface.z0_m)
    kind = passes.kind_of(own.is_road, own.is_ground | own.is_road)
    sigma = passes.packed_sigma(own.sigma)
    surface.tiles.write(passes.SURFACE, surface.tile, own.road_m, own.ground_m, kind, sigma)
    return CoarseGround.of(window, own.ground_m, np.isfinite(own.ground_m), cell_m)


@lru_cache(maxsize=1)
def _opened(folder: Path) -> PointStore:
    return PointStore.open(folder)


@lru_cache(maxsize=1)
def _path(file: Path) -> Trajectory:
    return read_path_part(file)
