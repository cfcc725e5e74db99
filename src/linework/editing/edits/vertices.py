"""A line with some of its vertices changed: what a person does to it by hand, one line in and one out."""

from __future__ import annotations

from typing import Any

import numpy as np

from linework.arrays import AnyArray, FloatArray
from linework.errors import UsageError
from linework.kernels.tracking.smooth import smooth_height, smooth_plane
from linework.kernels.tracking.track import CLOTHOID_M, STRAIGHT_RADIUS_M, TIGHTEST_M
from linework.model.lines import LINE_COLUMNS, VERTEX_COLUMNS, LineSet

#: Two vertices nearer than this are one place. [m]
ONE_PLACE_M = 0.001
#: Columns whose sign follows the direction of the line: positive to its left.
_SIDED = ("disagreement_mean_m",)


def move_vertex(line: LineSet, vertex: int, to: FloatArray, *, sigma_z_m: float = np.nan) -> LineSet:
    """Return a line with a vertex at another place.

    Parameters
    ----------
    line
        A single line, as for all functions here.
    to
        (3,) [m, world].
    sigma_z_m
        How well the height of the place is known; NaN: unknown. Across the line nobody knows.

    Raises
    ------
    UsageError
        There is no such vertex, or it would lie on its neighbour.
    """
    _check_vertex(line, vertex)
    _check_apart(line, to, [k for k in (vertex - 1, vertex + 1) if 0 <= k < len(line.xyz)])
    xyz, sigma_xy, sigma_z = line.xyz.copy(), line.sigma_xy_m.copy(), line.sigma_z_m.copy()
    xyz[vertex], sigma_xy[vertex], sigma_z[vertex] = to, np.nan, sigma_z_m
    return line.with_columns(xyz=xyz, sigma_xy_m=sigma_xy, sigma_z_m=sigma_z)


def insert_vertex(line: LineSet, after: int, to: FloatArray, *, sigma_z_m: float = np.nan) -> LineSet:
    """Return a line with one more vertex behind vertex `after`; -1: before the first, the last: behind it.

    A vertex on a bridged segment is bridged, too: somebody said where the line is, nobody measured it.

    Raises
    ------
    UsageError
        There is no such vertex, or the new one would lie on its neighbour.
    """
    if after != -1:
        _check_vertex(line, after)
    _check_apart(line, to, [k for k in (after, after + 1) if 0 <= k < len(line.xyz)])
    is_inside = 0 <= after < len(line.xyz) - 1
    values: dict[str, Any] = {
        "sigma_xy_m": np.nan,
        "sigma_z_m": sigma_z_m,
        "bridged": is_inside and bool(line.bridged[after] | line.bridged[after + 1]),
        "observed": True,
    }
    columns = {name: np.insert(getattr(line, name), after + 1, values[name]) for name in VERTEX_COLUMNS}
    return rebuild_line(line, np.insert(line.xyz, after + 1, to, axis=0), columns)


def remove_vertex(line: LineSet, vertex: int) -> LineSet:
    """Return a line without a vertex.

    Raises
    ------
    UsageError
        There is no such vertex, or the line has no more than two.
    """
    _check_vertex(line, vertex)
    if len(line.xyz) <= 2:
        raise UsageError("a line has two vertices at least", where="remove", advice="delete the whole line")
    return line_of_vertices(line, np.delete(np.arange(len(line.xyz)), vertex))


def trim_to_vertices(line: LineSet, first: int, last: int) -> LineSet:
    """Return what lies between two vertices, both kept.

    Raises
    ------
    UsageError
        There are no such vertices, or nothing between them.
    """
    _check_vertex(line, first)
    _check_vertex(line, last)
    if last <= first:
        raise UsageError(
            f"nothing is left from vertex {first} to vertex {last}", where="trim",
            advice="keep two vertices at least",
        )  # fmt: skip
    return line_of_vertices(line, np.arange(first, last + 1))


def reversed_line(line: LineSet) -> LineSet:
    """Return a line that runs the other way; what is on its left is on its right then."""
    turned = line_of_vertices(line, np.arange(len(line.xyz))[::-1])
    return turned.with_columns(**{name: -getattr(line, name) for name in _SIDED})


def line_of_vertices(line: LineSet, vertices: AnyArray) -> LineSet:
    """Return a line of some of a line's vertices, in the order named."""
    return rebuild_line(
        line, line.xyz[vertices], {name: getattr(line, name)[vertices] for name in VERTEX_COLUMNS}
    )


def rebuild_line(line: LineSet, xyz: FloatArray, vertex_columns: dict[str, AnyArray]) -> LineSet:
    """Return a single line with the columns of another, and vertices of its own."""
    columns = {name: getattr(line, name) for name in LINE_COLUMNS}
    return LineSet.from_lines([xyz], crs=line.crs, **columns, **vertex_columns)


