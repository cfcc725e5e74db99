"""The work folder of a survey: tile stores and unfinished runs, all of which can be rebuilt.

Its content::

    .linework/
        stores/<key>/       points of one state of the input files, and the surfaces found in them
        runs/<key>/         journal and lines of the tiles of a run that is not finished
        *.lock              held by the process that makes or uses what they are named for
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import shutil
import tempfile
from collections.abc import Sequence
from pathlib import Path

from linework.errors import InputError, MachineError, OutputExistsError, argument
from linework.files.output.locks import hold_lock
from linework.files.output.publish import machine_errors

NAME = ".linework"
STORES, RUNS = "stores", "runs"


def work_folder(root: Path, given: Path | None = None) -> Path:
    """Return the work folder of a survey, created if it is missing.

    It is in `root`, beside the survey; if that cannot be written, in the user's cache.

    Raises
    ------
    MachineError
        `given` is not a folder, or cannot be written.
    """
    if given is not None:
        _make(given)
        return given
    beside = root / NAME
    try:
        _make(beside)
    except MachineError:
        elsewhere = _in_cache(root)
        _make(elsewhere)
        return elsewhere
    return beside


def survey_root(inputs: Sequence[Path]) -> Path:
    """Return the folder of a survey: the one that was named, or the one of the first file."""
    return inputs[0] if inputs[0].is_dir() else inputs[0].parent


def existing_work_folders(root: Path, given: Path | None = None) -> list[Path]:
    """Return the work folders of a survey that exist."""
    candidates = [given] if given is not None else [root / NAME, _in_cache(root)]
    return [folder for folder in candidates if folder.is_dir()]


def clean_work_folder(folder: Path) -> int:
    """Remove what linework has written to a work folder, and the folder if it is then empty.

    Returns
    -------
    int
        Freed space. [bytes]

    Raises
    ------
    OutputExistsError
        A run is using it.
    InputError
        It is not a work folder.
    """
    ours = [
        path for path in sorted(folder.iterdir()) if path.name in (STORES, RUNS) or path.suffix == ".lock"
    ]
    if not ours and any(folder.iterdir()):
        raise InputError(
            "is not a work folder of linework",
            where=folder,
            advice=f"name the folder given as {argument('work')}",
        )
    held = contextlib.ExitStack()
    with held, machine_errors(folder):
        for lock in [path for path in ours if path.suffix == ".lock"]:
            held.enter_context(hold_lock(lock, folder_in_use_error(folder)))
        n_bytes = sum(f.stat().st_size for path in ours for f in path.rglob("*") if f.is_file())
        for path in ours:
            shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)
    with contextlib.suppress(OSError):
        folder.rmdir()
    return n_bytes


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
        for name in (STORES, RUNS):
            (folder / name).mkdir(parents=True, exist_ok=True)
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
