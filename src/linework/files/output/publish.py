"""Publish an output: write it beside its place, verify it by re-opening, make it durable, rename it."""

from __future__ import annotations

import contextlib
import errno
import os
import re
import shutil
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path

from linework.errors import (
    FREE_SPACE,
    LineworkError,
    MachineError,
    OutputExistsError,
    UsageError,
    argument,
    is_full_disk,
)
from linework.files.input import is_address
from linework.processes.forced_end import removed_if_forced
from linework.processes.system import is_alive

#: Makes the content of a file beside an output from the verified part file of the output.
FileBeside = Callable[[Path], bytes | None]
#: Parts that threads of this process write now.
_WRITING: set[Path] = set()
_TURN = threading.Lock()
#: Longest file name most file systems hold, in bytes.
_NAME_MAX = 255


def check_output(path: Path, *, overwrite: bool = False) -> None:
    """Refuse, before any work is done, an output that could not be published at the end.

    The parent folder is created if it is missing, and a file is created in it as a test.

    Raises
    ------
    OutputExistsError
        `path` is there already and `overwrite` is not set, or it is a folder.
    MachineError
        The parent is not a folder, or cannot be written to.
    """
    part = part_path(path)
    with machine_errors(path):
        if path.is_dir():
            raise OutputExistsError(
                "is a folder, expected the name of a file", where=path, advice="name a file"
            )
        if os.path.lexists(path) and not overwrite:
            raise OutputExistsError(
                "output exists already",
                where=path,
                advice=f"choose another name or give {argument('overwrite', True)}",
            )
        _make_parent(path)
        _clear_own_part(path)
        part.open("xb").close()
        part.unlink()


def publish(
    path: Path,
    write: Callable[[Path], None],
    verify: Callable[[Path], None],
    *,
    overwrite: bool = False,
    beside: Mapping[Path, FileBeside] | None = None,
) -> None:
    """Write the file `path` whole or not at all.

    Parameters
    ----------
    write
        Writes the part file it is given.
    verify
        Re-opens the part file with an independent reader and raises if anything is wrong.
    overwrite
        Replace an existing file; it stays until the new one is verified.
    beside
        Files that belong to it, in the same folder, and what makes their content from the verified part file; None:
        there must be none. They are replaced whether `overwrite` is set or not.

    Raises
    ------
    OutputExistsError
        `path` exists and `overwrite` is not set.
    MachineError
        The folder is missing, full, read-only; or the written file does not verify.

    Notes
    -----
    Order: part files, verify, fsync(files), rename those beside, fsync(folder), rename the file, fsync(folder). The
    file never stands beside what belonged to an older one. If it cannot be renamed, those beside become what they
    were. Whatever interrupts it, the parts are removed; parts left by processes that were killed are removed by the
    next run that publishes the same name on the same machine.
    """
    beside = beside or {}
    check_output(path, overwrite=overwrite)
    for output in (path, *beside):
        _remove_dead_parts(output)
    for side in beside:
        _remove_dead_parts(_kept_name(side))
    part = part_path(path)
    with _writing(path), removed_if_forced(part):
        try:
            with machine_errors(path):
                write(part)
                _verified(part, path, verify)
                sync(part)
                for side, content in beside.items():
                    _write_part(content(part), side)
                if os.path.lexists(path) and not overwrite:
                    raise OutputExistsError(
                        "output appeared while it was being written",
                        where=path,
                        advice=f"give {argument('overwrite', True)}",
                    )
                with _replacing(beside, part):
                    if beside:
                        sync(path.parent)
                    part.replace(path)
                sync(path.parent)
        finally:
            for output in (path, *beside):
                _remove_part(part_path(output))


def _verified(part: Path, path: Path, verify: Callable[[Path], None]) -> None:
    """Verify a part; whatever its reader says against what was just written is a fault of the disk."""
    try:
        verify(part)
    except MachineError:
        raise
    except (LineworkError, ValueError, EOFError) as error:
        raise MachineError(
            f"the written file does not read back ({str(error)[:100]})", where=path,
            advice="check the disk and its free space",
        ) from error  # fmt: skip


def _write_part(content: bytes | None, side: Path) -> None:
    """Write and verify the part of a file beside an output; None: it will be removed, and there is no part."""
    if content is None:
        return
    part = part_path(side)
    with machine_errors(side):
        part.write_bytes(content)
        if part.read_bytes() != content:
            raise OSError("the file reads back differently")
        sync(part)


