"""Which images were taken at the same time: by two clocks that agree, but skip, stick or jump now and then."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from linework.arrays import BoolArray, FloatArray, IntArray

#: Half the interval of a car camera (10 Hz), where a camera took too few images to tell its own. [s]
_TOLERANCE_S = 0.05


@dataclass(frozen=True, slots=True)
class PairedTimes:
    """Which image of the left camera goes with which of the right one.

    Parameters
    ----------
    left, right
        (n,) int64: their numbers, in time order.
    tolerance_s
        How far apart two images of a pair may be. [s]
    """

    left: IntArray
    right: IntArray
    tolerance_s: float


def pair_by_time(left_s: FloatArray, right_s: FloatArray) -> PairedTimes:
    """Pair each image with the one nearest in time, where each is the other's nearest.

    Parameters
    ----------
    left_s, right_s
        (n,), (m,) float64 [s], strictly increasing.

    Notes
    -----
    Two images of a pair are at most half the median interval of the faster camera apart: beyond that the next
    image would be as good, and where one is missing its neighbour would be taken for it.

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
    # Times a microsecond beyond half an interval are at half an interval, written with six decimals
    chosen = np.flatnonzero((of_right[of_left] == left) & (apart < tolerance - 1e-6))
    return PairedTimes(chosen.astype(np.int64), of_left[chosen].astype(np.int64), tolerance)


def _nearest(time_s: FloatArray, among_s: FloatArray) -> IntArray:
    """Return which of `among_s` is nearest to each time; the earlier one of two."""
    after = np.clip(np.searchsorted(among_s, time_s), 1, max(len(among_s) - 1, 1))
    after = np.minimum(after, len(among_s) - 1)
    before = np.maximum(after - 1, 0)
    is_before = np.abs(time_s - among_s[before]) <= np.abs(among_s[after] - time_s)
    return np.asarray(np.where(is_before, before, after), dtype=np.int64)


def certain_times(time_s: FloatArray) -> BoolArray:
    """Return which images have a time of their own, (n,), given their times in the order they were taken.

    Notes
    -----
    Of images with the same time as the one before, the first counts. Where the clock was set back, the same
    times were written twice: which of the two an image was taken at nobody knows, and neither counts.

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
