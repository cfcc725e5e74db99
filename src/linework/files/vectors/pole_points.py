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
    """Return which lines (m,) are points in files: poles, where all are upright from foot to top.

    >>> pole = [[0.0, 0.0, 5.0], [0.0, 0.0, 13.0]]
    >>> is_point(LineSet.from_lines([pole, pole], kind=[POLE, "cable"], height_m=8.0)).tolist()
    [True, False]
    """
    found = lines.kind == POLE
    is_upright = True
    for i in np.flatnonzero(found).tolist():
        xyz = lines[i].xyz
        top = xyz[0] + np.array([0.0, 0.0, float(lines.height_m[i])])
        is_upright &= len(xyz) == 2 and np.array_equal(xyz[1], top)
    return np.asarray(found & is_upright)


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

    >>> upright(shapely.points([[1.0, 2.0, 3.0]]), ["pole"], [8.0])[0].wkt
    'LINESTRING Z (1 2 3, 1 2 11)'
    """
    found = np.array([*shapes, None], dtype=object)[:-1]
    for i in np.flatnonzero(shapely.get_type_id(found) == shapely.GeometryType.POINT).tolist():
        height = _number(heights[i])
        if kinds[i] == POLE and height > 0.0 and not shapely.is_empty(found[i]):
            foot = np.nan_to_num(shapely.get_coordinates(found[i], include_z=True)[0])
            found[i] = shapely.linestrings([foot, foot + np.array([0.0, 0.0, height])])
    return found


def _number(value: Any) -> float:
    try:
        return float(value)
    except (TypeError, ValueError):
        return 0.0
