"""Kernels over the points of one block: selection, canonical order, coordinates.

The bits of a key are described in `linework.files.store.layout`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from linework.arrays import AnyArray
from linework.kernels.store.pack import (
    COL_BIT,
    COL_MASK,
    EAST_BIT,
    HEIGHT_MASK,
    KEY_CELL_STEPS,
    KEY_STEPS_PER_M,
    NORTH_BIT,
    PLAN_MASK,
    ROW_BIT,
    checksum,
)

Key64 = np.uint64
#: Keys (uint64) and indices of points (int32), and the same again as scratch.
Room = tuple[AnyArray, AnyArray, AnyArray, AnyArray]

#: Longest range that is sorted by insertion: measured best between 8 and 32.
_FEW = 16
#: Bits of the first buckets, the 2**14 cells of a block: more would no longer stay in the cache.
_CELL_BITS = 14
#: Most bits of the buckets of a cell's points: two for each of its 5,000 steps from south to north.
_MOST_BITS = 13
#: Cells in a row of a block.
_BLOCK_CELLS = 128


@njit(cache=True, nogil=True)
def first_damaged(
    keys: AnyArray,
    times: AnyArray,
    intensities: AnyArray,
    starts: AnyArray,
    has_time: AnyArray,
    sums: AnyArray,
) -> int:
    """Return the first run whose checksum does not match its columns, -1 without any.

    Parameters
    ----------
    keys, times, intensities
        (n,) uint64, uint64 (bits of float64) and uint16: the columns of all runs, one after the other.
    starts
        (m + 1,) int64: where each run begins.
    has_time, sums
        (m,) bool and uint64: whether a run has times, and its recorded checksum.
    """
    for r in range(len(sums)):
        a, b = starts[r], starts[r + 1]
        b_time = b if has_time[r] else a
        if checksum(keys[a:b], times[a:b_time], intensities[a:b]) != sums[r]:
            return r
    return -1


@njit(cache=True, nogil=True)
def keep_inside(
    keys: AnyArray, times: AnyArray, intensities: AnyArray, box: AnyArray, floors: AnyArray
) -> int:
    """Move the wanted points to the front, and return their number.

    Parameters
    ----------
    keys, times, intensities
        (n,) uint64, uint64 and uint16, reordered.
    box
        (6,) int64 west, east, south, north, low, high from the block's corner, half open. [steps]
    floors
        (129 * 128,) int32 lowest wanted z per cell from the block's corner [steps]; or of length 0: no limit. Row 0
        is the southern edge of the block, row k the cells whose northern edge is k cells farther north: cells of
        images are open to the south, those of keys to the north.
    """
    with_floors = len(floors) > 0
    m = 0
    for i in range(len(keys)):
        key = keys[i]
        y_in_cell = np.int64((key >> NORTH_BIT) & PLAN_MASK)
        x = np.int64((key >> COL_BIT) & COL_MASK) * KEY_CELL_STEPS + np.int64((key >> EAST_BIT) & PLAN_MASK)
        y = np.int64(key >> ROW_BIT) * KEY_CELL_STEPS + y_in_cell
        z = np.int64(key & HEIGHT_MASK)
        inside = (x >= box[0]) & (x < box[1]) & (y >= box[2]) & (y < box[3]) & (z >= box[4]) & (z < box[5])
        if with_floors:
            cell = np.int64(key >> COL_BIT) + (_BLOCK_CELLS if y_in_cell > 0 else 0)
            inside &= z >= floors[cell]
        # Always written, counted where wanted: no branch to predict
        keys[m], times[m], intensities[m] = key, times[i], intensities[i]
        m += inside
    return m


@njit(cache=True, nogil=True)
def sort_points(keys: AnyArray, times: AnyArray, intensities: AnyArray, room: Room) -> None:
    """Sort points into the canonical order: by key, then by time, then by intensity.

    Parameters
    ----------
    keys, times, intensities
        (n,) uint64, uint64 and uint16.
    room
        Keys (n,) uint64 and indices (n,) int32, and the same again. The first two are written: the sorted keys and
        the index of the point at each place; the others are scratch.

    Notes
    -----
    A counting sort into cells, then of each cell's points into as many buckets as it has points; the few points
    of a bucket are sorted by insertion, or by merging where they are many. 15 to 20 ns per point where numpy's
    argsort takes 60 to 75.
    """
    n = len(keys)
    bits = min(_CELL_BITS, _bits_for(n))
    shift = Key64(64 - bits)
    fill = np.zeros((1 << bits) + 1, np.int32)
    for i in range(n):
        fill[(keys[i] >> shift) + Key64(1)] += 1
    for k in range(1, len(fill)):
        fill[k] += fill[k - 1]
    to_keys, to_order = room[0], room[1]
    for i in range(n):
        k = keys[i] >> shift
        at = fill[k]
        fill[k] = at + 1
        to_keys[at], to_order[at] = keys[i], i
    buckets = np.empty((1 << _MOST_BITS) + 1, np.int32)
    first = np.int64(0)
    for k in range(1 << bits):
        last = np.int64(fill[k])  # by now the begin of the next bucket
        if last - first > 1:
            _sort_bucket(room, first, last, 64 - bits, buckets)
        first = last
    _settle_ties(times, intensities, room)


@njit(cache=True, nogil=True)
def _bits_for(n: int) -> int:
    """Return the number of bits of n - 1, at least 1."""
    bits = 1
    while (1 << bits) < n:
        bits += 1
    return bits


@njit(cache=True, nogil=True)
def _sort_bucket(room: Room, first: Any, last: Any, shift: int, fill: AnyArray) -> None:
    """Sort a range of keys that differ only below bit `shift`."""
    n = last - first
    keys, order, spare_keys, spare_order = room
    if n > _FEW:
        bits = min(_MOST_BITS, _bits_for(n))
        down, mask = Key64(shift - bits), Key64((1 << bits) - 1)
        n_buckets = 1 << bits
        fill[: n_buckets + 1] = 0
        for i in range(first, last):
            fill[((keys[i] >> down) & mask) + Key64(1)] += 1
        for k in range(1, n_buckets + 1):
            fill[k] += fill[k - 1]
        for i in range(first, last):
            k = (keys[i] >> down) & mask
            at = first + fill[k]
            fill[k] += 1
            spare_keys[at], spare_order[at] = keys[i], order[i]
        for i in range(first, last):
            keys[i], order[i] = spare_keys[i], spare_order[i]
        begin = first
        for k in range(n_buckets):
            end = first + np.int64(fill[k])
            if end - begin > _FEW:
                merge_sort(room, begin, end)
            begin = end
    _insertion_sort(keys, order, first, last)


@njit(cache=True, nogil=True)
def _insertion_sort(keys: AnyArray, order: AnyArray, first: Any, last: Any) -> None:
    for i in range(first + 1, last):
        key = keys[i]
        if keys[i - 1] <= key:
            continue
        number = order[i]
        at = i
        while at > first and keys[at - 1] > key:
            keys[at], order[at] = keys[at - 1], order[at - 1]
            at -= 1
        keys[at], order[at] = key, number


@njit(cache=True, nogil=True)
def merge_sort(room: Room, first: Any, last: Any) -> None:
    """Sort a range bottom up, in at most n log n steps whatever the points."""
    keys, order, to_keys, to_order = room
    for i in range(first, last, _FEW):
        _insertion_sort(keys, order, i, min(i + _FEW, last))
    is_swapped, width = False, _FEW
    while width < last - first:
        for begin in range(first, last, 2 * width):
            middle, end = min(begin + width, last), min(begin + 2 * width, last)
            a, b = begin, middle
            for at in range(begin, end):
                if b >= end or (a < middle and keys[a] <= keys[b]):
                    to_keys[at], to_order[at] = keys[a], order[a]
                    a += 1
                else:
                    to_keys[at], to_order[at] = keys[b], order[b]
                    b += 1
        keys, order, to_keys, to_order = to_keys, to_order, keys, order
        is_swapped = not is_swapped
        width *= 2
    if is_swapped:
        for i in range(first, last):
            to_keys[i], to_order[i] = keys[i], order[i]


@njit(cache=True, nogil=True)
def _settle_ties(times: AnyArray, intensities: AnyArray, room: Room) -> None:
    """Order points of equal keys by time, and those of equal times by intensity.

    The keys of such a range are replaced by what it is sorted by, and restored.
    """
    keys, order = room[0], room[1]
    n = np.int64(len(keys))
    first = np.int64(0)
    while first < n:
        last = first + 1
        while last < n and keys[last] == keys[first]:
            last += 1
        if last - first > 1:
            key = keys[first]
            for i in range(first, last):
                keys[i] = _sortable(times[order[i]])
            merge_sort(room, first, last)
            begin = first
            while begin < last:
                end = begin + 1
                while end < last and keys[end] == keys[begin]:
                    end += 1
                if end - begin > 1:
                    for i in range(begin, end):
                        keys[i] = Key64(intensities[order[i]])
                    merge_sort(room, begin, end)
                begin = end
            keys[first:last] = key
        first = last


@njit(cache=True, nogil=True)
def _sortable(bits: Any) -> Any:
    """Return an integer that sorts as the float64 of these bits; -0.0 comes before 0.0."""
    sign = Key64(1) << Key64(63)
    return ~bits if bits & sign else bits | sign


@njit(cache=True, nogil=True)
def unpack_points(
    keys: AnyArray,
    times: AnyArray,
    intensities: AnyArray,
    order: AnyArray,
    corner: AnyArray,
    out: tuple[AnyArray, AnyArray, AnyArray],
    at: int,
) -> None:
    """Write coordinates, times and intensities of the points of a block.

    Parameters
    ----------
    keys
        (n,) uint64 in the order in which to write.
    times, intensities
        (n,) uint64 (bits of float64) and uint16.
    order
        (n,) int32 index of each key's time and intensity; or of length 0: in the order of the keys.
    corner
        (3,) int64 corner of the block. [steps]
    out
        xyz (., 3) float64 [m, world], times (.,) uint64 (bits of float64) and intensities (.,) float32, written from
        `at`; of length 0 where not wanted.
    """
    xyz, to_time, to_intensity = out
    n = len(keys)
    for i in range(n):
        key = keys[i]
        x = np.int64((key >> COL_BIT) & COL_MASK) * KEY_CELL_STEPS + np.int64((key >> EAST_BIT) & PLAN_MASK)
        y = np.int64(key >> ROW_BIT) * KEY_CELL_STEPS + np.int64((key >> NORTH_BIT) & PLAN_MASK)
        xyz[at + i, 0] = (corner[0] + x) / KEY_STEPS_PER_M
        xyz[at + i, 1] = (corner[1] + y) / KEY_STEPS_PER_M
        xyz[at + i, 2] = (corner[2] + np.int64(key & HEIGHT_MASK)) / KEY_STEPS_PER_M
    if len(order) == n:
        if len(to_time) and len(to_intensity):
            for i in range(n):
                to_time[at + i] = times[order[i]]
                to_intensity[at + i] = intensities[order[i]]
        elif len(to_time):
            for i in range(n):
                to_time[at + i] = times[order[i]]
        elif len(to_intensity):
            for i in range(n):
                to_intensity[at + i] = intensities[order[i]]
        return
    if len(to_time):
        for i in range(n):
            to_time[at + i] = times[i]
    if len(to_intensity):
        for i in range(n):
            to_intensity[at + i] = intensities[i]
