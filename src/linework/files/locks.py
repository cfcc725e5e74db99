"""Locks between processes: files that are held, and let go by the system when their holder ends, however it ends."""

from __future__ import annotations

import contextlib
import fcntl
import os
from collections.abc import Iterator
from pathlib import Path

from linework.errors import OutputExistsError
from linework.files.publish import machine_errors


@contextlib.contextmanager
def locked(
    lock: Path, refusal: OutputExistsError | None = None, *, shared: bool = False, keep: bool = False
) -> Iterator[None]:
    """Hold a lock file for what is done inside.

    Parameters
    ----------
    refusal
        Raised where another process holds it; None: wait for that.
    shared
        Others may hold it too, if they share it.
    keep
        Leave the file: a shared lock's name must not go while others hold it.

    Raises
    ------
    MachineError
        The file cannot be made.
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
            # The holder before may have removed the name between our opening and our locking it
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
