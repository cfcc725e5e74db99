"""Kernels that lay outlines over a cross-section: how well a plate, a pipe or a square tube explains its points.

The points of a section lie in few of its cells, so only those with points are visited, at every place of the outline.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import Float32Array, FloatArray, IntArray

#: Cells after which a row of places is looked at again: whether it can still be likelier.
_CELLS_TOGETHER = 16


@njit(cache=True, nogil=True)
def flat_costs(number: FloatArray, across: FloatArray, places: FloatArray, most: float) -> FloatArray:
    """Return the sums of squared distances of points from a plate at each place, (p,) [m²].

    Parameters
    ----------
    number
        (k,) points of each column of cells.
    across
        (k,) middle of each column. [m]
    places
        (p,) tried places of the plate. [m]
    most
        Farther points count as if they were this far off. [m]
    """
    costs = np.zeros(len(places))
    for j in range(len(places)):
        for c in range(len(number)):
            if number[c] > 0.0:
                d = min(abs(across[c] - places[j]), most)
                costs[j] += number[c] * d * d
    return costs


@njit(cache=True, nogil=True)
def likeliest_view(
    cells: IntArray,
    number: FloatArray,
    views: Float32Array,
    largest: Float32Array,
    places: IntArray,
    most: float,
    at: int,
) -> tuple[float, int]:
    """Return how unlikely the points of a section are in the likeliest view of an outline [nats], and its place.

    Views that are no likelier than `most` do not count: a row of places is left as soon as what its cells have added, and
    the least that the others will add, are no less. Whole numbers times float32 add up without rounding, in any order.

    Parameters
    ----------
    cells
        (k, 2) cells with points: their row, and their distance across from the line [columns of a view]. Those of most
        points first, a row of places is left soonest.
    number
        (k,) points of each, whole numbers.
    views
        (v, rows, columns) float32 logarithms of the share of points in each cell, the middle of the outline in the middle
        column.
    largest
        (v, rows) float32 largest of each row of a view.
    places
        (p,) int64 tried places of the middle, rising. [columns of a view]
    most, at
        How unlikely they are in the likeliest of other views, infinity without any, and its place.
    """
    middle = views.shape[2] // 2
    best, best_place = most, at
    rest, costs = np.zeros(len(cells) + 1), np.empty(len(places))
    for view in range(views.shape[0]):
        for i in range(len(cells) - 1, -1, -1):
            rest[i] = rest[i + 1] - number[i] * largest[view, cells[i, 0]]
        first = 0
        while first < len(places):
            last = first
            while last + 1 < len(places) and places[last + 1] == places[last] + 1:
                last += 1
            row = costs[: last - first + 1]
            if _costs_in_row(cells, number, views[view], middle - places[last], rest, best, row):
                for place in range(places[first], places[last] + 1):
                    cost = row[places[last] - place]
                    if cost < best:
                        best, best_place = cost, place
            first = last + 1
    return best, best_place


@njit(cache=True, nogil=True)
def _costs_in_row(
    cells: IntArray, number: FloatArray, view: Float32Array, shift: int, rest: FloatArray, most: float, costs: FloatArray
) -> bool:  # fmt: skip
    """Write how unlikely points are in a view (rows, columns) moved by `shift` columns, by one more, ... [nats].

    False where none is less than `most`: `costs` are then not complete. `rest` (k + 1,) are the least that the cells from
    each one on add.
    """
    costs[:] = 0.0
    n_columns = view.shape[1]
    for i in range(len(cells)):
        column = cells[i, 1] + shift
        if column >= 0 and column + len(costs) <= n_columns:
            shares = view[cells[i, 0], column : column + len(costs)]
            for j in range(len(costs)):
                costs[j] -= number[i] * shares[j]
        else:
            for j in range(len(costs)):
                costs[j] -= number[i] * view[cells[i, 0], min(max(column + j, 0), n_columns - 1)]
        if i % _CELLS_TOGETHER == 0:
            least = costs[0]
            for j in range(1, len(costs)):
                least = min(least, costs[j])
            if least + rest[i + 1] >= most:
                return False
    return True
