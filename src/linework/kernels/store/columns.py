"""Kernels over the further columns of points: written to runs, checked, and used to settle ties.

Separate from `pack` and `order`, whose loops are as fast as they are because they know their three columns.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from linework.arrays import AnyArray
from linework.kernels.store.order import Room, merge_sort

Sum64 = np.uint64
#: Factors of the two sums of the checksum, as in `linework.kernels.store.pack`.
_MIX_SUM, _MIX_SUMS = Sum64(0x9E3779B97F4A7C15), Sum64(0xD1B54A32D192ED02)


@njit(cache=True, nogil=True)
def scatter_columns(
    columns: AnyArray, owners: AnyArray, firsts: AnyArray, counts: AnyArray, halves: AnyArray
) -> None:
    """Write further columns to the runs of their blocks, in the order in which `scatter_runs` writes the others.

    Parameters
    ----------
    columns
        (k, n) uint32: the bits of float32.
    owners
        (n,) int32: each point's block.
    firsts, counts
        (n_blocks,) int64: where the first column of each block begins in `halves`, and its number of points.
    halves
        (w,) uint32, written: the halves of the words of the runs.
    """
    fill = np.zeros(len(firsts), np.int64)
    for i in range(len(owners)):
        owner = owners[i]
        at = firsts[owner] + fill[owner]
        fill[owner] += 1
        for j in range(len(columns)):
            halves[at + j * counts[owner]] = columns[j, i]


@njit(cache=True, nogil=True)
def checksums_of_columns(columns: AnyArray, starts: AnyArray) -> AnyArray:
    """Return the checksum of each range of columns, (m,) uint64: sums as in `linework.kernels.store.pack.checksum`.

    Parameters
    ----------
    columns
        (k, n) uint32: the bits of float32.
    starts
        (m + 1,) int64: where each range begins.
    """
    sums = np.empty(len(starts) - 1, np.uint64)
    for r in range(len(sums)):
        a, b = Sum64(0), Sum64(0)
        for j in range(len(columns)):
            for i in range(starts[r], starts[r + 1]):
                a += Sum64(columns[j, i])
                b += a
        sums[r] = a * _MIX_SUM + b * _MIX_SUMS
    return sums


@njit(cache=True, nogil=True)
def settle_by_columns(times: AnyArray, intensities: AnyArray, columns: AnyArray, room: Room) -> None:
    """Order points of equal key, time and intensity by their further columns, the first one first.

    Parameters
    ----------
    times, intensities
        (n,) uint64 and uint16.
    columns
        (k, n) uint32: the bits of float32.
    room
        As `linework.kernels.store.order.sort_points` leaves it: sorted keys and their points; the others are scratch.
    """
    keys, order = room[0], room[1]
    n = np.int64(len(keys))
    first = np.int64(0)
    while first < n:
        key, time, intensity = keys[first], times[order[first]], intensities[order[first]]
        last = first + 1
        while last < n and keys[last] == key and times[order[last]] == time:
            if intensities[order[last]] != intensity:
                break
            last += 1
        if last - first > 1:
            # Sorts that keep the order of equals, the last column first: what is sorted last decides first
            for j in range(len(columns) - 1, -1, -1):
                for i in range(first, last):
                    keys[i] = _sortable_half(columns[j, order[i]])
                merge_sort(room, first, last)
            keys[first:last] = key
        first = last


@njit(cache=True, nogil=True)
def _sortable_half(bits: Any) -> Any:
    """Return an integer that sorts as the float32 of these bits; -0.0 comes before 0.0."""
    sign = Sum64(1) << Sum64(31)
    wide = Sum64(bits)
    return (~wide & Sum64(0xFFFFFFFF)) if wide & sign else wide | sign
