"""Intermediate results of a run, one file per piece: columns by name, written whole or not at all."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from linework.errors import MachineError
from linework.files.array_file import is_file_of, read_named_arrays, write_named_arrays
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
    return write_named_arrays(
        path, {name: np.asarray(column) for name, column in columns.items() if column is not None}
    )


def read_part(kind: type[PartT], path: Path, sha256: str) -> PartT | None:
    """Return what `write_part` wrote, or None where the file is missing or has other bytes."""
    try:
        columns = read_named_arrays(path, sha256)
    except (FileNotFoundError, MachineError):
        return None
    return kind(**{name: column if column.ndim else column.item() for name, column in columns.items()})


def read_path_part(path: Path) -> Trajectory:
    """Return the trajectory of a part that this run has written, without checking its bytes.

    Raises
    ------
    FileNotFoundError
        There is none.
    MachineError
        It cannot be read.
    """
    columns: dict[str, Any] = read_named_arrays(path)
    return Trajectory(**columns)


def part_is_whole(path: Path, sha256: str) -> bool:
    """Return whether a part exists and is what was written."""
    return is_file_of(path, sha256)
