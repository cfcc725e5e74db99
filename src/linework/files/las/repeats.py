"""Find points that a survey holds twice: a file merged with itself, or one drive in two files.

A sample of each file is kept, chosen by the points' coordinates: two equal points are both in it or neither,
whatever their files and order.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from itertools import combinations

import numpy as np

from linework.arrays import AnyArray, FloatArray, IntArray
from linework.files.store.layout import STORE_STEPS_PER_M

#: Approximate sample size of a whole survey: shares are accurate to a percent.
_SAMPLE = 1 << 16
#: Largest sample of one file; reached only by points that all have the same easting.
_MOST_OF_A_FILE = 1 << 18
#: Smallest sample that allows a conclusion.
_LEAST = 100
#: Least share of repeated points to report: no scanner measures a place twice at the same time, and 1 in 20 is the
#: seam of two tiles. Without times, coordinates rounded to centimetres coincide by chance.
_SHARE_TIMED, _SHARE_UNTIMED = 0.05, 0.3
#: Odd 64-bit numbers that spread neighbouring values (the golden ratio; the mixer of the SplitMix64 generator).
_SPREAD, _MIX = np.uint64(0x9E3779B97F4A7C15), np.uint64(0xBF58476D1CE4E5B9)


def sample_bits(n_points: int) -> int:
    """Return the sampling rate of a survey, in bits: one in 2**bits points.

    >>> sample_bits(1000), sample_bits(50_000_000)
    (0, 10)
    """
    return max(0, int(n_points / _SAMPLE).bit_length())


def sampled(xyz: FloatArray, bits: int) -> IntArray:
    """Return the numbers of one in 2**bits points (n, 3) [m], chosen by their coordinates, whatever their order."""
    if bits == 0:
        return np.arange(len(xyz))
    # One multiplication per point: the high bits of the product are uniformly distributed
    spread = _steps(xyz[:, 0])
    spread *= _SPREAD
    return np.flatnonzero(spread < np.uint64(1 << (64 - bits)))


class PointSample:
    """Sample of one file: a hash per point of its coordinates, time and intensity."""

    def __init__(self, bits: int) -> None:
        self._bits = bits
        self._parts: list[AnyArray] = []
        self._n = 0

    def add(self, xyz: FloatArray, intensity: AnyArray, time_s: FloatArray | None) -> None:
        """Add a batch to the sample.

        Parameters
        ----------
        xyz, intensity, time_s
            (n, 3) [m], (n,) uint16 and (n,) [s] or None, as written to the store.
        """
        if self._n >= _MOST_OF_A_FILE:
            return
        place = xyz
        if self._bits:
            chosen = sampled(xyz, self._bits)
            place, intensity = xyz[chosen], intensity[chosen]
            time_s = None if time_s is None else time_s[chosen]
        columns = [_steps(place[:, axis]) for axis in range(3)]
        columns.append(intensity.astype(np.uint64))
        key = np.zeros(len(place), np.uint64)
        if time_s is not None:
            columns.append(time_s.view(np.uint64))
        for column in columns:
            key = (key ^ column) * _MIX
            key ^= key >> np.uint64(32)
        self._parts.append(key)
        self._n += len(key)

    def numbers(self) -> AnyArray:
        """Return the sample, (n,) uint64, sorted."""
        return np.sort(np.concatenate([np.empty(0, np.uint64), *self._parts]))


def repeated_inside(sample: AnyArray, *, has_time: bool) -> tuple[str, ...]:
    """Return a warning about a file whose points repeat, or none.

    Parameters
    ----------
    sample
        Of `PointSample.numbers`.
    """
    share = 1.0 - len(np.unique(sample)) / max(len(sample), 1)
    if len(sample) < _LEAST or share < _least_share(has_time):
        return ()
    return (f"about {share:.0%} of the points repeat others ({_same(has_time)})",)


def repeated_elsewhere(samples: Sequence[AnyArray], *, has_time: bool) -> dict[int, tuple[int, float]]:
    """Return, for files whose points are in another one too, that file and the share of the points.

    Of two files with the same points the later one is listed.
    """
    owners = [np.unique(sample) for sample in samples]
    numbers = np.concatenate([np.empty(0, np.uint64), *owners])
    files = np.repeat(np.arange(len(owners)), [len(own) for own in owners])
    order = np.lexsort((files, numbers))
    numbers, files = numbers[order], files[order]
    starts = np.flatnonzero(np.concatenate([[True], numbers[1:] != numbers[:-1]])[: len(numbers)])
    counts = np.diff(starts, append=len(numbers))
    shared: Counter[tuple[int, int]] = Counter()
    for start, n in zip(starts[counts > 1].tolist(), counts[counts > 1].tolist(), strict=True):
        shared.update(combinations(files[start : start + n].tolist(), 2))
    found: dict[int, tuple[int, float]] = {}
    for (first, second), n in shared.items():
        for own, other in ((second, first), (first, second)):
            share = n / len(owners[own])
            is_copy_of_own = found.get(other, (-1, 0.0))[0] == own and found[other][1] == 1.0
            if len(owners[own]) >= _LEAST and share >= _least_share(has_time) and not is_copy_of_own:
                found[own] = max(found.get(own, (other, 0.0)), (other, share), key=lambda best: best[1])
    return found


def repeats_message(share: float, other: str, *, has_time: bool) -> str:
    """Return a line about a file whose points another one holds too."""
    return f"about {share:.0%} of the points are in {other} too ({_same(has_time)})"


def _least_share(has_time: bool) -> float:
    return _SHARE_TIMED if has_time else _SHARE_UNTIMED


def _same(has_time: bool) -> str:
    return "same place, time and intensity" if has_time else "same place and intensity"


def _steps(column_m: FloatArray) -> AnyArray:
    """Return coordinates as whole steps of the store's lattice, their bits as (n,) uint64."""
    steps = column_m * STORE_STEPS_PER_M
    np.rint(steps, out=steps)
    steps += 0.0  # -0 and 0 are one place
    return steps.view(np.uint64)
