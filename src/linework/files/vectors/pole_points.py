"""Poles as points of vector files, at their foot, and back to the vertical lines that they are in a set of lines."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import shapely

from linework.arrays import AnyArray
from linework.model.lines import POLE, LineSet
from linework.model.lineset.geometries import geometries


def is_point(lines: LineSet) -> AnyArray:
    """Return which lines (m,) are points in files: poles, where all are upright and observed from foot to top.

    A point has no values of vertices; what only a part of it shows, as truth may say, takes a line.

    >>> pole = [[0.0, 0.0, 5.0], [0.0, 0.0, 13.0]]
    >>> is_point(LineSet.from_lines([pole, pole], kind=[POLE, "cable"], height_m=8.0)).tolist()
    [True, False]
    """
    found = lines.kind == POLE
    if np.any(np.diff(lines.offsets)[found] != 2):
        return np.zeros(len(lines), dtype=bool)
    feet = lines.offsets[:-1][found]
    tops = lines.xyz[feet]
    tops[:, 2] += lines.height_m[found]
    ends = np.concatenate([feet, feet + 1])
    is_whole = bool(np.all(lines.observed[ends]) and not np.any(lines.bridged[ends]))
    return np.asarray(found & (is_whole and np.array_equal(lines.xyz[feet + 1], tops)))


def points_last(lines: LineSet) -> LineSet:
    """Return the lines with those that are points in files last, the order in which files are read back."""
    points = is_point(lines)
    order = np.argsort(points, kind="stable")
    return lines if np.array_equal(order, np.arange(len(lines))) else lines.take(order)


def feature_shapes(lines: LineSet) -> AnyArray:
    """Return the geometries (m,) of the lines as files hold them: Point Z at the foot of poles, else LineString Z."""
    shapes, points = geometries(lines), is_point(lines)
    shapes[points] = shapely.points(lines.xyz[lines.offsets[:-1][points]])
    return shapes


def upright(shapes: AnyArray, kinds: Sequence[Any], heights: Sequence[Any]) -> AnyArray:
    """Return geometries (n,) with the points of poles as vertical lines, as high as `heights` say.

    Points without a height or a place stay points.

    >>> upright(shapely.points([[1.0, 2.0, 3.0]]), ["pole"], [8.0])[0].wkt
    'LINESTRING Z (1 2 3, 1 2 11)'
    """
    found = np.array([*shapes, None], dtype=object)[:-1]
    for i in np.flatnonzero(shapely.get_type_id(found) == shapely.GeometryType.POINT).tolist():
        height = _number(heights[i])
        if kinds[i] != POLE or not 0.0 < height < np.inf or shapely.is_empty(found[i]):
            continue
        x, y, z = shapely.get_coordinates(found[i], include_z=True)[0].tolist()
        z = 0.0 if np.isnan(z) else z
        if np.isfinite([x, y, z]).all():
            found[i] = shapely.linestrings([[x, y, z], [x, y, z + height]])
    return found


def _number(value: Any) -> float:
    try:
        return float(value)
    except (TypeError, ValueError):
        return 0.0