@contextlib.contextmanager
def _replacing(sides: Iterable[Path], main: Path) -> Iterator[None]:
    """Put the parts of files in their places, where they stay if the part `main` gets its name in the context."""
    kept: dict[Path, Path] = {}
    placed: list[Path] = []
    try:
        for side in sides:
            if os.path.lexists(side):
                kept[side] = part_path(_kept_name(side))
                _link_or_copy(side, kept[side])
        for side in sides:
            placed.append(side)
            if part_path(side).exists():
                part_path(side).replace(side)
            else:
                side.unlink(missing_ok=True)
        yield
    except BaseException:
        # An interrupt may come just after the rename
        for side in placed if main.exists() else ():
            with contextlib.suppress(OSError):
                if side in kept:
                    kept[side].replace(side)
                else:
                    side.unlink(missing_ok=True)
        raise
    finally:
        for old in kept.values():
            _remove_part(old)


def _kept_name(side: Path) -> Path:
    """Return the name under which an old file is kept until the new output is in place."""
    return side.with_name(f"{side.stem}.old{side.suffix}")


def _link_or_copy(path: Path, kept: Path) -> None:
    kept.unlink(missing_ok=True)
    try:
        os.link(path, kept, follow_symlinks=False)
    except (OSError, NotImplementedError):
        # Not every file system has hard links
        shutil.copy2(path, kept, follow_symlinks=False)


def publish_folder(
    path: Path,
    write: Callable[[Path], None],
    verify: Callable[[Path], None],
    *,
    overwrite: bool = False,
) -> None:
    """Write the folder `path` with all its files or not at all.

    With `overwrite` an existing folder keeps its other files; those of the same name are replaced one by one after
    all new ones have been verified.

    Raises
    ------
    OutputExistsError
        `path` is a file, or a folder that is not empty while `overwrite` is not set.
    MachineError
        As for `publish`.
    """
    path = named_folder(path)
    check_output_folder(path, overwrite=overwrite)
    _remove_dead_parts(path)
    part = part_path(path)
    with _writing(path), removed_if_forced(part):
        try:
            with machine_errors(path):
                part.mkdir()
                write(part)
                _verified(part, path, verify)
                for file in sorted(p for p in part.rglob("*") if p.is_file()):
                    sync(file)
                if path.is_dir() and any(path.iterdir()):
                    _merge_folder(part, path)
                else:
                    part.replace(path)
                sync(path.parent)
        finally:
            _remove_part(part)


def check_output_folder(path: Path, *, overwrite: bool = False) -> None:
    """Refuse, before any work is done, a folder that could not be published at the end (see `check_output`)."""
    if os.path.lexists(path) and not path.is_dir():
        raise OutputExistsError("is a file, expected a folder", where=path, advice="name another folder")
    if path.is_dir() and not overwrite and any(path.iterdir()):
        raise OutputExistsError(
            "output folder is not empty",
            where=path,
            advice=f"choose another folder or give {argument('overwrite', True)}",
        )
    _make_parent(path)
    _clear_own_part(path)
    part = part_path(path)
    with machine_errors(path):
        part.mkdir()
        part.rmdir()


@contextlib.contextmanager
def _writing(path: Path) -> Iterator[None]:
    """Let no other thread write the part of this output during the context: it would have the same name."""
    with _TURN:
        _check_not_writing(path)
        _WRITING.add(part_path(path).absolute())
    try:
        yield
    finally:
        _WRITING.remove(part_path(path).absolute())


def _check_not_writing(path: Path) -> None:
    if part_path(path).absolute() in _WRITING:
        raise OutputExistsError(
            "is being written by this program already",
            where=path,
            advice="wait for it, or choose another name",
        )


def _clear_own_part(path: Path) -> None:
    """Remove a part that has this process's number, left by an earlier one: in a container they all have the same."""
    with _TURN:
        _check_not_writing(path)
        _remove_part(part_path(path))


def named_folder(path: Path) -> Path:
    """Return a folder by its name: "." and "../.." have none that a part file could be named by."""
    return path.resolve() if path.name in ("", "..") else path


def part_path(path: Path) -> Path:
    """Return the path of the part file: hidden, beside `path`, with the process number and the same suffix.

    >>> import os
    >>> part_path(Path("d/lines.gpkg")).name == f".lines.{os.getpid()}.part.gpkg"
    True
    """
    return path.with_name(f".{_part_stem(path)}.{os.getpid()}.part{path.suffix}")


