"""Ground that gaps in the data separate from the rest: smooth pieces level with the ground nearby."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from linework.arrays import AnyArray, BoolArray, Float32Array, offsets_of
from linework.kernels.cells import nearest as nearest_kernels
from linework.kernels.cells import regions as kernels
from linework.surface.carry import reach_cells
from linework.surface.config import RoadConfig
from linework.surface.regions import connected_groups

#: Halo width of the opening by 3 x 3 cells, which drops wires. [cells]
OPENING_HALO = 2
#: Least area of a piece of ground: larger than the roof of a lorry. [m2]
_MIN_AREA_M2 = 25.0
#: A piece is level within a step of the nearest ground [m], plus the rise of a steep road over the distance [1], which
#: counts up to 25 m [m]: a roof stands higher than that above the ground at its foot.
_MAX_STEP_M, _MAX_GRADE, _MAX_WAY_M = 1.0, 0.12, 25.0
_NOTHING = np.zeros(0, dtype=np.int64)


@dataclass(frozen=True, slots=True)
class IsolatedPieces:
    """Smooth pieces of a window that are not ground yet.

    Parameters
    ----------
    n_border
        Pieces 1 to `n_border` are near the edge of the window and may continue beyond it.
    edges
        (n,) int32 labels along the western, eastern, northern and southern edge; 0 without a piece.
    cells, level
        (n,) int64 number of cells of each piece, and of those level with the nearest ground.
    pairs
        (k, 2) int32 piece, and a ground label that shares cells with it.
    """

    n_border: int
    edges: tuple[AnyArray, AnyArray, AnyArray, AnyArray]
    cells: AnyArray
    level: AnyArray
    pairs: AnyArray


def smooth_pieces(candidates: BoolArray) -> tuple[AnyArray, int, int]:
    """Return the labels of pieces of candidate cells, the number near the edge, and the number in all.

    Parameters
    ----------
    candidates
        (n_rows + 2 `OPENING_HALO`, n_cols + 2 `OPENING_HALO`) bool: smooth and not ground.
    """
    mask = np.ascontiguousarray(
        kernels.opened(candidates)[OPENING_HALO:-OPENING_HALO, OPENING_HALO:-OPENING_HALO]
    )
    level = np.zeros(mask.shape, dtype=np.float32)
    labels, n_border, first = kernels.label_regions(level, level, level, mask, 1.0, 1.0, True)
    return labels, n_border, len(first)


def describe_pieces(
    labels: AnyArray,
    counts: tuple[int, int],
    ground: AnyArray,
    height: Float32Array,
    is_ground: BoolArray,
    config: RoadConfig,
) -> IsolatedPieces:
    """Return the pieces with what tells whether they are ground.

    Parameters
    ----------
    labels, counts
        As `smooth_pieces` returns them.
    ground
        (n_rows, n_cols): labels of ground regions.
    height, is_ground
        (n_rows + 2 h, n_cols + 2 h) with a halo of h = `reach_cells`.
    """
    n_border, n = counts
    edges = labels[:, 0].copy(), labels[:, -1].copy(), labels[0].copy(), labels[-1].copy()
    # The smallest rectangle that holds all pieces: most windows have few
    rows, cols = np.flatnonzero(labels.any(axis=1)), np.flatnonzero(labels.any(axis=0))
    if n == 0:
        return IsolatedPieces(0, edges, _NOTHING, _NOTHING, np.zeros((0, 2), dtype=np.int32))
    part = slice(rows[0], rows[-1] + 1), slice(cols[0], cols[-1] + 1)
    around = tuple(slice(p.start, p.stop + 2 * reach_cells(config)) for p in part)
    labels = labels[part]
    level = _is_level(np.ascontiguousarray(height[around]), np.ascontiguousarray(is_ground[around]), config)
    on = labels > 0
    pairs = np.unique((labels[on].astype(np.int64) << 32) | ground[part][on])
    return IsolatedPieces(
        n_border,
        edges,
        np.bincount(labels[on], minlength=n + 1)[1:],
        np.bincount(labels[on & level], minlength=n + 1)[1:],
        np.stack([pairs >> 32, pairs & 0xFFFFFFFF], axis=-1).astype(np.int32),
    )


def _is_level(height: Float32Array, is_ground: BoolArray, config: RoadConfig) -> BoolArray:
    """Return which of the inner cells are level with the nearest ground."""
    reach = reach_cells(config)
    index, square = nearest_kernels.nearest_known_squared(is_ground, reach, reach)
    rise = np.abs(height[reach:-reach, reach:-reach] - nearest_kernels.heights_by_index(height, index))
    way = np.minimum(np.sqrt(square, dtype=np.float32) * np.float32(config.cell_m), np.float32(_MAX_WAY_M))
    return np.asarray(
        rise - np.float32(_MAX_GRADE) * way <= np.float32(_MAX_STEP_M)
    )  # NaN, no ground near: no


def touching(one: IsolatedPieces, other: IsolatedPieces, *, below: bool) -> AnyArray:
    """Return the pairs of pieces that touch across the edge to the east, or to the south (`below`), (n, 2) int32."""
    a, b = (one.edges[3], other.edges[2]) if below else (one.edges[1], other.edges[0])
    return np.unique(np.stack([a, b], axis=-1)[(a > 0) & (b > 0)], axis=0)


def ground_of_pieces(
    pieces: Sequence[IsolatedPieces], links: Sequence[tuple[int, int, AnyArray]], cell_m: float
) -> list[AnyArray]:
    """Return the ground labels of each window that belong to level pieces, (k,) int32 each.

    Parameters
    ----------
    links
        Windows a and b, and the pairs (n, 2) of pieces that touch across their edge.
    cell_m
        Side of a cell. [m]
    """
    offsets = offsets_of([len(p.cells) for p in pieces])
    pairs = [np.stack([offsets[a], offsets[b]]) + labels.astype(np.int64) - 1 for a, b, labels in links]
    group = connected_groups(int(offsets[-1]), np.concatenate([np.zeros((0, 2), np.int64), *pairs]))
    cells = np.bincount(group, np.concatenate([p.cells for p in pieces]), minlength=1)
    level = np.bincount(group, np.concatenate([p.level for p in pieces]), minlength=1)
    # At least half of the cells: the median of their heights, but counts of parts add up
    chosen = ((cells * cell_m**2 >= _MIN_AREA_M2) & (2 * level >= cells))[group]
    found = []
    for i, piece in enumerate(pieces):
        mine = np.concatenate([[False], chosen[offsets[i] : offsets[i + 1]]])
        found.append(np.unique(piece.pairs[mine[piece.pairs[:, 0]], 1]))
    return found
