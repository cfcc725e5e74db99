"""Kernels for regions of cells: labels, links across window edges, opening, heights below a path."""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import BoolArray, Float32Array, FloatArray, Int32Array, IntArray

#: Distance from an edge within which a region may continue beyond it: it steps over one missing cell. [cells]
DEEP = 2


@njit(cache=True, nogil=True)
def label_regions(
    height: Float32Array,
    slope_east: Float32Array,
    slope_north: Float32Array,
    allowed: BoolArray,
    cell: float,
    max_step: float,
    level: bool,
) -> tuple[Int32Array, int, Int32Array]:
    """Label the connected regions of the allowed cells: 1, 2 ... (0: not allowed).

    Two cells are connected when they are neighbours in a row or a column, or have one missing cell between
    them, and their heights differ by at most `max_step` from what the mean of their slopes predicts
    (`level`: slopes count as 0). The relation is symmetric, so a region does not depend on where it starts.

    Parameters
    ----------
    height, slope_east, slope_north
        (n_rows, n_cols) float32, north up: heights [m], NaN where missing, and slopes.
    allowed
        (n_rows, n_cols) bool.
    cell, max_step
        Side of a cell, and largest deviation of a step. [m]
    level
        Take slopes as 0.

    Returns
    -------
    labels
        (n_rows, n_cols) int32.
    n_border
        Number of labels within `DEEP` cells of the edge; they come first.
    first
        (n,) int32: flat index of each label's first cell, row by row; entry 0 is label 1.
    """
    n_rows, n_cols = height.shape
    parent = np.full(n_rows * n_cols, -1, dtype=np.int32)
    spans = _spans_of(allowed)
    for r in range(n_rows):
        for c in range(spans[r, 0], spans[r, 1]):
            if not allowed[r, c]:
                continue
            at = r * n_cols + c
            parent[at] = at
            for axis in range(2):
                for reach in range(1, 3):
                    rr, cc = (r, c - reach) if axis == 0 else (r - reach, c)
                    if rr < 0 or cc < 0:
                        break
                    if np.isnan(height[rr, cc]):
                        continue  # look one cell further: a gap between two scan lines
                    if allowed[rr, cc]:
                        slope = np.float32(0.0)
                        if not level and axis == 0:
                            slope = np.float32(0.5) * (slope_east[r, c] + slope_east[rr, cc])
                        elif not level:
                            slope = np.float32(-0.5) * (slope_north[r, c] + slope_north[rr, cc])
                        rise = height[r, c] - height[rr, cc]
                        if abs(rise - slope * np.float32(reach * cell)) <= max_step:
                            _unite(parent, at, rr * n_cols + cc)
                    break
    return _numbered(parent, spans, n_rows, n_cols)


@njit(cache=True, nogil=True)
def _spans_of(mask: BoolArray) -> Int32Array:
    """Return the range of set cells of each row, (n_rows, 2): most cells of a tile with a road are empty."""
    n_rows, n_cols = mask.shape
    spans = np.zeros((n_rows, 2), dtype=np.int32)
    for r in range(n_rows):
        begin, end = 0, n_cols
        while begin < n_cols and not mask[r, begin]:
            begin += 1
        while end > begin and not mask[r, end - 1]:
            end -= 1
        spans[r, 0], spans[r, 1] = begin, end
    return spans


@njit(cache=True, nogil=True)
def _root(parent: Int32Array, at: int) -> int:
    while parent[at] != at:
        parent[at] = parent[parent[at]]
        at = parent[at]
    return at


@njit(cache=True, nogil=True)
def _unite(parent: Int32Array, a: int, b: int) -> None:
    a, b = _root(parent, a), _root(parent, b)
    if a < b:
        parent[b] = a
    else:
        parent[a] = b


@njit(cache=True, nogil=True)
def _numbered(
    parent: Int32Array, spans: Int32Array, n_rows: int, n_cols: int
) -> tuple[Int32Array, int, Int32Array]:
    """Return labels in the order of the regions' first cells, those near the edge first."""
    label_of = np.zeros(n_rows * n_cols, dtype=np.int32)
    first = np.empty(1024, dtype=np.int32)
    n = 0
    for r in range(n_rows):
        inner = r >= DEEP and r < n_rows - DEEP
        c = 0
        while c < n_cols:
            if inner and c == DEEP and n_cols > 2 * DEEP:
                c = n_cols - DEEP
            at = r * n_cols + c
            c += 1
            if parent[at] >= 0:
                root = _root(parent, at)
                if label_of[root] == 0:
                    n += 1
                    label_of[root] = n
    n_border = n
    labels = np.zeros((n_rows, n_cols), dtype=np.int32)
    for r in range(n_rows):
        for c in range(spans[r, 0], spans[r, 1]):
            at = r * n_cols + c
            if parent[at] < 0:
                continue
            if parent[at] == at:  # roots are the first cells of their regions
                if label_of[at] == 0:
                    n += 1
                    label_of[at] = n
                if n > len(first):
                    more = np.empty(2 * n, dtype=np.int32)
                    more[: len(first)] = first
                    first = more
                first[label_of[at] - 1] = at
            labels[r, c] = label_of[_root(parent, at)]
    return labels, n_border, first[:n]


