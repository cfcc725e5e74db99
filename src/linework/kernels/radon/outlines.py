"""Kernels that lay outlines over a cross-section: how well a plate, a pipe or a square tube explains its points.

The points of a section lie in few of its cells, so only those with points are visited, at every place of the outline.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import Float32Array, FloatArray, IntArray


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
    cells: IntArray, number: FloatArray, views: Float32Array, places: IntArray, most: float, at: int
) -> tuple[float, int]:
    """Return how unlikely the points of a section are in the likeliest view of an outline [nats], and its place.

    Views that are no likelier than `most` do not count.

    Parameters
    ----------
    cells
        (k, 2) cells with points: their row, and their distance across from the line [columns of a view].
    number
        (k,) points of each.
    views
        (v, rows, columns) float32 logarithms of the share of points in each cell, the middle of the outline in the middle
        column.
    places
        (p,) int64 tried places of the middle. [columns of a view]
    most, at
        How unlikely they are in the likeliest of other views, infinity without any, and its place.
    """
    middle = views.shape[2] // 2
    best, best_place = most, at
    for view in range(views.shape[0]):
        for place in places:
            cost = 0.0
            for i in range(len(cells)):
                column = min(max(cells[i, 1] - place + middle, 0), views.shape[2] - 1)
                cost -= number[i] * views[view, cells[i, 0], column]
                if cost >= best:  # shares are less than 1: costs only grow
                    break
            if cost < best:
                best, best_place = cost, place
    return best, best_place
