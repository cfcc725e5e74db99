"""What linework made in a work folder: listed before it is made, so that nothing else is ever removed.

The list is a text file in the work folder, ``linework-made.txt``: a name per line, relative to the folder. A folder
without it holds nothing of linework, whatever the folders in it are called.
"""

from __future__ import annotations

import contextlib
import os
import re
import stat
from collections.abc import Iterator, Sequence
from pathlib import Path

from linework.errors import OutputExistsError, argument
from linework.files.output.locks import hold_lock
from linework.files.output.publish import machine_errors
from linework.files.output.replace import make_durable

LIST = "linework-made.txt"
STORES, RUNS = "stores", "runs"
#: Folders that hold what is made; they may hold things of others too.
FOLDERS = (".", STORES, RUNS)
#: Names that may be listed: the folder itself, one in it, or one in a folder in it. A list from elsewhere can name no
#: place outside of the work folder.
_NAME = re.compile(r"\.|stores|runs|(stores|runs)/[A-Za-z0-9][\w.-]*")
_HEAD = "# Made by linework, and removed by `linework clean`. What is not listed here is left alone.\n"
#: Names of the files in stores and runs, parts of unfinished ones among them. Others were put there by somebody else, and
#: stay. Lines lie in a folder of their own while a job of the workbench makes them.
_FILES = re.compile(
    r"\d+\.points|runs\.npy|(store|surface|run)\.json|[\w.+-]+\.arrays|surface-[\w.+-]+\.lock|journal\.sqlite|live\.jsonl"
    r"|(given|located)-[0-9a-f]{16}\.csv|pairs-[0-9a-f]{16}\.json|\.[\w.+-]+\.part(\.\w+)?"
)
_JOB_FOLDER, _JOB_FILES = "runs/workbench-", re.compile(r"\.?lines\.([\w.-]*\.)?gpkg(\.run\.json|\.lock)?")
_ELSEWHERE = f"move it away, or name another folder with {argument('work')}"
_JOURNALS = ("-journal", "-wal", "-shm")


def is_listed(work: Path) -> bool:
    """Return whether a work folder has a list of what linework made in it."""
    return (work / LIST).is_file() and not (work / LIST).is_symlink()


def claim(work: Path, name: str) -> None:
    """List what is about to be made in a work folder, such as "stores/1b2c"; what is listed already may be there.

    Raises
    ------
    OutputExistsError
        It is there, and linework did not make it.
    MachineError
        The folder cannot be written to.
    """
    with listing(work) as listed:
        check_no_links(work, name)
        if name not in listed and os.path.lexists(work / name):
            raise OutputExistsError(
                f"was not made by linework: {LIST} does not name it", where=work / name, advice=_ELSEWHERE
            )
        _add(work, [name], listed)


def check_no_links(work: Path, *names: str) -> None:
    """Check that names in a work folder do not lead out of it.

    Raises
    ------
    OutputExistsError
        One is a link, or lies in a folder that is one.
    """
    for name in dict.fromkeys(part for full in names for part in (full.partition("/")[0], full)):
        if (work / name).is_symlink():
            raise _link_error(work / name)


def _link_error(path: Path) -> OutputExistsError:
    return OutputExistsError("is a link, and links are not followed", where=path, advice=_ELSEWHERE)


def list_made(work: Path, names: Sequence[str]) -> None:
    """List folders of a work folder that are made now, or have just been: ".", "stores" or "runs"."""
    with listing(work) as listed:
        _add(work, names, listed)


def _add(work: Path, names: Sequence[str], listed: Sequence[str]) -> None:
    assert all(_NAME.fullmatch(name) for name in names), names
    text = "".join(f"{name}\n" for name in names if name not in listed)
    if not text and is_listed(work):
        return
    if (work / LIST).is_symlink():
        raise _link_error(work / LIST)
    with machine_errors(work), (work / LIST).open("ab") as file:
        file.write(((_HEAD if not file.tell() else "") + text).encode())
    make_durable(work / LIST)


@contextlib.contextmanager
def listing(work: Path) -> Iterator[list[str]]:
    """Hold the list of a work folder, so that nothing is added meanwhile, and yield its names."""
    with hold_lock(work / f"{LIST}.lock"):
        yield _names(work)


def _names(work: Path) -> list[str]:
    if not is_listed(work):
        return []
    with machine_errors(work):
        lines = (work / LIST).read_text(encoding="utf-8", errors="replace").splitlines()
    return [line for line in dict.fromkeys(lines) if _NAME.fullmatch(line)]


def remove_made(work: Path, name: str) -> tuple[int, list[Path]]:
    """Remove a file or folder that linework made in a work folder; links are not followed.

    Folders for stores and runs are removed if they are empty.

    Returns
    -------
    n_bytes, kept
        Freed space [bytes], and what was left alone: links, and files of others in a folder of linework.
    """
    if name not in _names(work):
        return 0, []
    if name in FOLDERS:
        with contextlib.suppress(OSError):
            (work / name).rmdir()
        return 0, []
    kind, _, key = name.partition("/")
    if (work / kind).is_symlink():
        return 0, [work / kind]
    # A store that was killed while it was built has the second name
    with_lines = name.startswith(_JOB_FOLDER)
    removed = [_remove_tree(path, with_lines) for path in (work / name, work / kind / f".{key}.part")]
    return sum(n_bytes for n_bytes, _ in removed), [path for _, kept in removed for path in kept]


def _remove_tree(path: Path, with_lines: bool) -> tuple[int, list[Path]]:
    """Remove the files of linework in a folder, and the folders that are empty then."""
    n_bytes, kept = _remove_file(path, with_lines) if path.is_symlink() or not path.is_dir() else (0, [])
    if not path.is_symlink():
        for folder, folders, files in os.walk(path, topdown=False):
            for one in (*files, *folders):
                freed, left = _remove_file(Path(folder, one), with_lines)
                n_bytes, kept = n_bytes + freed, kept + left
        with contextlib.suppress(OSError):
            path.rmdir()
    return n_bytes, kept


def _remove_file(path: Path, with_lines: bool) -> tuple[int, list[Path]]:
    """Remove a file of linework, or a folder that is empty by now."""
    with contextlib.suppress(FileNotFoundError):
        status = path.lstat()
        if stat.S_ISDIR(status.st_mode):
            with contextlib.suppress(OSError):
                path.rmdir()
            return 0, []
        name = path.name
        for ending in _JOURNALS:
            name = name.removesuffix(ending)
        is_ours = _FILES.fullmatch(name) or (with_lines and _JOB_FILES.fullmatch(name))
        if not stat.S_ISREG(status.st_mode) or not is_ours:
            return 0, [path]
        path.unlink()
        return status.st_size, []
    return 0, []
