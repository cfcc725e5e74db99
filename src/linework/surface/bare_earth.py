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
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from linework.arrays import AnyArray, BoolArray, Float32Array
from linework.kernels.cells import openings as kernels
from linework.surface.blocks import BlockHeights, blocks_over, places_in_blocks
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
#: So few cells of a block, and fewer than twice as many in the nine about it, do not show what stands on what. [cells]
_FEW_CELLS = 3
#: Blocks around those of a window on which its slopes depend.
_SLOPE_HALO = 2 * _SLOPE_OPENING + 1 + _SLOPE_REACH
_INF = np.float32(np.inf)


def bare_halo(config: RoadConfig) -> int:
    """Return the width of the halo of cells around a window on which its bare cells depend. [cells]."""
    return max(_edge_cells(config) + 1, block_halos(config).get(1, 0))  # cells next to which one may be a pit


def block_halos(config: RoadConfig) -> dict[int, int]:
    """Return the sides of all blocks on which bare cells depend [cells], ascending, and how many around a window's own."""
    found = {_slope_block(config): _SLOPE_HALO}
    for size, n_blocks in _openings(config):
        found[size] = max(found.get(size, 0), 2 * n_blocks)
    # Which blocks say nothing, and next to those which is a pit: two more
    return {size: n_around + 2 for size, n_around in sorted(found.items())}


def block_sizes(config: RoadConfig) -> list[int]:
    """Return the sides of the blocks that are found once for a tile, ascending: all but the cells. [cells]."""
    return [size for size in block_halos(config) if size > 1]


