"""Read lines from files of other programs (reference maps, edited layers), and write FlatGeobuf."""

from __future__ import annotations

import io
import warnings
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from linework.arrays import AnyArray
from linework.crs import LOCAL, describe_crs, stated_crs
from linework.errors import CrsError, InputError, MachineError
from linework.files.vectors.fields import (
    REJECTED_LAYER,
    TABLES,
    field_values,
    lines_from_geometries,
)
from linework.files.vectors.gdal_input import pyogrio, reading_with_gdal
from linework.files.vectors.left_out import usable_features
from linework.files.vectors.pole_points import upright
from linework.model.lines import LINE_COLUMNS, LineSet
from linework.model.lineset.geometries import geometries

#: Our own layers and tables that hold no lines, or rejected ones.
_OURS = (*TABLES, REJECTED_LAYER)
#: The index of a Shapefile: a header, and a place and a length for each record. [bytes]
_INDEX_HEADER_BYTES, _INDEX_RECORD_BYTES = 100, 8


def read_foreign(
    path: Path, kind_field: str, kinds: Mapping[str, str] | None, crs: str | None, left_out: list[str]
) -> LineSet:
    """Read the lines of every layer of a GeoPackage, FlatGeobuf or Shapefile.

    The kind of a feature is the value of `kind_field` if there is one, else the name of the layer. Features that cannot
    be read are added to `left_out`.

    Raises
    ------
    InputError
        Not readable, or no lines in it.
    CrsError
        In degrees, or layers in different CRSs.
    """
    with reading_with_gdal(path) as source:
        layers = [str(name) for name, kind in pyogrio.list_layers(source) if str(name) not in _OURS and kind]
        read = [(layer, *_read_layer(source, layer, path)) for layer in layers]
        for layer, _, fids, shapes, _ in read:
            left_out += _damaged(source, layer, fids, shapes)
    if not read:
        raise InputError("no layer with geometries", where=path, advice="check what this file is")
    sets, all_shapes = [], []
    for layer, meta, fids, shapes, values in read:
        own = stated_crs(meta["crs"], crs, where=path) if meta["crs"] else None
        table = dict(zip(meta["fields"], values, strict=True))
        kind = table.get(kind_field, np.full(len(shapes), layer, dtype=object))
        with np.errstate(invalid="ignore"):
            parsed = shapely.from_wkb(shapes)
        names = [f"feature {fid} of layer {layer}" for fid in fids]
        all_shapes.append(parsed)
        sets.append(foreign_lines(parsed, kind, table, kinds, own or crs or LOCAL, path, left_out, names))
    if kinds is None and not left_out and not any(len(lines) for lines in sets) and any(map(len, all_shapes)):
        raise no_lines_error(np.concatenate(all_shapes), path)
    others = [lines.crs for lines in sets if lines.crs != sets[0].crs]
    if others:
        raise CrsError(
            f"layers in different CRSs: {describe_crs(sets[0].crs)}, {describe_crs(others[0])}", where=path,
            advice="convert them to one",
        )  # fmt: skip
    return LineSet.concatenate(sets)


def _read_layer(source: Path, layer: str, path: Path) -> Any:
    """Return what pyogrio reads of a layer of `source`, which is `path` to GDAL: facts, ids, geometries, fields.

    GDAL believes what a table of a GeoPackage (gpkg_ogr_contents) says of the number of features; a program that does not
    know the table leaves it as it was. With a condition GDAL counts; asked for by their ids, all features come.
    """
    if source.suffix.lower() == ".gpkg":
        _, there, _, _ = pyogrio.raw.read(
            source, layer=layer, where="1 = 1", columns=[], read_geometry=False, return_fids=True
        )
        if len(there) != pyogrio.read_info(source, layer=layer)["features"]:
            return pyogrio.raw.read(source, layer=layer, fids=there, return_fids=True)
    if source.suffix.lower() == ".shp":
        _check_index(path, int(pyogrio.read_info(source, layer=layer)["features"]))
    return pyogrio.raw.read(source, layer=layer, return_fids=True)


