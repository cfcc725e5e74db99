"""Whether something nearer stands where a line should be seen."""

from __future__ import annotations

import numpy as np

from linework.arrays import AnyArray, FloatArray
from linework.methods.stereo.edge_view import View

#: Half size of the windows that are compared. [rows, columns]
_HALF = (4, 7)
#: Two windows show the same thing when they correlate so well; the nearer must do so better than the road by this.
_SAME, _BETTER = 0.8, 0.1
#: Something that stands on the road is nearer than the road behind it by at least so much of its disparity, and by
#: at least so many pixels. Nothing is looked for nearer than a quarter of the distance.
_NEARER, _NEARER_PX, _NEAREST = 1.12, 2.0, 4.0


def is_hidden(view: View, places: FloatArray) -> bool:
    """Return whether most of (n, 3) places [m, local world] are behind something.

    Notes
    -----
    The window around each place in the left image is looked for along its row of the right image. It is hidden
    where a disparity larger than the place's own fits better.
    """
    ahead = places[view.is_inside(0, places) & (view.depth_m(places) > 1.0)]
    if len(ahead) == 0:
        return False
    left, right = view.pixels(0, ahead), view.pixels(1, ahead)
    votes = [
        _is_nearer(view.images, c, r, d) for (c, r), d in zip(left, left[:, 0] - right[:, 0], strict=True)
    ]
    return 2 * sum(votes) > len(votes)


def _is_nearer(images: tuple[AnyArray, AnyArray], col: float, row: float, disparity: float) -> bool:
    left, right = images
    c, r = round(col), round(row)
    high, wide = _HALF
    if not (high <= r < left.shape[0] - high and wide <= c < left.shape[1] - wide):
        return False
    window = _normal(left[r - high : r + high + 1, c - wide : c + wide + 1].astype(np.float64)[None])[0]
    first = max(c - wide - int(_NEAREST * disparity) - 1, 0)
    strip = right[r - high : r + high + 1, first : c + wide + 1 - max(int(disparity) - 2, 0)].astype(
        np.float64
    )
    if strip.shape[1] < 2 * wide + 1:
        return False
    shifted = np.lib.stride_tricks.sliding_window_view(strip, window.shape)[0]
    alike = np.einsum("krc,rc->k", _normal(shifted), window)
    found = c - wide - (first + np.arange(len(alike)))
    nearer = found > max(_NEARER * disparity, disparity + _NEARER_PX)
    if not nearer.any() or nearer.all():
        return False
    best = alike[nearer].max()
    return bool(best > _SAME and best > alike[~nearer].max() + _BETTER)


def _normal(windows: FloatArray) -> FloatArray:
    """Return (k, rows, columns) windows less their mean, of unit length; empty ones stay 0."""
    out = windows - windows.mean(axis=(1, 2), keepdims=True)
    length = np.sqrt((out * out).sum(axis=(1, 2), keepdims=True))
    return np.asarray(out / np.maximum(length, 1.0))
