"""Kernels for seed segments: peaks of the Radon transforms of many windows, and the set cells along them."""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import BoolArray, FloatArray, IntArray
from linework.kernels.radon.peaks import PEAK_RHO, PEAK_STRENGTH, PEAK_THETA, peaks
from linework.kernels.radon.transform import radon

#: Columns of a line through a window: x and y of the window's centre, theta and rho about it, strength.
LINE_CENTRE_X, LINE_CENTRE_Y, LINE_THETA, LINE_RHO, LINE_STRENGTH = 0, 1, 2, 3, 4
#: Columns of a segment: x and y of both ends [m], strength of its peak.
SEGMENT_X0, SEGMENT_Y0, SEGMENT_X1, SEGMENT_Y1, SEGMENT_STRENGTH = 0, 1, 2, 3, 4
#: Columns of a peak of a window: number of the window, theta, rho, strength.
WINDOW_NUMBER, WINDOW_THETA, WINDOW_RHO, WINDOW_STRENGTH = 0, 1, 2, 3
#: Number of peaks that room is made for at first; more is made as needed.
_PEAK_ROOM = 256


@njit(cache=True, nogil=True)
def is_set_beside(
    image: BoolArray, place: tuple[int, int, float, float], x: float, y: float, nx: float, ny: float
) -> bool:
    """Return whether the cell at (x, y), or half a cell beside it along the normal (nx, ny), is set.

    Parameters
    ----------
    image
        (rows, cols) bool, north up.
    place
        Column and row of the cell that holds x = y = 0, and the position in that cell from its west and its
        south edge. [cells]
    x, y
        East and north. [cells]
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
    """Return the occupied segments of lines through square windows, (m, 5), columns `SEGMENT_X0` and following.

    Parameters
    ----------
    image, cell
        (rows, cols) bool, north up, and the side of a cell [m].
    lines
        (n, 5), columns `LINE_CENTRE_X` and following. [m, rad]
    places, within
        (n, 2) int64 column and row of the cell of the window's centre, and (n, 2) the position in that cell;
        see `is_set_beside`.
    t
        (k,) evenly spaced stations along a line, about the centre. [m]
    half
        Stations within this of the centre in x and in y count. [m]
    gap, least
        Segments are parted where more than `gap` stations in a row have no set cell; those over fewer than
        `least` stations are dropped.
    """
    out = np.empty((len(lines) * (len(t) // max(gap, 1) + 1), 5))
    n = 0
    for i in range(len(lines)):
        nx, ny, rho = np.cos(lines[i, LINE_THETA]), np.sin(lines[i, LINE_THETA]), lines[i, LINE_RHO]
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
                    out[n, SEGMENT_X0] = rho * nx - t[first] * ny + lines[i, LINE_CENTRE_X]
                    out[n, SEGMENT_Y0] = rho * ny + t[first] * nx + lines[i, LINE_CENTRE_Y]
                    out[n, SEGMENT_X1] = rho * nx - t[last] * ny + lines[i, LINE_CENTRE_X]
                    out[n, SEGMENT_Y1] = rho * ny + t[last] * nx + lines[i, LINE_CENTRE_Y]
                    out[n, SEGMENT_STRENGTH] = lines[i, LINE_STRENGTH]
                    n += 1
                first = -1
            if is_set:
                first = k if first < 0 else first
                last = k
    return out[:n].copy()


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
    """Return the peaks of each window's Radon transform, (n, 4), columns `WINDOW_NUMBER` and following.

    Parameters
    ----------
    cells, starts
        (n, 2) centres of occupied cells by quarter [m], and (q + 1,) int64: quarter i has the cells from
        starts[i] to starts[i + 1].
    windows
        (m, 4) int64 quarters of each window, -1 where one is empty, and (m, 2) its centre [m].
    frame
        Cell (width, height, turn) and width of the strips; see `linework.kernels.radon.transform.radon`.
    angles, rho
        (a,) angles [rad] and (b,) centres of the strips [m], an odd number.
    limits
        Threshold and half windows; see `linework.kernels.radon.peaks.peaks`.
    fewest
        Windows with fewer occupied cells are skipped.
    """
    quarters, centres = windows
    cell, step = frame
    threshold, half_window, half_bins = limits
    n_most = 0
    for i in range(len(starts) - 1):
        n_most = max(n_most, starts[i + 1] - starts[i])
    x, y, ones = np.empty(4 * n_most), np.empty(4 * n_most), np.ones(4 * n_most)
    out, n_out = np.empty((_PEAK_ROOM, 4)), 0
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
            out[n_out, WINDOW_NUMBER] = w
            out[n_out, WINDOW_THETA] = found[k, PEAK_THETA]
            out[n_out, WINDOW_RHO] = found[k, PEAK_RHO]
            out[n_out, WINDOW_STRENGTH] = found[k, PEAK_STRENGTH]
            n_out += 1
    return out[:n_out].copy()
