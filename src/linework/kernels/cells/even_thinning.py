"""Kernels that thin points evenly in space, independent of the order of the points."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from linework.arrays import AnyArray

Hash64 = np.uint64
#: Constants of the finalizer of splitmix64 (Steele 2014, doi:10.1145/2660193.2660195).
_ADD, _MIX1, _MIX2 = Hash64(0x9E3779B97F4A7C15), Hash64(0xBF58476D1CE4E5B9), Hash64(0x94D049BB133111EB)
#: Sides of the tried cubes: from 5 mm, four per doubling, up to 80 m. [m, 1, 1]
LEAST_CUBE_M, CUBES_PER_DOUBLING, N_CUBES = 0.005, 4, 56
#: Resolution of coordinates in a key: 1 mm. [1/m]
_STEPS_PER_M = 1000.0


@njit(cache=True, nogil=True)
def sampling_keys(x: AnyArray, y: AnyArray, z: AnyArray, intensity: AnyArray, salt: int) -> AnyArray:
    """Return pseudo-random keys of points, (n,) uint64, the same for the same point.

    Parameters
    ----------
    x, y, z
        (n,) coordinates from a local origin. [m]
    intensity
        (n,) uint16.
    salt
        Number of the local origin.
    """
    out = np.empty(len(x), np.uint64)
    start = _mixed(Hash64(salt))
    for i in range(len(x)):
        plan = (Hash64(np.int64(x[i] * _STEPS_PER_M)) << Hash64(32)) ^ Hash64(np.int64(y[i] * _STEPS_PER_M))
        rest = (Hash64(np.int64(z[i] * _STEPS_PER_M)) << Hash64(16)) ^ Hash64(intensity[i])
        out[i] = _mixed(_mixed(start ^ plan) ^ rest)
    return out


@njit(cache=True, nogil=True)
def _mixed(value: Any) -> Any:
    value = value + _ADD
    value = (value ^ (value >> Hash64(30))) * _MIX1
    value = (value ^ (value >> Hash64(27))) * _MIX2
    return value ^ (value >> Hash64(31))


@njit(cache=True, nogil=True)
def evenly_thinned(xyz: AnyArray, most: int) -> AnyArray:
    """Return the indices of the points to keep, (k,) int64 with k <= `most`: the first point of every cube.

    The cubes are the smallest that leave at most that many.

    Parameters
    ----------
    xyz
        (n, 3) float32, local; the first point of a cube is taken in this order. [m]
    most
        Largest number of points to keep.
    """
    n = len(xyz)
    if n <= most:
        return np.arange(n)
    size = 16
    while size < 2 * n:
        size *= 2
    table = np.empty(size, np.uint64)
    low, high = 0, N_CUBES
    while low < high:
        middle = (low + high) // 2
        if len(_firsts(xyz, _cube_m(middle), table, most)) <= most:
            high = middle
        else:
            low = middle + 1
    return _firsts(xyz, _cube_m(low), table, most)[:most]


@njit(cache=True, nogil=True)
def _cube_m(number: int) -> float:
    return float(LEAST_CUBE_M * 2.0 ** (number / CUBES_PER_DOUBLING))


@njit(cache=True, nogil=True)
def _firsts(xyz: AnyArray, cube_m: float, table: AnyArray, most: int) -> AnyArray:
    """Return the first point of every cube; stops at `most` + 1 points. `table` is scratch."""
    table[:] = 0
    mask = Hash64(len(table) - 1)
    firsts = np.empty(most + 1, np.int64)
    n = 0
    for i in range(len(xyz)):
        key = Hash64(1)
        for k in range(3):
            # 21 bits each: cubes of 5 mm reach over 10 km
            cell = np.int64(np.floor(xyz[i, k] / cube_m)) + np.int64(1 << 20)
            key = (key << Hash64(21)) | (Hash64(cell) & Hash64(0x1FFFFF))
        slot = _mixed(key) & mask
        while table[slot] != Hash64(0) and table[slot] != key:
            slot = (slot + Hash64(1)) & mask
        if table[slot] == Hash64(0):
            table[slot] = key
            firsts[n] = i
            n += 1
            if n > most:
                break
    return firsts[:n]
