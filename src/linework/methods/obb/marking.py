"""Marking boxes: oriented boxes on stripes of paint, brighter than the road on both sides (step 2.3).

Separate from `method`, which runs the steps in order: this is step 2.3, which needs intensities and no normals.

S. Kang, J. Lee, J. Lee (2023), doi:10.3390/rs15194656: the points within an intensity range chosen for the
survey make a box. Here the range follows from the statistics of the search area, and centre, direction and width come
from the two edges of the paint, fitted to the intensity of all the points around.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import expit

from linework.arrays import AnyArray, BoolArray, Float32Array, FloatArray, IntArray
from linework.kernels.paint import paint_points, stripes
from linework.kernels.paint.scan_rows import ROWS_REACH_M, evened_rows
from linework.kernels.paint.stripes_ahead import cells_ahead
from linework.kernels.paint.stripes_all import BRIGHT_SPREADS, all_stripes
from linework.methods.obb.kerbs_and_edges import STONES_REACH_M, local_origin_of
from linework.methods.obb.own_paint import IS_PAINT
from linework.methods.tracking.fitted import LEAST_PIECE_SCORE, PAINT_SCORE_OFFSET, PAINT_SCORE_SLOPE
from linework.model.boxes import BoxForm, BoxSet
from linework.model.grid import Bounds
from linework.model.ground import Ground
from linework.model.points import Points
from linework.model.settings import Settings, setting
from linework.model.tile import TileData

#: Side of the cells; each holds one box of a stripe. [m]
MARKING_CELL_M = 0.5
#: Cells that a stripe is followed into, beyond those with bright points: 3, 4 and 8 changed no scene by more than 13 m
#: (11 simulated scenes that were looked at, 2026-11-27, decision 100).
CELLS_AHEAD = 2
#: A box depends on the points within this of its cell only: the largest search area reaches 3.5 m from its middle, which is
#: in the cell, and the longest window ahead 3.75 m beyond the cell that it asks for and 1.1 m to its sides, 3.9 m. Cells
#: follow each other across corners, too: 0.71 m each, 5.3 m in all; and the brightness of a point on those of its row. [m]
MARKING_REACH_M = 4.5 + CELLS_AHEAD * MARKING_CELL_M + ROWS_REACH_M
#: Directions of rows where there are none.
_NO_ROWS = np.zeros((0, 3))
#: Share of the points of a road without paint that are 2.5 standard deviations above its level, texture included.
_CHANCE = 0.02
#: Smallest t-value of a band in the profile across a search area that is fitted.
LEAST_T = 4.0
#: A stripe goes on as it was, but for the error of a box: offset [m], and cosine of the angle (10 degrees).
_GOES_ON_M, _GOES_ON = 0.06, 0.985
#: Largest height of a step under paint, as such and in its standard deviations: kerbs are 2.5 cm high and more. [m]
_FLAT_M, _FLAT_SIGMAS = 0.025, 3.0
#: Narrowest stripe [m]; shortest stripe over its width; spacing of the points up to which width is not blurred [m].
_NARROWEST_M, _LEAST_RATIO, _DENSE_M = 0.05, 1.5, 0.1
#: Difference of the road on both sides of paint, over the paint's contrast, that wheel tracks and patches make, as a
#: standard deviation: a third of the most beside faint paint, 0.36, where the border of two materials has 0.45 to 0.7
#: (simulated roads, seeds 100 to 104).
_TRACKS_DIFFER = 0.13
#: Distance of an edge line from the end of its road [m]: a hand's breadth to a shoulder of 0.5 m.
_EDGE_LINE_M = 0.3
#: Logarithm of the odds of paint against what lies along borders of materials, before the two sides are compared: what is as
#: bright, as narrow and as straight is paint in 7 of 8 cases; and the share of paint beside which, where points are as far
#: apart as that, what lies beyond the road is measured. Set by hand, 2026-11-30: of 3.0 and 0.5, 2.5 and 0.2, 2.0 and 0.1, and
#: these, the last lose least on als-roads-t1105 and -t0717 and on simulated airborne roads 17601 and 17602.
_PAINT_LOG_ODDS, _BEYOND_SHARE = 2.0, 0.2
#: Smallest standard deviation of a box: no scanner measures better. [m, rad]
_LEAST_SIGMA = 0.001


@dataclass(frozen=True, slots=True, kw_only=True)
class MarkingConfig(Settings):
    """Settings of the detection of paint."""

    min_intensity: float = setting(
        0.0, unit="as recorded", reason="lowest intensity of paint; both 0: from the points", low=0, high=1e6
    )
    max_intensity: float = setting(
        0.0, unit="as recorded", reason="highest intensity of paint; both 0: from the points", low=0, high=1e6
    )
    tolerance_m: float = setting(
        0.15,
        unit="m",
        reason="distance of paint from the road: 3 sigma of 3 cm noise, and the curvature within a cell",
        low=0.02,
        high=1,
    )
    least_contrast: float = setting(
        1.0,
        unit="",
        reason="paint over road, beyond what noise allows; intensities with an unknown zero show paint at 1.1",
        low=1,
        high=10,
    )
    widest_line_m: float = setting(
        0.45,
        unit="m",
        reason="lines are up to 0.40 m wide, stop lines and bars 0.5 m and more",
        low=0.05,
        high=1,
    )


@dataclass(frozen=True, slots=True)
class PaintPoints:
    """Points near the road, sorted into the cells of the global lattice.

    Parameters
    ----------
    rows
        (n, 5) float64: place [m, from the local origin], intensity, time [s].
    starts
        (n_cells + 1,) int64: first point of each cell.
    lattice
        Cell size [m], numbers of the south row and the west column, number of rows and of columns.
    """

    rows: FloatArray
    starts: IntArray
    lattice: tuple[float, int, int, int, int]

    @classmethod
    def of(
        cls,
        points: Points,
        surface: Ground,
        origin: tuple[float, float, float],
        config: MarkingConfig,
        probability: Float32Array | None = None,
        scan_rows: FloatArray = _NO_ROWS,
    ) -> PaintPoints:
        """Return the points near the road, sorted into cells.

        probability: of paint, (n,) float32, instead of the intensity; it is stored less 0.5, so that paint is above 0.
        scan_rows: (k, 3), see `linework.model.tile.LaserGains`; intensities are without what rows differ by.
        """
        intensity = np.zeros(len(points), np.float32) if points.intensity is None else points.intensity
        if probability is not None:
            intensity = probability - np.float32(IS_PAINT)
        elif config.max_intensity > 0.0 or config.min_intensity > 0.0:
            intensity = _inside_range(intensity, config)
        grid, size = surface.grid, surface.grid.cell_width_m
        north = round((grid.north_m - origin[1]) / size) - 1
        west = round((grid.east_m - origin[0]) / size)
        n_rows, n_cols = (int(np.ceil(n * size / MARKING_CELL_M)) + 2 for n in grid.shape)
        south_row = int(np.floor((north + 1 - grid.n_rows) * size / MARKING_CELL_M))
        lattice = (MARKING_CELL_M, south_row, int(np.floor(west * size / MARKING_CELL_M)), n_rows, n_cols)
        local = np.asarray(origin, dtype=np.float64)
        cells = paint_points.cells_near_road(
            points.xyz, local, (size, north, west, surface.z0_m - origin[2]), surface.road_m,
            _grown(surface.is_road), config.tolerance_m, lattice,
        )  # fmt: skip
        time_s = np.zeros(0) if points.time_s is None else points.time_s
        rows, starts = paint_points.sort_into_cells(
            points.xyz, intensity, time_s, local, cells, n_rows * n_cols
        )
        # A range or a probability of the user's own says what paint is, whatever its neighbours
        has_own = probability is not None or config.max_intensity > 0.0 or config.min_intensity > 0.0
        if len(scan_rows) and points.intensity is not None and not has_own:
            rows[:, paint_points.POINT_INTENSITY] = evened_rows(rows, starts, lattice, scan_rows)
        return cls(rows, starts, lattice)


def find_marking_boxes(
    tile: TileData,
    surface: Ground,
    config: MarkingConfig,
    cores: Sequence[Bounds] = (),
    probability: Float32Array | None = None,
) -> BoxSet:
    """Return oriented boxes on all paint near the road of a tile's core, by cell row, column and position.

    Behind them come those of stripes that go on into cells without a sure one, see `CELLS_AHEAD`.

    A box depends only on the points within `MARKING_REACH_M` of its cell, in the order in which the tile has them.

    Parameters
    ----------
    cores
        Disjoint parts of the core: only cells that touch one of them are searched; none: the whole core.
    probability
        (n,) float32: that each point is paint, 0 to 1, as evidence instead of the intensity
        (`linework.methods.obb.own_paint`). Paint is then a stripe above 0.5 between road below it.
    """
    if len(tile.points) == 0 or (tile.points.intensity is None and probability is None):
        return BoxSet.empty()
    # Points near the road, in cells
    origin = local_origin_of(tile)
    paint = PaintPoints.of(tile.points, surface, origin, config, probability, tile.gains.rows)
    *_, n_cols = paint.lattice
    # Search areas: about the bright points of every cell that has more of them than expected by chance
    if probability is None:
        bright = paint_points.count_bright(paint.rows, paint.starts, n_cols, BRIGHT_SPREADS)
    else:
        bright = _count_paint(paint)
    cells, places = paint_points.bright_centres(bright, paint.starts, n_cols, _CHANCE)
    # A stripe that goes on into a core may begin outside of it, and a boundary in the core lie at the edge of one outside
    ahead_m = STONES_REACH_M + (CELLS_AHEAD * MARKING_CELL_M if probability is None else 0.0)
    wanted = [core.grown(ahead_m) for core in cores or (tile.core,)]
    inside = np.any([_touches(core, origin, cells, paint.lattice) for core in wanted], axis=0)
    cells, places = cells[inside], places[inside]
    # Direction, edges and extent of the stripes in each
    unknown = np.full(len(cells), np.nan)
    found = all_stripes(paint.rows, paint.starts, paint.lattice, cells, places, unknown, LEAST_T)
    ahead = list[FloatArray]() if probability is not None else _stripes_ahead(paint, found, config)
    if probability is not None:
        found = _as_intensities(found, config)
    # What the first look was unsure of and is measured along its line counts once
    grown = np.concatenate([found[:0], *ahead])
    found = found[~_measured_again(found, grown[_is_flat(grown)], paint.lattice)]
    has_time = tile.points.time_s is not None
    return BoxSet.concatenate([marking_box_set(part, config, has_time=has_time) for part in (found, *ahead)])


def _stripes_ahead(paint: PaintPoints, found: FloatArray, config: MarkingConfig) -> list[FloatArray]:
    """Return the stripes in the next cells along others (m, 24) that hold no sure one: (k, 24) for each step.

    Where place and direction are known, worn paint shows in the mean of its points even if hardly one of them is bright.
    """
    searched = np.zeros(len(paint.starts) - 1, dtype=np.bool_)
    last = found[_is_line_of_paint(found, config)]
    searched[_cells_of(last, paint.lattice)] = True
    grown = list[FloatArray]()
    for _ in range(CELLS_AHEAD):
        ahead, places, behind = cells_ahead(paint.rows, paint.starts, paint.lattice, last, searched, LEAST_T)
        angles = np.arctan2(last[behind, stripes.STRIPE_UY], last[behind, stripes.STRIPE_UX])
        new = all_stripes(paint.rows, paint.starts, paint.lattice, ahead, places, angles, LEAST_T)
        searched[ahead] = True
        before = last[behind[np.searchsorted(ahead, _cells_of(new, paint.lattice))]]
        last = new[_goes_on(new, before) & _is_line_of_paint(new, config)]
        grown.append(last)
    return grown


def _goes_on(found: FloatArray, before: FloatArray) -> BoolArray:
    """Return which stripes (m, 24) lie on the lines along others (m, 24), (m,)."""
    step = found - before
    ux, uy = before[:, stripes.STRIPE_UX], before[:, stripes.STRIPE_UY]
    across = step[:, stripes.STRIPE_Y] * ux - step[:, stripes.STRIPE_X] * uy
    cosine = found[:, stripes.STRIPE_UX] * ux + found[:, stripes.STRIPE_UY] * uy
    return np.asarray((np.abs(across) <= _GOES_ON_M) & (np.abs(cosine) >= _GOES_ON))


def _measured_again(
    found: FloatArray, grown: FloatArray, lattice: tuple[float, int, int, int, int]
) -> BoolArray:
    """Return which stripes (m, 24) lie on one (k, 24) in their cell that was found ahead of another, (m,)."""
    own, others = _cells_of(found, lattice), _cells_of(grown, lattice)
    order = np.argsort(others, kind="stable")
    first, stop = (np.searchsorted(others[order], own, side) for side in ("left", "right"))
    again = np.zeros(len(found), dtype=np.bool_)
    for k in range(int((stop - first).max(initial=0))):
        rows = np.flatnonzero(first + k < stop)
        again[rows] |= _goes_on(found[rows], grown[order[first[rows] + k]])
    return again


def _cells_of(found: FloatArray, lattice: tuple[float, int, int, int, int]) -> IntArray:
    """Return the cells that the centres of stripes (m, 24) lie in, (m,)."""
    size, south, west, _, n_cols = lattice
    col, row = np.floor(found[:, [stripes.STRIPE_X, stripes.STRIPE_Y]] / size).astype(np.int64).T
    return np.asarray((row - south) * n_cols + col - west)


def _is_flat(found: FloatArray) -> BoolArray:
    """Return which stripes (m, 24) lie on a plane, (m,)."""
    limit_m = np.maximum(_FLAT_M, _FLAT_SIGMAS * found[:, stripes.STRIPE_SIGMA_STEP])
    return np.asarray(found[:, stripes.STRIPE_STEP] < limit_m)


def _is_line_of_paint(found: FloatArray, config: MarkingConfig) -> BoolArray:
    """Return which stripes (m, 24) are more likely paint than not, as bright as that, and as wide as lines are, (m,)."""
    width = 2.0 * found[:, stripes.STRIPE_HALF_V]
    is_line: BoolArray = (width >= _NARROWEST_M) & (width <= config.widest_line_m)
    is_bright = found[:, stripes.STRIPE_BRIGHT] >= config.least_contrast * found[:, stripes.STRIPE_DARK]
    return is_line & is_bright & (_chance_of_paint(found) >= LEAST_PIECE_SCORE)


def _count_paint(paint: PaintPoints) -> FloatArray:
    """Return the points of each cell that are paint by their probability, (n_cells, 3): number, sums of x and y [m]."""
    n = len(paint.starts) - 1
    cell = np.repeat(np.arange(n), np.diff(paint.starts))
    is_paint = paint.rows[:, paint_points.POINT_INTENSITY] > 0.0
    cell, rows = cell[is_paint], paint.rows[is_paint]
    columns = (np.ones(len(rows)), rows[:, paint_points.POINT_X], rows[:, paint_points.POINT_Y])
    return np.stack([np.bincount(cell, weights=weights, minlength=n) for weights in columns], axis=-1)


def _as_intensities(found: FloatArray, config: MarkingConfig) -> FloatArray:
    """Return the stripes (m, 24) that are paint by their probability, their levels as those of ordinary paint.

    The contrast of a probability means nothing: it is set to the least that counts.
    """
    dark, bright = found[:, stripes.STRIPE_DARK], found[:, stripes.STRIPE_BRIGHT]
    found = found[(bright > 0.0) & (dark < 0.0)].copy()
    found[:, stripes.STRIPE_DARK], found[:, stripes.STRIPE_BRIGHT] = 1.0, config.least_contrast
    return found


def _touches(
    core: Bounds,
    origin: tuple[float, float, float],
    cells: IntArray,
    lattice: tuple[float, int, int, int, int],
) -> BoolArray:
    """Return which cells (n,) touch a core, (n,) bool: those of the buffer belong to other tiles."""
    size, south, west, _, n_cols = lattice
    x, y = (cells % n_cols + west) * size + origin[0], (cells // n_cols + south) * size + origin[1]
    inside: BoolArray = (x + size >= core.west) & (x <= core.east)
    return inside & (y + size >= core.south) & (y <= core.north)


def marking_box_set(found: FloatArray, config: MarkingConfig, *, has_time: bool) -> BoxSet:
    """Return the stripes that can be paint as boxes: bright enough, and on a plane.

    Parameters
    ----------
    found
        (n, 24) float64: rows of `linework.kernels.paint.stripes`.
    """
    dark, bright = found[:, stripes.STRIPE_DARK], found[:, stripes.STRIPE_BRIGHT]
    found = found[_is_flat(found) & (bright >= config.least_contrast * dark)]
    dark, bright = found[:, stripes.STRIPE_DARK], found[:, stripes.STRIPE_BRIGHT]
    width, length = 2.0 * found[:, stripes.STRIPE_HALF_V], found[:, stripes.STRIPE_LENGTH]
    # Points farther apart than a line is wide (airborne), and laser spots as large, make paint wider by that
    widest = config.widest_line_m + np.maximum(found[:, stripes.STRIPE_SPACING] - _DENSE_M, 0.0)
    is_stripe = (width >= _NARROWEST_M) & (width <= widest) & (length >= _LEAST_RATIO * width)
    times = found[:, [stripes.STRIPE_FIRST, stripes.STRIPE_LAST]]
    # Both -1: no point lay on the stripe
    times = np.where(has_time & (times != -1.0).any(axis=1, keepdims=True), times, np.nan)
    return BoxSet(
        centre=found[:, [stripes.STRIPE_X, stripes.STRIPE_Y, stripes.STRIPE_Z]],
        u=found[:, [stripes.STRIPE_UX, stripes.STRIPE_UY]],
        half_u_m=found[:, stripes.STRIPE_HALF_U],
        half_v_m=found[:, stripes.STRIPE_HALF_V],
        sigma_v_m=np.maximum(found[:, stripes.STRIPE_SIGMA_V], _LEAST_SIGMA),
        sigma_z_m=np.maximum(found[:, stripes.STRIPE_SIGMA_Z], _LEAST_SIGMA),
        sigma_u_rad=np.maximum(found[:, stripes.STRIPE_SIGMA_U], _LEAST_SIGMA),
        score=_chance_of_paint(found),
        form=np.where(is_stripe, BoxForm.STRIPE, BoxForm.OTHER_PAINT).astype(np.int8),
        height_m=found[:, stripes.STRIPE_RISE],
        contrast=np.where(dark > 0.0, bright / np.where(dark > 0.0, dark, 1.0), np.nan),
        n_points=found[:, stripes.STRIPE_POINTS].astype(np.int64),
        time_start_s=times[:, 0],
        time_end_s=times[:, 1],
    )


def _chance_of_paint(found: FloatArray) -> FloatArray:
    """Return the chance that stripes (n, 24) are paint, (n,), against what else is brighter than the road.

    A strip that fades into the road is what is left between wheel tracks, or dries first.
    """
    odds = PAINT_SCORE_SLOPE * found[:, stripes.STRIPE_T] + PAINT_SCORE_OFFSET
    chance: FloatArray = expit(odds - np.maximum(found[:, stripes.STRIPE_FADES], 0.0))
    return chance * chance_by_sides(found)


def chance_by_sides(found: FloatArray) -> FloatArray:
    """Return the chance that stripes (n, 24) are paint, (n,), not the stone, gutter or dust along two materials' border.

    Paint has the same road on both sides, but for wheel tracks and noise; along a border any difference is as likely. An
    edge line lies a hand's breadth from the end of its road: where points are as far apart as that, what is measured
    beside it is in one case of five what lies beyond, and the difference says less.
    """
    sides = np.minimum(found[:, stripes.STRIPE_SIDES], 1.0)
    # The contrast to the brighter side is 1 - sides of that to the darker one, and its t-value tells the noise
    spread = np.hypot(_TRACKS_DIFFER, (1.0 - sides) / np.maximum(found[:, stripes.STRIPE_T], 1.0))
    beyond = _BEYOND_SHARE * np.minimum(found[:, stripes.STRIPE_SPACING] / _EDGE_LINE_M, 1.0) ** 2
    alike = np.sqrt(2.0 / np.pi) / spread * np.exp(-0.5 * (sides / spread) ** 2)
    return np.asarray(expit(_PAINT_LOG_ODDS + np.log((1.0 - beyond) * alike + beyond)))


def _inside_range(intensity: Float32Array, config: MarkingConfig) -> Float32Array:
    """Return 1 for intensities (n,) within the range of the settings, else 0."""
    high = config.max_intensity if config.max_intensity > 0.0 else np.inf
    inside: AnyArray = (intensity >= config.min_intensity) & (intensity <= high)
    return inside.astype(np.float32)


def _grown(mask: BoolArray) -> BoolArray:
    """Return the cells of a mask (rows, cols) and their eight neighbours."""
    padded = np.pad(mask, 1)
    wide = padded[:, :-2] | padded[:, 1:-1] | padded[:, 2:]
    return np.asarray(wide[:-2] | wide[1:-1] | wide[2:])
