"""The pixel nearest to a refused pick that works."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from linework.model.arrays import AnyArray

#: Rings around the pick, so far apart, out to the last; places on each. [pixels]
_RING_PX, _LAST_PX, _PLACES = 6.0, 90.0, 16
#: A place is tried where grey values within two pixels differ by so much.
_LEAST_DIFFERENCE = 10


def nearest_pick(
    image: AnyArray, pick: tuple[float, float], works: Callable[[float, float], bool]
) -> tuple[int, int] | None:
    """Return the nearest pixel (col, row) of an image that works, None if there is none within 90 pixels."""
    height, width = image.shape
    for ring in np.arange(_RING_PX, _LAST_PX + 1.0, _RING_PX):
        for turn in 2.0 * np.pi * np.arange(_PLACES) / _PLACES:
            col, row = round(pick[0] + ring * np.cos(turn)), round(pick[1] + ring * np.sin(turn))
            if not (2 <= col < width - 2 and 2 <= row < height - 2):
                continue
            around = image[row - 2 : row + 3, col - 2 : col + 3]
            if int(around.max()) - int(around.min()) >= _LEAST_DIFFERENCE and works(col, row):
                return col, row
    return None
