"""Reserve an output for one run: refused early if it cannot be published, locked while it is worked on."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path

from linework.errors import OutputExistsError
from linework.files.locks import locked
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
        busy = OutputExistsError(
            "another run is writing it", where=path, advice="wait for it, or choose another name"
        )
        with locked(lock_path(path), busy):
            yield
    finally:
        with contextlib.suppress(OSError):
            for folder in missing:
                folder.rmdir()


def lock_path(path: Path) -> Path:
    """Return the lock of an output: a hidden file beside it."""
    return path.with_name(f".{path.name}"[:200] + ".lock")