def bare_cells(
    window: CellWindow,
    height: Float32Array,
    halo: int,
    blocks: Mapping[int, BlockHeights],
    is_dense: bool,
    config: RoadConfig,
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
    blocks
        For each side of `block_halos` but 1: blocks of the window, and so many around them.
    is_dense
        Whether single low cells may be stray: `linework.surface.strays.LoneCells.is_dense`.

    Returns
    -------
    earth, gentle
        (n_rows, n_cols) bool each; earth cells are gentle too.
    """
    earth, gentle = np.zeros(window.shape, dtype=bool), np.zeros(window.shape, dtype=bool)
    known = ~np.isnan(height[halo:-halo, halo:-halo])
    rows, cols = np.flatnonzero(known.any(axis=1)), np.flatnonzero(known.any(axis=0))
    if not len(rows):
        return earth, gentle
    # Most cells of a tile with a road are empty: only the rectangle around the others is looked at
    top, bottom, left, right = int(rows[0]), int(rows[-1]), int(cols[0]), int(cols[-1])
    part = np.s_[top : bottom + 1, left : right + 1]
    inner = CellWindow(window.west + left, window.north - 1 - bottom, bottom - top + 1, right - left + 1)
    around = inner.grown(bare_halo(config))
    height = height[window.grown(halo).part(around)]
    earth[part], gentle[part] = _bare_cells(inner, around, height, blocks, is_dense, config)
    return earth, gentle


def _bare_cells(
    window: CellWindow,
    around: CellWindow,
    height: Float32Array,
    blocks: Mapping[int, BlockHeights],
    is_dense: bool,
    config: RoadConfig,
) -> tuple[BoolArray, BoolArray]:
    """Return earth and gentle cells of a window, given the heights of the cells around it."""
    measured = np.where(np.isnan(height), _INF, height)
    layer, depth = np.float32(config.layer_m), _EDGE_SLOPE * config.cell_m
    # A cell that stands alone below those around it, with stray points alone, says nothing about them
    z = kernels.without_pits(measured, depth) if is_dense else measured
    levels = {size: _level(found, is_dense, depth) for size, found in blocks.items()}
    levels[1] = _Level(1, around, z, np.isfinite(measured))
    # Gentle: no cell nearby is lower by more than the slope of an edge
    reach, rise = _edge_cells(config), depth
    near = np.ascontiguousarray(z[around.part(window.grown(reach))])
    lowered = kernels.lowered_by_slope(near, reach, rise, rise * math.sqrt(2.0))[reach:-reach, reach:-reach]
    own, filled = measured[around.part(window)], z[around.part(window)]
    gentle = np.isfinite(own) & (own <= lowered + layer)
    slope_blocks, slope = _terrain_slope(levels[_slope_block(config)], window, config)
    places = places_in_blocks(slope_blocks, _slope_block(config), window)
    limit = np.full(window.shape, _INF)
    for size, n_blocks in _openings(config):
        over = blocks_over(window, size).grown(2 * n_blocks)
        level = _opened(levels[size], over, n_blocks)
        half_m = n_blocks * size * config.cell_m
        kernels.lower_limits(limit, level, *places_in_blocks(over, size, window), slope, *places, half_m)
    # A pit in earth is none: below a hedge or a crop the cells around one are leaves
    is_earth = (own <= limit + layer) & ((filled == own) | (filled > limit + layer))
    return gentle & is_earth & _has_surroundings(levels, window, config), gentle


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


class _Level(NamedTuple):
    """The lowest heights of blocks of one size, without stray ones, and how many cells of each have a height."""

    size: int
    window: CellWindow
    lowest: Float32Array
    known: AnyArray


def _level(blocks: BlockHeights, is_dense: bool, depth: float) -> _Level:
    """Return blocks; in a dense survey without stray cells: few with few about them, and such as stand alone below all."""
    if not is_dense:
        return _Level(blocks.size, blocks.window, blocks.lowest[:, :, 0], blocks.known)
    lowest = blocks.lowest_supported(depth)
    padded = np.pad(blocks.known.astype(np.int64), 1)
    about = sum(padded[r : r + lowest.shape[0], c : c + lowest.shape[1]] for r in range(3) for c in range(3))
    lowest[(blocks.known < _FEW_CELLS) & (about < 2 * _FEW_CELLS)] = _INF
    return _Level(blocks.size, blocks.window, kernels.without_pits(lowest, depth * blocks.size), blocks.known)


def _terrain_slope(blocks: _Level, window: CellWindow, config: RoadConfig) -> tuple[CellWindow, Float32Array]:
    """Return the blocks of a window, and the slope of the terrain about each without what stands on it. [m/m].

    It is the sum of the slopes along rows and columns: by so much a square window falls.
    """
    own = blocks_over(window, blocks.size)
    near = own.grown(_SLOPE_HALO)
    lowest = _opened(blocks, near, _SLOPE_OPENING)
    total = np.zeros_like(lowest)
    for axis in (0, 1):
        with np.errstate(invalid="ignore"):
            rise = np.abs(_shifted(lowest, 1, axis, _INF) - lowest)
        rise = np.where(np.isfinite(rise), rise, np.float32(0.0))
        total += np.maximum(rise, _shifted(rise, -1, axis, np.float32(0.0)))
    total[np.isinf(lowest)] = np.nan
    total = total[near.part(own.grown(_SLOPE_REACH))] / np.float32(blocks.size * config.cell_m)
    slope = _quantile_about(total, _SLOPE_REACH, _SLOPE_SHARE)
    return own, np.clip(slope, np.float32(_LEVEL_SLOPE), np.float32(_MOST_SLOPE))


def _quantile_about(values: Float32Array, n: int, share: float) -> Float32Array:
    """Return a quantile of the known values within n rows and columns of each but the outer n; 0 without any."""
    around = np.lib.stride_tricks.sliding_window_view(values, (2 * n + 1, 2 * n + 1))
    ordered = np.sort(around.reshape(*around.shape[:2], -1), axis=-1)  # NaN last
    n_known = np.count_nonzero(~np.isnan(ordered), axis=-1)
    at = np.maximum(np.ceil(share * n_known).astype(np.int64) - 1, 0)
    found = np.take_along_axis(ordered, at[..., None], axis=-1)[..., 0]
    return np.where(np.isnan(found), np.float32(0.0), found)


def _has_surroundings(blocks: Mapping[int, _Level], window: CellWindow, config: RoadConfig) -> BoolArray:
    """Return which cells of a window have enough known cells about them to say what stands on what."""
    size, n_blocks = max(_openings(config))
    own = blocks_over(window, size)
    known = blocks[size].known[blocks[size].window.part(own.grown(n_blocks))].astype(np.int64)
    sums = np.pad(known, ((1, 0), (1, 0))).cumsum(axis=0).cumsum(axis=1)
    n = 2 * n_blocks + 1
    total = sums[n:, n:] - sums[:-n, n:] - sums[n:, :-n] + sums[:-n, :-n]
    rows, cols = places_in_blocks(own, size, window)
    return np.asarray((total * config.cell_m**2 >= _LEAST_KNOWN_M2)[rows][:, cols])


def _opened(blocks: _Level, window: CellWindow, n: int) -> Float32Array:
    """Return the opening of the blocks of a window by one of 2 n + 1. Unknown blocks are infinite.

    Windows about unknown blocks do not count: a roof beside which the data end is narrower than any window.
    """
    opened: Float32Array = kernels.opened(np.ascontiguousarray(blocks.lowest[blocks.window.part(window)]), n)
    return opened


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
