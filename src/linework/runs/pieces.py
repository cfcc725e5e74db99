"""Pieces of a survey as tasks load them: a tile of points, or a time window of stereo pairs.

What a task holds are paths, names and settings: any process opens what it needs by itself.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np

from linework.errors import InputError
from linework.files.output.parts import read_path_part
from linework.files.store.layout import STORE_CELL_M
from linework.files.store.read import PointStore
from linework.imaging.rectify import Rectifier, rectifier_of
from linework.model.camera import StereoRig
from linework.model.grid import Image
from linework.model.images import ImagePair, StereoSeries
from linework.model.tile import ScannerTiming, TileData
from linework.model.trajectory import Trajectory
from linework.runs.extraction import Failure
from linework.runs.opened.pairs import rectified_pair
from linework.runs.opened.surface import SurveySurface
from linework.runs.tiles import Tile

#: Pairs in a window: some ten seconds of driving, which is the most that a killed run loses. [pairs]
WINDOW_PAIRS = 64


class Loaded(NamedTuple):
    """A piece to be looked at and the number of points or pairs in it, or why it cannot be read."""

    piece: Any
    size: int
    failure: Failure | None = None


class Pieces(Protocol):
    """The pieces of one task."""

    def load(self) -> Iterator[Loaded]:
        """Yield the pieces one by one."""
        ...

    def failures(self, task: str, problem: str, trace: str) -> list[Failure]:
        """Return what is left out when the task fails as a whole."""
        ...


# Tiles of points


@dataclass(frozen=True, slots=True)
class TiledPoints:
    """What all tiles of a run share.

    Parameters
    ----------
    store, surface, trajectory
        Folder of the tile store, folder of the surface, file of the vehicle's path (None: there is none).
    source
        Name of the survey.
    origin
        Local origin of the survey. [m, world]
    scanner
        What is known of the scanner.
    """

    store: Path
    surface: Path
    trajectory: Path | None
    source: str
    origin: tuple[float, float, float]
    scanner: ScannerTiming


@dataclass(frozen=True, slots=True)
class TilePiece:
    """One tile of a survey's points.

    Parameters
    ----------
    tile, survey
        Which tile, of what.
    least_height_m
        Lower points above ground are not loaded. [m]
    is_whole
        Whether the tile is the only one, so that its lines are not cut.
    """

    tile: Tile
    survey: TiledPoints
    least_height_m: float
    is_whole: bool

    def load(self) -> Iterator[Loaded]:
        """Yield the tile, if there are points in it."""
        tile, survey = self.tile, self.survey
        surface = _opened_surface(survey.surface).over(tile.extent)
        lowest, above_m = None, 0.0
        # Points are left out by the ground below their cell of the store: cells of the surface must hold whole ones
        if np.isfinite(self.least_height_m) and surface.grid.cell_width_m % STORE_CELL_M == 0.0:
            lowest, above_m = Image(surface.ground_m, surface.grid), surface.z0_m + self.least_height_m
        points = _opened_store(survey.store).points(tile.extent, lowest=lowest, above_m=above_m)
        path = _trajectory(survey.trajectory) if survey.trajectory else None
        if len(points):
            data = TileData(
                tile.tile_id,
                tile.core,
                points,
                path,
                survey.source,
                surface,
                survey.origin,
                self.is_whole,
                survey.scanner,
                survey.scanner.gains,
            )
            yield Loaded(data, len(points))

    def failures(self, task: str, problem: str, trace: str) -> list[Failure]:
        """Return the failure of the tile."""
        return [Failure("tile", task, problem, trace)]


# A process does many tiles of one run: what they share stays open
@lru_cache(maxsize=1)
def _opened_store(folder: Path) -> PointStore:
    return PointStore.open(folder)


@lru_cache(maxsize=1)
def _opened_surface(folder: Path) -> SurveySurface:
    return SurveySurface.open(folder)


@lru_cache(maxsize=1)
def _trajectory(path: Path) -> Trajectory:
    return read_path_part(path)


# Windows of stereo pairs


@dataclass(frozen=True, slots=True)
class PairWindow:
    """Successive stereo pairs of a survey; each of them is a piece by itself."""

    pairs: tuple[ImagePair, ...]
    rig: StereoRig

    def load(self) -> Iterator[Loaded]:
        """Yield the rectified pairs; a pair that cannot be read stops no other."""
        series, rectifier = StereoSeries(self.rig, self.pairs), _rectifier(_EqualRig(self.rig))
        for pair in self.pairs:
            try:
                piece = rectified_pair(pair, series, rectifier)
            except InputError as error:
                yield Loaded(None, 0, Failure("image", str(pair.left), str(error)))
            else:
                yield Loaded(piece, 1)

    def failures(self, task: str, problem: str, trace: str) -> list[Failure]:  # noqa: ARG002 - tiles need it
        """Return a failure for each pair."""
        return [
            Failure("image", str(pair.left), f"{pair.left.name}: {problem}", trace) for pair in self.pairs
        ]


def windows_of(pairs: tuple[ImagePair, ...], rig: StereoRig) -> Iterator[tuple[int, PairWindow]]:
    """Yield the windows of all pairs with their numbers: the pair numbers of a window are fixed."""
    by_window: dict[int, list[ImagePair]] = {}
    for pair in pairs:
        by_window.setdefault(pair.number // WINDOW_PAIRS, []).append(pair)
    for number, held in sorted(by_window.items()):
        yield number, PairWindow(tuple(held), rig)


class _EqualRig:
    """A rig as a key of a cache: rigs of equal numbers are equal."""

    def __init__(self, rig: StereoRig) -> None:
        self.rig = rig
        self._key = repr(rig)

    def __hash__(self) -> int:
        return hash(self._key)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _EqualRig) and other._key == self._key


# A process looks at many windows of one run: the maps of its cameras are made once
@lru_cache(maxsize=1)
def _rectifier(key: _EqualRig) -> Rectifier:
    return rectifier_of(key.rig)
