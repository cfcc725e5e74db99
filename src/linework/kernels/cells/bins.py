"""Binning of the points near an image's set cells: by cell in plan and, within a cell, by layers of height."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

from linework.arrays import BoolArray, Float32Array, FloatArray, IntArray

#: Layers above a bin's lowest point; the last one is open above. 16 layers of 0.2 m reach over a beam on a bank.
N_LAYERS = 16
#: Thickness of a layer: a followed sheet needs 0.8 m of height, four or five layers of a bin. [m]
BIN_LAYER_M = 0.20
#: Columns of binned points: x, y and z from the bins' origin, height above the road. [m]
BIN_X, BIN_Y, BIN_Z, BIN_HEIGHT = 0, 1, 2, 3
#: Number of these columns.
BIN_COLUMNS = 4
#: Index of the layers: slot of each bin, lowest z of each slot, where its layers begin; see `sort_into_layers`.
LayeredBins = tuple[IntArray, FloatArray, IntArray]


@njit(cache=True, nogil=True)
def steps_to_set(image: BoolArray, most: int) -> npt.NDArray[np.uint8]:
    """Return the distance of each cell to the nearest set cell, (rows, cols) uint8 [cells, city block].

    Parameters
    ----------
    image
        (rows, cols) bool.
    most
        Distances beyond this are `most` + 1; at most 254.
    """
    n_rows, n_cols = image.shape
    steps = np.full((n_rows, n_cols), most + 1, dtype=np.uint8)
    for r in range(n_rows):
        for c in range(n_cols):
            nearest = np.int64(most)
            if image[r, c]:
                nearest = np.int64(-1)
            elif r > 0:
                nearest = min(nearest, np.int64(steps[r - 1, c]))
            if c > 0 and not image[r, c]:
                nearest = min(nearest, np.int64(steps[r, c - 1]))
            steps[r, c] = nearest + 1
    for r in range(n_rows - 1, -1, -1):
        for c in range(n_cols - 1, -1, -1):
            nearest = np.int64(steps[r, c]) - 1
            if r + 1 < n_rows:
                nearest = min(nearest, np.int64(steps[r + 1, c]))
            if c + 1 < n_cols:
                nearest = min(nearest, np.int64(steps[r, c + 1]))
            steps[r, c] = nearest + 1
    return steps


@njit(cache=True, nogil=True)
def choose_near(
    xyz: FloatArray,
    height: Float32Array,
    frame: tuple[float, float, float],
    image: BoolArray,
    most: int,
    band: tuple[float, float],
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Choose the points within a height band and within `most` cells of a set cell of an image.

    Parameters
    ----------
    xyz
        (n, 3) points. [m, world]
    height
        (n,) float32 heights above the road. [m]
    frame
        West edge, north edge and cell size of the north-up image. [m, world]
    image
        (rows, cols) bool.
    most
        Largest distance to a set cell. [cells, city block]
    band
        Lowest and highest height above the road. [m]

    Returns
    -------
    index
        (k,) int64: the chosen points.
    low, high
        (3,) lowest and highest coordinates among them, infinite without any. [m, world]
    """
    west, north, cell = frame
    n_rows, n_cols = image.shape
    steps = steps_to_set(image, most)
    index = np.empty(len(xyz), dtype=np.int64)
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    n = 0
    for i in range(len(xyz)):
        if height[i] < band[0] or height[i] > band[1]:
            continue
        c = int(np.floor((xyz[i, 0] - west) / cell))
        r = int(np.floor((north - xyz[i, 1]) / cell))
        if r >= 0 and r < n_rows and c >= 0 and c < n_cols and steps[r, c] <= most:
            index[n] = i
            n += 1
            for k in range(3):
                low[k], high[k] = min(low[k], xyz[i, k]), max(high[k], xyz[i, k])
    return index[:n], low, high


