"""Seed lines from the peaks of Radon transforms of local windows, and the occupied segments along them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from linework.arrays import FloatArray, IntArray
from linework.kernels.radon import segments as kernels
from linework.kernels.radon.segments import SEGMENT_STRENGTH, SEGMENT_X0, SEGMENT_X1
from linework.methods.drawn import draw_segments
from linework.methods.radon.peaks import PeakFinder, Peaks, find_peaks, peaks_by
from linework.methods.radon.transform import RadonImage, radon_of_cells, rho_bins
from linework.model.grid import Grid, Image
from linework.model.settings import Settings, setting

#: Half lengths of the two dilating line elements: of two peaks within both only the higher counts. The paper does
#: not publish them; one cell, and two and a half steps of the angle.
HALF_WINDOW_DEG, HALF_WINDOW_CELLS = 7.5, 1


@dataclass(frozen=True, slots=True, kw_only=True)
class SeedConfig(Settings):
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
    """n straight candidates, each a direction and an offset that hold within its window.

    Parameters
    ----------
    centre_xy
        (n, 2) centre of the window. [m, world]
    theta_rad, rho_m
        (n,) normal form about that centre. [rad, m]
    strength_m
        (n,) occupied length along the line. [m]
    """

    centre_xy: FloatArray
    theta_rad: FloatArray
    rho_m: FloatArray
    strength_m: FloatArray

    def __len__(self) -> int:
        return len(self.rho_m)

    def plot(self, ax: Any = None, **options: Any) -> Any:
        """Draw each line in plan, as long as it is strong, about the foot from its window's centre; return the axes."""
        normal = np.stack([np.cos(self.theta_rad), np.sin(self.theta_rad)], axis=-1)
        foot = self.centre_xy + self.rho_m[:, None] * normal
        half = 0.5 * self.strength_m[:, None] * np.stack([-normal[:, 1], normal[:, 0]], axis=-1)
        return draw_segments(foot - half, foot + half, ax, **options)


@dataclass(frozen=True, slots=True)
class SeedSegments:
    """n straight segments: ends (n, 2) [m, world] and strength of their seed line (n,) [m]."""

    start_xy: FloatArray
    end_xy: FloatArray
    strength_m: FloatArray

    def __len__(self) -> int:
        return len(self.strength_m)

    def plot(self, ax: Any = None, **options: Any) -> Any:
        """Draw the segments in plan; return the axes."""
        return draw_segments(self.start_xy, self.end_xy, ax, **options)


def find_seed_lines(binary: Image, config: SeedConfig, finder: PeakFinder | None = None) -> SeedLines:
    """Return the prominent directions of a binary image, window by window.

    Parameters
    ----------
    binary
        (rows, cols) bool: cells with points in the height band.
    finder
        Own function that finds the peaks of each window's Radon image; None: `linework.methods.radon.peaks.find_peaks`.

    Notes
    -----
    Windows overlap by half and sit on one global lattice, so that neighbouring tiles see the same ones.
    A single Radon transform of the whole image finds straight roads only: a chord of L m leaves a curve
    of radius R by L^2 / (8 R). Windows with less than `peak_threshold_m` of occupied cells are passed over.

    References
    ----------
    Manandhar and Shibasaki (2002), "Line Detection by Radon Transformation".

    Examples
    --------
    >>> rail = np.zeros((60, 60), dtype=bool)
    >>> rail[30] = True  # 12 m from west to east
    >>> seeds = find_seed_lines(Image(rail, Grid(0.0, 12.0, 0.2, 0.2, 60, 60)), SeedConfig())
    >>> strongest = int(np.argmax(seeds.strength_m))
    >>> float(np.degrees(seeds.theta_rad[strongest]).round(3)), float(seeds.strength_m[strongest].round(3))
    (90.0, 3.0)
    """
    if finder is not None:
        return _own_seed_lines(binary, config, finder)
    angles = np.radians(np.arange(0.0, 180.0 - 0.5 * config.step_deg, config.step_deg))
    cell, half = binary.grid.cell_width_m, config.window_m / 2
    rho = rho_bins(half * math.sqrt(2), cell)
    cells, starts, quarters, centres = _windows(binary, config)
    table = kernels.peaks_of_windows(
        cells,
        starts,
        (quarters, centres),
        ((cell, binary.grid.cell_height_m, 0.0), cell),
        angles,
        rho,
        (config.peak_threshold_m, math.radians(HALF_WINDOW_DEG), HALF_WINDOW_CELLS),
        config.peak_threshold_m / cell,
    )
    number, theta, offset, strength = table.T
    order = np.lexsort((offset, theta, -strength, number))  # window by window, the strongest first
    return SeedLines(centres[number[order].astype(np.int64)], theta[order], offset[order], strength[order])


def windows_of_image(binary: Image, config: SeedConfig) -> Iterator[tuple[FloatArray, RadonImage]]:
    """Yield the centre (2,) [m, world] and the Radon image of each window with enough occupied cells.

    They are those that `find_seed_lines` searches for peaks, in its order.
    """
    angles = np.radians(np.arange(0.0, 180.0 - 0.5 * config.step_deg, config.step_deg))
    cell, half = binary.grid.cell_width_m, config.window_m / 2
    cells, starts, quarters, centres = _windows(binary, config)
    for window, centre in zip(quarters, centres, strict=True):
        held = [cells[starts[q] : starts[q + 1]] for q in window if q >= 0]
        if sum(map(len, held)) < config.peak_threshold_m / cell:
            continue
        x, y = (np.concatenate(held) - centre).T
        values = radon_of_cells(
            np.ascontiguousarray(x),
            np.ascontiguousarray(y),
            np.ones(len(x)),
            cell_width_m=cell,
            cell_height_m=binary.grid.cell_height_m,
            angles_rad=angles,
            rho_step_m=cell,
            rho_max_m=half * math.sqrt(2),
        )
        yield centre, RadonImage(values, angles, rho_bins(half * math.sqrt(2), cell), cell, centre)


