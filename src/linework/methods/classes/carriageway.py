"""Which cells of the ground are road: what the surface calls road, up to the boundaries that lines show.

Separate from `tile`, which puts together what a tile needs: this is about the ground in plan alone.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import (
    binary_closing,
    binary_dilation,
    distance_transform_edt,
    label,
    median_filter,
    rank_filter,
)
from scipy.spatial import cKDTree

from linework.arrays import AnyArray, BoolArray, FloatArray, offsets_of
from linework.kernels.classes.near_lines import (
    BOUNDARY_PIECE,
    LEFT_IS_ROAD,
    MARKING_PIECE,
    PIECE_CELL_M,
    RIGHT_IS_ROAD,
    NearLines,
    in_sight,
)
from linework.kernels.classes.points import CELL_IS_PAVED, CELL_IS_ROAD
from linework.model.ground import PAVED_SPREAD, Ground

#: Distance within which a place is road because the vehicle drove, or paint is, in sight of it [m]: six lanes and a hard
#: shoulder.
SIGHT_M = 25.0
#: Gaps in what the surface calls road that are closed [m]: shadows of posts and of cars' wheels.
_CLOSED_M = 1.5
#: Near a boundary the surface ends early, as its cells hold the step [m].
_EARLY_M = 1.0
#: Without a path and paint, the road is seen from where it is as wide as a lane: half of 2.5 m. [m]
_HALF_LANE_M = 1.25
#: A side of a boundary is looked at this far from it [m]: beyond the width of a kerb and of an edge line.
_ASIDE_M = 0.4
#: Cells that scatter this many times as much as the road under the path are not road [ratio]: on asphalt, noise grows by
#: up to 1.7 times across a road with the range. But they may be if they scatter by less than this [m], as grass does not.
_ROUGH_SCATTER, _SMOOTH_M = 1.75, 0.010
#: The road under the path is looked at this far to its sides. [m]
_UNDER_PATH_M = 2.0
#: Cells that scatter less than any scanner's noise hold one point, or a few of one moment. [m]
_FEW_POINTS_M = 0.0025
#: A footway may be narrower than three cells: of 3 x 3 of them a third are even. [rank]
_EVEN_RANK = 3
#: Widest footway and cycle track beside a kerb. [m]
_FOOTWAY_M = 6.0


def plan_of(
    ground: Ground, near: NearLines, path: FloatArray, *, has_path: bool
) -> tuple[AnyArray, AnyArray]:
    """Return what the cells of the ground are in plan, and which sides of boundaries are road.

    Parameters
    ----------
    ground
        Cells of a tile and of ``SIGHT_M`` around it.
    near
        Pieces of lines in the same area.
    path
        (n, 2) places of the vehicle's path there. [m, world]
    has_path
        Whether the survey has a path at all.

    Returns
    -------
    bits
        (rows, cols) uint8: ``CELL_IS_ROAD``, ``CELL_IS_PAVED``.
    sides
        (n,) uint8 of the pieces: ``LEFT_IS_ROAD``, ``RIGHT_IS_ROAD``.

    Notes
    -----
    A cell is road if no boundary lies between it and the nearest place where the vehicle drove, or the nearest paint.
    So a gap in a boundary lets the road end where the surface says, over its length alone.
    """
    at_boundary = _cells_near_boundary(ground, near)
    reach = max(round(_CLOSED_M / ground.grid.cell_width_m / 2), 1)
    early = max(round(_EARLY_M / ground.grid.cell_width_m), 1)
    paint = 0.5 * (near.ends[:, :2] + near.ends[:, 3:5])[near.kind == MARKING_PIECE]
    seeds = [paint, path if has_path else _wide_places(ground, at_boundary)]
    even = ground.is_road & ~_is_rough(ground, seeds[1])
    is_road = even | binary_closing(np.pad(even, reach), _disk(reach))[reach:-reach, reach:-reach]
    is_road |= binary_dilation(even, _disk(early)) & at_boundary
    rows, cols = np.nonzero(is_road)
    places = ground.grid.to_world(rows + 0.5, cols + 0.5)
    bits = np.zeros(ground.grid.shape, dtype=np.uint8)
    bits[rows, cols] = np.where(_in_sight_of_any(places, seeds, near), CELL_IS_ROAD, 0)
    paved = _is_paved(ground, near, bits > 0)
    paved |= binary_dilation(paved, _disk(early)) & at_boundary
    bits |= np.where(paved, CELL_IS_PAVED, 0).astype(np.uint8)
    return bits, _sides(near, seeds)


def _sides(near: NearLines, seeds: list[FloatArray]) -> AnyArray:
    """Return which sides of each boundary piece are road, (n,) uint8."""
    a, b = near.ends[:, :2], near.ends[:, 3:5]
    along = b - a
    length = np.maximum(np.hypot(*along.T), 1e-9)
    left = np.stack([-along[:, 1], along[:, 0]], axis=-1) / length[:, None]
    sides = np.zeros(len(near.kind), dtype=np.uint8)
    which = np.flatnonzero(near.kind == BOUNDARY_PIECE)
    middle = 0.5 * (a + b)
    for sign, bit in ((1.0, LEFT_IS_ROAD), (-1.0, RIGHT_IS_ROAD)):
        places = (middle + sign * _ASIDE_M * left)[which]
        sides[which] |= np.where(_in_sight_of_any(places, seeds, near), bit, 0).astype(np.uint8)
    return sides


def _in_sight_of_any(places: FloatArray, seeds: list[FloatArray], near: NearLines) -> BoolArray:
    """Return which places (n, 2) are in sight of the nearest of some seeds (m, 2), for any of several sets of them."""
    found = np.zeros(len(places), dtype=bool)
    for among in seeds:
        if len(among) == 0 or len(places) == 0:
            continue
        distance, nearest = cKDTree(among).query(places, distance_upper_bound=SIGHT_M)
        wanted = np.flatnonzero(np.isfinite(distance) & ~found)
        found[wanted] = in_sight(
            np.ascontiguousarray(places[wanted]), np.ascontiguousarray(among[nearest[wanted]]), near
        )
    return found


def _wide_places(ground: Ground, at_boundary: BoolArray) -> FloatArray:
    """Return places (n, 2) where the road is at least as wide as a lane, boundaries cutting it. [m, world]."""
    deep = distance_transform_edt(np.pad(ground.is_road & ~at_boundary, 1))[1:-1, 1:-1]
    rows, cols = np.nonzero(deep * ground.grid.cell_width_m >= _HALF_LANE_M)
    return np.asarray(ground.grid.to_world(rows + 0.5, cols + 0.5))


def _is_rough(ground: Ground, under: FloatArray) -> BoolArray:
    """Return which cells scatter more than the road at places (n, 2) and beside them, (rows, cols) bool."""
    sigma = _scatter(ground)
    rows, cols = np.nonzero(ground.is_road & np.isfinite(sigma))
    if len(under) == 0 or len(rows) == 0:
        return np.zeros(ground.grid.shape, dtype=bool)
    places = ground.grid.to_world(rows + 0.5, cols + 0.5)
    close = np.isfinite(cKDTree(under).query(places, distance_upper_bound=_UNDER_PATH_M)[0])
    if not close.any():
        return np.zeros(ground.grid.shape, dtype=bool)
    limit = max(_ROUGH_SCATTER * float(np.median(sigma[rows[close], cols[close]])), _SMOOTH_M)
    smooth = median_filter(np.where(np.isfinite(sigma), sigma, 0.0), size=3, mode="nearest")
    return np.asarray(smooth > limit)


def _scatter(ground: Ground) -> FloatArray:
    """Return how much the ground scatters in each cell, (rows, cols) [m]; NaN where it was not measured.

    One point in a cell has no scatter, but its height has that against its neighbours: the mean of two opposite ones,
    whose variance with its own is 1.5 times that of each.
    """
    height = np.pad(
        np.where(ground.is_ground, ground.ground_m, np.nan).astype(np.float64), 1, constant_values=np.nan
    )
    middle, rows, cols = height[1:-1, 1:-1], slice(1, -1), slice(1, -1)
    off = np.stack([
        middle - 0.5 * (height[rows, :-2] + height[rows, 2:]),
        middle - 0.5 * (height[:-2, cols] + height[2:, cols]),
    ])  # fmt: skip
    known = np.isfinite(off)
    square = np.where(known, off, 0.0) ** 2
    between = square.sum(axis=0) / np.maximum(known.sum(axis=0), 1) / 1.5
    own = np.where(ground.is_ground, ground.sigma, np.nan).astype(np.float64)
    return np.asarray(np.where(own < _FEW_POINTS_M, np.sqrt(own**2 + between), own))


def _cells_near_boundary(ground: Ground, near: NearLines) -> BoolArray:
    """Return which cells of the ground have a boundary near them, (rows, cols) bool."""
    count = np.diff(offsets_of(near.kind[near.item] == BOUNDARY_PIECE)[near.start])
    there = (count > 0).reshape(near.n_rows, near.n_cols)
    grid = ground.grid
    rows, cols = np.arange(grid.n_rows), np.arange(grid.n_cols)
    east = grid.east_m + (cols + 0.5) * grid.cell_width_m
    north = grid.north_m - (rows + 0.5) * grid.cell_width_m
    c = np.floor((east - near.west) / PIECE_CELL_M).astype(np.int64)
    r = np.floor((north - near.south) / PIECE_CELL_M).astype(np.int64)
    inside = ((r >= 0) & (r < near.n_rows))[:, None] & ((c >= 0) & (c < near.n_cols))[None]
    found: BoolArray = there[r.clip(0, near.n_rows - 1)[:, None], c.clip(0, near.n_cols - 1)[None]] & inside
    return found


def _is_paved(ground: Ground, near: NearLines, is_road: BoolArray) -> BoolArray:
    """Return which cells are a footway: ground beside a kerb, as even as the road."""
    kerb = np.flatnonzero((near.kind == BOUNDARY_PIECE) & (near.reach > 0.0))
    sigma = _scatter(ground)
    road = sigma[is_road & np.isfinite(sigma)]
    if len(kerb) == 0 or len(road) == 0:
        return np.zeros(ground.grid.shape, dtype=bool)
    limit = PAVED_SPREAD * float(np.median(road))
    smooth = rank_filter(np.where(np.isfinite(sigma), sigma, np.inf), _EVEN_RANK, size=3, mode="nearest")
    even = (smooth <= limit) & ~is_road
    rows, cols = np.nonzero(even)
    places = ground.grid.to_world(rows + 0.5, cols + 0.5)
    middles = 0.5 * (near.ends[kerb, :2] + near.ends[kerb, 3:5])
    close = np.isfinite(cKDTree(middles).query(places, distance_upper_bound=_FOOTWAY_M)[0])
    even[rows[~close], cols[~close]] = False
    # Only what reaches the kerb
    pieces, _ = label(even)
    touching = np.unique(pieces[_cells_near_boundary(ground, near)])
    return np.isin(pieces, touching[touching > 0])


def _disk(reach: int) -> BoolArray:
    """Return a disk of cells, (2 reach + 1, 2 reach + 1) bool."""
    at = np.arange(-reach, reach + 1)
    return np.asarray(at[:, None] ** 2 + at[None] ** 2 <= reach**2 + reach)
