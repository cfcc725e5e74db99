"""Intermediate results of a run, one file per tile or pair: lines, boxes, sightings, the trajectory.

Each file is written whole or not at all; its hash goes into the journal, and a file that has another is made anew.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from linework.arrays import AnyArray
from linework.errors import MachineError
from linework.files.array_file import is_file_of, read_named_arrays, write_named_arrays
from linework.model.boxes import BoxSet
from linework.model.lines import LINE_COLUMNS, VERTEX_COLUMNS, LineSet
from linework.model.sightings import Sightings
from linework.model.trajectory import Trajectory


def write_line_part(lines: LineSet, path: Path) -> str:
    """Write lines and return the SHA-256 of the file: the same lines give the same bytes.

    Raises
    ------
    MachineError
        The folder is full, read-only or gone.
    """
    columns = {name: getattr(lines, name) for name in ("xyz", "offsets", *VERTEX_COLUMNS, *LINE_COLUMNS)}
    return write_named_arrays(path, {"crs": np.array([lines.crs]), **columns})


def read_line_part(path: Path, sha256: str) -> LineSet | None:
    """Return the lines of a part, or None where it is missing or damaged."""
    columns = _read(path, sha256)
    return None if columns is None else LineSet(crs=str(columns.pop("crs")[0]), **columns)


def write_box_part(boxes: BoxSet, path: Path) -> str:
    """Write boxes and return the SHA-256 of the file (see `write_line_part`)."""
    return write_named_arrays(path, boxes.by_name())


def read_box_part(path: Path, sha256: str) -> BoxSet | None:
    """Return the boxes of a part, or None where it is missing or damaged."""
    columns = _read(path, sha256)
    return None if columns is None else BoxSet(**columns)


def write_sighting_part(sightings: Sightings, path: Path) -> str:
    """Write sightings and return the SHA-256 of the file (see `write_line_part`)."""
    return write_named_arrays(path, sightings.by_name())


def read_sighting_part(path: Path, sha256: str) -> Sightings | None:
    """Return the sightings of a part, or None where it is missing or damaged."""
    columns = _read(path, sha256)
    return None if columns is None else Sightings(**columns)


def write_path_part(trajectory: Trajectory, path: Path) -> str:
    """Write a trajectory for the workers, who read it a hundred times as fast as its CSV; return the SHA-256."""
    return write_named_arrays(path, trajectory.by_name())


def read_path_part(path: Path) -> Trajectory:
    """Return the trajectory of a part.

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


def _read(path: Path, sha256: str) -> dict[str, AnyArray] | None:
    try:
        return read_named_arrays(path, sha256)
    except (FileNotFoundError, MachineError):
        return None
