"""The tile store of a survey: built once for one state of its files, then used by everything that needs points."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from linework.errors import InputError
from linework.files.las.decoder import DecoderLimits
from linework.files.las.header import read_las_header
from linework.files.output.locks import hold_lock
from linework.files.output.record import hash_file
from linework.files.output.replace import replacing_folder
from linework.files.remote.address import address_text, is_remote
from linework.files.remote.reader import remote_state
from linework.files.store.build import build_store, keeps_noise
from linework.files.store.facts import StoreFacts, facts_of_store
from linework.files.store.from_points import store_points
from linework.files.store.read import PointStore
from linework.model.points import Points
from linework.model.survey import Survey
from linework.runs.opened.made import STORES, claim, remove_made
from linework.runs.opened.work_folder import folder_in_use_error
from linework.runs.resume import source_hash
from linework.runs.steps import Advance, RunSteps

if TYPE_CHECKING:
    from linework.model.survey import Survey
    from linework.processes.executors import Executor
    from linework.runs.settings import RunSettings


@dataclass(frozen=True, slots=True)
class HeldStore:
    """A tile store that is locked against removal.

    Parameters
    ----------
    key
        Hash of the content of all point files, or of the points, and of what they were read with.
    hashes
        SHA-256 of every point file that can be read; of a remote one, its length and ETag.
    """

    points: PointStore
    facts: StoreFacts
    key: str
    hashes: Mapping[Path, str]


@contextlib.contextmanager
def held_store(
    survey: Survey,
    work: Path,
    *,
    n_threads: int = 1,
    limits: DecoderLimits | None = None,
    steps: RunSteps | None = None,
) -> Iterator[HeldStore]:
    """Open the store of a survey, built if the work folder has none for the present content of the files.

    Parameters
    ----------
    n_threads, limits
        Of the decoder; the store does not depend on them.

    Raises
    ------
    InputError
        No file can be used, or one changed while it was read.
    MachineError
        The work folder is full.

    Notes
    -----
    A store is identified by the bytes of its files, not by their times. Stores of earlier states are removed.
    """
    before = _states(survey)
    hashes = _hashes(survey.point_files, n_threads)

    def build(folder: Path, advance: Advance) -> None:
        build_store(survey, folder, n_threads=n_threads, progress=advance, limits=limits)
        _refuse_changed(before, _states(survey))

    with _held(work, _names(survey, hashes), build, hashes, steps or RunSteps()) as held:
        yield held


@contextlib.contextmanager
def held_store_of_points(
    points: Points, work: Path, *, name: str = "points", steps: RunSteps | None = None
) -> Iterator[HeldStore]:
    """Open the store of points that are in memory, built if the work folder has none for these points.

    Parameters
    ----------
    name
        Name of the points, for messages and for the sources of lines.

    Raises
    ------
    UsageError, CrsError, MachineError
        As for `linework.files.store.from_points.store_points`.
    """

    def build(folder: Path, advance: Advance) -> None:
        store_points(points, folder, name=name, progress=advance)

    with _held(work, _names_of_points(points, name), build, {}, steps or RunSteps()) as held:
        yield held


@contextlib.contextmanager
def _held(
    work: Path,
    names: tuple[str, str],
    build: Callable[[Path, Advance], None],
    hashes: Mapping[Path, str],
    steps: RunSteps,
) -> Iterator[HeldStore]:
    """Open a store that is named for its input and for the state of that, built if it is missing."""
    family, key = names
    name = f"{family}-{key}"
    folder, lock = work / STORES / name, work / f"store-{name}.lock"
    if not folder.is_dir():
        with hold_lock(lock, keep=True):
            if not folder.is_dir():
                claim(work, f"{STORES}/{name}")
                # Gets its name when it is whole
                with replacing_folder(folder) as part, steps.step("read points", unit="points") as advance:
                    build(part, advance)
                _remove_earlier(work, family, name)
    with hold_lock(lock, shared=True, keep=True):
        points = PointStore.open(folder)
        yield HeldStore(points, facts_of_store(points), key, hashes)


def promised_points(survey: Survey) -> int:
    """Return the number of points by the files' headers; a file that cannot be read counts none."""
    total = 0
    for path in survey.point_files:
        with contextlib.suppress(InputError):
            total += read_las_header(path).n_points
    return total


