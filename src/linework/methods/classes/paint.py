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
#: Shares of a normal distribution one standard deviation below and above its median.
_LOW, _HIGH = 0.1587, 0.8413
#: Standard errors of those two shares of normal values, in standard deviations of one over the root of their number.
_ERROR_OF_BRIGHT, _ERROR_OF_MIDDLE = 1.709, 1.253
#: Paint shows where either share stands out from that beside it by so many standard errors: of pieces without paint one
#: in 370 does.
_LEAST_T = 3.0
#: Steps in which intensities are recorded: counts, and 8 bits stretched to 16 by either factor. [counts]
_STEPS = (1.0, 256.0, 257.0)
#: Standard error of a level that was rounded to such a step, in steps: values that scatter less are all rounded alike, and
#: their number makes it no smaller.
_ERROR_OF_STEP = 12.0**-0.5
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
    n = len(least)
    (road, n_road), (paint, n_paint) = (_by_piece(value[k], piece[k], n) for k in (beside, is_on))
    dark, dark_bright, below, above = (
        _share_of(road, n_road, share) for share in (_MIDDLE, _BRIGHT, _LOW, _HIGH)
    )
    middle, bright = (_share_of(paint, n_paint, share) for share in (_MIDDLE, _BRIGHT))
    known = np.isfinite(dark) & np.isfinite(bright)
    least[known] = np.inf
    # In units of the noise beside the piece, which holds whatever the zero of the intensities is
    points = np.stack([np.diff(n_road), np.diff(n_paint)])[:, known]
    error = 0.5 * (above - below)[known] * np.sqrt((1.0 / points).sum(axis=0))
    error = np.maximum(error, _ERROR_OF_STEP * _step_of(value, piece, n)[known])
    shows = (bright - dark_bright)[known] > _LEAST_T * _ERROR_OF_BRIGHT * error
    shows |= (middle - dark)[known] > _LEAST_T * _ERROR_OF_MIDDLE * error
    shown = np.flatnonzero(known)[shows]
    least[shown] = 0.5 * (dark + bright)[shown]
    return least


def _by_piece(value: FloatArray, piece: AnyArray, n: int) -> tuple[FloatArray, IntArray]:
    """Return values sorted within their pieces, and where those of each of n pieces start, (n + 1,)."""
    order = np.lexsort((value, piece))
    return value[order], np.searchsorted(piece[order], np.arange(n + 1)).astype(np.int64)


def _step_of(value: FloatArray, piece: IntArray, n: int) -> FloatArray:
    """Return the step in which the values of each of n pieces were recorded, (n,) float64; 0 where they show none."""
    step = np.zeros(n)
    for size in _STEPS:
        step[np.bincount(piece[value % size != 0.0], minlength=n) == 0] = size
    return step


def _share_of(value: FloatArray, start: IntArray, share: float) -> FloatArray:
    """Return the value below which a share of the values of each piece lie, (n,) float64; NaN for too few of them."""
    count = np.diff(start)
    found = np.full(len(count), np.nan)
    enough = np.flatnonzero(count >= _LEAST_POINTS)
    found[enough] = value[start[enough] + np.floor(share * (count[enough] - 1)).astype(np.int64)]
    return found
