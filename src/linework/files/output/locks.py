"""Lock files between processes; the system releases them when the holder ends, however it ends.

The only file that uses the module `fcntl`. Where a system has none, the lock file is an empty SQLite database, and the
lock is one of SQLite's own, which exist on every system, shared ones too.
"""

from __future__ import annotations

import contextlib
import os
import sqlite3
from collections.abc import Iterable, Iterator
from pathlib import Path

from linework.errors import OutputExistsError
from linework.files.output.inputs import check_not_read, reserved
from linework.files.output.publish import (
    check_output,
    check_output_folder,
    machine_errors,
    named_folder,
)
from linework.processes.forced_end import removed_if_forced

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

#: SQLite polls for a lock that another process holds, up to its longest time (2^31 ms). [s]
_LONGEST_WAIT_S = 2e6


@contextlib.contextmanager
def hold_lock(
    lock: Path, refusal: OutputExistsError | None = None, *, shared: bool = False, keep: bool = False
) -> Iterator[None]:
    """Hold a lock file during the context.

    Parameters
    ----------
    refusal
        Raised where another process holds it; None: wait.
    shared
        Other processes may hold it at the same time, if they share it too.
    keep
        Leave the file in place: that of a shared lock must not be removed while others hold it. Where there is no
        flock(2) it always stays.

    Raises
    ------
    MachineError
        The file cannot be created.
    """
    if fcntl is None:
        with _hold_in_sqlite(lock, refusal, shared=shared):
            yield
        return
    kind = (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | (fcntl.LOCK_NB if refusal is not None else 0)
    while True:
        with machine_errors(lock):
            handle = os.open(lock, os.O_RDWR | os.O_CREAT, 0o666)
        try:
            try:
                fcntl.flock(handle, kind)
            except BlockingIOError:
                assert refusal is not None
                raise refusal from None
            # The previous holder may have removed the file between our opening and locking it
            if not _is_named(handle, lock):
                continue
            try:
                with contextlib.nullcontext() if keep else removed_if_forced(lock):
                    yield
            finally:
                if not keep:
                    lock.unlink(missing_ok=True)
            return
        finally:
            os.close(handle)


def _is_named(handle: int, path: Path) -> bool:
    with contextlib.suppress(FileNotFoundError):
        return os.path.samestat(os.fstat(handle), path.stat())
    return False


@contextlib.contextmanager
def _hold_in_sqlite(lock: Path, refusal: OutputExistsError | None, *, shared: bool) -> Iterator[None]:
    """Hold the lock of an empty database during the context (see `hold_lock`).

    The file stays: SQLite does not tell which file it has opened, so that it could not be known whether the previous
    holder has removed that one.
    """
    with machine_errors(lock):
        lock.touch()
    connection = sqlite3.connect(
        lock, timeout=0.0 if refusal is not None else _LONGEST_WAIT_S, isolation_level=None, check_same_thread=False
    )  # fmt: skip
    try:
        try:
            connection.execute("BEGIN" if shared else "BEGIN EXCLUSIVE")
            # The transaction of a reader begins with its first read
            connection.execute("SELECT count(*) FROM sqlite_master").fetchone()
        except sqlite3.OperationalError:
            if refusal is None:
                raise
            raise refusal from None
        yield
    finally:
        connection.close()


@contextlib.contextmanager
def reserve_output(
    path: Path, *, overwrite: bool = False, inputs: Iterable[Path | None] = ()
) -> Iterator[None]:
    """Reserve the output `path` during the context: checked first, then locked.

    Folders created for it are removed again if they stay empty.

    Parameters
    ----------
    inputs
        Files named by the user that the command reads; those of surveys follow when they are opened.

    Raises
    ------
    UsageError
        It is one of the files that the command reads; those are refused when they are opened, too.
    OutputExistsError
        It exists and `overwrite` is not set, or another run holds it.
    MachineError
        It could not be written.

    Notes
    -----
    The lock is an advisory one on a hidden file beside the output. The system frees it when the process ends,
    however it ends; the next run reuses the file that a killed one leaves.
    """
    check_not_read(path, inputs=inputs)
    with _removing_empty_parents(path):
        check_output(path, overwrite=overwrite)
        with hold_lock(lock_path(path), _busy(path)), reserved(path):
            # Another run may have finished it between the check and the lock
            check_output(path, overwrite=overwrite)
            yield


@contextlib.contextmanager
def reserve_folder(
    path: Path, *, overwrite: bool = False, inputs: Iterable[Path | None] = (), reads_it: bool = False
) -> Iterator[None]:
    """Reserve the output folder `path` during the context, as `reserve_output` does a file.

    Parameters
    ----------
    inputs
        Files named by the user that the command reads.
    reads_it
        The command reads again what it has written there.

    Raises
    ------
    UsageError
        It is, or holds, a survey that the command reads, or is a folder of its files.
    OutputExistsError
        It is a file, or holds files while `overwrite` is not set, or another run holds it.
    MachineError
        It could not be written.
    """
    path = named_folder(path)
    check_not_read(path, inputs=inputs, is_folder=True)
    with _removing_empty_parents(path), contextlib.ExitStack() as held:
        check_output_folder(path, overwrite=overwrite)
        held.enter_context(hold_lock(lock_path(path), _busy(path)))
        # Another run may have filled it between the check and the lock
        check_output_folder(path, overwrite=overwrite)
        if not reads_it:
            held.enter_context(reserved(path, is_folder=True))
        yield


@contextlib.contextmanager
def _removing_empty_parents(path: Path) -> Iterator[None]:
    """Remove folders that were created for an output if they stay empty."""
    missing = [folder for folder in (path.parent, *path.parent.parents) if not folder.exists()]
    try:
        with contextlib.ExitStack() as created:
            for folder in reversed(missing):
                created.enter_context(removed_if_forced(folder, only_empty=True))
            yield
    finally:
        with contextlib.suppress(OSError):
            for folder in missing:
                folder.rmdir()


def _busy(path: Path) -> OutputExistsError:
    return OutputExistsError(
        "another run is writing it", where=path, advice="wait for it, or choose another name"
    )


def lock_path(path: Path) -> Path:
    """Return the lock of an output: a hidden file beside it."""
    return path.with_name(f".{path.name}"[:200] + ".lock")
