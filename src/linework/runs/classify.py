"""Classify the points of a survey: tiles of what they are classified by, then copies of the files, one after another."""

from __future__ import annotations

import os
from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path

import numpy as np

from linework.arrays import AnyArray, Float32Array, FloatArray, IntArray
from linework.errors import InputError, UsageError, argument
from linework.files.array_file import ARRAY_SUFFIX, read_named_arrays
from linework.files.las.copy import CopiedFile, check_copy, copy_classified
from linework.files.las.crs import resolve_crs
from linework.files.las.header import LasHeader, read_las_header
from linework.files.output.parts import read_path_part, write_part
from linework.files.remote.address import address_text
from linework.files.remote.copies import RemoteCopies
from linework.files.store.cell_tiles import TileNumber
from linework.files.store.layout import STORE_BLOCK_M
from linework.files.store.read import PointStore
from linework.methods.classes.pieces import RoadPieces
from linework.methods.classes.point_class import PointClass
from linework.methods.classes.tile import (
    PLAN_MARGIN_M,
    STANDING_MARGIN_M,
    TileClasses,
    tile_classes,
)
from linework.model.grid import Bounds
from linework.model.lines import REJECTED_REVIEW, LineSet
from linework.model.tile import LaserGains
from linework.processes.executors import Executor
from linework.runs.extraction import Failure
from linework.runs.opened.points import OpenedSurvey
from linework.runs.opened.surface import SurveySurface
from linework.runs.steps import Advance
from linework.scanlines.sampled import sampled_gains
from linework.surface.cells import path_samples

#: Sides of tiles, the largest that holds no more than this many points is taken [m, points]: a tile in work takes 40
#: bytes for each of them.
_TILES_M, _MOST_POINTS = (128.0, 64.0, 32.0, 16.0), 8_000_000
#: Tiles of one file that are held at a time: a van is in a few of them for some time. One takes up to 2 MB.
_N_HELD = 64
#: Samples of the vehicle's path. [m]
_PATH_STEP_M = 0.5


@dataclass(frozen=True, slots=True)
class ClassTask:
    """One tile that is made ready for its points.

    Parameters
    ----------
    tile, tile_m
        Number east and north, and side of the tile. [m]
    store, surface, pieces, path
        Folder of the tile store, folder of the surface, file of the pieces of lines, file of the path (None: none).
    results
        Folder for what is made.
    gains
        Of the survey's lasers.
    """

    tile: TileNumber
    tile_m: float
    store: Path
    surface: Path
    pieces: Path
    path: Path | None
    results: Path
    gains: LaserGains

    @property
    def result(self) -> Path:
        """File for what is made."""
        return self.results / f"e{self.tile[0]}n{self.tile[1]}{ARRAY_SUFFIX}"

    @property
    def core(self) -> Bounds:
        """The tile."""
        west, south = self.tile[0] * self.tile_m, self.tile[1] * self.tile_m
        return Bounds(west, south, west + self.tile_m, south + self.tile_m)


def make_tile(task: ClassTask) -> int:
    """Make a tile ready for its points and return how many were looked at; runs in any process."""
    core = task.core
    points = _opened_store(task.store).points(
        core.grown(STANDING_MARGIN_M), ordered=False, with_time=False, with_columns=bool(task.gains.column)
    )
    points = task.gains.without(points)
    ground = _opened_surface(task.surface).over(core.grown(PLAN_MARGIN_M))
    path = np.zeros((0, 2)) if task.path is None else _path_places(task.path)
    found = tile_classes(core, ground, points, _pieces(task.pieces), path, has_path=task.path is not None)
    write_part(found, task.result)
    return len(points)


# A process makes many tiles of one survey: what they share stays open
@lru_cache(maxsize=1)
def _opened_store(folder: Path) -> PointStore:
    return PointStore.open(folder)


@lru_cache(maxsize=1)
def _opened_surface(folder: Path) -> SurveySurface:
    return SurveySurface.open(folder)


@lru_cache(maxsize=1)
def _path_places(path: Path) -> FloatArray:
    return np.ascontiguousarray(path_samples(read_path_part(path), _PATH_STEP_M)[:, :2])


@lru_cache(maxsize=1)
def _pieces(path: Path) -> RoadPieces:
    return RoadPieces(**read_named_arrays(path))


