"""Lines as a GeoPandas frame, and back.

Separate from `linework.model.lineset.for_others`: each library has a module of its own.
"""

from __future__ import annotations

import warnings
from collections.abc import Collection, Iterable, Mapping
from typing import Any

import numpy as np
import shapely

from linework.arrays import AnyArray
from linework.crs import LOCAL, parse_crs
from linework.errors import InputError, LineworkWarning, argument, needed
from linework.model.columns import column_types
from linework.model.lines import LINE_COLUMNS, VERTEX_COLUMNS, LineSet
from linework.model.lineset.geometries import geometries, lines_of_shapes


def frame_of(lines: LineSet, *, per_vertex: bool) -> Any:
    """Return the lines as a `geopandas.GeoDataFrame`: the work of `LineSet.to_geopandas`."""
    geopandas = needed("geopandas", "tables", where="to_geopandas()")
    columns: dict[str, Any] = {}
    for name in LINE_COLUMNS:
        values = getattr(lines, name)
        columns[name] = values.astype(object) if values.dtype.kind == "U" else values.copy()
    if per_vertex:
        for name in VERTEX_COLUMNS:
            columns[name] = _per_line(lines, getattr(lines, name))
    return geopandas.GeoDataFrame(
        columns, geometry=geometries(lines), crs=None if lines.crs == LOCAL else lines.crs
    )


def _per_line(lines: LineSet, values: AnyArray) -> AnyArray:
    """Return an object array (m,) with the values at the vertices of each line."""
    found = np.full(len(lines), None, dtype=object)
    for i in range(len(lines)):
        found[i] = values[lines.offsets[i] : lines.offsets[i + 1]].copy()
    return found


def lines_of_frame(frame: Any, crs: object, columns: Mapping[str, Any]) -> LineSet:
    """Return the lines of a GeoDataFrame: the work of `LineSet.from_geopandas`."""
    pandas = needed("pandas", "tables", where="from_geopandas()")
    stated = frame.crs
    found_crs = parse_crs(
        crs if stated is None else stated, where=argument("crs") if stated is None else "from_geopandas()"
    )
    given: dict[str, Any] = {}
    for name in LINE_COLUMNS:
        if name in frame.columns and name not in columns:
            values = frame[name]
            # Missing texts may be NaN, None or NA
            plain = np.full(len(values), None, dtype=object)
            known = np.flatnonzero(~pandas.isna(values).to_numpy(dtype=bool))
            plain[known] = values.to_numpy(dtype=object)[known]
            given[name] = plain
    shapes = np.asarray(frame.geometry.array, dtype=object)
    for name in VERTEX_COLUMNS:
        if name in frame.columns and name not in columns and _is_ragged(frame[name]):
            given[name] = vertex_values(name, frame[name].to_numpy(dtype=object), shapes)
    if len(frame):
        warn_of_left_out(
            [str(name) for name in frame.columns if name != frame.geometry.name], {*given, *columns}
        )
    return lines_of_shapes(shapes, found_crs, given | dict(columns))


def _is_ragged(values: Any) -> bool:
    """Return whether a column holds lists; files of linework hold one rms of the sigmas under the same name."""
    return len(values) > 0 and all(np.ndim(value) == 1 for value in values)


def warn_of_left_out(names: Iterable[str], taken: Collection[str]) -> None:
    """Warn of the columns of a table that do not become columns of lines."""
    left_out = [name for name in names if name not in taken]
    per_line = [name for name in left_out if name in VERTEX_COLUMNS]
    unknown = [name for name in left_out if name not in VERTEX_COLUMNS]
    if per_line:
        warnings.warn(
            f"left out: {', '.join(per_line)}: one value for each line, expected one for each vertex. Files of linework "
            "are read with read_lines().",
            LineworkWarning,
            stacklevel=5,
        )
    if unknown:
        warnings.warn(
            f"left out, for lines have no such columns: {', '.join(unknown)}", LineworkWarning, stacklevel=5
        )


def vertex_values(name: str, values: AnyArray, shapes: AnyArray) -> AnyArray:
    """Return the concatenated values at the vertices of lines, from (m,) lists.

    Raises
    ------
    InputError
        A list of another length than its line has vertices.
    """
    counts = shapely.get_num_coordinates(shapes)
    wrong = np.flatnonzero(counts != [len(value) for value in values])
    if len(wrong):
        i = int(wrong[0])
        raise InputError(
            f"{name} of line {i} has {len(values[i])} values for {int(counts[i])} vertices", where=argument("frame"),
            advice="leave the column out, or correct it",
        )  # fmt: skip
    dtype = column_types(LineSet)[name].dtype
    return np.concatenate([np.asarray(value, dtype=dtype) for value in values])
