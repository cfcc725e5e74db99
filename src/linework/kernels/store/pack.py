"""Kernels that pack points into runs of keys, with checksums and extents; `linework.files.store.layout` has the format."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from linework.arrays import AnyArray

Code64 = np.uint64

#: Steps of coordinates: 0.1 mm. [1/m]
KEY_STEPS_PER_M = 10000.0
#: Side of a cell (0.5 m) and of a block (64 m, 128 cells) in plan. [steps]
KEY_CELL_STEPS, KEY_BLOCK_STEPS = 5_000, 640_000
#: First bits of the parts of a key: row and column of the cell in its block, north and east in the cell; up from the
#: block's lower edge is in the lowest bits.
ROW_BIT, COL_BIT, NORTH_BIT, EAST_BIT = Code64(57), Code64(50), Code64(37), Code64(24)
#: Bits of a cell's column, of a position in a cell, and of a height, after shifting.
COL_MASK, PLAN_MASK, HEIGHT_MASK = Code64(127), Code64(8191), Code64(0xFFFFFF)

#: Added to a coordinate in steps: whole blocks, so that it is never negative; far beyond 1e8 m.
_PLAN_BLOCKS, _UP_BLOCKS = 2**21, 2**16
_PLAN_SHIFT, _UP_SHIFT = _PLAN_BLOCKS * KEY_BLOCK_STEPS, _UP_BLOCKS * 2**24
_PLAN_END, _UP_END = Code64(2 * _PLAN_SHIFT), Code64(2 * _UP_SHIFT)
_BLOCK, _CELL = Code64(KEY_BLOCK_STEPS), Code64(KEY_CELL_STEPS)
#: First bits and masks of a block's code: north, east, up, so that sorted codes are row-major from the south-west.
_NORTH_BITS, _EAST_BITS = Code64(39), Code64(17)
_EAST_MASK, _UP_MASK = Code64(2**22 - 1), Code64(2**17 - 1)
#: Bits of a height within a block.
_UP_BITS = Code64(24)
#: Code that no block has.
_NO_CODE = Code64(2**64 - 1)
#: Factors of the two sums of the checksum, odd and even: a change of one word always changes it.
_MIX_SUM, _MIX_SUMS = Code64(0x9E3779B97F4A7C15), Code64(0xD1B54A32D192ED02)
#: Factor of Fibonacci hashing: 2**64 over the golden ratio.
_GOLDEN = Code64(0x9E3779B97F4A7C15)


@njit(cache=True, nogil=True)
def pack_points(
    xyz: AnyArray, keys: AnyArray, owners: AnyArray, heights: AnyArray, middle: int
) -> tuple[bool, AnyArray, AnyArray, Any, Any]:
    """Write the key of each point, and find its block.

    Parameters
    ----------
    xyz
        (n, 3) float64. [m, world]
    keys
        (n,) uint64, written.
    owners
        (n,) int32, written: the number of the point's block.
    heights
        (b,) int64, added to: points by 64 m of height; height 0 is in bucket `middle`.

    Returns
    -------
    is_valid
        Whether all coordinates are numbers within the range of keys; the rest is incomplete where not.
    codes, counts
        (m,) uint64 and int64: blocks in the order of their first points, and their numbers of points.
    low, high
        Lowest and highest bucket.
    """
    table = np.full(1024, -1, np.int32)
    codes = np.empty(512, np.uint64)
    counts = np.zeros(512, np.int64)
    n_blocks = np.int64(0)
    # Counted by runs of points in one block: 9 ns per point where plain sums took 14
    last_code, owner, since_code = _NO_CODE, np.int64(0), 0
    last_bucket: Any = -1
    n_bucket = 0
    low: Any = len(heights)
    high: Any = -1
    for i in range(len(xyz)):
        x = Code64(np.int64(np.rint(xyz[i, 0] * KEY_STEPS_PER_M)) + _PLAN_SHIFT)
        y = Code64(np.int64(np.rint(xyz[i, 1] * KEY_STEPS_PER_M)) + _PLAN_SHIFT)
        up = np.int64(np.rint(xyz[i, 2] * KEY_STEPS_PER_M))
        z = Code64(up + _UP_SHIFT)
        if x >= _PLAN_END or y >= _PLAN_END or z >= _UP_END:
            return False, codes, counts, low, high
        east, north = x // _BLOCK, y // _BLOCK
        x -= east * _BLOCK
        y -= north * _BLOCK
        col, row = x // _CELL, y // _CELL
        keys[i] = (
            (row << ROW_BIT)
            | (col << COL_BIT)
            | ((y - row * _CELL) << NORTH_BIT)
            | ((x - col * _CELL) << EAST_BIT)
            | (z & HEIGHT_MASK)
        )
        bucket = np.int64(Code64(up + _PLAN_SHIFT) // _BLOCK) - _PLAN_BLOCKS + middle
        if bucket != last_bucket:
            if n_bucket:
                heights[last_bucket] += n_bucket
            last_bucket, n_bucket = bucket, 0
            low, high = min(low, bucket), max(high, bucket)
        n_bucket += 1
        code = (north << _NORTH_BITS) | (east << _EAST_BITS) | (z >> _UP_BITS)
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
    """Return table, codes and counts with room for twice as many blocks; the table is at most half full."""
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
    """Return the block numbers east, north and up of codes (n,) uint64, (n, 3) int64."""
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
    """Write the columns of points to the runs of their blocks.

    Parameters
    ----------
    keys, intensity
        (n,) uint64 and uint16.
    time
        (n,) float64, or of length 0: none. [s]
    owners
        (n,) int32: each point's block.
    firsts
        (n_blocks, 3) int64: where the columns of each block begin, keys and times in `words`, intensities in its
        quarters.
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
    """Return a 64-bit checksum of the columns of a run.

    Two running sums as in Fletcher [1], modulo 2**64: any change within one word is detected for certain, as the
    first factor is odd. It costs 1.0 ns per point; CRC-32 (zlib) costs 4.3, more than the rest of decoding.

    Parameters
    ----------
    keys, times, intensities
        (n,) uint64; (n,) uint64, the bits of float64, or of length 0; (n,) uint16.

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
    """Return the closed extent of keys (n,) uint64: west, south, low, east, north, high, (6,) int64 [steps].

    Counted from the corner of the block.
    """
    west, south, low = np.int64(2**24), np.int64(2**24), np.int64(2**24)
    east, north, high = np.int64(-1), np.int64(-1), np.int64(-1)
    for i in range(len(keys)):
        key = keys[i]
        x = np.int64((key >> COL_BIT) & COL_MASK) * KEY_CELL_STEPS + np.int64((key >> EAST_BIT) & PLAN_MASK)
        y = np.int64(key >> ROW_BIT) * KEY_CELL_STEPS + np.int64((key >> NORTH_BIT) & PLAN_MASK)
        z = np.int64(key & HEIGHT_MASK)
        west, east = min(west, x), max(east, x)
        south, north = min(south, y), max(north, y)
        low, high = min(low, z), max(high, z)
    return np.array([west, south, low, east, north, high])


@njit(cache=True, nogil=True)
def describe_runs(
    words: AnyArray, firsts: AnyArray, counts: AnyArray, with_time: bool
) -> tuple[AnyArray, AnyArray]:
    """Return the checksum (m,) uint64 and the extent (m, 6) int64 of each run that `scatter_runs` has written.

    Parameters
    ----------
    firsts
        (m, 3) int64: where the columns of each run begin; see `scatter_runs`.
    counts
        (m,) int64 points of each run.
    with_time
        Whether the runs have times.
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
