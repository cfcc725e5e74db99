"""The main job: read a survey, work its tiles, name and order the lines."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from linework.errors import InputError
from linework.files.las_header import read_las_header
from linework.files.run_record import hash_file
from linework.files.survey_points import (
    SurveyPoints,
    check_trajectory_covers,
    read_survey_points,
    read_survey_trajectory,
)
from linework.methods.protocol import Method
from linework.model.arrays import BoolArray
from linework.model.grid import Bounds
from linework.model.lines import KINDS, LineSet
from linework.model.points import Points
from linework.model.survey import Survey
from linework.model.tile import TileData
from linework.model.trajectory import Trajectory
from linework.navigation.lever import at_vehicle_origin
from linework.tiling.executors import in_order
from linework.tiling.identify import identify
from linework.tiling.plan import Tile, plan_tiles
from linework.tiling.seams import inside_core, join_seams
from linework.tiling.sources import with_sources
from linework.tiling.steps import Steps


@dataclass(frozen=True, slots=True)
class TileReport:
    """What came of a tile: points it saw (core and buffer) and lines found."""

    tile: Tile
    n_points: int
    n_lines: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Extraction:
    """Lines of a survey and the account of how they came about.

    Parameters
    ----------
    source
        Name of the survey.
    lines
        In their fixed order, with their names.
    kinds
        What was looked for.
    read
        Points used and left out, file by file.
    hashes
        SHA-256 of every input file.
    """

    source: str
    lines: LineSet
    kinds: tuple[str, ...]
    read: SurveyPoints
    tiles: tuple[TileReport, ...]
    hashes: Mapping[Path, str]
    warnings: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class SurveyRead:
    """A survey with its points and its trajectory in memory.

    Parameters
    ----------
    points
        Points used and left out, file by file.
    trajectory
        Path of the vehicle's origin, or None.
    warnings
        One line each.
    hashes
        SHA-256 of every input file that can be read.
    """

    survey: Survey
    points: SurveyPoints
    trajectory: Trajectory | None
    warnings: tuple[str, ...]
    hashes: Mapping[Path, str]


def read_survey(survey: Survey, steps: Steps | None = None) -> SurveyRead:
    """Read points and trajectory, and check that they belong together.

    Raises
    ------
    InputError
        No file can be used, or the trajectory does not go with the points. Damaged files among good ones
        are no error here: ``points.failures`` lists them.
    """
    inputs = [*survey.point_files, *([survey.trajectory_file] if survey.trajectory_file else [])]
    n_promised = sum(map(_n_promised, survey.point_files))
    with (
        (steps or Steps()).step("read points", unit="points") as advance,
        ThreadPoolExecutor(max_workers=1, thread_name_prefix="hash") as pool,
    ):
        # Hashing lets go of the interpreter's lock: it costs next to no time beside the decoding
        hashes = {path: pool.submit(hash_file, path) for path in inputs}
        trajectory = read_survey_trajectory(survey)
        points = read_survey_points(survey, progress=lambda done: advance(done, n_promised))
    warnings = points.warnings
    if trajectory is not None:
        trajectory = at_vehicle_origin(trajectory, survey.trajectory_lever_m)
        warnings += check_trajectory_covers(trajectory, points.facts, where=survey.trajectory_file)
    return SurveyRead(survey, points, trajectory, warnings, _readable(hashes))


def extract_lines(
    survey: Survey | SurveyRead, methods: Sequence[Method], *, n_workers: int = 1, steps: Steps | None = None
) -> Extraction:
    """Return all lines that the methods find in a survey.

    Parameters
    ----------
    survey
        Read already, or to be read.
    n_workers
        How many tiles are worked at a time; the lines do not depend on it.
    steps
        Times and shows the steps.

    Raises
    ------
    InputError
        As for `read_survey`.
    """
    steps = steps or Steps()
    read = survey if isinstance(survey, SurveyRead) else read_survey(survey, steps)
    points, name = read.points.points, read.survey.name
    bounds = points.bounds
    tiles = plan_tiles(bounds, max(method.buffer_m for method in methods))
    tiles = tiles if len(tiles) == 1 else tuple(tile for tile in tiles if _has_points(tile.core, points))

    def work(tile: Tile) -> tuple[TileReport, LineSet]:
        data = TileData(tile.tile_id, tile.core, _points_of(tile, points, bounds), read.trajectory, name)
        found = LineSet.concatenate([_in_crs(method.extract(data), read.survey.crs) for method in methods])
        found = found if len(tiles) == 1 else inside_core(found, tile.core)
        return TileReport(tile, len(data.points), len(found)), found

    with steps.step("find lines", unit="tiles") as advance:
        worked = []
        for result in in_order(work, tiles, n_workers):
            worked.append(result)
            if len(tiles) > 1:
                advance(len(worked), len(tiles))
        lines = LineSet.concatenate([found for _, found in worked])
        if len(tiles) > 1:
            lines = join_seams(lines, [tile.core for tile in tiles])
        lines = identify(with_sources(lines, read.points.files, name))
    return Extraction(
        source=read.survey.name,
        lines=lines,
        kinds=tuple(kind for kind in KINDS if any(kind in method.kinds for method in methods)),
        read=read.points,
        tiles=tuple(report for report, _ in worked),
        hashes=read.hashes,
        warnings=read.warnings,
    )


def _n_promised(path: Path) -> int:
    """Return the points a file's header promises, 0 where it cannot be read: said when its points are."""
    try:
        return read_las_header(path).n_points
    except InputError:
        return 0


def _points_of(tile: Tile, points: Points, bounds: Bounds) -> Points:
    """Return the tile's points in core and buffer: all of them, uncopied, where it covers the survey."""
    west, south, east, north = tile.extent
    if west <= bounds.west and south <= bounds.south and bounds.east < east and bounds.north < north:
        return points
    return points.take(np.flatnonzero(_inside(tile.extent, points)))


def _has_points(core: Bounds, points: Points) -> bool:
    return bool(_inside(core, points).any())


def _inside(bounds: Bounds, points: Points) -> BoolArray:
    east, north = points.xyz[:, 0], points.xyz[:, 1]
    inside: BoolArray = (east >= bounds.west) & (east < bounds.east)
    return inside & (north >= bounds.south) & (north < bounds.north)


def _in_crs(lines: LineSet, crs: str) -> LineSet:
    """Return a method's lines in the survey's CRS: methods know metres only."""
    return lines if lines.crs == crs else lines.with_columns(crs=crs)


def _readable(hashes: Mapping[Path, Future[str]]) -> dict[Path, str]:
    """Return the hashes; a file that cannot be read is told about by whoever reads its points."""
    return {path: future.result() for path, future in hashes.items() if future.exception() is None}
