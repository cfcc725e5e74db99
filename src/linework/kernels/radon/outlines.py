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
def pipe_rarity(
    points: FloatArray, place: float, sizes: tuple[float, float, float], elevations: FloatArray
) -> float:
    """Return how rare the places of points on a pipe are, against places evenly over its height: about that, in nats.

    Beams are evenly spaced across their direction: on a piece of outline they return in proportion to how squarely it
    faces the scanner, and a plate has as many at any height. Distances alone do not say this: near its top, where a pipe
    is level, any error across costs nothing, and it explains a plate with noise as well as a plate does. The direction is
    that of the most likely view, from the left, the right, or in two passes from both. The blur of the limb is not taken
    from the rest of the surface, so that with much noise (2 cm and more on 12 cm) plates still look like pipes.

    Parameters
    ----------
    points
        (n, 3) cells with points: their number, distance across and height over the middle of the pipe. [m]
    place
        Of its middle. [m]
    sizes
        Its radius, the distance from which on points do not lie on it and are not counted, and the standard deviation of
        the noise: it blurs the limb, which beams graze. [m]
    elevations
        (e,) tried elevations of the scanner. [rad]
    """
    radius, most, noise = sizes
    # Half of what the surface shows, on average, over the noise beside its limb
    limb = 0.5 * np.sqrt(1.6 * noise / radius)
    best = np.inf
    for e in range(len(elevations)):
        level, down = np.cos(elevations[e]), np.sin(elevations[e])
        for side in range(-1, 2):
            # Each of two passes has half of the points
            share, rarity = (1.0 if side != 0 else 0.5), 0.0
            for i in range(len(points)):
                number, across, tall = points[i, 0], points[i, 1] - place, points[i, 2]
                across = abs(across) if side == 0 else side * across
                away = max(np.hypot(across, tall), 1e-9)
                if abs(away - radius) <= most:
                    facing = (level * across + down * tall) / away
                    rarity -= number * np.log(share * 0.5 * (facing + np.sqrt(facing**2 + 4.0 * limb**2)))
            best = min(best, rarity)
    return best


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