@njit(cache=True, nogil=True)
def sort_into_bins(
    xyz: FloatArray,
    height: Float32Array,
    index: IntArray,
    origin: FloatArray,
    cell: float,
    n_x: int,
    n_y: int,
) -> tuple[FloatArray, IntArray]:
    """Sort chosen points into square bins, row-major from the south-west; stable.

    Parameters
    ----------
    xyz
        (n, 3) points. [m, world]
    height
        (n,) float32 heights above the road. [m]
    index
        (k,) int64: the points to sort.
    origin
        (3,) south-west corner of the first bin, and the zero of heights. [m, world]
    cell
        Side of a bin. [m]
    n_x, n_y
        Number of bins to the east and to the north.

    Returns
    -------
    points
        (k, 4) by bin; columns `BIN_X` to `BIN_HEIGHT`. [m]
    starts
        (n_x * n_y + 1,) int64: where each bin's points begin.
    """
    starts = np.zeros(n_x * n_y + 1, dtype=np.int64)
    bins = np.empty(len(index), dtype=np.int64)
    for k in range(len(index)):
        i = index[k]
        b = int((xyz[i, 1] - origin[1]) / cell) * n_x + int((xyz[i, 0] - origin[0]) / cell)
        bins[k] = b
        starts[b + 1] += 1
    for b in range(n_x * n_y):
        starts[b + 1] += starts[b]
    fill = starts[:-1].copy()
    points = np.empty((len(index), BIN_COLUMNS))
    for k in range(len(index)):
        i, at = index[k], fill[bins[k]]
        fill[bins[k]] += 1
        points[at, BIN_X] = xyz[i, 0] - origin[0]
        points[at, BIN_Y] = xyz[i, 1] - origin[1]
        points[at, BIN_Z] = xyz[i, 2] - origin[2]
        points[at, BIN_HEIGHT] = height[i]
    return points, starts


@njit(cache=True, nogil=True)
def layer_of(z: float, floor: float) -> int:
    """Return the layer of height `z` [m] in a bin whose lowest point is at `floor` [m]."""
    return int(min(max((z - floor) / BIN_LAYER_M, 0.0), N_LAYERS - 1.0))


@njit(cache=True, nogil=True)
def sort_into_layers(points: FloatArray, starts: IntArray) -> LayeredBins:
    """Sort each bin's points by layer, in place and stable, and return the index of the layers.

    Parameters
    ----------
    points
        (n, 4) as `sort_into_bins` returns them; reordered. [m]
    starts
        (n_bins + 1,) int64: where each bin's points begin.

    Returns
    -------
    slot
        (n_bins,) int64: number of the bin among those that hold points, else -1.
    floor
        (n_slots,) lowest z of the bin. [m]
    layers
        (n_slots, N_LAYERS + 1) int64: where each layer's points begin.
    """
    n_bins = len(starts) - 1
    slot = np.full(n_bins, -1, dtype=np.int64)
    n_slots, n_most = 0, 0
    for b in range(n_bins):
        if starts[b + 1] > starts[b]:
            slot[b] = n_slots
            n_slots += 1
            n_most = max(n_most, starts[b + 1] - starts[b])
    floor = np.empty(n_slots)
    layers = np.zeros((n_slots, N_LAYERS + 1), dtype=np.int64)
    copy = np.empty((n_most, BIN_COLUMNS))
    fill = np.empty(N_LAYERS, dtype=np.int64)
    for b in range(n_bins):
        k, first, last = slot[b], starts[b], starts[b + 1]
        if k < 0:
            continue
        lowest = np.inf
        for i in range(first, last):
            lowest = min(lowest, points[i, BIN_Z])
            for j in range(BIN_COLUMNS):
                copy[i - first, j] = points[i, j]
        for i in range(first, last):
            layers[k, layer_of(points[i, BIN_Z], lowest) + 1] += 1
        layers[k, 0] = first
        for j in range(N_LAYERS):
            fill[j] = layers[k, j]
            layers[k, j + 1] += layers[k, j]
        for i in range(last - first):
            j = layer_of(copy[i, BIN_Z], lowest)
            for m in range(BIN_COLUMNS):
                points[fill[j], m] = copy[i, m]
            fill[j] += 1
        floor[k] = lowest
    return slot, floor, layers
