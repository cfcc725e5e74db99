"""Where along lines through windows of a binary image its cells are set."""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import BoolArray, FloatArray, IntArray
from linework.kernels.radon.peaks import peaks
from linework.kernels.radon.transform import radon


@njit(cache=True, nogil=True)
def is_set_beside(
    image: BoolArray, place: tuple[int, int, float, float], x: float, y: float, nx: float, ny: float
) -> bool:
    """Return whether the cell at (x, y), or half a cell beside it along the normal (nx, ny), is set.

    place: column and row of the cell of x = y = 0, and where in that cell, from its west and its south edge;
    all in cells, as are x (east) and y (north).
    """
    col, row, from_west, from_south = place
    n_rows, n_cols = image.shape
    for offset in (-0.5, 0.0, 0.5):
        c = col + int(np.floor(x + offset * nx + from_west))
        r = row - int(np.floor(y + offset * ny + from_south))
        if r >= 0 and r < n_rows and c >= 0 and c < n_cols and image[r, c]:
            return True
    return False


@njit(cache=True, nogil=True)
def segments_of(
    image: BoolArray,
    cell: float,
    lines: FloatArray,
    places: IntArray,
    within: FloatArray,
    t: FloatArray,
    half: float,
    gap: int,
    least: int,
) -> FloatArray:
    """Return the occupied pieces (m, 5: x, y of both ends, strength) of lines through square windows.

    lines: (n, 5) window centre x, y; theta, rho about it; strength. places, within: (n, 2) column and row of
    the cell of the centre, and where in the cell it lies (see `is_set_beside`). t: evenly spaced places along
    a line, of which those within `half` of the centre in x and y count. Pieces are parted where more than
    `gap` places in a row have no set cell beside them; those over fewer than `least` places are dropped.
    """
    out = np.empty((len(lines) * (len(t) // max(gap, 1) + 1), 5))
    n = 0
    for i in range(len(lines)):
        nx, ny, rho = np.cos(lines[i, 2]), np.sin(lines[i, 2]), lines[i, 3]
        place = places[i, 0], places[i, 1], within[i, 0], within[i, 1]
        first, last = -1, -1
        for k in range(len(t) + 1):
            x, y = 0.0, 0.0
            inside = k < len(t)
            if inside:
                x, y = rho * nx - t[k] * ny, rho * ny + t[k] * nx
                inside = abs(x) <= half and abs(y) <= half
            is_set = inside and is_set_beside(image, place, x / cell, y / cell, nx, ny)
            if first >= 0 and (k == len(t) or (is_set and k - last > gap)):
                if last - first >= least:
                    out[n, 0] = rho * nx - t[first] * ny + lines[i, 0]
                    out[n, 1] = rho * ny + t[first] * nx + lines[i, 1]
                    out[n, 2] = rho * nx - t[last] * ny + lines[i, 0]
                    out[n, 3] = rho * ny + t[last] * nx + lines[i, 1]
                    out[n, 4] = lines[i, 4]
                    n += 1
                first = -1
            if is_set:
                first = k if first < 0 else first
                last = k
    return out[:n].copy()


# Peaks of the Radon transforms of many small windows, one after the other


@njit(cache=True, nogil=True)
def peaks_of_windows(
    cells: FloatArray,
    starts: IntArray,
    windows: tuple[IntArray, FloatArray],
    frame: tuple[tuple[float, float, float], float],
    angles: FloatArray,
    rho: FloatArray,
    limits: tuple[float, float, int],
    fewest: float,
) -> FloatArray:
    """Return (n, 4) window, theta, rho and strength of the peaks of each window's Radon transform.

    Parameters
    ----------
    cells
        (n, 2): centres of occupied cells by quarter; quarter i has those from starts[i] to starts[i + 1].
    windows
        (m, 4) the quarters of each window, -1 where one is empty, and (m, 2) its centre.
    frame
        Cells, and the strips' step; see `linework.kernels.radon.transform.radon`.
    rho
        Centres of the strips, an odd number.
    limits
        Threshold and half windows; see `linework.kernels.radon.peaks.peaks`.
    fewest
        Windows with fewer occupied cells are passed over.
    """
    quarters, centres = windows
    cell, step = frame
    threshold, half_window, half_bins = limits
    n_most = 0
    for i in range(len(starts) - 1):
        n_most = max(n_most, starts[i + 1] - starts[i])
    x, y, ones = np.empty(4 * n_most), np.empty(4 * n_most), np.ones(4 * n_most)
    out, n_out = np.empty((256, 4)), 0
    for w in range(len(quarters)):
        n = 0
        for q in quarters[w]:
            if q < 0:
                continue
            for k in range(starts[q], starts[q + 1]):
                x[n], y[n] = cells[k, 0] - centres[w, 0], cells[k, 1] - centres[w, 1]
                n += 1
        if n < fewest:
            continue
        values = radon(x[:n], y[:n], ones[:n], cell, angles, step, len(rho) // 2)
        found = peaks(values, angles, rho, threshold, half_window, half_bins)
        if n_out + len(found) > len(out):
            out = np.concatenate((out, np.empty((len(out) + len(found), 4))))
        for k in range(len(found)):
            out[n_out, 0] = w
            out[n_out, 1:] = found[k]
            n_out += 1
    return out[:n_out].copy()
