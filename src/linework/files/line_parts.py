"""The lines of a tile on their way to the whole: a file of columns, written whole or not at all."""

from __future__ import annotations

import hashlib
import io
import os
from pathlib import Path

import numpy as np

from linework.files.publish import machine_errors
from linework.model.lines import LINE_COLUMNS, VERTEX_COLUMNS, LineSet


def write_line_part(lines: LineSet, path: Path) -> str:
    """Write lines and return the SHA-256 of the file: the same lines give the same bytes.

    Raises
    ------
    MachineError
        The folder is full, read-only or gone.
    """
    columns = {name: getattr(lines, name) for name in (*VERTEX_COLUMNS, *LINE_COLUMNS)}
    held = io.BytesIO()
    np.savez(held, xyz=lines.xyz, offsets=lines.offsets, crs=np.array(lines.crs), **columns)
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


def read_line_part(path: Path, sha256: str) -> LineSet | None:
    """Return the lines of a part, or None where it is gone or is not what was written."""
    try:
        data = path.read_bytes()
    except OSError:
        return None
    if hashlib.sha256(data).hexdigest() != sha256:
        return None
    with np.load(io.BytesIO(data), allow_pickle=False) as held:
        columns = {name: held[name] for name in held.files if name != "crs"}
        return LineSet(crs=str(held["crs"]), **columns)
