"""Kernels that interpolate heights of cells by planes through known cells around them, in windows that grow."""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import BoolArray, Float32Array, IntArray

#: Steps of heights in the sums [1/m]: whole numbers give the same plane in every window. With 0.2 mm, heights up to 10 km
#: and windows of 1000 cells have room.
_STEPS = 2.0**12
#: Sums: number, x, y, xx, xy, yy, z, xz, yz, zz of the known cells.
_N_SUMS = 10


@njit(cache=True, nogil=True)
def summed_moments(height: Float32Array, known: BoolArray, base: int) -> IntArray:
    """Return the moments of the known cells north and west of every corner, (n_rows + 1, n_cols + 1, 10) int64.

    Parameters
    ----------
    height
        (n_rows, n_cols) float32. [m]
    known
        (n_rows, n_cols) bool.
    base
        Height that the moments are above, near all of them, in whole metres: it changes no result. [m]
    """
    n_rows, n_cols = height.shape
    table = np.zeros((n_rows + 1, n_cols + 1, _N_SUMS), dtype=np.int64)
    row = np.empty(_N_SUMS, dtype=np.int64)
    for r in range(n_rows):
        row[:] = 0
        for c in range(n_cols):
            if known[r, c]:
                z = int(np.rint(float(height[r, c]) * _STEPS)) - base * int(_STEPS)
                row[0] += 1
                row[1] += c
                row[2] += r
                row[3] += c * c
                row[4] += c * r
                row[5] += r * r
                row[6] += z
                row[7] += c * z
                row[8] += r * z
                row[9] += z * z
            for k in range(_N_SUMS):
                table[r + 1, c + 1, k] = table[r, c + 1, k] + row[k]
    return table


@njit(cache=True, nogil=True)
def interpolated(
    table: IntArray, wanted: BoolArray, radii: IntArray, least: int, most_sigma: float, halo: int, base: int
) -> tuple[Float32Array, Float32Array]:
    """Return heights of wanted cells from planes, and their sigma.

    The window grows until each of its four quarters around the cell holds `least` known cells: what lies outside of the
    known cells is not interpolated. Sigma is the scatter of the known cells about the plane, and what the next larger
    window changes.

    Parameters
    ----------
    table
        As `summed_moments` returns it, of a grid with a halo around the wanted cells.
    wanted
        (n_rows, n_cols) bool.
    radii
        (k,) int64, ascending: reach of the windows; the last one only checks the one before. [cells]
    least
        Known cells in each quarter.
    most_sigma
        A height with a larger sigma is not known. [m]
    halo
        Width of the halo, at least the last radius. [cells]
    base
        As for `summed_moments`. [m]

    Returns
    -------
    height, sigma
        (n_rows, n_cols) float32; NaN where the height is not known or not wanted. [m]
    """
    n_rows, n_cols = wanted.shape
    height = np.full((n_rows, n_cols), np.float32(np.nan), dtype=np.float32)
    sigma = np.full((n_rows, n_cols), np.float32(np.nan), dtype=np.float32)
    s = np.empty(_N_SUMS, dtype=np.int64)
    for r in range(n_rows):
        for c in range(n_cols):
            if not wanted[r, c]:
                continue
            y, x = r + halo, c + halo
            for k in range(len(radii) - 1):
                n = radii[k]
                if (
                    _count(table, y - n, y, x - n, x) < least
                    or _count(table, y - n, y, x + 1, x + n + 1) < least
                    or _count(table, y + 1, y + n + 1, x - n, x) < least
                    or _count(table, y + 1, y + n + 1, x + 1, x + n + 1) < least
                ):
                    continue
                _sums_about(table, y, x, n, s)
                level, scatter = _plane(s, x, y, base)
                _sums_about(table, y, x, radii[k + 1], s)
                sure = np.hypot(scatter, _plane(s, x, y, base)[0] - level)
                if sure <= most_sigma:
                    height[r, c], sigma[r, c] = level, sure
                break
    return height, sigma


@njit(cache=True, nogil=True)
def _sums_about(table: IntArray, y: int, x: int, n: int, s: IntArray) -> None:
    """Write the moments of the known cells within n cells of a cell."""
    top, bottom, left, right = y - n, y + n + 1, x - n, x + n + 1
    for i in range(_N_SUMS):
        s[i] = table[bottom, right, i] - table[top, right, i] - table[bottom, left, i] + table[top, left, i]


@njit(cache=True, nogil=True)
def _count(table: IntArray, top: int, bottom: int, left: int, right: int) -> int:
    return int(table[bottom, right, 0] - table[top, right, 0] - table[bottom, left, 0] + table[top, left, 0])


@njit(cache=True, nogil=True)
def _plane(s: IntArray, x: int, y: int, base: int) -> tuple[float, float]:
    """Return height and sigma of the plane with these moments at a cell (x, y), by least squares."""
    n = s[0]
    # Moments about the cell and about a height among them, in whole numbers: where window and base are is gone
    z = s[6] // n
    sx, sy, sz = s[1] - n * x, s[2] - n * y, s[6] - n * z
    sxx = s[3] - 2 * x * s[1] + n * x * x
    sxy = s[4] - x * s[2] - y * s[1] + n * x * y
    syy = s[5] - 2 * y * s[2] + n * y * y
    sxz = s[7] - x * s[6] - z * sx
    syz = s[8] - y * s[6] - z * sy
    szz = s[9] - 2 * z * s[6] + n * z * z
    mx, my, mz = sx / n, sy / n, sz / n
    cxx, cxy, cyy = sxx - sx * mx, sxy - sx * my, syy - sy * my
    cxz, cyz, czz = sxz - sx * mz, syz - sy * mz, szz - sz * mz
    det = cxx * cyy - cxy * cxy
    a = (cxz * cyy - cyz * cxy) / det
    b = (cyz * cxx - cxz * cxy) / det
    left = max(czz - a * cxz - b * cyz, 0.0)
    height = (base * int(_STEPS) + z + (mz - a * mx - b * my)) / _STEPS
    return height, np.sqrt(left / max(n - 3, 1)) / _STEPS