@njit(cache=True, nogil=True)
def sizes_of_labels(labels: Int32Array, count: Int32Array, n: int) -> tuple[IntArray, IntArray]:
    """Return the number of cells of each label and of the points in them, (n,) int64 each; entry 0 is label 1.

    Parameters
    ----------
    labels, count
        (n_rows, n_cols) int32 labels, and int32 points per cell.
    n
        Number of labels.
    """
    cells, points = np.zeros(n, dtype=np.int64), np.zeros(n, dtype=np.int64)
    for r in range(labels.shape[0]):
        for c in range(labels.shape[1]):
            if labels[r, c] > 0:
                cells[labels[r, c] - 1] += 1
                points[labels[r, c] - 1] += count[r, c]
    return cells, points


@njit(cache=True, nogil=True)
def links_across(
    height: Float32Array,
    slope: Float32Array,
    labels: Int32Array,
    height_b: Float32Array,
    slope_b: Float32Array,
    labels_b: Int32Array,
    cell: float,
    max_step: float,
) -> Int32Array:
    """Return the pairs of labels that are connected across an edge, (m, 2) int32, as `label_regions` connects.

    Parameters
    ----------
    height, slope, labels
        (n, 2) float32 and int32: the cells along the edge on this side, the nearest to it last; slopes towards the
        other side.
    height_b, slope_b, labels_b
        (n, 2) float32 and int32: those on the other side, the nearest to the edge first.
    cell, max_step
        Side of a cell, and largest deviation of a step. [m]
    """
    found = np.empty((len(height), 2), dtype=np.int32)
    n = 0
    for i in range(len(height)):
        a, b = 1, 0
        if np.isnan(height[i, 1]) and np.isnan(height_b[i, 0]):
            continue
        if np.isnan(height[i, 1]):
            a = 0
        elif np.isnan(height_b[i, 0]):
            b = 1
        if labels[i, a] == 0 or labels_b[i, b] == 0:
            continue  # not allowed, or missing: labelled cells have a height
        reach = 2 - a + b
        expected = np.float32(0.5) * (slope[i, a] + slope_b[i, b]) * np.float32(reach * cell)
        if abs(height_b[i, b] - height[i, a] - expected) <= max_step:
            if n > 0 and found[n - 1, 0] == labels[i, a] and found[n - 1, 1] == labels_b[i, b]:
                continue
            found[n, 0], found[n, 1] = labels[i, a], labels_b[i, b]
            n += 1
    return found[:n]


@njit(cache=True, nogil=True)
def drops_below(
    path: FloatArray, west: int, south: int, height: Float32Array, cell: float, z0: float, reach: int
) -> tuple[Float32Array, Float32Array]:
    """Return the least and largest height of a path above each cell near it, (n_rows, n_cols) float32 [m]; else NaN.

    Parameters
    ----------
    path
        (n, 3) samples. [m, world]
    west, south
        Numbers of the first column and of the last row. [cells]
    height, cell, z0
        (n_rows, n_cols) float32 heights above z0 [m], side of a cell [m], and z0 [m, world].
    reach
        Distance from the path along rows and columns. [cells]
    """
    n_rows, n_cols = height.shape
    least = np.full((n_rows, n_cols), np.float32(np.nan), dtype=np.float32)
    most = np.full((n_rows, n_cols), np.float32(np.nan), dtype=np.float32)
    for i in range(len(path)):
        c0 = int(np.floor(path[i, 0] / cell)) - west
        r0 = n_rows - 1 - (int(np.floor(path[i, 1] / cell)) - south)
        for r in range(max(r0 - reach, 0), min(r0 + reach + 1, n_rows)):
            for c in range(max(c0 - reach, 0), min(c0 + reach + 1, n_cols)):
                if np.isnan(height[r, c]):
                    continue
                drop = np.float32(path[i, 2] - z0 - height[r, c])
                if not drop >= least[r, c]:
                    least[r, c] = drop
                if not drop <= most[r, c]:
                    most[r, c] = drop
    return least, most


@njit(cache=True, nogil=True)
def with_labels(labels: Int32Array, chosen: BoolArray) -> BoolArray:
    """Return which cells have a chosen label, bool of the shape of `labels`; `chosen` (n,) bool is indexed by label."""
    out = np.zeros(labels.shape, dtype=np.bool_)
    for r in range(labels.shape[0]):
        for c in range(labels.shape[1]):
            label = labels[r, c]
            out[r, c] = label < len(chosen) and chosen[label]
    return out
