"""Read lines from files of other programs (reference maps, edited layers), and write FlatGeobuf."""

from __future__ import annotations

import io
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from linework.arrays import AnyArray
from linework.crs import LOCAL, describe_crs, stated_crs
from linework.errors import CrsError, InputError, LineworkWarning, MachineError
from linework.files.vectors.fields import (
    REJECTED_LAYER,
    TABLES,
    field_values,
    lines_from_geometries,
)
from linework.files.vectors.gdal_input import pyogrio, reading_with_gdal
from linework.model.lines import LINE_COLUMNS, LineSet
from linework.model.lineset.geometries import geometries

#: Our own layers and tables that hold no lines, or rejected ones.
_OURS = (*TABLES, REJECTED_LAYER)
#: With a condition, GDAL counts the features. Without one it believes a table of a GeoPackage (gpkg_ogr_contents), which
#: a program that does not know it leaves as it was: of 6 features 3 were read where it said 3.
_COUNTED = "1 = 1"


def read_foreign(path: Path, kind_field: str, kinds: Mapping[str, str] | None, crs: str | None) -> LineSet:
    """Read the lines of every layer of a GeoPackage, FlatGeobuf or Shapefile.

    The kind of a feature is the value of `kind_field` if there is one, else the name of the layer.

    Raises
    ------
    InputError
        Not readable, or no lines in it.
    CrsError
        In degrees, or layers in different CRSs.
    """
    with reading_with_gdal(path):
        layers = [str(name) for name, kind in pyogrio.list_layers(path) if str(name) not in _OURS and kind]
        read = [(layer, *pyogrio.raw.read(path, layer=layer, where=_COUNTED)) for layer in layers]
    if not read:
        raise InputError("no layer with geometries", where=path, advice="check what this file is")
    sets = []
    for layer, meta, _, shapes, values in read:
        own = stated_crs(meta["crs"], crs, where=path) if meta["crs"] else None
        table = dict(zip(meta["fields"], values, strict=True))
        kind = table.get(kind_field, np.full(len(shapes), layer, dtype=object))
        geometries_read = shapely.from_wkb(shapes)
        _warn_of_missing(geometries_read, path)
        sets.append(foreign_lines(geometries_read, kind, table, kinds, own or crs or LOCAL, path))
    others = [lines.crs for lines in sets if lines.crs != sets[0].crs]
    if others:
        raise CrsError(
            f"layers in different CRSs: {describe_crs(sets[0].crs)}, {describe_crs(others[0])}", where=path,
            advice="convert them to one",
        )  # fmt: skip
    return LineSet.concatenate(sets)


def foreign_lines(
    shapes: AnyArray, values: Any, table: Mapping[str, Any], kinds: Mapping[str, str] | None, crs: str, path: Path
) -> LineSet:  # fmt: skip
    """Return the lines of one layer; with `kinds`, only those whose value it maps to a kind."""
    named = ["" if v is None else str(v) for v in values]
    kept = [i for i, v in enumerate(named) if kinds is None or v in kinds]
    columns = {name: [table[name][i] for i in kept] for name in LINE_COLUMNS if name in table}
    columns["kind"] = [named[i] if kinds is None else kinds[named[i]] for i in kept]
    lines, _ = lines_from_geometries(np.asarray(shapes, dtype=object)[kept], columns, crs, path)
    return lines


def _warn_of_missing(shapes: AnyArray, path: Path) -> None:
    """Say how many features have no geometry: GDAL gives none where it cannot read one."""
    missing = np.flatnonzero(shapely.is_missing(shapes))
    if len(missing):
        warnings.warn(
            f"{path}: {len(missing):,} of {len(shapes):,} features have no geometry that can be read, the first is"
            f" feature {missing[0] + 1:,}",
            LineworkWarning, stacklevel=2,
        )  # fmt: skip


def write_flatgeobuf(lines: LineSet, part: Path, kinds: Sequence[str] = ()) -> None:  # noqa: ARG001
    """Write FlatGeobuf: all kinds in one layer, without vertex columns (called through `publish`)."""
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
                layer_options={"SPATIAL_INDEX": "NO"},  # an index would reorder the lines
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