def strongest_window(binary: Image, config: SeedConfig) -> RadonImage | None:
    """Return the Radon image of the window with the strongest peak, to be looked at; None: all windows are empty."""
    windows = (radon for _, radon in windows_of_image(binary, config))
    return max(windows, key=lambda radon: float(radon.values.max()), default=None)


def peaks_of_window(radon: RadonImage, config: SeedConfig, finder: PeakFinder | None = None) -> Peaks:
    """Return the peaks of the Radon image of one window, with the settings of `find_seed_lines`."""
    limits = {
        "threshold": config.peak_threshold_m,
        "theta_window_rad": 2.0 * math.radians(HALF_WINDOW_DEG),
        "rho_window_m": 2.0 * HALF_WINDOW_CELLS * radon.rho_step_m,
    }
    if finder is None:
        return find_peaks(radon.values, radon.angles_rad, radon.rho_m, **limits)
    return peaks_by(finder, radon.values, radon.angles_rad, radon.rho_m, **limits)


def _own_seed_lines(binary: Image, config: SeedConfig, finder: PeakFinder) -> SeedLines:
    """Return the seed lines at the peaks that an own function finds."""
    centres, found = [], []
    for centre, radon in windows_of_image(binary, config):
        peaks = peaks_of_window(radon, config, finder)
        found.append(peaks)
        centres.append(np.tile(centre, (len(peaks), 1)))
    return SeedLines(
        np.concatenate([np.zeros((0, 2)), *centres]),
        *(
            np.concatenate([np.zeros(0), *(getattr(peaks, name) for peaks in found)])
            for name in ("theta_rad", "rho_m", "strength_m")
        ),
    )


def _windows(binary: Image, config: SeedConfig) -> tuple[FloatArray, IntArray, IntArray, FloatArray]:
    """Return the occupied cells and the windows, in the form of `linework.kernels.radon.segments`.

    Returns
    -------
    cells
        (n, 2) centres of the occupied cells, by quarter of a window. [m, world]
    starts
        (q + 1,) int64: where each quarter's cells begin.
    quarters
        (m, 4) int64 quarters of each window, from the south-west; -1 where one is empty.
    centres
        (m, 2) centres of the windows. [m, world]
    """
    grid = binary.grid
    rows, cols = np.nonzero(binary.values)
    if len(rows) == 0:
        nothing = np.zeros(0, dtype=np.int64)
        return np.zeros((0, 2)), np.zeros(1, dtype=np.int64), nothing.reshape(0, 4), np.zeros((0, 2))
    # Coordinates from whole numbers that all tiles share, so that ties between peaks are decided alike in each
    west, north = _corner(grid)
    xy = np.column_stack([(west + cols + 0.5) * grid.cell_width_m, (north - rows - 0.5) * grid.cell_height_m])
    stride = config.window_m / 2
    lattice = np.floor(xy / stride).astype(np.int64)
    lowest = lattice.min(axis=0) - 1
    place = lattice - lowest
    wide = int(place[:, 0].max()) + 2
    number = place[:, 1] * wide + place[:, 0]
    order = np.argsort(number, kind="stable")
    keys, starts = np.unique(number[order], return_index=True)
    # The number of a window is that of its south-west quarter
    window = np.unique(np.concatenate([keys, keys - 1, keys - wide, keys - wide - 1]))
    quarter = window[:, None] + np.array([0, 1, wide, wide + 1])
    at = np.minimum(np.searchsorted(keys, quarter), len(keys) - 1)
    quarters = np.where(keys[at] == quarter, at, -1)
    corner = np.column_stack([window % wide, window // wide]) + lowest
    return xy[order], np.append(starts, len(xy)), quarters, (corner + 1) * stride


def split_into_segments(seeds: SeedLines, binary: Image, config: SeedConfig) -> SeedSegments:
    """Return the occupied segments of an image along seed lines.

    A Radon peak says nothing about extent. Segments are parted where the image is empty for more than
    `max_gap_m`; those shorter than half of `peak_threshold_m` are dropped.

    Parameters
    ----------
    seeds
        Lines of windows of `binary`.
    binary
        (rows, cols) bool: cells with points in the height band.

    Examples
    --------
    >>> rail = np.zeros((60, 60), dtype=bool)
    >>> rail[30, 5:20] = rail[30, 35:] = True  # a gap of 3 m
    >>> binary = Image(rail, Grid(0.0, 12.0, 0.2, 0.2, 60, 60))
    >>> segments = split_into_segments(find_seed_lines(binary, SeedConfig()), binary, SeedConfig())
    >>> east = np.sort(np.stack([segments.start_xy[:, 0], segments.end_xy[:, 0]], axis=-1), axis=1)
    >>> bool(((east <= 4.05) | (east >= 6.95)).all())
    True
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
    return SeedSegments(
        table[:, SEGMENT_X0:SEGMENT_X1], table[:, SEGMENT_X1:SEGMENT_STRENGTH], table[:, SEGMENT_STRENGTH]
    )


def _corner(grid: Grid) -> tuple[int, int]:
    """Return the numbers of the grid's north-west corner on the lattice of its cells."""
    return round(grid.east_m / grid.cell_width_m), round(grid.north_m / grid.cell_height_m)
