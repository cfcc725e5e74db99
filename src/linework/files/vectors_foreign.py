"""Lines from files that other programs made: reference maps, edited layers."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from linework.arrays import AnyArray
from linework.errors import CrsError, InputError
from linework.files.crs import LOCAL, describe_crs, parse_crs
from linework.files.line_fields import REJECTED, TABLES, lines_from_geometries
from linework.files.vector_input import pyogrio, readable
from linework.model.lines import LINE_COLUMNS, LineSet

#: Layers and tables of ours that hold no lines, and lines that are none.
_OURS = (*TABLES, REJECTED)


def read_foreign(path: Path, kind_field: str, kinds: Mapping[str, str] | None, crs: str | None) -> LineSet:
    """Read the lines of every layer of a GeoPackage, FlatGeobuf or Shapefile.

    A feature's kind is the value of `kind_field` where there is such a field, else the layer's name.

    Raises
    ------
    InputError
        Not readable, or no lines in it.
    CrsError
        In degrees, or layers in different CRSs.
    """
    with readable(path):
        layers = [str(name) for name, kind in pyogrio.list_layers(path) if str(name) not in _OURS and kind]
        read = [(layer, *pyogrio.raw.read(path, layer=layer)) for layer in layers]
    if not read:
        raise InputError("no layer with geometries", where=path, advice="check what this file is")
    sets = []
    for layer, meta, _, shapes, values in read:
        own = parse_crs(meta["crs"], where=path) if meta["crs"] else None
        table = dict(zip(meta["fields"], values, strict=True))
        kind = table.get(kind_field, np.full(len(shapes), layer, dtype=object))
        sets.append(foreign_lines(shapely.from_wkb(shapes), kind, table, kinds, own or crs or LOCAL, path))
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
    """Return the lines of one layer; with `kinds` only values in it are kept and take its names."""
    named = ["" if v is None else str(v) for v in values]
    kept = [i for i, v in enumerate(named) if kinds is None or v in kinds]
    columns = {name: [table[name][i] for i in kept] for name in LINE_COLUMNS if name in table}
    columns["kind"] = [named[i] if kinds is None else kinds[named[i]] for i in kept]
    lines, _ = lines_from_geometries(np.asarray(shapes, dtype=object)[kept], columns, crs, path)
    return lines
