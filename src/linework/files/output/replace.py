"""Replace one file or folder whole: written beside its place, then renamed; for files of the work folder.

What a user asked for goes through `linework.files.output.publish`, which also verifies it by re-opening.
"""

from __future__ import annotations

import contextlib
import glob
import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from linework.files.output.publish import machine_errors, part_path, sync
from linework.processes.system import is_alive


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


@contextlib.contextmanager
def set_record_aside(path: Path) -> Iterator[None]:
    """Take an old record away while its output is replaced; it comes back if that fails.

    The order is: old record away, new output in place, new record in place. Whenever the run is killed,
    no output stands beside the record of another.
    """
    _put_back(path)
    aside = path.with_name(f".{path.name}.{os.getpid()}.old")
    had_one = path.exists()
    if had_one:
        path.replace(aside)
    try:
        yield
    except BaseException:
        if had_one:
            aside.replace(path)
        raise
    aside.unlink(missing_ok=True)


def _put_back(path: Path) -> None:
    """Put back the old record that a killed run took away, or remove it where there is a newer one."""
    for aside in sorted(path.parent.glob(f".{glob.escape(path.name)}.*.old")):
        number = aside.name.removesuffix(".old").rpartition(".")[2]
        if number.isdigit() and not is_alive(int(number)):
            if path.exists():
                aside.unlink()
            else:
                aside.replace(path)
