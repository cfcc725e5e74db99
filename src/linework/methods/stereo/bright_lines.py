"""Bright line markers, thinning and line following, as published (sections 3.1 to 3.3)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter

from linework.arrays import AnyArray, BoolArray, FloatArray, IntArray
from linework.kernels.thinning import corners_of, follow_chains, thin_in_place

#: The published settings: window of the median [pixels], standard deviations above the mean of the scan line, and
#: the shortest line that is kept [pixels].
MEDIAN_PX, SIGMAS, LEAST_PX = 5, 1.5, 10


@dataclass(frozen=True, slots=True)
class Chains:
    """Lines of pixels: line i is ``pixels[offsets[i]:offsets[i + 1]]``, (row, col), from its lowest end up.

    `is_corner` tells the pixels that a straight line between their neighbours does not pass: only these would have
    to be stored.
    """

    pixels: IntArray
    offsets: IntArray
    is_corner: BoolArray

    def __len__(self) -> int:
        return len(self.offsets) - 1

    def line(self, i: int) -> IntArray:
        """Return the (n, 2) pixels of line i."""
        return self.pixels[self.offsets[i] : self.offsets[i + 1]]


def bright_pixels(image: AnyArray, window: BoolArray | None = None) -> BoolArray:
    """Return where the median of five pixels is more than 1.5 standard deviations above its scan line's mean (3.1).

    Parameters
    ----------
    image
        (rows, cols) uint8.
    window
        (rows, cols) bool: where the road is expected; None: everywhere.

    Returns
    -------
    ndarray
        (rows, cols) bool.
    """
    grey = image.astype(np.float64)
    inside = np.ones(image.shape) if window is None else window.astype(np.float64)
    n = np.maximum(inside.sum(axis=1, keepdims=True), 1.0)
    mean = (grey * inside).sum(axis=1, keepdims=True) / n
    sigma = np.sqrt(((grey - mean) ** 2 * inside).sum(axis=1, keepdims=True) / n)
    median = median_filter(image, size=(1, MEDIAN_PX)).astype(np.float64)
    return np.asarray((median - mean > SIGMAS * sigma) & (inside > 0.0))


def centres_of_runs(bright: BoolArray) -> FloatArray:
    """Return for every bright pixel the middle column of the run of bright pixels side by side it is in (3.1).

    >>> centres_of_runs(np.array([[0, 1, 1, 1, 0, 1]], dtype=bool)).tolist()
    [[nan, 2.0, 2.0, 2.0, nan, 5.0]]
    """
    padded = np.pad(bright.astype(np.int8), ((0, 0), (1, 1)))
    step = np.diff(padded, axis=1)
    first, beyond = np.nonzero(step == 1)[1], np.nonzero(step == -1)[1]
    centres = np.full(bright.shape, np.nan)
    # Runs and their pixels are both in the order of rows, then columns
    centres[bright] = np.repeat((first + beyond - 1) / 2.0, beyond - first)
    return centres


def thinned(white: BoolArray) -> BoolArray:
    """Return lines one pixel wide in the middle of white areas (3.2)."""
    image = np.pad(white.astype(np.uint8), 1)
    thin_in_place(image)
    return image[1:-1, 1:-1].astype(bool)


def chain_code(thin: BoolArray, least_px: int = LEAST_PX) -> Chains:
    """Return the lines of a thinned image, followed pixel by pixel; shorter ones are dropped (3.3)."""
    pixels, offsets = follow_chains(np.pad(thin.astype(np.uint8), 1), least_px)
    return Chains(pixels - 1, offsets, corners_of(pixels, offsets))
