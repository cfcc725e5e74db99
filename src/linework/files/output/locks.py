"""Lock files between processes; the system releases them when the holder ends, however it ends."""

from __future__ import annotations

import contextlib
import fcntl
import os
from collections.abc import Iterator
from pathlib import Path

from linework.errors import OutputExistsError
from linework.files.output.publish import check_output, machine_errors


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
        Leave the file in place: that of a shared lock must not be removed while others hold it.

    Raises
    ------
    MachineError
        The file cannot be created.
    """
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
def reserve_output(path: Path, *, overwrite: bool = False) -> Iterator[None]:
    """Reserve the output `path` during the context: checked first, then locked.

    Folders created for it are removed again if they stay empty.

    Raises
    ------
    OutputExistsError
        It exists and `overwrite` is not set, or another run holds it.
    MachineError
        It could not be written.

    Notes
    -----
    The lock is an advisory one on a hidden file beside the output. The system frees it when the process ends,
    however it ends; the next run reuses the file that a killed one leaves.
    """
    missing = [folder for folder in (path.parent, *path.parent.parents) if not folder.exists()]
    try:
        check_output(path, overwrite=overwrite)
        busy = OutputExistsError(
            "another run is writing it", where=path, advice="wait for it, or choose another name"
        )
        with hold_lock(lock_path(path), busy):
            yield
    finally:
        with contextlib.suppress(OSError):
            for folder in missing:
                folder.rmdir()


def lock_path(path: Path) -> Path:
    """Return the lock of an output: a hidden file beside it."""
    return path.with_name(f".{path.name}"[:200] + ".lock")
