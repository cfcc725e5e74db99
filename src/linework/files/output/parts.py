"""What is kept of a run on its way to the whole: files of columns, written whole or not at all."""

from __future__ import annotations

import hashlib
import io
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, cast

import numpy as np

from linework.arrays import AnyArray
from linework.files.output.publish import machine_errors
from linework.model.boxes import BOX_COLUMNS, BoxSet
from linework.model.lines import LINE_COLUMNS, VERTEX_COLUMNS, LineSet
from linework.model.sightings import SIGHTING_COLUMNS, Sightings
from linework.model.trajectory import Trajectory


def write_line_part(lines: LineSet, path: Path) -> str:
    """Write lines and return the SHA-256 of the file: the same lines give the same bytes.

    Raises
    ------
    MachineError
        The folder is full, read-only or gone.
    """
    columns = {name: getattr(lines, name) for name in (*VERTEX_COLUMNS, *LINE_COLUMNS)}
    return _write({"xyz": lines.xyz, "offsets": lines.offsets, "crs": np.array(lines.crs), **columns}, path)


def read_line_part(path: Path, sha256: str) -> LineSet | None:
    """Return the lines of a part, or None where it is gone or is not what was written."""
    columns = _read(path, sha256)
    return None if columns is None else LineSet(crs=str(columns.pop("crs")), **columns)


def write_box_part(boxes: BoxSet, path: Path) -> str:
    """Write boxes, as `write_line_part` does lines."""
    return _write({name: getattr(boxes, name) for name in ("centre", "u", *BOX_COLUMNS)}, path)


def read_box_part(path: Path, sha256: str) -> BoxSet | None:
    """Return the boxes of a part, or None where it is gone or is not what was written."""
    columns = _read(path, sha256)
    return None if columns is None else BoxSet(**columns)


def write_sighting_part(seen: Sightings, path: Path) -> str:
    """Write sightings, as `write_line_part` does lines."""
    return _write({name: getattr(seen, name) for name in ("xyz", *SIGHTING_COLUMNS)}, path)


def read_sighting_part(path: Path, sha256: str) -> Sightings | None:
    """Return the sightings of a part, or None where it is gone or is not what was written."""
    columns = _read(path, sha256)
    return None if columns is None else Sightings(**columns)


def write_path_part(trajectory: Trajectory, path: Path) -> str:
    """Write a trajectory: read back by many workers, a hundred times as fast as its CSV."""
    columns = {"time_s": trajectory.time_s, "xyz": trajectory.xyz}
    for name in ("attitude_deg", "sigma_xyz_m", "sigma_attitude_deg"):
        value = getattr(trajectory, name)
        columns |= {} if value is None else {name: value}
    return _write(columns, path)


def read_path_part(path: Path) -> Trajectory:
    """Return the trajectory of a part."""
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


def _read(path: Path, sha256: str) -> dict[str, AnyArray] | None:
    try:
        data = path.read_bytes()
    except OSError:
        return None
    if hashlib.sha256(data).hexdigest() != sha256:
        return None
    with np.load(io.BytesIO(data), allow_pickle=False) as held:
        return {name: held[name] for name in held.files}