@dataclass(frozen=True, slots=True)
class TiledClasses:
    """All tiles of a survey, ready for its points.

    Parameters
    ----------
    tile_m
        Side of a tile. [m]
    files
        Files of the tiles by their numbers.
    failures
        Tiles that could not be made: their points are of no class.
    gains
        Of the survey's lasers: intensities are asked for without them.
    """

    tile_m: float
    files: Mapping[TileNumber, Path]
    failures: tuple[Failure, ...]
    gains: LaserGains


def make_tiles(
    opened: OpenedSurvey,
    surface: SurveySurface,
    lines: LineSet,
    results: Path,
    executor: Executor,
    advance: Advance,
) -> TiledClasses:
    """Make all tiles of a survey ready for its points.

    Parameters
    ----------
    lines
        By which points are classified; their order gives their numbers, from 1.
    results
        Folder for the tiles.
    executor
        Makes them; the classes do not depend on it.
    """
    pieces = results / f"pieces{ARRAY_SUFFIX}"
    write_part(RoadPieces.of(lines), pieces)
    path = None
    if opened.trajectory is not None:
        path = results / f"path{ARRAY_SUFFIX}"
        write_part(opened.trajectory, path)
    tile_m, numbers = _tiles_of(*opened.points.block_counts)
    gains = sampled_gains(*opened.points.block_counts, opened.points.points)
    tasks = [
        ClassTask(tile, tile_m, opened.points.folder, surface.tiles.folder, pieces, path, results, gains)
        for tile in numbers
    ]
    files = dict[TileNumber, Path]()
    # Where there is no surface, no height is known
    failures = [Failure("tile", name, problem) for name, problem in surface.failures]
    for n, outcome in enumerate(executor.run(make_tile, tasks), start=1):
        if outcome.receipt is None:
            name = "e{}n{}".format(*outcome.task.tile)
            failures.append(Failure("tile", name, outcome.problem, outcome.trace))
        else:
            files[outcome.task.tile] = outcome.task.result
        advance(n, len(tasks))
    return TiledClasses(tile_m, files, tuple(sorted(failures)), gains)


