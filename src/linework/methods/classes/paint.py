"""How bright a point must be to be paint, at every piece of a marking: worn paint is road.

Separate from `tile`, which asks it: what is known of intensities is here.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from linework.arrays import AnyArray, BoolArray, Float32Array, FloatArray, IntArray
from linework.kernels.classes.near_lines import MARKING_PIECE, NearLines
from linework.kernels.classes.paint import on_and_beside

#: Paint is as bright as the brightest tenth of what is within its outline, as worn paint has bare places; road as the
#: median of what is beside it. [share]
_BRIGHT, _MIDDLE = 0.90, 0.5
#: Plain asphalt, whose texture and noise are some 10 %, differs by less between those two shares; paint, which is at
#: least 1.3 times as bright as road, by more. [ratio]
_LEAST_CONTRAST = 1.15
#: Fewest points on and beside a piece that show it. [points]
_LEAST_POINTS = 8


def least_of_paint(
    near: NearLines,
    xyz: FloatArray,
    intensity: Float32Array | None,
    low: IntArray,
    is_road: Callable[[IntArray], BoolArray],
) -> FloatArray:
    """Return the least intensity of a point of paint at each piece, (n,) float64.

    Parameters
    ----------
    xyz, intensity
        (m, 3) points [m, world] and (m,) intensities; None: there are none, and all points within the outline are paint.
    low
        (k,) int64: the points on the ground.
    is_road
        Returns which points (j,), by their numbers, are road or paint: beyond an edge line grass may be brighter.

    Returns
    -------
    least
        Infinite where no paint shows: what was drawn there is too wide, or gone. Minus infinity where too few points
        show anything, and for all that are not markings.
    """
    least = np.full(len(near.kind), -np.inf)
    if intensity is None or not (near.kind == MARKING_PIECE).any():
        return least
    point, piece, is_on = on_and_beside(xyz, low, near)
    value = intensity[point].astype(np.float64)
    beside = ~is_on
    beside[beside] = is_road(point[beside])
    dark = _share_of(value[beside], piece[beside], len(least), _MIDDLE)
    bright = _share_of(value[is_on], piece[is_on], len(least), _BRIGHT)
    known = np.isfinite(dark) & np.isfinite(bright)
    shows = known & (bright >= _LEAST_CONTRAST * dark)
    least[known] = np.inf
    least[shows] = 0.5 * (dark + bright)[shows]
    return least


def _share_of(value: FloatArray, piece: AnyArray, n: int, share: float) -> FloatArray:
    """Return the value below which a share of the values of each piece lie, (n,) float64; NaN for too few of them."""
    order = np.lexsort((value, piece))
    start = np.searchsorted(piece[order], np.arange(n + 1))
    count = np.diff(start)
    found = np.full(n, np.nan)
    enough = np.flatnonzero(count >= _LEAST_POINTS)
    at = start[enough] + np.floor(share * (count[enough] - 1)).astype(np.int64)
    found[enough] = value[order][at]
    return found
