"""Reserve an output for one run: refused early if it cannot be published, locked while it is worked on."""

from __future__ import annotations

import contextlib
import fcntl
import os
from collections.abc import Iterator
from pathlib import Path

from linework.errors import OutputExistsError
from linework.files.publish import check_output


@contextlib.contextmanager
def reserved_output(path: Path, *, overwrite: bool = False) -> Iterator[None]:
    """Hold the output `path` for what is done inside.

    Folders made for it are taken away again if nothing was put into them.

    Raises
    ------
    OutputExistsError
        It exists and `overwrite` is not set, or another run holds it.
    MachineError
        It could not be written.

    Notes
    -----
    The lock is an advisory one on a hidden file beside the output: the system frees it when the process
    ends, however it ends, and the next run takes over the file that a killed one leaves.
    """
    missing = [folder for folder in (path.parent, *path.parent.parents) if not folder.exists()]
    try:
        check_output(path, overwrite=overwrite)
        with _locked(path):
            yield
    finally:
        with contextlib.suppress(OSError):
            for folder in missing:
                folder.rmdir()


@contextlib.contextmanager
def _locked(path: Path) -> Iterator[None]:
    lock = path.with_name(f".{path.name}"[:200] + ".lock")
    while True:
        handle = os.open(lock, os.O_RDWR | os.O_CREAT, 0o666)
        try:
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise OutputExistsError(
                    "another run is writing it", where=path, advice="wait for it, or choose another name"
                ) from None
            # The run before may have removed the name between our opening and our locking it
            if not _is_named(handle, lock):
                continue
            try:
                yield
            finally:
                lock.unlink(missing_ok=True)
            return
        finally:
            os.close(handle)


def _is_named(handle: int, path: Path) -> bool:
    with contextlib.suppress(FileNotFoundError):
        return os.path.samestat(os.fstat(handle), path.stat())
    return False
