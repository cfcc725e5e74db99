"""Points to runs of packed keys, and back. What the bits mean is told in `linework.files.store.layout`."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from linework.arrays import AnyArray

Code64 = np.uint64

#: Added to a coordinate in steps: whole blocks, so that what is counted is never negative. Beyond 1e8 m.
_PLAN_BLOCKS, _UP_BLOCKS = 2**21, 2**16
_PLAN_SHIFT, _UP_SHIFT = _PLAN_BLOCKS * 640_000, _UP_BLOCKS * 2**24
_PLAN_END, _UP_END = Code64(2 * _PLAN_SHIFT), Code64(2 * _UP_SHIFT)
_BLOCK, _CELL = Code64(640_000), Code64(5_000)
#: A block's code: north, east, up, so that codes in order are blocks row-major from the south-west.
_NORTH_BITS, _EAST_BITS = Code64(39), Code64(17)
_EAST_MASK, _UP_MASK = Code64(2**22 - 1), Code64(2**17 - 1)
_NO_CODE = Code64(2**64 - 1)
#: Odd, and even: their sum with any multiple of the second is odd, so that a change of one word always shows.
_MIX_SUM, _MIX_SUMS = Code64(0x9E3779B97F4A7C15), Code64(0xD1B54A32D192ED02)
#: Fibonacci hashing.
_GOLDEN = Code64(0x9E3779B97F4A7C15)


@njit(cache=True, nogil=True)
def pack_points(
    xyz: AnyArray, keys: AnyArray, owners: AnyArray, heights: AnyArray, middle: int
) -> tuple[bool, AnyArray, AnyArray, Any, Any]:
    """Write the key of each point, and find which block it lies in.

    Parameters
    ----------
    xyz
        (n, 3) float64 [m].
    keys
        (n,) uint64, written.
    owners
        (n,) int32, written: the number of the point's block.
    heights
        int64, added to: points by bucket of 64 m; bucket 0 is at `middle`.

    Returns
    -------
    whether all coordinates are numbers and not too far, codes and counts of the blocks (in the order in which
    they came up), lowest and highest bucket.
    """
    table = np.full(1024, -1, np.int32)
    codes = np.empty(512, np.uint64)
    counts = np.zeros(512, np.int64)
    n_blocks = np.int64(0)
    # Counted by stretches, and `continue` where the block stays: 9 ns a point where plain sums took 14
    last_code, owner, since_code = _NO_CODE, np.int64(0), 0
    last_bucket: Any = -1
    n_bucket = 0
    low: Any = len(heights)
    high: Any = -1
    for i in range(len(xyz)):
        x = Code64(np.int64(np.rint(xyz[i, 0] * 10000.0)) + _PLAN_SHIFT)
        y = Code64(np.int64(np.rint(xyz[i, 1] * 10000.0)) + _PLAN_SHIFT)
        up = np.int64(np.rint(xyz[i, 2] * 10000.0))
        z = Code64(up + _UP_SHIFT)
        if x >= _PLAN_END or y >= _PLAN_END or z >= _UP_END:
            return False, codes, counts, low, high
        east, north = x // _BLOCK, y // _BLOCK
        x -= east * _BLOCK
        y -= north * _BLOCK
        col, row = x // _CELL, y // _CELL
        keys[i] = (
            (row << Code64(57))
            | (col << Code64(50))
            | ((y - row * _CELL) << Code64(37))
            | ((x - col * _CELL) << Code64(24))
            | (z & Code64(0xFFFFFF))
        )
        bucket = np.int64(Code64(up + _PLAN_SHIFT) // _BLOCK) - _PLAN_BLOCKS + middle
        if bucket != last_bucket:
            if n_bucket:
                heights[last_bucket] += n_bucket
            last_bucket, n_bucket = bucket, 0
            low, high = min(low, bucket), max(high, bucket)
        n_bucket += 1
        code = (north << _NORTH_BITS) | (east << _EAST_BITS) | (z >> Code64(24))
        if code == last_code:
            owners[i] = owner
            continue
        if i > since_code:
            counts[owner] += i - since_code
        last_code, since_code = code, i
        owner = _slot_of(code, table, codes)
        if owner >= 0:
            owner = table[owner]
        else:
            if n_blocks == len(codes):
                table, codes, counts = _doubled(codes, counts)
                owner = _slot_of(code, table, codes)
            table[-1 - owner] = n_blocks
            codes[n_blocks] = code
            owner = n_blocks
            n_blocks += 1
        owners[i] = owner
    if len(xyz):
        heights[last_bucket] += n_bucket
        counts[owner] += len(xyz) - since_code
    return True, codes[:n_blocks], counts[:n_blocks], low, high


@njit(cache=True, nogil=True)
def _slot_of(code: Any, table: AnyArray, codes: AnyArray) -> Any:
    """Return the slot of the hash table that holds `code`, or -1 - the free slot where it belongs."""
    mask = Code64(len(table) - 1)
    slot = (code * _GOLDEN) >> Code64(32) & mask
    while table[slot] >= 0:
        if codes[table[slot]] == code:
            return np.int64(slot)
        slot = (slot + Code64(1)) & mask
    return -1 - np.int64(slot)


@njit(cache=True, nogil=True)
def _doubled(codes: AnyArray, counts: AnyArray) -> tuple[AnyArray, AnyArray, AnyArray]:
    """Return table, codes and counts with room for twice as many blocks; the table is half full at most."""
    n = len(codes)
    table = np.full(4 * n, -1, np.int32)
    more_codes = np.empty(2 * n, np.uint64)
    more_counts = np.zeros(2 * n, np.int64)
    for i in range(n):
        more_codes[i], more_counts[i] = codes[i], counts[i]
        table[-1 - _slot_of(codes[i], table, more_codes)] = i
    return table, more_codes, more_counts


@njit(cache=True, nogil=True)
def blocks_of(codes: AnyArray) -> AnyArray:
    """Return the (n, 3) int64 block numbers (east, north, up) of codes."""
    blocks = np.empty((len(codes), 3), np.int64)
    for i in range(len(codes)):
        blocks[i, 0] = np.int64((codes[i] >> _EAST_BITS) & _EAST_MASK) - _PLAN_BLOCKS
        blocks[i, 1] = np.int64(codes[i] >> _NORTH_BITS) - _PLAN_BLOCKS
        blocks[i, 2] = np.int64(codes[i] & _UP_MASK) - _UP_BLOCKS
    return blocks


@njit(cache=True, nogil=True)
def scatter_runs(
    keys: AnyArray, intensity: AnyArray, time: AnyArray, owners: AnyArray, firsts: AnyArray, words: AnyArray
) -> None:
    """Write the points' columns to their runs.

    Parameters
    ----------
    time
        (n,) float64, or of length 0: none.
    owners
        (n,) int32: each point's block.
    firsts
        (n_blocks, 3) int64: where in `words` (keys, times) and in its quarters (intensities) the columns of each
        block begin.
    words
        (w,) uint64, written.
    """
    quarters = words.view(np.uint16)
    reals = words.view(np.float64)
    with_time = len(time) > 0
    fill = np.zeros(len(firsts), np.int64)
    for i in range(len(owners)):
        owner = owners[i]
        at = fill[owner]
        fill[owner] = at + 1
        words[firsts[owner, 0] + at] = keys[i]
        if with_time:
            reals[firsts[owner, 1] + at] = time[i]
        quarters[firsts[owner, 2] + at] = intensity[i]


@njit(cache=True, nogil=True)
def checksum(keys: AnyArray, times: AnyArray, intensities: AnyArray) -> Any:
    """Return a 64-bit checksum of a run's columns (times as uint64, or of length 0).

    Two running sums as in Fletcher [1], modulo 2**64: any change within one word shows for certain, as their
    mix is odd; it costs 1.0 ns a point, CRC-32 4.3 (zlib), more than the rest of decoding.

    References
    ----------
    [1] Fletcher, An arithmetic checksum for serial transmissions (1982), doi:10.1109/TCOM.1982.1095369
    """
    a, b = Code64(0), Code64(0)
    for i in range(len(keys)):
        a += keys[i]
        b += a
    for i in range(len(times)):
        a += times[i]
        b += a
    n = len(intensities)
    for i in range(0, n - 3, 4):
        a += (
            Code64(intensities[i])
            | (Code64(intensities[i + 1]) << Code64(16))
            | (Code64(intensities[i + 2]) << Code64(32))
            | (Code64(intensities[i + 3]) << Code64(48))
        )
        b += a
    word = Code64(0)
    for i in range(n - n % 4, n):
        word |= Code64(intensities[i]) << Code64(16 * (i % 4))
    a += word
    b += a
    return a * _MIX_SUM + b * _MIX_SUMS


@njit(cache=True, nogil=True)
def extent_of(keys: AnyArray) -> AnyArray:
    """Return the closed extent west, south, low, east, north, high of keys, (6,) int64 steps from the corner."""
    west, south, low = np.int64(2**24), np.int64(2**24), np.int64(2**24)
    east, north, high = np.int64(-1), np.int64(-1), np.int64(-1)
    for i in range(len(keys)):
        key = keys[i]
        x = np.int64((key >> Code64(50)) & Code64(127)) * 5000 + np.int64((key >> Code64(24)) & Code64(8191))
        y = np.int64(key >> Code64(57)) * 5000 + np.int64((key >> Code64(37)) & Code64(8191))
        z = np.int64(key & Code64(0xFFFFFF))
        west, east = min(west, x), max(east, x)
        south, north = min(south, y), max(north, y)
        low, high = min(low, z), max(high, z)
    return np.array([west, south, low, east, north, high])


@njit(cache=True, nogil=True)
def describe_runs(
    words: AnyArray, firsts: AnyArray, counts: AnyArray, with_time: bool
) -> tuple[AnyArray, AnyArray]:
    """Return the checksum and the extent of each run that `scatter_runs` has made.

    Parameters
    ----------
    firsts
        (m, 3) int64: where each run's columns begin, as for `scatter_runs`.
    """
    quarters = words.view(np.uint16)
    sums = np.empty(len(counts), np.uint64)
    extents = np.empty((len(counts), 6), np.int64)
    for r in range(len(counts)):
        n = counts[r]
        keys = words[firsts[r, 0] : firsts[r, 0] + n]
        times = words[firsts[r, 1] : firsts[r, 1] + (n if with_time else 0)]
        sums[r] = checksum(keys, times, quarters[firsts[r, 2] : firsts[r, 2] + n])
        extents[r] = extent_of(keys)
    return sums, extents
