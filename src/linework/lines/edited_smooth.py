"""A line made smoother, no further from where it was measured than its sigmas allow."""

from __future__ import annotations

import numpy as np

from linework.arrays import FloatArray
from linework.errors import UsageError
from linework.kernels.smooth import smooth_height, smooth_plane
from linework.kernels.track import CLOTHOID_M, STRAIGHT_M, TIGHTEST_M
from linework.model.lines import LineSet

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


def smoothed(line: LineSet) -> LineSet:
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
    The filter along the line, and back, of tracked lines (`linework.kernels.smooth`), through the vertices
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
        states = smooth_plane(t, xy, variance, (curvature + 1.0 / STRAIGHT_M) ** 2 / CLOTHOID_M)[0]
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
