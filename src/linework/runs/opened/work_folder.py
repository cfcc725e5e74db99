"""The work folder of a survey: tile stores and unfinished runs, all of which can be rebuilt.

Its content::

    .linework/
        stores/<key>/       points of one state of the input files, and the surfaces found in them
        runs/<key>/         journal and lines of the tiles of a run that is not finished
        *.lock              held by the process that makes or uses what they are named for
        linework-made.txt  lists what linework made, and may remove: `linework.runs.opened.made`
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from linework.errors import InputError, MachineError, OutputExistsError, argument
from linework.files.output.locks import hold_lock
from linework.files.output.publish import machine_errors
from linework.files.survey.open import root_of
from linework.runs.opened.made import (
    FOLDERS,
    LIST,
    RUNS,
    STORES,
    check_no_links,
    is_listed,
    list_made,
    listing,
    remove_made,
)

NAME = ".linework"


def work_folder(root: Path, given: Path | None = None) -> Path:
    """Return the work folder of a survey, created if it is missing.

    It is in `root`, beside the survey; if that cannot be written, in the user's cache.

    Raises
    ------
    MachineError
        `given` is not a folder, or cannot be written.
    OutputExistsError
        The one beside the survey, or what is in it, is a link: it may lead anywhere.
    """
    if given is not None:
        _make(given)
        return given
    beside = root / NAME
    check_no_links(root, NAME)
    try:
        _make(beside)
    except MachineError:
        elsewhere = _in_cache(root)
        _make(elsewhere)
        return elsewhere
    return beside


def survey_root(inputs: Sequence[Path]) -> Path:
    """Return the folder of a survey: the one that was named, or the one of the first file on this machine."""
    return root_of(inputs)


def existing_work_folders(root: Path, given: Path | None = None) -> list[Path]:
    """Return the work folders of a survey that exist."""
    candidates = [given] if given is not None else [root / NAME, _in_cache(root)]
    return [folder for folder in candidates if folder.is_dir()]


@dataclass(frozen=True, slots=True)
class Cleaned:
    """What cleaning a work folder came to.

    Parameters
    ----------
    n_bytes
        Freed space. [bytes]
    kept
        What linework did not make, or reached only through links.
    """

    n_bytes: int
    kept: tuple[Path, ...]


def clean_work_folder(folder: Path) -> Cleaned:
    """Remove what linework made in a work folder, and the folder if linework made that too and it is then empty.

    Raises
    ------
    OutputExistsError
        A run is using it.
    InputError
        It is not a work folder, or a link to one.
    """
    if folder.is_symlink():
        raise InputError(
            "is a link, and links are not followed", where=folder,
            advice=f"name the folder itself as {argument('work')}, if it is linework's",
        )  # fmt: skip
    if not is_listed(folder):
        raise InputError(
            f"is not a work folder of linework: it has no {LIST}", where=folder,
            advice=f"name the folder given as {argument('work')}, or delete it yourself",
        )  # fmt: skip
    n_bytes, kept = 0, list[Path]()
    held = contextlib.ExitStack()
    with listing(folder) as made, held, machine_errors(folder):
        for lock in [_lock_of(folder, name) for name in made]:
            if lock is not None and lock.is_file() and not lock.is_symlink():
                held.enter_context(hold_lock(lock, folder_in_use_error(folder)))
        # What is in a folder goes before it
        for name in sorted(made, reverse=True):
            if name != ".":
                freed, left = remove_made(folder, name)
                n_bytes, kept = n_bytes + freed, kept + left
        held.close()
        kept = list(dict.fromkeys([*kept, *_left_in(folder)]))
        if not any(os.path.lexists(folder / name) for name in made if name not in FOLDERS):
            (folder / LIST).unlink()
    if "." in made:
        with contextlib.suppress(OSError):
            folder.rmdir()
    return Cleaned(n_bytes, tuple(kept))


def _lock_of(folder: Path, name: str) -> Path | None:
    """Return the lock of a store or run: it is in use while that is held."""
    kind, _, key = name.partition("/")
    return folder / f"{kind.removesuffix('s')}-{key}.lock" if key else None


def _left_in(folder: Path) -> list[Path]:
    """Return what is in a work folder beside its list, the folders for stores and runs without their content last."""
    return [
        path
        for place in (folder, folder / STORES, folder / RUNS)
        if place.is_dir() and not place.is_symlink()
        for path in sorted(place.iterdir())
        if path.parent != folder or path.name not in (STORES, RUNS, LIST, f"{LIST}.lock")
    ]


def folder_in_use_error(folder: Path) -> OutputExistsError:
    """Return the error to raise if another run uses a work folder."""
    return OutputExistsError("another run is using it", where=folder, advice="wait for it")


def _make(folder: Path) -> None:
    """Create a folder and check that files can be created in it."""
    if os.path.lexists(folder) and not folder.is_dir():
        raise MachineError(
            "is not a folder", where=folder, advice=f"name another place with {argument('work')}"
        )
    with machine_errors(folder):
        check_no_links(folder, STORES, RUNS, LIST)
        made = [] if folder.is_dir() else ["."]
        folder.mkdir(parents=True, exist_ok=True)
        made += [name for name in (STORES, RUNS) if not os.path.lexists(folder / name)]
        if made or not is_listed(folder):
            list_made(folder, made)
        for name in (STORES, RUNS):
            (folder / name).mkdir(exist_ok=True)
        with tempfile.TemporaryFile(dir=folder / RUNS):
            pass


def _in_cache(root: Path) -> Path:
    """Return the survey's folder in the user's cache; without a home folder, among the temporary files."""
    given = os.environ.get("XDG_CACHE_HOME", "")
    try:
        base = Path(given) if given else Path.home() / ".cache"
    except RuntimeError:
        base = Path(tempfile.gettempdir())
    return base / "linework" / hashlib.sha256(os.fsencode(root.resolve())).hexdigest()[:16]
