"""Which cells show the bare earth, road or no road: by openings that remove what stands on it, and by steep edges.

Separate from `regions`, which joins cells: this is a filter of its own, and depends on heights alone.

Published filters choose one of two weaknesses: with windows wide enough for a building a dam loses its crest, with
smaller ones roofs stay. Here they decide together. A cell that no opening lowers by more than the terrain's own slope
is earth; whole regions without a steep edge inside are earth where at least half of their cells are, so that the crest
of a dam follows its foot, and a roof, which no gentle slope joins to the earth, does not.

References
----------
T. J. Pingel, K. C. Clarke, W. A. McBride, An improved simple morphological filter for the terrain classification of
airborne LIDAR data, ISPRS Journal 77, 2013, doi:10.1016/j.isprsjprs.2012.12.002: openings whose limit grows with their
window. G. Vosselman, Slope based filtering of laser altimetry data, IAPRS 33-B3, 2000: a point that stands above
another by more than a slope allows is no earth.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from linework.arrays import AnyArray, BoolArray, Float32Array
from linework.surface.cells import CellWindow
from linework.surface.config import RoadConfig

#: Half sides of the windows of the openings: from a post to half of a hall of 128 m. [m]
_WINDOWS_M = (0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0)
#: Windows are at most so many blocks of cells to a side: larger ones are opened on blocks' lowest heights. [blocks]
_MOST_BLOCKS = 8
#: Slope that level ground has everywhere: the crossfall that lets water run off, twice. [m/m]
_LEVEL_SLOPE = 0.05
#: Side of the blocks from which the terrain's own slope is taken, and its limit: no bank of soil is steeper for long
#: (1 in 1.5). [m], [m/m]
_SLOPE_BLOCK_M, _MOST_SLOPE = 8.0, 0.67
#: Buildings are opened away within this, and of the slopes of the blocks within that a larger share than the walls at the
#: corner of a hall make up counts: a crest is level itself. [blocks], [ratio]
_SLOPE_OPENING, _SLOPE_REACH, _SLOPE_SHARE = 2, 5, 0.6
#: Steeper than any bank, less than walls, cars and hedges; and how far such an edge is looked for: as high a wall counts
#: as any. [m/m], [m]
_EDGE_SLOPE, _EDGE_REACH_M = 1.0, 5.0
#: A lamp of which nothing else is known for the widest window stands on unknown ground: larger than the roof of a
#: lorry. [m2]
_LEAST_KNOWN_M2 = 25.0
#: Blocks around a window on which its slopes depend.
_SLOPE_HALO = 2 * _SLOPE_OPENING + 1 + _SLOPE_REACH + 1
_INF = np.float32(np.inf)
_Pick = Callable[[AnyArray, AnyArray], AnyArray]


def bare_halo(config: RoadConfig) -> int:
    """Return the width of the halo around a window on which its bare cells depend. [cells]."""
    widest = max((2 * n_blocks + 1) * size for size, n_blocks in _openings(config))
    slope = _SLOPE_HALO * _slope_block(config)
    return max(widest, slope) + _edge_cells(config)


def bare_cells(
    window: CellWindow, height: Float32Array, config: RoadConfig, halo: int
) -> tuple[BoolArray, BoolArray]:
    """Return which cells of a window are earth by the openings, and which have no steep edge below them.

    Parameters
    ----------
    window
        The cells without the halo.
    height
        (n_rows + 2 halo, n_cols + 2 halo) float32; NaN in empty cells. [m]
    halo
        `bare_halo`, or more. [cells]

    Returns
    -------
    earth, gentle
        (n_rows, n_cols) bool each; earth cells are gentle too.
    """
    around = window.grown(halo)
    z = np.where(np.isnan(height), _INF, height)
    inner = around.part(window)
    # Gentle: no cell nearby is lower by more than the slope of an edge
    reach = _edge_cells(config)
    lowered = _cone(z[around.part(window.grown(reach))], reach, config)[reach:-reach, reach:-reach]
    own = z[inner]
    gentle = np.isfinite(own) & (own <= lowered + np.float32(config.layer_m))
    slope = _terrain_slope(around, z, window, config)
    limit = np.full(window.shape, _INF)
    for size, n_blocks in _openings(config):
        near = window.grown((2 * n_blocks + 1) * size)
        opened = _opened(_lowest_of_blocks(near, z[around.part(near)], size), n_blocks)
        level = _of_blocks(near, opened, window, size)
        np.minimum(limit, level + slope * np.float32(n_blocks * size * config.cell_m), out=limit)
    earth = (
        gentle & (own <= limit + np.float32(config.layer_m)) & _has_surroundings(around, z, window, config)
    )
    return earth, gentle


def _openings(config: RoadConfig) -> list[tuple[int, int]]:
    """Return the side of a block [cells] and the half side of the window [blocks] of each opening."""
    found = []
    for half_m in _WINDOWS_M:
        cells = half_m / config.cell_m
        size = 1
        while cells / size > _MOST_BLOCKS:
            size *= 4
        if cells >= 1.0:
            found.append((size, round(cells / size)))
    return found


def _slope_block(config: RoadConfig) -> int:
    return max(round(_SLOPE_BLOCK_M / config.cell_m), 1)


def _edge_cells(config: RoadConfig) -> int:
    return max(math.ceil(_EDGE_REACH_M / config.cell_m), 1)


def _terrain_slope(
    around: CellWindow, z: Float32Array, window: CellWindow, config: RoadConfig
) -> Float32Array:
    """Return the slope of the terrain about each cell of a window, without what stands on it, (n_rows, n_cols) [m/m].

    It is the sum of the slopes along rows and columns: by so much a square window falls.
    """
    size = _slope_block(config)
    near = window.grown(_SLOPE_HALO * size)
    blocks = _opened(_lowest_of_blocks(near, z[around.part(near)], size), _SLOPE_OPENING)
    total = np.zeros_like(blocks)
    for axis in (0, 1):
        with np.errstate(invalid="ignore"):
            rise = np.abs(_shifted(blocks, 1, axis, _INF) - blocks)
        rise = np.where(np.isfinite(rise), rise, np.float32(0.0))
        total += np.maximum(rise, _shifted(rise, -1, axis, np.float32(0.0)))
    total[np.isinf(blocks)] = np.nan
    slope = _quantile_about(total / np.float32(size * config.cell_m), _SLOPE_REACH, _SLOPE_SHARE)
    slope = np.clip(slope, np.float32(_LEVEL_SLOPE), np.float32(_MOST_SLOPE))
    return _of_blocks(near, slope, window, size)


def _quantile_about(values: Float32Array, n: int, share: float) -> Float32Array:
    """Return a quantile of the known values within n rows and columns of each; 0 without any."""
    padded = np.pad(values, n, constant_values=np.nan)
    around = np.lib.stride_tricks.sliding_window_view(padded, (2 * n + 1, 2 * n + 1))
    ordered = np.sort(around.reshape(*values.shape, -1), axis=-1)  # NaN last
    n_known = np.count_nonzero(~np.isnan(ordered), axis=-1)
    at = np.maximum(np.ceil(share * n_known).astype(np.int64) - 1, 0)
    found = np.take_along_axis(ordered, at[..., None], axis=-1)[..., 0]
    return np.where(np.isnan(found), np.float32(0.0), found)


def _has_surroundings(
    around: CellWindow, z: Float32Array, window: CellWindow, config: RoadConfig
) -> BoolArray:
    """Return which cells of a window have enough known cells about them to say what stands on what."""
    size, n_blocks = max(_openings(config), default=(1, 1))
    near = window.grown((n_blocks + 1) * size)
    known = _by_blocks(near, np.isfinite(z[around.part(near)]), size, np.sum, 0)
    sums = np.pad(known, n_blocks + 1).cumsum(axis=0).cumsum(axis=1)
    n = 2 * n_blocks + 1
    total = sums[n:, n:] - sums[:-n, n:] - sums[n:, :-n] + sums[:-n, :-n]
    total = total[: known.shape[0], : known.shape[1]]
    return _of_blocks(near, total, window, size) * config.cell_m**2 >= _LEAST_KNOWN_M2


def _cone(z: Float32Array, reach: int, config: RoadConfig) -> Float32Array:
    """Return the lowest height that the slope of an edge allows each cell, given the cells within `reach` of it."""
    side = np.float32(_EDGE_SLOPE * config.cell_m)
    corner = np.float32(_EDGE_SLOPE * config.cell_m * math.sqrt(2.0))
    for _ in range(reach):
        rows = np.minimum(_shifted(z, 1, 0, _INF), _shifted(z, -1, 0, _INF))
        cols = np.minimum(_shifted(z, 1, 1, _INF), _shifted(z, -1, 1, _INF))
        corners = np.minimum(_shifted(rows, 1, 1, _INF), _shifted(rows, -1, 1, _INF))
        z = np.minimum(np.minimum(z, np.minimum(rows, cols) + side), corners + corner)
    return z


def _lowest_of_blocks(window: CellWindow, z: Float32Array, size: int) -> Float32Array:
    """Return the lowest height of each block of `size` cells that the window touches."""
    return _by_blocks(window, z, size, np.min, np.inf)


def _by_blocks(
    window: CellWindow, values: AnyArray, size: int, of: Callable[..., AnyArray], fill: float
) -> AnyArray:
    """Return a value of each block of `size` cells that the window touches; blocks count from the zero of the cells."""
    south, west = window.south % size, window.west % size
    north, east = -window.north % size, -window.east % size
    values = np.pad(values, ((north, south), (west, east)), constant_values=fill)
    rows, cols = values.shape[0] // size, values.shape[1] // size
    # Rows first: whole rows are added side by side
    return of(of(values.reshape(rows, size, -1), axis=1).reshape(rows, cols, size), axis=2)


def _of_blocks(window: CellWindow, values: AnyArray, inner: CellWindow, size: int) -> AnyArray:
    """Return the values of blocks of a window at the cells of an inner window."""
    top, left = -(-window.north // size), window.west // size
    rows = top - 1 - (inner.north - 1 - np.arange(inner.n_rows)) // size
    cols = (inner.west + np.arange(inner.n_cols)) // size - left
    return np.asarray(values[rows][:, cols])


def _opened(z: Float32Array, n: int) -> Float32Array:
    """Return the opening by a window of 2 n + 1: nothing narrower than that stays. Unknown cells are infinite.

    Windows about unknown cells do not count: a roof beside which the data end is narrower than any window.
    """
    low = np.where(np.isinf(z), -_INF, _over_window(z, n, np.minimum, _INF))
    high = _over_window(low, n, np.maximum, -_INF)
    high[np.isinf(high)] = _INF
    return high


def _over_window(z: Float32Array, n: int, pick: _Pick, fill: np.float32) -> Float32Array:
    """Return the lowest or highest value within n cells of each, in windows that double."""
    for axis in (0, 1):
        done = 0
        while done < n:
            step = min(n - done, 2 * done + 1)
            z = pick(pick(z, _shifted(z, step, axis, fill)), _shifted(z, -step, axis, fill))
            done += step
    return z


def _shifted(z: AnyArray, n: int, axis: int, fill: np.float32) -> AnyArray:
    """Return the value n cells further along an axis, and `fill` beyond the edge."""
    out = np.full_like(z, fill)
    n = max(min(n, z.shape[axis]), -z.shape[axis])
    kept, taken = (slice(None, -n), slice(n, None)) if n > 0 else (slice(-n, None), slice(None, n))
    if axis == 0:
        out[kept] = z[taken]
    else:
        out[:, kept] = z[:, taken]
    return out
