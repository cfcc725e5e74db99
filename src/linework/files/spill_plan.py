"""Look at all files of a survey before any is decoded: what can be told from headers and bytes ends here."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from linework.errors import InputError
from linework.files.las_crs import ResolvedCrs, resolve_crs
from linework.files.las_header import LasHeader, read_las_header
from linework.files.run_record import hash_file
from linework.model.survey import Survey

CHANGED_ADVICE = "run again when nothing writes to it"


@dataclass(frozen=True, slots=True)
class PlannedFile:
    """A file whose header is sound, and its state then: size, time of change, inode."""

    path: Path
    header: LasHeader
    crs: ResolvedCrs
    state: tuple[int, int, int]


@dataclass(slots=True)
class SpillAccount:
    """What is found on the way, by file."""

    warnings: dict[Path, list[str]]
    failures: dict[Path, InputError] = field(default_factory=dict)
    empty: InputError | None = None


def plan_files(survey: Survey) -> tuple[list[PlannedFile], SpillAccount]:
    """Check the headers of all files before anything is decoded.

    Raises
    ------
    CrsError
        A file's CRS is missing, or contradicts the survey's.
    """
    planned, account = [], SpillAccount({path: [] for path in survey.point_files})
    repeated = _repeated(survey.point_files)
    for path in survey.point_files:
        if path in repeated:
            account.warnings[path].append(f"the same bytes as {repeated[path].name}, left out")
            continue
        try:
            state = state_of(path)
            header = read_las_header(path)
        except InputError as error:
            account.failures[path] = error
            continue
        if header.n_points == 0:
            empty = InputError("no points (0 in the header)", where=path, advice="leave the file out")
            account.warnings[path].append(f"{empty.problem}, left out")
            account.empty = account.empty or empty
            continue
        crs = resolve_crs(header.projection, survey.settings.get("crs"), where=path)
        planned.append(PlannedFile(path, header, crs, state))
    return planned, account


def state_of(path: Path) -> tuple[int, int, int]:
    """Return what tells that a file was changed: size, time of change, inode.

    Raises
    ------
    InputError
        It went away.
    """
    try:
        status = path.stat()
    except OSError as error:
        raise InputError(
            f"cannot be opened any more: {error.strerror}", where=path, advice=CHANGED_ADVICE
        ) from error
    return status.st_size, status.st_mtime_ns, status.st_ino


def _repeated(files: Sequence[Path]) -> dict[Path, Path]:
    """Return the files whose bytes are those of an earlier one."""
    sizes = {path: path.stat().st_size for path in files if path.is_file()}
    how_often = Counter(sizes.values())
    first: dict[tuple[int, str], Path] = {}
    found = {}
    for path, size in sizes.items():
        if how_often[size] < 2 or size == 0:
            continue
        other = first.setdefault((size, hash_file(path)), path)
        if other is not path:
            found[path] = other
    return found
