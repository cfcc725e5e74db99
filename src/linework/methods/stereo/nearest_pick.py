"""The pixel nearest to a refused pick that works."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from linework.arrays import AnyArray

#: Rings around the pick, so far apart, out to the last; places on each. [pixels]
_RING_PX, _LAST_PX, _PLACES = 6.0, 90.0, 16
#: A place is tried where grey values within two pixels differ by so much, and by half of what they do where they
#: differ most around the pick; so many places at most: each takes as long as a pick.
_LEAST_DIFFERENCE, _OF_THE_MOST, _MOST_TRIES = 10.0, 0.5, 40


def nearest_pick(
    image: AnyArray,
    pick: tuple[float, float],
    is_road: Callable[[float, float], bool],
    works: Callable[[float, float], bool],
) -> tuple[int, int] | None:
    """Return the nearest pixel (col, row) of an image that works, None if there is none within 90 pixels.

    Parameters
    ----------
    is_road
        Whether a pixel shows the road's surface, near enough: asked of all places.
    works
        Whether a line can be followed from it: asked of those that differ from their surroundings.
    """
    height, width = image.shape
    places = [
        (round(pick[0] + ring * np.cos(turn)), round(pick[1] + ring * np.sin(turn)))
        for ring in np.arange(_RING_PX, _LAST_PX + 1.0, _RING_PX)
        for turn in 2.0 * np.pi * np.arange(_PLACES) / _PLACES
    ]
    inside = [(c, r) for c, r in places if 2 <= c < width - 2 and 2 <= r < height - 2 and is_road(c, r)]
    if not inside:
        return None
    differ = np.array([float(np.ptp(image[r - 2 : r + 3, c - 2 : c + 3])) for c, r in inside])
    least = max(_LEAST_DIFFERENCE, _OF_THE_MOST * float(differ.max()))
    tried = [inside[i] for i in np.flatnonzero(differ >= least)[:_MOST_TRIES]]
    return next((place for place in tried if works(*place)), None)
