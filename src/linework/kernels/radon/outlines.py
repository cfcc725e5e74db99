"""Kernels that lay outlines over a cross-section: how far its points are from a plate, a pipe or a square tube.

The points of a section lie in few of its cells, so only those with points are visited, at every place of the outline.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import FloatArray


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
def bar_costs(
    points: FloatArray,
    places: FloatArray,
    half: float,
    most: float,
    top: tuple[float, float],
) -> FloatArray:
    """Return how well a pipe and a square tube explain a section at each place, (p, 5).

    Parameters
    ----------
    points
        (n, 3) cells with points: their number, distance across and height over the middle of the outline. [m]
    places
        (p,) tried places of the middle. [m]
    half
        Half of the thickness. [m]
    most
        Farther points count as if they were this far off. [m]
    top
        What is on top of a tube is above the first, and nearer to its middle than the second. [m]

    Returns
    -------
    (p, 5) float64
        Sums of squared distances from the pipe and from the tube [m²], the numbers of points that are no farther than
        `most` from each, and the number of points on the tube's top.
    """
    out = np.zeros((len(places), 5))
    over, inside = top
    for j in range(len(places)):
        pipe, box, on_pipe, on_box, on_top = 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(len(points)):
            number, across, tall = points[i, 0], abs(points[i, 1] - places[j]), points[i, 2]
            if tall > over and across < inside:
                on_top += number
            if across > half + most:
                pipe += number * most * most
                box += number * most * most
                continue
            d = abs(np.hypot(across, tall) - half)
            on_pipe += number if d <= most else 0.0
            pipe += number * min(d, most) ** 2
            d = outside_of_tube(across, tall, half)
            on_box += number if d <= most else 0.0
            box += number * min(d, most) ** 2
        out[j, 0], out[j, 1], out[j, 2], out[j, 3], out[j, 4] = pipe, box, on_pipe, on_box, on_top
    return out


@njit(cache=True, nogil=True)
def outside_of_tube(across: float, tall: float, half: float) -> float:
    """Return the distance of a point from the faces of a square tube [m]; across is not negative."""
    sideways, upward = across - half, abs(tall) - half
    inner = max(sideways, upward)
    if inner <= 0.0:
        return -inner
    if sideways <= 0.0:
        return upward
    return float(sideways if upward <= 0.0 else np.hypot(sideways, upward))