def _check_vertex(line: LineSet, vertex: int) -> None:
    if not 0 <= vertex < len(line.xyz):
        raise UsageError(
            f"there is no vertex {vertex}, the line has {len(line.xyz)} from 0", where="edit",
            advice="reload the page and try again",
        )  # fmt: skip


def _check_apart(line: LineSet, to: FloatArray, neighbours: list[int]) -> None:
    if any(float(np.linalg.norm(line.xyz[k] - to)) < ONE_PLACE_M for k in neighbours):
        raise UsageError(
            "the place is that of the vertex beside it", where="edit", advice="remove the vertex instead"
        )


# A line made smoother, no further from where it was measured than its sigmas allow

#: A place that somebody clicked on is known to a cell of the pictures. [m]
CLICKED_M = 0.05
#: No vertex moves further than this many of its standard deviations.
FURTHEST = 3.0
#: The grade changes by as much in a vertical curve of 500 m radius. [1/m]
_GRADE_CHANGE = 1.0 / 500.0**2
#: The ends stay: they are known to so much. [m]
_HELD_M = 1e-4
#: A vertex is no nearer to the one before it than this, so that a line runs on. [m]
_STEP_M = 1e-4


def smooth_by_sigmas(line: LineSet) -> LineSet:
    """Return a line whose curvature and grade change no faster than a road's.

    Parameters
    ----------
    line
        A single line, no cable: those hang by their weight.

    Returns
    -------
    LineSet
        The same vertices, moved; ends stay where they are. A vertex moves by no more than `FURTHEST` of its sigmas
        (where none is known: of `CLICKED_M`), in plan and in height; bridged ones go where the others lead. Sigmas
        stay: nothing was measured anew.

    Raises
    ------
    UsageError
        It has no vertex between its ends, or is a cable.

    Notes
    -----
    The filter along the line, and back, of tracked lines (`linework.kernels.tracking.smooth`), through the vertices
    instead of boxes, twice: the first pass shows how tight the bends are.
    """
    if str(line.kind[0]) == "cable":
        raise UsageError(
            "a cable hangs by its own weight", where="smooth", advice="move its vertices, or follow it again"
        )
    if len(line.xyz) < 3:
        raise UsageError(
            "the line has no vertex between its ends", where="smooth", advice="insert one, or follow the line"
        )
    step = np.hypot(*np.diff(line.xyz[:, :2], axis=0).T)
    t = np.r_[0.0, np.cumsum(np.maximum(step, _STEP_M))]
    origin = line.xyz[0]
    local = line.xyz - origin
    sigma_xy, sigma_z = (_known(sigma) for sigma in (line.sigma_xy_m, line.sigma_z_m))
    plan = _smooth_plan(t, local[:, :2], _variance(sigma_xy, line))
    height = smooth_height(t, local[:, 2], _variance(sigma_z, line), _GRADE_CHANGE)[0]
    way = np.column_stack([plan, height]) - local
    way[:, :2] *= _share(np.hypot(way[:, 0], way[:, 1]), sigma_xy, line)[:, None]
    way[:, 2] *= _share(np.abs(way[:, 2]), sigma_z, line)
    way[[0, -1]] = 0.0
    return line.with_columns(xyz=line.xyz + way)


def _smooth_plan(t: FloatArray, xy: FloatArray, variance: FloatArray) -> FloatArray:
    """Return (n, 2) places smoothed along a line."""
    curvature = np.full(len(t), 1.0 / 50.0)
    states = np.zeros((len(t), 3, 2))
    for _ in range(2):
        states = smooth_plane(t, xy, variance, (curvature + 1.0 / STRAIGHT_RADIUS_M) ** 2 / CLOTHOID_M)[0]
        way = states[:, 1] / np.maximum(np.hypot(*states[:, 1].T), 1e-9)[:, None]
        turn = np.abs(way[:, 0] * states[:, 2, 1] - way[:, 1] * states[:, 2, 0])
        curvature = np.minimum(turn, 1.0 / TIGHTEST_M)
    return np.asarray(states[:, 0])


def _known(sigma_m: FloatArray) -> FloatArray:
    return np.asarray(np.where(np.isfinite(sigma_m), sigma_m, CLICKED_M))


def _variance(sigma_m: FloatArray, line: LineSet) -> FloatArray:
    """Return how well each vertex is known: the ends as they are, bridged ones not at all. [m^2]"""  # noqa: D400
    variance = np.where(line.bridged, np.inf, np.maximum(sigma_m, _HELD_M) ** 2)
    variance[[0, -1]] = _HELD_M**2
    return variance


def _share(way_m: FloatArray, sigma_m: FloatArray, line: LineSet) -> FloatArray:
    """Return the share of its way that each vertex may move."""
    most = np.where(line.bridged, np.inf, FURTHEST * sigma_m)
    return np.asarray(np.minimum(1.0, most / np.maximum(way_m, 1e-12)))