def _part_stem(path: Path) -> str:
    """Return the name without suffix, shortened, and without characters that GDAL rejects (line ends)."""
    plain = "".join(c if c.isprintable() else "_" for c in path.stem)
    room = _NAME_MAX - len(os.fsencode(f"..{2**32}.part{path.suffix}"))
    return os.fsencode(plain)[:room].decode(errors="ignore")


def _make_parent(path: Path) -> None:
    if is_address(path):
        raise UsageError("is not a file on this machine", where=path, advice="write a file and copy it there")
    parent = path.parent
    if os.path.lexists(parent) and not parent.is_dir():
        raise MachineError(f"{parent} is not a folder", where=path, advice="choose another place")
    with machine_errors(path):
        parent.mkdir(parents=True, exist_ok=True)


@contextlib.contextmanager
def machine_errors(path: Path) -> Iterator[None]:
    """Turn errors of the operating system into one line that names the output."""
    try:
        yield
    except LineworkError as error:
        if error.where == part_path(path):
            error.where = path
        raise
    except OSError as error:
        reason = error.strerror or str(error) or type(error).__name__
        advice = {
            errno.ENOSPC: FREE_SPACE,
            errno.EDQUOT: "your quota is used up: free some space, or write to another disk",
            errno.EACCES: "choose a folder you may write to",
            errno.EPERM: "choose a folder you may write to",
            errno.EROFS: "the disk is read-only: choose another folder",
            errno.ENAMETOOLONG: "choose a shorter name",
        }.get(error.errno or 0, "choose another place, or check the disk")
        number = f" (errno {error.errno})" if error.errno else ""
        raise MachineError(f"cannot be written: {reason}{number}", where=path, advice=advice) from error
    except Exception as error:
        # Libraries that write by themselves have errors of their own
        if not is_full_disk(error):
            raise
        raise MachineError(f"cannot be written: {error}", where=path, advice=FREE_SPACE) from error


def sync(path: Path) -> None:
    """Wait until the disk holds a file, or a folder's names.

    Windows opens no folders: there names may be lost with the power, though not with a process.
    """
    is_posix = hasattr(os, "O_DIRECTORY")
    if not is_posix and path.is_dir():
        return
    # Windows synchronises only what is open for writing
    descriptor = os.open(path, os.O_RDONLY if is_posix else os.O_RDWR)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _merge_folder(part: Path, path: Path) -> None:
    for file in sorted(p for p in part.rglob("*") if p.is_file()):
        target = path / file.relative_to(part)
        target.parent.mkdir(parents=True, exist_ok=True)
        file.replace(target)
        sync(target.parent)


def _remove_part(part: Path) -> None:
    """Remove a part file and the journals that a driver may have left beside it."""
    with contextlib.suppress(OSError):
        if part.is_dir() and not part.is_symlink():
            shutil.rmtree(part, ignore_errors=True)
        for ending in ("", "-journal", "-wal", "-shm", ".aux.xml", ".ovr.tmp"):
            part.with_name(part.name + ending).unlink(missing_ok=True)


def _remove_dead_parts(path: Path) -> None:
    """Remove part files of this output whose process has ended."""
    pattern = re.compile(r"\." + re.escape(_part_stem(path)) + r"\.(\d+)\.part" + re.escape(path.suffix))
    with contextlib.suppress(OSError):
        for other in sorted(path.parent.iterdir()):
            found = pattern.fullmatch(other.name)
            if found and not is_alive(int(found[1])):
                _remove_part(other)


def write_bytes(content: bytes, path: Path, *, overwrite: bool = False) -> None:
    """Publish a file of the given bytes: whole, verified, or not at all.

    Raises
    ------
    OutputExistsError, MachineError
        As for `publish`.
    """

    def write(part: Path) -> None:
        part.write_bytes(content)

    def verify(part: Path) -> None:
        if part.read_bytes() != content:
            raise OSError("the file reads back differently")

    publish(path, write, verify, overwrite=overwrite)


def write_page(html: str, path: Path, *, overwrite: bool = False) -> None:
    """Publish a page as UTF-8 (see `write_bytes`)."""
    write_bytes(html.encode("utf-8", errors="backslashreplace"), path, overwrite=overwrite)
