"""Own evidence of paint: a probability for each point, from a column or from a function of the user.

Separate from `marking`, which fits boxes to the evidence: here the evidence comes from elsewhere, such as a neural
network, instead of the intensity.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from linework.arrays import Float32Array, IntArray
from linework.errors import OwnCodeError, UsageError, argument
from linework.model.grid import Grid
from linework.model.ground import Ground
from linework.model.points import Points
from linework.processes.own_code import call_own
from linework.surface.road import height_above_road

#: Side of the pieces on which an own function is evaluated, and the margin of points around each: a network sees
#: the surroundings of a point on either side, and pieces with their margin fit into the memory of a small device.
#: Both are whole multiples of any cell of the surface that divides 1 m. [m]
PIECE_M, PIECE_MARGIN_M = 32.0, 8.0
#: Margin of points that a tile needs so that all pieces around its core are whole, boxes included. [m]
WHOLE_PIECES_M = PIECE_M + PIECE_MARGIN_M + 8.0
#: Points higher or lower than this above the road are not given to an own function: paint is on the ground, and what
#: stands beside it (kerbs, parked cars) is visible at its foot. [m]
NEAR_ROAD_M = 1.0
#: Name of the column with the height of the points above the road [m] that an own function is given.
ABOVE_ROAD = "above_road_m"
#: Probability from which a point counts as paint.
IS_PAINT = 0.5
#: Probabilities may exceed 0 and 1 by rounding. [1]
_ROUNDING = 1e-3

#: Returns the probability of paint (n,), 0 to 1, for points near the road; they have the column `ABOVE_ROAD`.
PaintClassifier = Callable[[Points], Any]


def paint_probability(points: Points, surface: Ground, paint: str | PaintClassifier) -> Float32Array:
    """Return the probability that each point is paint, (n,) float32 from 0 to 1; 0 where it is unknown.

    Parameters
    ----------
    points
        Of a tile.
    surface
        Road and ground over the tile.
    paint
        Name of a column of the points, or a function: it is given the points within 1 m of the road's height in a
        piece of 32 m and 8 m around it (`Points` in a fixed order, with intensity, time and further columns where
        there are any, and their height above the road in the column "above_road_m"), and returns their probabilities.

    Raises
    ------
    UsageError
        The points have no such column, or its values are not probabilities.
    OwnCodeError
        The function failed, or returned something else.

    Notes
    -----
    Pieces lie on one lattice of the world. What a function returns for a point is therefore the same in every tile,
    whatever it makes of the points around.

    Examples
    --------
    >>> xyz = np.array([[0.2, 0.2, 5.0], [0.4, 0.2, 5.0], [0.4, 0.4, 9.0]])
    >>> surface = Ground.from_heights(np.full((4, 4), 5.0), Grid(0.0, 2.0, 0.5, 0.5, 4, 4))
    >>> points = Points(xyz, intensity=[10.0, 90.0, 90.0])
    >>> paint_probability(points, surface, lambda near: near.intensity > 50.0).tolist()
    [0.0, 1.0, 0.0]
    """
    if isinstance(paint, str):
        if paint not in points.columns:
            there = ", ".join(points.columns) or "none"
            raise UsageError(
                f"the points have no column {paint!r}; further columns: {there}", where=argument("paint"),
                advice=f"read it from the files with {argument('carry', paint)}",
            )  # fmt: skip
        values = np.asarray(points.columns[paint], dtype=np.float32)
        problem = _problem_of(values)
        if problem:
            raise UsageError(
                f"column {paint!r} {problem}",
                where=argument("paint"),
                advice="give probabilities from 0 to 1",
            )
        return _bounded(values)
    out = np.zeros(len(points), dtype=np.float32)
    number = np.floor(points.xyz[:, :2] / PIECE_M).astype(np.int64)
    for east, north in np.unique(number, axis=0).tolist():
        inside = (number[:, 0] == east) & (number[:, 1] == north)
        at = _near_piece(points, east, north)
        window = _surface_of_piece(surface, east, north)
        near = points.take(at)
        above_m = height_above_road(window, near.xyz)
        keep = np.abs(above_m) <= NEAR_ROAD_M  # NaN: no
        at, above_m = at[keep], above_m[keep]
        if len(at) == 0:
            continue
        given = points.take(at)
        given = Points(
            given.xyz, intensity=given.intensity, time_s=given.time_s, crs=given.crs,
            columns={**given.columns, ABOVE_ROAD: above_m},
        )  # fmt: skip
        own = inside[at]
        out[at[own]] = _probabilities(call_own(paint, "paint", given), len(given))[own]
    return out


def _near_piece(points: Points, east: int, north: int) -> IntArray:
    """Return which points (k,) int64 lie in a piece or its margin."""
    low = np.array([east, north]) * PIECE_M - PIECE_MARGIN_M
    high = low + PIECE_M + 2.0 * PIECE_MARGIN_M
    xy = points.xyz[:, :2]
    return np.flatnonzero(((xy >= low) & (xy < high)).all(axis=1))


def _surface_of_piece(surface: Ground, east: int, north: int) -> Ground:
    """Return the surface over a piece and its margin: heights above it are the same, to the last bit, in every tile."""
    size = surface.grid.cell_width_m
    reach = round((PIECE_M + 2.0 * PIECE_MARGIN_M) / size)
    west_cell = round((east * PIECE_M - PIECE_MARGIN_M) / size)
    north_cell = round(((north + 1) * PIECE_M + PIECE_MARGIN_M) / size)
    left = west_cell - round(surface.grid.east_m / size)
    top = round(surface.grid.north_m / size) - north_cell
    rows = np.clip(np.arange(top, top + reach), 0, surface.grid.n_rows - 1)
    cols = np.clip(np.arange(left, left + reach), 0, surface.grid.n_cols - 1)
    grid = Grid(west_cell * size, north_cell * size, size, size, reach, reach)
    part = np.ix_(rows, cols)
    return Ground(
        grid, surface.z0_m, surface.road_m[part], surface.ground_m[part], surface.is_road[part],
        surface.is_ground[part], surface.sigma[part],
    )  # fmt: skip


def _probabilities(returned: Any, n: int) -> Float32Array:
    """Return what an own function returned as probabilities (n,) float32."""
    try:
        values = np.asarray(returned, dtype=np.float32)
    except (TypeError, ValueError):
        raise OwnCodeError(
            f"returned {type(returned).__name__}, expected an array of {n} probabilities", where="paint"
        ) from None
    if values.shape != (n,):
        raise OwnCodeError(
            f"returned an array of shape {values.shape}, expected ({n},): a probability for each point",
            where="paint",
        )
    problem = _problem_of(values)
    if problem:
        raise OwnCodeError(f"what it returned {problem}, expected probabilities from 0 to 1", where="paint")
    return _bounded(values)


def _problem_of(values: Float32Array) -> str:
    """Return what is wrong with probabilities, or ""."""
    known = values[~np.isnan(values)]
    if len(known) == 0 or (known.min() >= -_ROUNDING and known.max() <= 1.0 + _ROUNDING):
        return ""
    return f"has values from {known.min():g} to {known.max():g}"


def _bounded(values: Float32Array) -> Float32Array:
    return np.clip(np.nan_to_num(values, nan=0.0), 0.0, 1.0).astype(np.float32)
