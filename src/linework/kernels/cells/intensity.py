"""Kernels for intensity: viewing geometry of each point, and histograms in whole numbers, which add up over tiles."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

from linework.arrays import BoolArray, Float32Array, FloatArray, IntArray

#: Bins of the logarithm of a value: 16 per doubling (4 %), from 2^-8 (ratios) to 2^16 (16 bit).
N_INTENSITY_BINS, PER_DOUBLING, LOWEST = 384, 16, -8
#: Bins of range, 4 per doubling from 1 m to 64 m, and of the cosine of incidence, 2 per halving.
N_RANGES, RANGES_PER_DOUBLING = 24, 4
N_COSINES, COSINES_PER_HALVING = 10, 2


@njit(cache=True, nogil=True)
def bin_of(value: float) -> int:
    """Return the bin of a value; values out of range fall into the first and the last bin."""
    if not value > 0.0:
        return 0
    b = math.floor((math.log2(value) - LOWEST) * PER_DOUBLING)
    return int(min(max(b, 0), N_INTENSITY_BINS - 1))


@njit(cache=True, nogil=True)
def viewing_geometry(
    xyz: FloatArray,
    time_s: FloatArray,
    path_time_s: FloatArray,
    path_xyz: FloatArray,
    mount_m: float,
    frame: tuple[float, float, float],
    slopes: Float32Array,
) -> tuple[Float32Array, Float32Array]:
    """Return range [m] and cosine of incidence of each point, (n,) float32 each; NaN beyond the path's times.

    Parameters
    ----------
    xyz, time_s
        (n, 3) points [m, world] and (n,) their times [s].
    path_time_s, path_xyz
        (m,) rising times [s] and (m, 3) positions [m, world] of the path, m >= 2.
    mount_m
        Height of the scanner over the path. [m]
    frame, slopes
        West edge, north edge and cell of a north-up grid [m, world]; (rows, cols, 2) float32 slopes of the ground
        to the east and to the north.
    """
    west, north, cell = frame
    n_rows, n_cols = slopes.shape[0], slopes.shape[1]
    reach, cosine = np.full(len(xyz), np.nan, np.float32), np.full(len(xyz), np.nan, np.float32)
    last = len(path_time_s) - 1
    k = 0
    for i in range(len(xyz)):
        t = time_s[i]
        if not (t >= path_time_s[0] and t <= path_time_s[last]):
            continue
        # Points are nearly in the order of time
        if not (path_time_s[k] <= t and t <= path_time_s[min(k + 1, last)]):
            k = min(max(np.searchsorted(path_time_s, t) - 1, 0), last - 1)
        share = (t - path_time_s[k]) / (path_time_s[k + 1] - path_time_s[k])
        dx = path_xyz[k, 0] + share * (path_xyz[k + 1, 0] - path_xyz[k, 0]) - xyz[i, 0]
        dy = path_xyz[k, 1] + share * (path_xyz[k + 1, 1] - path_xyz[k, 1]) - xyz[i, 1]
        dz = path_xyz[k, 2] + share * (path_xyz[k + 1, 2] - path_xyz[k, 2]) - xyz[i, 2] + mount_m
        r = math.sqrt(dx * dx + dy * dy + dz * dz)
        col = min(max(int((xyz[i, 0] - west) / cell), 0), n_cols - 1)
        row = min(max(int((north - xyz[i, 1]) / cell), 0), n_rows - 1)
        east, up = slopes[row, col, 0], slopes[row, col, 1]
        if r > 0.0:
            reach[i] = r
            cosine[i] = abs(dz - east * dx - up * dy) / (r * math.sqrt(1.0 + east * east + up * up))
    return reach, cosine


@njit(cache=True, nogil=True)
def count_views(
    value: Float32Array, reach: Float32Array, cosine: Float32Array, chosen: BoolArray
) -> IntArray:
    """Return the histogram of the chosen points, (N_RANGES, N_COSINES, N_INTENSITY_BINS) int64.

    Parameters
    ----------
    value, reach, cosine
        (n,) float32 intensities, ranges [m] and cosines of incidence.
    chosen
        (n,) bool.
    """
    counts = np.zeros((N_RANGES, N_COSINES, N_INTENSITY_BINS), np.int64)
    for i in range(len(value)):
        if not (chosen[i] and reach[i] >= 1.0 and cosine[i] > 0.0):
            continue
        r = int(math.log2(reach[i]) * RANGES_PER_DOUBLING)
        c = int(-math.log2(cosine[i]) * COSINES_PER_HALVING)
        if r < N_RANGES and c < N_COSINES:
            counts[r, c, bin_of(value[i])] += 1
    return counts


@njit(cache=True, nogil=True)
def count_in_blocks(
    xyz: FloatArray,
    value: Float32Array,
    chosen: BoolArray,
    size: float,
    first: tuple[int, int],
    n_rows: int,
    n_cols: int,
) -> npt.NDArray[np.int32]:
    """Return the histogram of the chosen points in each block, (n_rows, n_cols, N_INTENSITY_BINS) int32.

    Parameters
    ----------
    xyz, value, chosen
        (n, 3) points [m, world], (n,) float32 intensities and (n,) bool.
    size
        Side of a block; blocks are on the lattice of its multiples. [m]
    first
        Numbers of the west column and of the south row.
    """
    counts = np.zeros((n_rows, n_cols, N_INTENSITY_BINS), np.int32)
    for i in range(len(xyz)):
        if not (chosen[i] and value[i] > 0.0):
            continue
        col = math.floor(xyz[i, 0] / size) - first[0]
        row = math.floor(xyz[i, 1] / size) - first[1]
        if 0 <= col < n_cols and 0 <= row < n_rows:
            counts[int(row), int(col), bin_of(value[i])] += np.int32(1)
    return counts
