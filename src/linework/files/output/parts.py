"""Intermediate results of a run: files of columns, written whole or not at all."""

from __future__ import annotations

import hashlib
import io
import os
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, cast

import numpy as np

from linework.arrays import AnyArray
from linework.files.output.publish import machine_errors
from linework.model.trajectory import Trajectory

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

PartT = TypeVar("PartT")


def write_part(value: DataclassInstance, path: Path) -> str:
    """Write a dataclass of columns and return the SHA-256 of the file: equal values give equal bytes.

    Parameters
    ----------
    value
        Its fields are arrays, strings or None: lines, boxes, sightings, a trajectory.

    Raises
    ------
    MachineError
        The folder is full, read-only or missing.
    """
    columns = {field.name: getattr(value, field.name) for field in fields(value)}
    return _write({name: np.asarray(column) for name, column in columns.items() if column is not None}, path)


def read_part(kind: type[PartT], path: Path, sha256: str) -> PartT | None:
    """Return what `write_part` wrote, or None where the file is missing or has other bytes."""
    columns = _read(path, sha256)
    return None if columns is None else kind(**columns)


def read_path_part(path: Path) -> Trajectory:
    """Return the trajectory of a part that this run has written, without checking its bytes."""
    with np.load(path, allow_pickle=False) as held:
        return Trajectory(**{name: held[name] for name in held.files})


def part_is_whole(path: Path, sha256: str) -> bool:
    """Return whether a part is there and is what was written."""
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest() == sha256
    except OSError:
        return False


def _write(columns: Mapping[str, AnyArray], path: Path) -> str:
    held = io.BytesIO()
    np.savez(held, **cast(Any, columns))
    data = held.getvalue()
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    with machine_errors(path):
        try:
            with part.open("wb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
            part.replace(path)
        finally:
            part.unlink(missing_ok=True)
    return hashlib.sha256(data).hexdigest()


def _read(path: Path, sha256: str) -> dict[str, Any] | None:
    """Return the columns of a part; a string is an array without dimensions in the file."""
    try:
        data = path.read_bytes()
    except OSError:
        return None
    if hashlib.sha256(data).hexdigest() != sha256:
        return None
    with np.load(io.BytesIO(data), allow_pickle=False) as held:
        columns = {name: held[name] for name in held.files}
    return {name: column if column.ndim else column.item() for name, column in columns.items()}
