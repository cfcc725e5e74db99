"""Seed lines: peaks of the Radon transforms of local windows; and the segments of the image along them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from linework.kernels import segments as kernels
from linework.methods.radon.peaks import find_peaks_in
from linework.methods.radon.transform import radon_of_cells, rho_bins
from linework.model.arrays import FloatArray
from linework.model.grid import Grid, Image
from linework.model.settings import setting


@dataclass(frozen=True, slots=True, kw_only=True)
class SeedConfig:
    """Settings of the search for seed lines."""

    window_m: float = setting(
        6.0,
        unit="m",
        reason="the chord that stays within one 0.20 m cell of a bend of 22 m radius: sqrt(8 R c)",
        low=1.0,
        high=1000.0,
    )
    step_deg: float = setting(
        3.0, unit="deg", reason="a cell seen over half a window: atan(0.2 / 3) = 3.8", low=0.1, high=45.0
    )
    peak_threshold_m: float = setting(
        2.0,
        unit="m",
        reason="occupied length along the line; a car's side or a hedge's end is shorter",
        low=0.1,
    )
    max_gap_m: float = setting(
        1.0, unit="m", reason="four scan lines at the widest spacing of 25 cm", low=0.0, high=100.0
    )


@dataclass(frozen=True, slots=True)
class SeedLines:
    """n straight candidates: direction and offset only, each valid within its window.

    Parameters
    ----------
    centre_xy
        (n, 2) float64 [m, world]: centre of the window.
    theta_rad, rho_m
        (n,) float64: normal form about that centre.
    strength_m
        (n,) float64 [m]: occupied length along the line.
    """

    centre_xy: FloatArray
    theta_rad: FloatArray
    rho_m: FloatArray
    strength_m: FloatArray

    def __len__(self) -> int:
        return len(self.rho_m)


@dataclass(frozen=True, slots=True)
class Segments:
    """n straight pieces of lines: ends (n, 2) float64 [m, world] and strength (n,) [m]."""

    start_xy: FloatArray
    end_xy: FloatArray
    strength_m: FloatArray

    def __len__(self) -> int:
        return len(self.strength_m)


def find_seed_lines(binary: Image, config: SeedConfig) -> SeedLines:
    """Return the prominent directions of a binary image, window by window.

    Windows overlap by half and sit on one global lattice, so that neighbouring tiles see the same ones.
    A single Radon transform of the whole image finds straight roads only: a chord of L m leaves a curve
    of radius R by L^2 / (8 R).

    References
    ----------
    Manandhar and Shibasaki (2002), "Line Detection by Radon Transformation".
    """
    grid = binary.grid
    angles = np.radians(np.arange(0.0, 180.0 - 0.5 * config.step_deg, config.step_deg))
    half = config.window_m / 2
    rho = rho_bins(half * math.sqrt(2), grid.cell_width_m)
    found: list[FloatArray] = []
    for centre, xy in _windows(binary, config):
        x, y = np.ascontiguousarray(xy.T)  # as cables give them: numba compiles for either layout
        values = radon_of_cells(
            x,
            y,
            np.ones(len(xy)),
            cell_width_m=grid.cell_width_m,
            cell_height_m=grid.cell_height_m,
            angles_rad=angles,
            rho_step_m=grid.cell_width_m,
            rho_max_m=half * math.sqrt(2),
        )
        peaks = find_peaks_in(
            values,
            angles,
            rho,
            threshold=config.peak_threshold_m,
            theta_window_rad=math.radians(15.0),
            rho_window_m=3 * grid.cell_width_m,
        )
        n = len(peaks.rho_m)
        if n:
            found.append(
                np.stack([*np.tile(centre, (n, 1)).T, peaks.theta_rad, peaks.rho_m, peaks.strength_m], 1)
            )
    table = np.concatenate(found) if found else np.zeros((0, 5))
    return SeedLines(table[:, :2], table[:, 2], table[:, 3], table[:, 4])


def _windows(binary: Image, config: SeedConfig) -> list[tuple[FloatArray, FloatArray]]:
    """Centre and occupied cells (n, 2), relative to it, of every window that holds enough of them."""
    grid = binary.grid
    rows, cols = np.nonzero(binary.values)
    if len(rows) == 0:
        return []
    # From whole numbers that all tiles share: the same cells give the same numbers to the last bit, and ties
    # between peaks fall the same way
    west, north = _corner(grid)
    xy = np.column_stack([(west + cols + 0.5) * grid.cell_width_m, (north - rows - 0.5) * grid.cell_height_m])
    stride = config.window_m / 2
    lattice = np.floor(xy / stride).astype(np.int64)
    order = np.lexsort((lattice[:, 0], lattice[:, 1]))
    keys, starts = np.unique(lattice[order][:, ::-1], axis=0, return_index=True)
    blocks = dict(zip(map(tuple, keys.tolist()), np.split(xy[order], starts[1:]), strict=True))
    enough = config.peak_threshold_m / grid.cell_width_m
    out = []
    for j, i in sorted({(j - dj, i - di) for j, i in blocks for dj in (0, 1) for di in (0, 1)}):
        parts = [blocks[k] for k in ((j, i), (j, i + 1), (j + 1, i), (j + 1, i + 1)) if k in blocks]
        cells = np.concatenate(parts)
        if len(cells) >= enough:
            centre = np.array([(i + 1) * stride, (j + 1) * stride])
            out.append((centre, cells - centre))
    return out


def split_into_segments(seeds: SeedLines, binary: Image, config: SeedConfig) -> Segments:
    """Return where along each seed line the image is occupied.

    A Radon peak says nothing about the extent: collinear pieces are parted where the image is empty for
    more than `max_gap_m`; pieces shorter than half of `peak_threshold_m` are dropped.
    """
    grid, cell = binary.grid, binary.grid.cell_width_m
    half, step = config.window_m / 2, cell / 2
    lines = np.column_stack([seeds.centre_xy, seeds.theta_rad, seeds.rho_m, seeds.strength_m])
    centre = seeds.centre_xy / cell
    whole = np.round(centre)
    centre = np.where(np.abs(centre - whole) < 1e-6, whole, centre)  # windows end on edges of cells
    corner = np.floor(centre)
    west, north = _corner(grid)
    table = kernels.segments_of(
        binary.values,
        cell,
        lines,
        np.column_stack([corner[:, 0] - west, north - 1 - corner[:, 1]]).astype(np.int64),
        centre - corner,
        np.arange(-half, half, step),
        half,
        math.floor(config.max_gap_m / step + 1e-6),
        math.ceil(config.peak_threshold_m / 2 / step - 1e-6),
    )
    return Segments(table[:, :2], table[:, 2:4], table[:, 4])


def _corner(grid: Grid) -> tuple[int, int]:
    """Return the numbers of the grid's north-west corner on the lattice of its cells."""
    return round(grid.east_m / grid.cell_width_m), round(grid.north_m / grid.cell_height_m)