def _names(survey: Survey, hashes: Mapping[Path, str]) -> tuple[str, str]:
    """Return a hash of what is read (files and further columns), and one of its content and CRS."""
    names = [
        address_text(path) if is_remote(path) else os.fsdecode(os.fsencode(path.absolute()))
        for path in survey.point_files
    ]
    content = [
        source_hash("files", "kernels"),
        survey.crs,
        survey.settings.get("crs"),
        keeps_noise(survey),
        [hashes.get(p) for p in survey.point_files],
        survey.carry,
    ]
    return _short_hashes([*names, *survey.carry], content)


def _names_of_points(points: Points, name: str) -> tuple[str, str]:
    """Return a hash of the points' name and columns, and one of their values and CRS."""
    columns = points.by_name()
    # Of the arrays as they are: the same points in another order have another store with the same content
    values = [
        hashlib.sha256(column.reshape(-1).view(np.uint8).data).hexdigest() for column in columns.values()
    ]
    content = [source_hash("files", "kernels"), points.crs, values]
    return _short_hashes(["points", name, *columns], content)


def _short_hashes(names: list[str], content: list[Any]) -> tuple[str, str]:
    files, state = (hashlib.sha256(json.dumps(v).encode()).hexdigest() for v in (names, content))
    return files[:8], state[:16]


def _hashes(paths: tuple[Path, ...], n_threads: int) -> dict[Path, str]:
    """Return the hashes, or the states of remote files; what cannot be read is reported when its points are read."""

    def hashed(path: Path) -> str | None:
        if is_remote(path):
            with contextlib.suppress(InputError):
                return remote_state(path).text
            return None
        with contextlib.suppress(InputError, OSError):
            return hash_file(path)
        return None

    with ThreadPoolExecutor(max_workers=n_threads) as pool:
        return {path: text for path, text in zip(paths, pool.map(hashed, paths), strict=True) if text}


def _states(survey: Survey) -> dict[Path, tuple[int, ...]]:
    """Return device, inode, size and time of each file, by which a change is noticed."""
    found: dict[Path, tuple[int, ...]] = {}
    for path in survey.point_files:
        # A remote file is fetched in one state
        with contextlib.suppress(OSError):
            status = path.stat()
            found[path] = (status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns)
    return found


def _refuse_changed(before: Mapping[Path, tuple[int, ...]], after: Mapping[Path, tuple[int, ...]]) -> None:
    for path, state in before.items():
        if after.get(path) != state:
            raise InputError(
                "changed while it was read", where=path, advice="run again when nothing writes to it any more"
            )


def _remove_earlier(work: Path, family: str, name: str) -> None:
    """Remove the stores of earlier states of the same files, except those in use."""
    for folder in sorted((work / STORES).glob(f"{family}-*")):
        if folder.name != name:
            lock = work / f"store-{folder.name}.lock"
            with contextlib.suppress(OSError), hold_lock(lock, folder_in_use_error(work)):
                remove_made(work, f"{STORES}/{folder.name}")


# The executor of a run on this machine

#: What the processes of workers import before their first task.
WORKER_MODULES = ("linework.runs.tasks", "linework.methods.choose")


@contextlib.contextmanager
def executor_for(
    n_points: int,
    n_workers: int,
    settings: RunSettings,
    *,
    has_images: bool = False,
    has_own_code: bool = False,
    names: Iterable[str] = (),
) -> Iterator[Executor]:
    """Open the executor of a run: worker processes, started now; for a survey of one tile threads, or one task at a time.

    Parameters
    ----------
    n_points
        Points of the survey (`promised_points` before they are read).
    has_images
        Whether stereo pairs are looked at: many small windows, any number of which is worth workers.
    has_own_code
        Whether tasks call functions of somebody else's, which may not expect to be called by two threads at once.
    names
        What the tasks come to, as for `linework.runs.compile.compile_stage`: its kernels are loaded once for all workers.
    """
    from linework.processes.executors import Serial, Threads
    from linework.processes.pool import Processes

    if n_workers == 1 or (n_points <= settings.tiling.max_points and not has_images):
        yield Serial() if n_workers == 1 or has_own_code else Threads(n_workers)
        return
    from linework.runs.compile import loading_of

    with Processes(n_workers, modules=WORKER_MODULES, prepare=loading_of(names)) as processes:
        yield processes
