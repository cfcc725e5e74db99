"""Routes to which a report refers: lines of a file, the driven path, or the lines themselves."""

from __future__ import annotations

import numpy as np
import shapely

from linework.arrays import FloatArray
from linework.errors import InputError, argument
from linework.lines.crosscuts import REACH_M, Axis, axis_along
from linework.model.lines import LineSet
from linework.model.lineset.geometries import geometries

#: Kinds that run along a road, the first ones rather than the last.
_ALONG = ("lane_marking", "road_boundary", "guardrail", "barrier")
#: Shortest line that becomes a route of its own: three intervals of 10 m. [m]
_SHORTEST_M = 30.0


def routes_of_file(routes: LineSet) -> list[Axis]:
    """Return the axes of the lines of a route file, each with its id, or its number where it has none.

    Raises
    ------
    InputError
        No line has a length.
    """
    long = np.flatnonzero(routes.length_m > 0.0)
    if not len(long):
        raise InputError("the route has no lines", advice="name a file with the axis of the road")
    names = [str(routes.id[i]) or f"route {i + 1}" for i in long]
    return [axis_along(name, _with_heights(routes[int(i)].xyz)) for i, name in zip(long, names, strict=True)]


def _with_heights(xyz: FloatArray) -> FloatArray:
    """Return a line in two dimensions at height 0: heights of routes are not used but for the grade."""
    return np.column_stack([xyz[:, :2], np.nan_to_num(xyz[:, 2])])


def route_of_path(xyz: FloatArray) -> list[Axis]:
    """Return the axis of a driven path (n, 3), places where the van stood left out."""
    moved = np.concatenate([[True], np.linalg.norm(np.diff(xyz[:, :2], axis=0), axis=1) > 0.01])
    return [axis_along("path", xyz[moved])]


def own_routes(lines: LineSet) -> list[Axis]:
    """Return axes among the lines themselves: the longest ones, and others where those are not near.

    Raises
    ------
    InputError
        No line along a road is long enough.
    """
    shapes, length_m = geometries(lines), lines.length_m
    rank = np.array([_ALONG.index(k) if k in _ALONG else len(_ALONG) for k in lines.kind.tolist()])
    candidates = [i for i in np.lexsort((-length_m, rank)).tolist() if rank[i] < len(_ALONG)]
    axes: list[Axis] = []
    covered = shapely.Polygon()
    for i in candidates:
        if length_m[i] < _SHORTEST_M:
            continue
        outside = shapely.length(shapely.difference(shapely.force_2d(shapes[i]), covered))
        if outside < max(_SHORTEST_M, 0.5 * length_m[i]):
            continue
        axes.append(axis_along(str(lines.id[i]) or f"line {i + 1}", lines[i].xyz))
        covered = shapely.union(covered, shapely.buffer(shapes[i], REACH_M))
    if not axes:
        raise InputError(
            f"no marking, boundary or rail of at least {_SHORTEST_M:.0f} m to refer to",
            advice=f"name the axis of the road with {argument('route')}",
        )
    return axes
