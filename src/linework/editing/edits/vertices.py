"""Manual edits of the vertices of a single line, and smoothing: one line in, one line out."""

from __future__ import annotations

from typing import Any

import numpy as np

from linework.arrays import AnyArray, FloatArray
from linework.errors import UsageError
from linework.model.lines import LINE_COLUMNS, VERTEX_COLUMNS, LineSet

#: Two vertices nearer than this are one place. [m]
ONE_PLACE_M = 0.001
#: Columns whose sign follows the direction of the line: positive to its left.
_SIDED = ("disagreement_mean_m",)


def move_vertex(line: LineSet, vertex: int, to: FloatArray, *, sigma_z_m: float = np.nan) -> LineSet:
    """Return a line with one vertex moved.

    Parameters
    ----------
    line
        A single line, as for all functions here.
    to
        (3,) [m, world].
    sigma_z_m
        Standard deviation of the height of the place [m]; NaN: unknown. That across the line is always unknown.

    Raises
    ------
    UsageError
        The vertex does not exist, or would coincide with its neighbour.
    """
    _check_vertex(line, vertex)
    _check_apart(line, to, [k for k in (vertex - 1, vertex + 1) if 0 <= k < len(line.xyz)])
    xyz, sigma_xy, sigma_z = line.xyz.copy(), line.sigma_xy_m.copy(), line.sigma_z_m.copy()
    xyz[vertex], sigma_xy[vertex], sigma_z[vertex] = to, np.nan, sigma_z_m
    return line.with_columns(xyz=xyz, sigma_xy_m=sigma_xy, sigma_z_m=sigma_z)


def insert_vertex(line: LineSet, after: int, to: FloatArray, *, sigma_z_m: float = np.nan) -> LineSet:
    """Return a line with a vertex inserted after vertex `after`; -1 inserts it before the first.

    A vertex inserted in a bridged segment is bridged, too: it was placed by a person, not measured.

    Raises
    ------
    UsageError
        The vertex does not exist, or the new one would coincide with its neighbour.
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
        The vertex does not exist, or the line has only two.
    """
    _check_vertex(line, vertex)
    if len(line.xyz) <= 2:
        raise UsageError("a line needs at least two vertices", where="remove", advice="delete the whole line")
    return line_of_vertices(line, np.delete(np.arange(len(line.xyz)), vertex))


def trim_to_vertices(line: LineSet, first: int, last: int) -> LineSet:
    """Return the part of a line from one vertex to another, both included.

    Raises
    ------
    UsageError
        A vertex does not exist, or `last` does not follow `first`.
    """
    _check_vertex(line, first)
    _check_vertex(line, last)
    if last <= first:
        raise UsageError(
            f"nothing is left from vertex {first} to vertex {last}", where="trim",
            advice="keep at least two vertices",
        )  # fmt: skip
    return line_of_vertices(line, np.arange(first, last + 1))


def reversed_line(line: LineSet) -> LineSet:
    """Return a line in reverse direction; columns signed by side change sign."""
    turned = line_of_vertices(line, np.arange(len(line.xyz))[::-1])
    return turned.with_columns(**{name: -getattr(line, name) for name in _SIDED})


def line_of_vertices(line: LineSet, vertices: AnyArray) -> LineSet:
    """Return a line made of some of a line's vertices, in the given order."""
    return rebuild_line(
        line, line.xyz[vertices], {name: getattr(line, name)[vertices] for name in VERTEX_COLUMNS}
    )


def rebuild_line(line: LineSet, xyz: FloatArray, vertex_columns: dict[str, AnyArray]) -> LineSet:
    """Return a single line with the attributes of another line and new vertices."""
    columns = {name: getattr(line, name) for name in LINE_COLUMNS}
    return LineSet.from_lines([xyz], crs=line.crs, **columns, **vertex_columns)


def _check_vertex(line: LineSet, vertex: int) -> None:
    if not 0 <= vertex < len(line.xyz):
        raise UsageError(
            f"vertex {vertex} does not exist: the line has {len(line.xyz)}, counted from 0", where="edit",
            advice="reload the page and try again",
        )  # fmt: skip


def _check_apart(line: LineSet, to: FloatArray, neighbours: list[int]) -> None:
    if any(float(np.linalg.norm(line.xyz[k] - to)) < ONE_PLACE_M for k in neighbours):
        raise UsageError(
            "the place coincides with the neighbouring vertex",
            where="edit",
            advice="remove the vertex instead",
        )


# Smoothing within the standard deviations

#: Standard deviation of a clicked place: one cell of the plan view. [m]
CLICKED_M = 0.05
#: Largest shift of a vertex, in standard deviations.
FURTHEST = 3.0
#: Power of the random walk of curvature in height: a vertical curve of 500 m radius. [1/m^2]
_GRADE_CHANGE = 1.0 / 500.0**2
#: Standard deviation that holds the ends in place. [m]
_HELD_M = 1e-4
#: Smallest step between vertices, so that distances along the line increase. [m]
_STEP_M = 1e-4


def smooth_by_sigmas(line: LineSet) -> LineSet:
    """Return a line smoothed so that curvature and grade change no faster than a road's.

    Parameters
    ----------
    line
        A single line, not a cable: a cable hangs as a catenary.

    Returns
    -------
    LineSet
        The same vertices, shifted; the ends stay. A vertex moves by at most `FURTHEST` of its sigmas
        (`CLICKED_M` where unknown), in plan and in height; bridged vertices follow the others. Sigmas
        stay: nothing was measured again.

    Raises
    ------
    UsageError
        The line has no vertex between its ends, or is a cable.

    Notes
    -----
    The forward filter and backward smoother of tracked lines (`linework.kernels.tracking.smooth`), run over the
    vertices instead of boxes, twice: the first pass estimates the curvature.
    """
    if str(line.kind[0]) == "cable":
        raise UsageError(
            "cables cannot be smoothed: they hang as catenaries",
            where="smooth",
            advice="move its vertices, or follow it again",
        )
    if len(line.xyz) < 3:
        raise UsageError(
            "the line has no vertex between its ends", where="smooth", advice="insert one, or follow the line"
        )
    from linework.kernels.tracking.smooth import smooth_height  # 70 MB of numba, and few edits smooth

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
    from linework.kernels.tracking.smooth import smooth_plane
    from linework.kernels.tracking.track import CLOTHOID_M, STRAIGHT_RADIUS_M, TIGHTEST_M

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
    """Return the variance of each vertex (n,) [m^2]: ends are held, bridged vertices unknown (inf)."""
    variance = np.where(line.bridged, np.inf, np.maximum(sigma_m, _HELD_M) ** 2)
    variance[[0, -1]] = _HELD_M**2
    return variance


def _share(way_m: FloatArray, sigma_m: FloatArray, line: LineSet) -> FloatArray:
    """Return the share (n,) of its shift that each vertex may make."""
    most = np.where(line.bridged, np.inf, FURTHEST * sigma_m)
    return np.asarray(np.minimum(1.0, most / np.maximum(way_m, 1e-12)))
