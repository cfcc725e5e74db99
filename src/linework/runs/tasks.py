"""What is done with one tile: load its points and surface, run the methods, keep the lines of its core."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Protocol, TypeVar

import numpy as np

from linework.errors import InputError
from linework.files.output.parts import (
    part_is_whole,
    read_path_part,
    write_box_part,
    write_line_part,
    write_sighting_part,
)
from linework.files.store.layout import STORE_CELL_M
from linework.files.store.read import PointStore
from linework.imaging.rectify import Rectifier, rectifier_of
from linework.methods.protocol import BoxMethod, Method
from linework.methods.stereo.method import StereoMethod
from linework.model.boxes import BoxSet
from linework.model.camera import StereoRig
from linework.model.grid import Image, holds
from linework.model.images import ImagePair, StereoSeries
from linework.model.lines import LineSet
from linework.model.sightings import Sightings
from linework.model.tile import TileData
from linework.model.trajectory import Trajectory
from linework.processes.executors import Executor, Outcome
from linework.runs.opened.pairs import rectified_pair
from linework.runs.opened.surface import SurveySurface
from linework.runs.resume import JournalEntry, RunFolder
from linework.runs.seams import inside_core
from linework.runs.steps import Advance
from linework.runs.tiles import Tile


@dataclass(frozen=True, slots=True)
class RunContext:
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
    job: RunContext
    is_whole: bool

    @property
    def name(self) -> str:
        """The kinds that are looked for, and the tile's name."""
        return f"{'+'.join(self.method.kinds)}-{self.tile.tile_id}"

    @property
    def result(self) -> Path:
        """Where its lines go."""
        return self.job.results / f"{self.name}.arrays"


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


def process_tile(task: TileTask) -> TileReceipt:
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


def _tile_data(job: RunContext, tile: Tile, method: Method) -> TileData:
    """Return what a method sees of a tile."""
    surface = _opened_surface(job.surface).over(tile.extent)
    lowest, above_m = None, 0.0
    # A surface of cells that do not fit into those of the store cannot say which points to pass over
    if np.isfinite(method.least_height_m) and surface.grid.cell_width_m % STORE_CELL_M == 0.0:
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


# What is done with one time window of stereo pairs: read each, look for lines in it, keep what was seen

#: Pairs of a window: some ten seconds of driving; a killed run loses no more than these.
WINDOW_PAIRS = 64


@dataclass(frozen=True, slots=True)
class WindowTask:
    """Successive pairs to be looked at; `results` is the folder for what is seen."""

    pairs: tuple[ImagePair, ...]
    rig: StereoRig
    method: StereoMethod
    results: Path

    @property
    def name(self) -> str:
        """The method and the window's place in the series, the same in every run."""
        return f"{self.method.name}-{self.pairs[0].number // WINDOW_PAIRS:06d}"

    @property
    def result(self) -> Path:
        """Where what is seen goes."""
        return self.results / f"{self.name}.arrays"


@dataclass(frozen=True, slots=True)
class WindowReceipt:
    """What came of a window: pairs looked at, places seen, the hash of its file, and what could not be read.

    `failures` are (left image, problem).
    """

    name: str
    n_pairs: int
    n_sightings: int
    seconds: float
    sha256: str
    failures: tuple[tuple[str, str], ...] = ()

    def as_document(self) -> dict[str, Any]:
        """Return it for the journal."""
        return asdict(self)


def windows_of(
    pairs: tuple[ImagePair, ...], rig: StereoRig, method: StereoMethod, results: Path
) -> list[WindowTask]:
    """Return the tasks for all pairs: windows lie on one lattice of numbers, whatever pairs are left out."""
    by_window: dict[int, list[ImagePair]] = {}
    for pair in pairs:
        by_window.setdefault(pair.number // WINDOW_PAIRS, []).append(pair)
    return [WindowTask(tuple(held), rig, method, results) for _, held in sorted(by_window.items())]


def process_window(task: WindowTask) -> WindowReceipt:
    """Look at the pairs of a window; a pair that cannot be read is noted, and stops no other."""
    start = time.perf_counter()
    series, rectifier = StereoSeries(task.rig, task.pairs), _rectifier(_Same(task.rig))
    seen, failures = [], []
    for pair in task.pairs:
        try:
            seen.append(task.method.see(rectified_pair(pair, series, rectifier)))
        except InputError as error:
            failures.append((str(pair.left), str(error)))
    found = Sightings.concatenate(seen)
    sha256 = write_sighting_part(found, task.result)
    seconds = time.perf_counter() - start
    return WindowReceipt(task.name, len(seen), len(found), seconds, sha256, tuple(failures))


class _Same:
    """A rig as a key: two of the same numbers are one."""

    def __init__(self, rig: StereoRig) -> None:
        self.rig = rig
        self._key = repr(rig)

    def __hash__(self) -> int:
        return hash(self._key)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Same) and other._key == self._key


# A process looks at many windows of one run: the maps of its cameras are made once
@lru_cache(maxsize=1)
def _rectifier(same: _Same) -> Rectifier:
    return rectifier_of(same.rig)


# Do the tasks of a run that are not done yet, and note each in the journal as it comes


class NamedTask(Protocol):
    """A task that has a name in the journal and a file for its result."""

    @property
    def name(self) -> str:
        """The same in every run."""
        ...

    @property
    def result(self) -> Path:
        """Where what it finds goes."""
        ...


class NotedReceipt(Protocol):
    """What came of a task: enough to take it over from the journal."""

    @property
    def sha256(self) -> str:
        """Of the result's file."""
        ...

    def as_document(self) -> dict[str, Any]:
        """Return it for the journal."""
        ...


RunTaskT = TypeVar("RunTaskT", bound=NamedTask)
RunReceiptT = TypeVar("RunReceiptT", bound=NotedReceipt)


def run_tasks(
    work: Callable[[RunTaskT], RunReceiptT],
    tasks: Sequence[RunTaskT],
    receipt_of: Callable[..., RunReceiptT],
    run: RunFolder,
    executor: Executor,
    advance: Advance,
) -> tuple[dict[str, RunReceiptT], list[Outcome[RunTaskT, RunReceiptT]]]:
    """Work the tasks that are not done yet; return receipts by the tasks' names, and what failed.

    Parameters
    ----------
    receipt_of
        Makes a receipt of what the journal holds.
    """
    done, failed = _taken_over(run, tasks, receipt_of), list[Outcome[RunTaskT, RunReceiptT]]()
    advance(len(done), len(tasks))
    for outcome in executor.run(work, [task for task in tasks if task.name not in done]):
        name = outcome.task.name
        if outcome.receipt is None:
            failed.append(outcome)
        else:
            done[name] = outcome.receipt
            run.journal.enter(JournalEntry(name, outcome.receipt.sha256, outcome.receipt.as_document()))
        advance(len(done) + len(failed), len(tasks))
    return done, failed


def _taken_over(
    run: RunFolder, tasks: Sequence[RunTaskT], receipt_of: Callable[..., RunReceiptT]
) -> dict[str, RunReceiptT]:
    """Return the receipts of tasks that an earlier process has done, if their results are still what they were."""
    entries: Mapping[str, JournalEntry] = run.journal.done()
    found = {}
    for task in tasks:
        entry = entries.get(task.name)
        if entry is not None and part_is_whole(task.result, entry.sha256):
            found[task.name] = receipt_of(**entry.receipt)
    return found
