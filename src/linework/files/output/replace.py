"""Replace one file or folder whole: written beside its place, then renamed; for files of the work folder.

What a user asked for goes through `linework.files.output.publish`, which also verifies it by re-opening.
"""

from __future__ import annotations

import contextlib
import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from linework.files.output.publish import machine_errors, part_path, sync


@contextlib.contextmanager
def replacing(path: Path, *, durable: bool = True) -> Iterator[BinaryIO]:
    """Yield a file to write to; it takes the place of `path` if nothing fails, else it is removed.

    Parameters
    ----------
    durable
        Whether the disk must hold the bytes before the rename; not needed for what is synced later, or can be
        made again.

    Raises
    ------
    MachineError
        The folder is full, read-only or gone.
    """
    part = part_path(path)
    with machine_errors(path):
        try:
            with part.open("wb") as file:
                yield file
                if durable:
                    file.flush()
                    os.fsync(file.fileno())
            part.replace(path)
        finally:
            part.unlink(missing_ok=True)


def replace_file(path: Path, data: bytes) -> None:
    """Write a file of these bytes, whole or not at all, and durable when this returns.

    Raises
    ------
    MachineError
        The folder is full, read-only or gone.
    """
    with replacing(path) as file:
        file.write(data)


@contextlib.contextmanager
def replacing_folder(folder: Path) -> Iterator[Path]:
    """Yield an empty folder to fill; it gets the name `folder`, which must be free, if nothing fails.

    Its name holds no process number, so that the next attempt removes what a killed one left.

    Raises
    ------
    MachineError
        The disk is full, read-only or gone.
    """
    part = folder.with_name(f".{folder.name}.part")
    with machine_errors(folder):
        shutil.rmtree(part, ignore_errors=True)
        part.mkdir(parents=True)
        try:
            yield part
            part.replace(folder)
        finally:
            shutil.rmtree(part, ignore_errors=True)


def make_durable(path: Path) -> None:
    """Wait until the disk holds a file, or a folder's names.

    Raises
    ------
    MachineError
        The disk is full, or failed.
    """
    with machine_errors(path):
        sync(path)
