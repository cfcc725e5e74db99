"""Lines as FlatGeobuf: all kinds in one layer, without the vertex columns."""

from __future__ import annotations

import io
import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import shapely

from linework.errors import MachineError
from linework.files.crs import LOCAL
from linework.files.line_fields import field_values, geometries
from linework.files.vector_input import pyogrio
from linework.files.vectors_foreign import read_foreign
from linework.model.lines import LineSet


def write_flatgeobuf(lines: LineSet, part: Path, kinds: Sequence[str] = ()) -> None:  # noqa: ARG001
    """Write lines in the set's order (called through `publish`)."""
    values = {
        name: column.astype(object) if column.dtype.kind == "U" else column
        for name, column in field_values(lines).items()
    }
    # In memory first: GDAL does not report every failed write
    content = io.BytesIO()
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", message="'crs' was not provided")
            pyogrio.raw.write(
                content, shapely.to_wkb(geometries(lines), flavor="iso"), list(values.values()), list(values),
                layer="lines", driver="FlatGeobuf", crs=None if lines.crs == LOCAL else lines.crs,
                geometry_type="LineString Z", encoding="utf-8", nan_as_null=True,
                layer_options={"SPATIAL_INDEX": "NO"},  # an index sorts the lines anew
            )  # fmt: skip
    except RuntimeError as error:  # the root of pyogrio's errors
        raise MachineError(f"cannot be written: {error}", where=part, advice="check the disk") from error
    part.write_bytes(content.getvalue())


def verify_flatgeobuf(part: Path, lines: LineSet, path: Path) -> None:
    """Read the file back and compare every coordinate.

    Raises
    ------
    MachineError
        Not the lines that were written.
    """
    back = read_foreign(part, "kind", None, None)
    if len(back) != len(lines) or not np.array_equal(back.xyz, lines.xyz):
        raise MachineError(
            "written file does not read back the same", where=path, advice="check for free space"
        )
