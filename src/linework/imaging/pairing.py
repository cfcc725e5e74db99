"""Pairing of images by time, where clocks agree but may skip, stick or jump, and images with unambiguous times."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from linework.arrays import BoolArray, FloatArray, IntArray

#: Half the interval of a car camera (10 Hz), used where there are too few images for their own interval. [s]
_TOLERANCE_S = 0.05


@dataclass(frozen=True, slots=True)
class PairedTimes:
    """Pairs of images of the left and the right camera.

    Parameters
    ----------
    left, right
        (n,) int64: indices of the images of each pair, in time order.
    tolerance_s
        Largest difference in time of a pair. [s]
    """

    left: IntArray
    right: IntArray
    tolerance_s: float


def pair_by_time(left_s: FloatArray, right_s: FloatArray) -> PairedTimes:
    """Return the pairs of images that are each other's nearest in time.

    Parameters
    ----------
    left_s, right_s
        (n,), (m,) float64 [s], strictly increasing.

    Notes
    -----
    The images of a pair are less than half the median interval of the faster camera apart: beyond that the next image
    would be as near, and the neighbour of a missing image would be taken for it.

    Examples
    --------
    The second image of the right camera is missing:

    >>> found = pair_by_time(np.array([0.0, 0.1, 0.2]), np.array([0.001, 0.201]))
    >>> found.left.tolist(), found.right.tolist(), found.tolerance_s
    ([0, 2], [0, 1], 0.05)
    """
    intervals = [float(np.median(np.diff(s))) for s in (left_s, right_s) if len(s) > 1]
    tolerance = 0.5 * min(intervals) if intervals else _TOLERANCE_S
    if not len(left_s) or not len(right_s):
        return PairedTimes(np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64), tolerance)
    of_left, of_right = _nearest(left_s, right_s), _nearest(right_s, left_s)
    left = np.arange(len(left_s))
    apart = np.abs(right_s[of_left] - left_s)
    # A microsecond of slack: times are written with six decimals
    chosen = np.flatnonzero((of_right[of_left] == left) & (apart < tolerance - 1e-6))
    return PairedTimes(chosen.astype(np.int64), of_left[chosen].astype(np.int64), tolerance)


def _nearest(time_s: FloatArray, among_s: FloatArray) -> IntArray:
    """Return (n,) the index of the time in `among_s` nearest to each time, the earlier one of two equally near."""
    after = np.clip(np.searchsorted(among_s, time_s), 1, max(len(among_s) - 1, 1))
    after = np.minimum(after, len(among_s) - 1)
    before = np.maximum(after - 1, 0)
    is_before = np.abs(time_s - among_s[before]) <= np.abs(among_s[after] - time_s)
    return np.asarray(np.where(is_before, before, after), dtype=np.int64)


def certain_times(time_s: FloatArray) -> BoolArray:
    """Return (n,) bool: the time of the image is unambiguous.

    Parameters
    ----------
    time_s
        (n,) times of the images in the order they were taken. [s]

    Notes
    -----
    Of images with equal times in a row, the first is used. Where the clock was set back, a range of times occurs
    twice: the images of both passes are ambiguous, and none of them is used.

    Examples
    --------
    A clock that is set back from 0.3 s to 0.15 s:

    >>> certain_times(np.array([0.0, 0.1, 0.2, 0.3, 0.15, 0.25, 0.35, 0.45])).tolist()
    [True, True, False, False, False, False, True, True]
    """
    is_new = np.diff(time_s, prepend=-np.inf) != 0.0
    kept = time_s[is_new]
    ends = np.flatnonzero(np.diff(kept) < 0.0)
    first, last = np.append(0, ends + 1), np.append(ends, len(kept) - 1)
    n_covering = np.searchsorted(np.sort(kept[first]), kept, side="right") - np.searchsorted(
        np.sort(kept[last]), kept, side="left"
    )
    certain = np.zeros(len(time_s), dtype=bool)
    certain[np.flatnonzero(is_new)[n_covering == 1]] = True
    return certain
