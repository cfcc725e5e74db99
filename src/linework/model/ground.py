"""Road and ground below the points of a survey, as heights on a grid."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from linework.arrays import AnyArray, BoolArray, Float32Array, FloatArray
from linework.model.grid import Grid, Image

#: Zeros of heights are whole multiples of this, so that float32 resolves 0.01 mm above them. [m]
_ZERO_STEP_M = 100.0
#: Sides of a cell that differ by less count as equal, and a smaller turn as none. [m, deg]
_SAME = 1e-9
#: Edges this near a multiple of the size of a cell are on it: coordinates have rounded. [cells]
_SAME_CELL = 1e-6
#: Rows and columns that a slope needs.
_LEAST_FOR_SLOPE = 2
#: Ground is paved where its heights spread at most this many times as much as on the road driven on [ratio]: grass of 2 cm
#: spreads 1.35 times as much even for a scanner with a noise of 2 cm; the limit lies midway, on a logarithmic scale.
PAVED_SPREAD = 1.17


@dataclass(frozen=True, slots=True)
class Ground:
    """Heights of road and ground on one grid, without holes (NaN only where the computation failed).

    `linework.find_ground` makes it from points, `Ground.from_heights` from your own heights, such as a terrain
    model. Methods take heights of points above it, and search for paint and kerbs on the cells that are road.

    Parameters
    ----------
    grid
        North-up, with square cells.
    z0_m
        Zero of the heights: the surfaces are float32 above it. [m, world]
    road_m
        (rows, cols) float32 [m above z0_m]: the road, extended beyond its edge over the ground.
    ground_m
        (rows, cols) float32 [m above z0_m]: the ground, of which the road is part.
    is_road, is_ground
        (rows, cols) bool: cells in which road, or ground, was measured.
    sigma_m
        (rows, cols) float32 [m]: standard deviation of `ground_m`, where it was measured the scatter of the points in
        the cell; NaN where it is not known, but extended from elsewhere. None: all measured cells are exact.

    Examples
    --------
    >>> ground = Ground.from_heights(np.full((3, 4), 350.2), Grid(10.0, 53.0, 1.0, 1.0, 3, 4))
    >>> ground
    Ground(3 x 4 cells of 1 m, 12 of them road, 350.20 to 350.20 m)
    >>> ground.height_m(np.array([[11.5, 52.0]])).round(2).tolist()
    [350.2]
    """

    grid: Grid
    z0_m: float
    road_m: Float32Array
    ground_m: Float32Array
    is_road: BoolArray
    is_ground: BoolArray
    sigma_m: Float32Array | None = None

    @property
    def sigma(self) -> Float32Array:
        """(rows, cols) float32 [m]: standard deviation of `ground_m`; NaN where it is not known."""
        if self.sigma_m is not None:
            return self.sigma_m
        return np.where(self.is_ground, np.float32(0.0), np.float32(np.nan))

    @property
    def is_known(self) -> BoolArray:
        """(rows, cols) bool: cells whose ground was measured, or interpolated between measured cells on all sides."""
        return np.isfinite(self.sigma)

    @property
    def is_interpolated(self) -> BoolArray:
        """(rows, cols) bool: cells whose ground is known and was not measured."""
        return self.is_known & ~self.is_ground

    @property
    def slope(self) -> Float32Array:
        """(rows, cols) float32 [m/m]: slope of the ground across each cell and its neighbours."""
        if min(self.ground_m.shape) < _LEAST_FOR_SLOPE:
            return np.zeros_like(self.ground_m)
        return np.asarray(np.hypot(*np.gradient(self.ground_m, self.grid.cell_width_m)), dtype=np.float32)

    @property
    def distance_m(self) -> Float32Array:
        """(rows, cols) float32 [m]: from each cell to the nearest one that was measured; inf without any."""
        if not self.is_ground.any():
            return np.full(self.grid.shape, np.inf, dtype=np.float32)
        from scipy.ndimage import distance_transform_edt

        return np.asarray(distance_transform_edt(~self.is_ground) * self.grid.cell_width_m, dtype=np.float32)

    @classmethod
    def from_heights(
        cls,
        heights: AnyArray | Image,
        grid: Grid | None = None,
        *,
        is_road: AnyArray | None = None,
        z0_m: float | None = None,
    ) -> Self:
        """Return the ground with your own heights.

        Parameters
        ----------
        heights
            (rows, cols) [m, world], row 0 north: the height at the centre of each cell; NaN where it is unknown.
            An `Image` brings its grid.
        grid
            Where the cells are: north-up and square. Not needed with an `Image`.
        is_road
            (rows, cols) bool: the cells that are road; None: all cells whose height is known.
        z0_m
            Zero of the heights [m]; None: a multiple of 100 m below the median.

        Raises
        ------
        ValueError
            No height is known, the shapes do not agree, or the grid is turned or has oblong cells.

        Notes
        -----
        Cells whose height is unknown take that of the nearest cell that has one; they are neither road nor ground.

        Examples
        --------
        >>> heights = np.array([[1.0, np.nan], [3.0, 4.0]])
        >>> ground = Ground.from_heights(heights, Grid(0.0, 2.0, 1.0, 1.0, 2, 2))
        >>> ground.is_ground.tolist()
        [[True, False], [True, True]]
        """
        if isinstance(heights, Image):
            grid = heights.grid
        values = np.asarray(heights.values if isinstance(heights, Image) else heights, dtype=np.float64)
        if grid is None:
            raise ValueError("grid: an array of heights needs the grid of its cells")
        _check_grid(grid)
        if values.shape != grid.shape:
            raise ValueError(f"heights: shape {values.shape}, the grid has {grid.shape}")
        known = np.isfinite(values)
        if not known.any():
            raise ValueError("heights: not one is a number")
        road = known if is_road is None else np.asarray(is_road, dtype=np.bool_) & known
        if road.shape != grid.shape:
            raise ValueError(f"is_road: shape {road.shape}, the grid has {grid.shape}")
        if z0_m is None:
            z0_m = math.floor(float(np.median(values[known])) / _ZERO_STEP_M) * _ZERO_STEP_M
        filled = _filled(values, known) - z0_m
        above = filled.astype(np.float32)
        return cls(grid, z0_m, above, above.copy(), road, known)

    def on_grid(self, grid: Grid, z0_m: float | None = None) -> Ground:
        """Return the ground on another grid: heights bilinear between centres of cells, road by the nearest cell.

        Parameters
        ----------
        grid
            North-up, with square cells. Beyond the cells of this ground the nearest height counts, and nothing is
            road or ground.
        z0_m
            Zero of the heights [m]; None: as it is.

        Raises
        ------
        ValueError
            The grid is turned or has oblong cells.
        """
        _check_grid(grid)
        if grid == self.grid and z0_m in (None, self.z0_m):
            return self
        zero = self.z0_m if z0_m is None else z0_m
        rows, cols = np.divmod(np.arange(grid.n_rows * grid.n_cols), grid.n_cols)
        xy = grid.to_world(rows + 0.5, cols + 0.5)
        road_m, ground_m = (
            (self._between(plane, xy) + (self.z0_m - zero)).astype(np.float32).reshape(grid.shape)
            for plane in (self.road_m, self.ground_m)
        )
        row, col = (np.floor(at).astype(np.int64) for at in self.grid.to_cell(xy))
        inside = (row >= 0) & (row < self.grid.n_rows) & (col >= 0) & (col < self.grid.n_cols)
        masks = []
        for mask in (self.is_road, self.is_ground):
            there = np.zeros(len(xy), dtype=np.bool_)
            there[inside] = mask[row[inside], col[inside]]
            masks.append(there.reshape(grid.shape))
        sigma_m = np.full(len(xy), np.nan, dtype=np.float32)
        sigma_m[inside] = self.sigma[row[inside], col[inside]]
        return Ground(grid, zero, road_m, ground_m, masks[0], masks[1], sigma_m.reshape(grid.shape))

    def height_m(self, xy: AnyArray) -> FloatArray:
        """Return the height of the ground at (n, 2 or 3) places [m, world], (n,) float64 [m, world].

        Heights are bilinear between the centres of cells; beyond them the nearest counts.
        """
        return self._between(self.ground_m, np.asarray(xy, dtype=np.float64)[:, :2]) + self.z0_m

    @property
    def is_on_lattice(self) -> bool:
        """Whether the edges of cells lie at whole multiples of their size, as those of neighbouring tiles do."""
        size = self.grid.cell_width_m
        return all(
            abs(v / size - round(v / size)) < _SAME_CELL for v in (self.grid.east_m, self.grid.north_m)
        )

    @property
    def image(self) -> Image:
        """Heights of the ground as an image [m, world]."""
        return Image(self.ground_m.astype(np.float64) + self.z0_m, self.grid)

    def plot(self, ax: Any = None, **options: Any) -> Any:
        """Draw the heights of the ground in plan; return the axes (see `Image.plot`)."""
        return self.image.plot(ax, **options)

    def _between(self, plane: Float32Array, xy: FloatArray) -> FloatArray:
        """Return the values of a plane at places (n, 2) [m, world], bilinear, (n,) float64."""
        rows, cols = self.grid.to_cell(xy)
        n_rows, n_cols = self.grid.shape
        y, x = np.clip(rows - 0.5, 0.0, n_rows - 1.0), np.clip(cols - 0.5, 0.0, n_cols - 1.0)
        top, left = y.astype(np.int64), x.astype(np.int64)
        bottom, right = np.minimum(top + 1, n_rows - 1), np.minimum(left + 1, n_cols - 1)
        fy, fx = y - top, x - left
        north = plane[top, left] * (1.0 - fx) + plane[top, right] * fx
        south = plane[bottom, left] * (1.0 - fx) + plane[bottom, right] * fx
        return np.asarray(north * (1.0 - fy) + south * fy, dtype=np.float64)

    def __repr__(self) -> str:
        rows, cols = self.grid.shape
        known = self.ground_m[np.isfinite(self.ground_m)].astype(np.float64) + self.z0_m
        span = f"{known.min():.2f} to {known.max():.2f} m" if len(known) else "no heights"
        n_road = int(self.is_road.sum())
        return f"Ground({rows} x {cols} cells of {self.grid.cell_width_m:g} m, {n_road} of them road, {span})"


def _check_grid(grid: Grid) -> None:
    if abs(grid.cell_width_m - grid.cell_height_m) > _SAME or abs(grid.rotation_deg) > _SAME:
        raise ValueError("grid: must be north-up with square cells")


def _filled(values: FloatArray, known: BoolArray) -> FloatArray:
    """Return values (rows, cols), those that are unknown taken from the nearest known cell."""
    if known.all():
        return values
    from scipy.ndimage import distance_transform_edt

    nearest = distance_transform_edt(~known, return_distances=False, return_indices=True)
    return np.asarray(values[tuple(nearest)])