def _check_index(path: Path, n_features: int) -> None:
    """Refuse a Shapefile whose index says another number of records than it has room for: GDAL believes what it says."""
    index = next((p for p in (path.with_suffix(".shx"), path.with_suffix(".SHX")) if p.is_file()), None)
    if index is None:
        return
    n_records = (index.stat().st_size - _INDEX_HEADER_BYTES) // _INDEX_RECORD_BYTES
    if n_records != n_features:
        raise InputError(
            f"its index has {n_records:,} records and says {n_features:,} (cut off or damaged)", where=path,
            advice="copy all files of the Shapefile again",
        )  # fmt: skip


def _damaged(path: Path, layer: str, fids: AnyArray, shapes: AnyArray) -> list[str]:
    """Return the features that have a geometry in the file, but none of GDAL's, which says nothing."""
    missing = {int(fid) for fid, shape in zip(fids, shapes, strict=True) if shape is None}
    if not missing:
        return []
    if path.suffix.lower() != ".gpkg":
        return [f"feature {fid} of layer {layer}: no geometry can be read" for fid in sorted(missing)]
    column = str(pyogrio.read_info(path, layer=layer)["geometry_name"]).replace('"', '""')
    _, there, _, _ = pyogrio.raw.read(
        path, layer=layer, where=f'"{column}" IS NOT NULL', columns=[], read_geometry=False, return_fids=True
    )
    damaged = sorted(missing & {int(fid) for fid in there})
    return [f"feature {fid} of layer {layer}: its geometry is damaged" for fid in damaged]


def foreign_lines(
    shapes: AnyArray, values: Any, table: Mapping[str, Any], kinds: Mapping[str, str] | None, crs: str, path: Path,
    left_out: list[str], names: Sequence[str],
) -> LineSet:  # fmt: skip
    """Return the lines of one layer; with `kinds`, only those whose value it maps to a kind.

    Features with places that are not finite, and those that are no lines beside others that are, are added to `left_out`,
    by their names.
    """
    named = ["" if v is None else str(v) for v in values]
    shapes = upright(shapes, table.get("kind", named), table.get("height_m", [None] * len(named)))
    wanted = [i for i, v in enumerate(named) if kinds is None or v in kinds]
    kept = usable_features(shapes, wanted, names.__getitem__, left_out)
    columns = {name: [table[name][i] for i in kept] for name in LINE_COLUMNS if name in table}
    columns["kind"] = [named[i] if kinds is None else kinds[named[i]] for i in kept]
    lines, feature = lines_from_geometries(shapes[kept], columns, crs, path)
    found = {kept[i] for i in feature.tolist()}
    others = [i for i in kept if i not in found and shapes[i] is not None and not shapes[i].is_empty]
    if found:
        left_out += [f"{names[i]}: a {shapes[i].geom_type} is no line" for i in others]
    return lines


def no_lines_error(shapes: AnyArray, path: Path) -> InputError:
    """Return the error to raise for a file with these features, (n,) geometries or None, of which none is a line."""
    types = Counter("nothing" if shape is None else shape.geom_type for shape in shapes)
    text = ", ".join(f"{n:,} {name}" for name, n in sorted(types.items()))
    return InputError(
        f"no lines in it: its features are {text}", where=path, advice="name the file with the lines"
    )


def write_flatgeobuf(lines: LineSet, part: Path, kinds: Sequence[str] = ()) -> None:  # noqa: ARG001
    """Write FlatGeobuf: all kinds in one layer of lines, poles as vertical ones, without vertex columns (called through `publish`)."""
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
    back = read_foreign(part, "kind", None, None, [])
    if len(back) != len(lines) or not np.array_equal(back.xyz, lines.xyz):
        raise MachineError(
            "written file does not read back the same", where=path, advice="check for free space"
        )