def _tiles_of(blocks: IntArray, counts: IntArray) -> tuple[float, list[TileNumber]]:
    """Return the side of the tiles, and the numbers of those that may hold points, south-west first."""
    for tile_m in _TILES_M:
        per_tile = max(round(tile_m / STORE_BLOCK_M), 1)
        number, index = np.unique(blocks // per_tile, axis=0, return_inverse=True)
        most = np.bincount(index.ravel(), counts).max(initial=0) * min(tile_m / STORE_BLOCK_M, 1.0) ** 2
        if most <= _MOST_POINTS:
            break
    parts = max(round(STORE_BLOCK_M / tile_m), 1)
    found = [
        (east * parts + i, north * parts + j)
        for east, north in number.tolist()
        for i in range(parts)
        for j in range(parts)
    ]
    return tile_m, sorted(found, key=lambda tile: (tile[1], tile[0]))


class PointClassifier:
    """Gives points of any file of a survey their classes; holds the tiles that were asked for last."""

    def __init__(self, tiles: TiledClasses) -> None:
        self._tiles = tiles
        self._held: OrderedDict[TileNumber, TileClasses | None] = OrderedDict()

    def __call__(self, xyz: FloatArray, intensity: Float32Array) -> tuple[AnyArray, AnyArray]:
        """Return the class (n,) uint8 and the number of the line (n,) uint32 of points.

        Parameters
        ----------
        xyz, intensity
            (n, 3) float64 [m, world] and (n,) float32, without the gains of lasers.
        """
        out = np.full(len(xyz), PointClass.OTHER, dtype=np.uint8)
        line = np.zeros(len(xyz), dtype=np.uint32)
        for tile, index in _by_tile(xyz, self._tiles.tile_m):
            classes = self._tile(tile)
            if classes is not None:
                classes.classify(xyz, intensity, index, out, line)
        return out, line

    def _tile(self, tile: TileNumber) -> TileClasses | None:
        if tile not in self._held:
            file = self._tiles.files.get(tile)
            self._held[tile] = None if file is None else TileClasses(**read_named_arrays(file))
            while len(self._held) > _N_HELD:
                self._held.popitem(last=False)
        self._held.move_to_end(tile)
        return self._held[tile]


def _by_tile(xyz: FloatArray, tile_m: float) -> list[tuple[TileNumber, IntArray]]:
    """Return the tiles that points are in, and the numbers of the points in each."""
    if len(xyz) == 0:
        return []
    east, north = np.floor(xyz[:, 0] / tile_m), np.floor(xyz[:, 1] / tile_m)
    west, south = east.min(), north.min()
    wide = east.max() - west + 1.0
    n_tiles = wide * (north.max() - south + 1.0)
    code = (north - south) * wide + (east - west)
    if n_tiles == 1.0:
        return [((int(west), int(south)), np.arange(len(xyz)))]
    # Sixteen bits are sorted ten times as fast
    code = code.astype(np.uint16 if n_tiles <= 2**16 else np.int64)
    order = np.argsort(code, kind="stable")
    found, start = np.unique(code[order], return_index=True)
    parts = np.split(order, start[1:])
    rows, cols = np.divmod(found.astype(np.int64), int(wide))
    return [
        ((int(west) + c, int(south) + r), part)
        for r, c, part in zip(rows.tolist(), cols.tolist(), parts, strict=True)
    ]


# The copies of the files


@dataclass(frozen=True, slots=True)
class ClassifiedFiles:
    """Copies of the files of a survey.

    Parameters
    ----------
    copies
        What became of each file, by the name of its copy in the output folder.
    failures
        Files that could not be copied.
    """

    copies: Mapping[str, tuple[Path, CopiedFile]]
    failures: tuple[Failure, ...]


def copy_names(paths: Sequence[Path]) -> dict[Path, str]:
    """Return the names of copies in one folder: those of the files, with their folders where two have the same.

    >>> [*copy_names([Path("a/1.laz"), Path("a/2.copc.laz")]).values()], [*copy_names([Path("a/1.laz"), Path("b/1.laz")]).values()]
    (['1.laz', '2.laz'], ['a/1.laz', 'b/1.laz'])
    """
    plain = {path: path.name for path in paths}
    if len({_stem(name).lower() for name in plain.values()}) < len(plain):
        top = os.path.commonpath([path.absolute().parent for path in paths])
        plain = {path: path.absolute().relative_to(top).as_posix() for path in paths}
    # The copy of a COPC file is a LAZ file: places in its index are no longer right
    return {path: _stem(name) for path, name in plain.items()}


def _stem(name: str) -> str:
    ending = ".copc.laz"
    return name[: -len(ending)] + ".laz" if name.lower().endswith(ending) else name


def copy_files(opened: OpenedSurvey, tiles: TiledClasses, folder: Path, advance: Advance) -> ClassifiedFiles:
    """Write copies of the files of a survey to a folder; files that cannot be copied are left out and listed.

    Files at an address are fetched into the folder for as long as their copies are written.

    Raises
    ------
    MachineError
        The folder cannot be written.
    InputError
        No file can be copied; the first file's error.
    """
    classifier = PointClassifier(tiles)
    files = opened.facts.files
    names = copy_names([file.path for file in files])
    n_all = sum(file.n_promised for file in files)
    copies, failures, first = dict[str, tuple[Path, CopiedFile]](), list[Failure](), list[InputError]()
    n_before = 0
    fetched = RemoteCopies(folder, lambda *_: None)
    for file in files:
        target = folder / names[file.path]
        target.parent.mkdir(parents=True, exist_ok=True)
        report = partial(_advance_by, advance, n_before, n_all)
        try:
            own = fetched.local(file.path)
            header = _header_of_laser_file(own)
            crs = resolve_crs(header.projection, opened.survey.settings.get("crs"), where=file.path)
            copied = copy_classified(own, target, crs.factors, classifier, report, tiles.gains)
            check_copy(target, file.n_promised)
            copies[names[file.path]] = file.path, copied
        except InputError as error:
            target.unlink(missing_ok=True)
            first.append(error)
            failures.append(Failure("file", address_text(file.path), str(error)))
        finally:
            fetched.drop(file.path)
        n_before += file.n_promised
        advance(n_before, n_all)
    if not copies:
        raise first[0]
    return ClassifiedFiles(copies, tuple(failures))


def _header_of_laser_file(path: Path) -> LasHeader:
    header = read_las_header(path)
    if header.cloud is not None:
        raise InputError("copies with classes are made of .las and .laz files only", where=path,
                         advice="convert it to .laz")  # fmt: skip
    return header


def _advance_by(advance: Callable[[int, int], None], before: int, total: int, done: int) -> None:
    advance(before + done, total)


def usable_lines(lines: LineSet, named: object) -> LineSet:
    """Return the lines without those that a person has rejected: there is no such feature.

    Raises
    ------
    UsageError
        None is left, so that nothing can be classified by them.
    """
    kept = lines.take(lines.review != REJECTED_REVIEW)
    if len(kept) == 0:
        advice = f"extract lines, and give them as {argument('lines')}"
        raise UsageError("holds no lines", where=named, advice=advice)
    return kept
