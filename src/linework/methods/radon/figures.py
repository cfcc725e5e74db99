"""Images that `linework raster` writes: figures 2 to 7 of the Radon paper, made from the points."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from linework.arrays import BoolArray, Float32Array, FloatArray
from linework.imaging.overview import ImageWindow, close_ups
from linework.imaging.picture import MAP_CLOSE_UP_M, OverlaidLines, Style, draw_map, draw_radon
from linework.imaging.raster import RasterImages, cell_indices, in_height_band, rasterise
from linework.methods.radon.peaks import Peaks, dilate, find_peaks, ridges
from linework.methods.radon.transform import RadonImage, evenly_spaced_angles, radon_transform
from linework.model.grid import Grid, Image
from linework.model.points import Points
from linework.model.settings import Settings, setting

#: Classes of the classified image, the paper's colours.
ROAD_CLASS, OFF_ROAD = 1, 2


@dataclass(frozen=True, slots=True, kw_only=True)
class FigureConfig(Settings):
    """Settings of the pictures of the whole survey (extraction has its own settings, for windows)."""

    low_m: float = setting(
        0.2,
        unit="m",
        reason="value of the paper: above kerbs and grass, below the beam of a guardrail",
        low=-100,
        high=1000,
    )
    high_m: float = setting(
        1.2, unit="m", reason="value of the paper: guardrails are about 1 m high", low=-100, high=10000
    )
    step_deg: float = setting(
        0.25,
        unit="deg",
        reason="at 45 m from the centre, successive angles are one cell apart",
        low=0.01,
        high=10,
    )
    theta_window_deg: float = setting(
        6.0, unit="deg", reason="the ridge of one rail in Radon space is narrower", low=0, high=90
    )
    rho_window_m: float = setting(
        1.0, unit="m", reason="the two beams of a median are further apart", low=0, high=100
    )
    ridge_m: float = setting(
        1.0,
        unit="m",
        reason="a rail fills 0.6 m of rho; ramps, hedges and trails are broader; 0: all count, as published",
        low=0,
        high=100,
    )
    min_length_m: float = setting(
        8.0,
        unit="m",
        reason="two bays of a guardrail; chance alignments of bushes are shorter",
        low=0,
        high=10000,
    )
    by_maximum: bool = setting(
        False,
        unit="",
        reason="true: the highest point of a cell is in the band, as published; false: any point",
    )
    max_lines: int = setting(
        20, unit="lines", reason="more cannot be told apart in a picture", low=0, high=1000
    )


@dataclass(frozen=True, slots=True)
class RasterFigure:
    """One figure: its raster image and a picture of it.

    Parameters
    ----------
    name
        Stem of its file names.
    image
        Raster for the GeoTIFF.
    png
        Encoded picture.
    in_world
        False for the Radon images, whose axes are theta [deg] and rho [m].
    """

    name: str
    image: Image
    png: bytes
    in_world: bool = True


@dataclass(frozen=True, slots=True)
class CandidateLines:
    """Radon image of a binary image, the dilation of its ridges, and the candidate lines: their peaks."""

    radon: RadonImage
    dilated: RadonImage
    peaks: Peaks


def find_candidate_lines(binary: Image, config: FigureConfig) -> CandidateLines:
    """Return the Radon image of the whole binary image and its prominent peaks.

    Candidate lines are straight and run across the whole image, as in the paper: they show what the transform
    detects. Extraction works in windows instead, so that roads may bend. Over a whole image, tree crowns and ramps
    add up to more than a rail, so peaks are searched for in the ridges of the Radon image; in the Radon image itself,
    as published, if `ridge_m` is 0.
    """
    radon = radon_transform(binary, evenly_spaced_angles(config.step_deg))
    windows = {
        "theta_window_rad": math.radians(config.theta_window_deg),
        "rho_window_m": config.rho_window_m,
    }
    thin = ridges(radon, width_m=config.ridge_m) if config.ridge_m else radon
    peaks = find_peaks(thin.values, thin.angles_rad, thin.rho_m, threshold=config.min_length_m, **windows)
    first = slice(0, config.max_lines)
    strongest = Peaks(peaks.theta_rad[first], peaks.rho_m[first], peaks.strength_m[first])
    return CandidateLines(radon, dilate(thin, **windows), strongest)


def line_ends(peaks: Peaks, radon: RadonImage) -> FloatArray:
    """Return (m, 2, 2) ends [m, world] of the candidate lines, across the whole image."""
    cos, sin = np.cos(peaks.theta_rad), np.sin(peaks.theta_rad)
    foot = np.stack([cos, sin], axis=1) * peaks.rho_m[:, None] + radon.centre_xy
    along = np.stack([-sin, cos], axis=1) * float(radon.rho_m[-1] + radon.rho_step_m)
    return np.stack([foot - along, foot + along], axis=1)


def classified(points: Points, is_road: BoolArray, grid: Grid) -> Image:
    """Return the uint8 image of road (1) and non-road (2) cells by the majority of their points; 0: empty.

    The paper's figure 2, as an image.
    """
    cells = cell_indices(points, grid)
    inside = cells >= 0
    n_cells = grid.n_rows * grid.n_cols
    balance = np.bincount(cells[inside], weights=np.where(is_road[inside], 1.0, -1.0), minlength=n_cells)
    has_points = np.bincount(cells[inside], minlength=n_cells) > 0
    classes = np.where(has_points, np.where(balance > 0, ROAD_CLASS, OFF_ROAD), 0).astype(np.uint8)
    return Image(classes.reshape(grid.shape), grid)


def with_lines(binary: Image, ends: FloatArray) -> Image:
    """Return the uint8 image of the paper's figure 5: 0 empty, 1 occupied, 2 line, 3 line on occupied."""
    grid = binary.grid
    values = binary.values.astype(np.uint8)
    step = 0.5 * min(grid.cell_width_m, grid.cell_height_m)
    for start, end in ends:
        n = math.ceil(math.dist(start, end) / step) + 1
        rows, cols = grid.to_cell(start + np.linspace(0.0, 1.0, n)[:, None] * (end - start))
        rows, cols = np.floor(rows).astype(np.int64), np.floor(cols).astype(np.int64)
        inside = (rows >= 0) & (rows < grid.n_rows) & (cols >= 0) & (cols < grid.n_cols)
        values[rows[inside], cols[inside]] |= 2
    return Image(values, grid)


def radon_as_image(radon: RadonImage) -> Image:
    """Return a Radon image as a raster: columns are theta [deg], rows are rho [m], the largest on top."""
    n_angles, n_rho = radon.values.shape
    step_deg = 180.0 / n_angles
    top = float(radon.rho_m[-1]) + 0.5 * radon.rho_step_m
    grid = Grid(-0.5 * step_deg, top, step_deg, radon.rho_step_m, n_rho, n_angles)
    return Image(radon.values.T[::-1].astype(np.float32), grid)


def raster_figures(
    points: Points,
    height_m: Float32Array,
    is_road: BoolArray,
    grid: Grid,
    config: FigureConfig,
    *,
    crs_name: str,
    normal: Float32Array | None = None,
    candidates: list[CandidateLines] | None = None,
) -> Iterator[RasterFigure]:
    """Yield the figures one by one, so that only one is in memory at a time.

    Parameters
    ----------
    height_m
        (n,) float32 [m]: height of each point above the road.
    is_road
        (n,) bool: the point is on the road.
    crs_name
        Name of the CRS, for the captions.
    normal
        (n,) float32: intensities normalised so that asphalt is 1, or None.
    candidates
        Takes the candidate lines once they are found.
    """
    raw = rasterise(points, grid)
    caption = _Caption(crs_name, close_ups(raw.density, *MAP_CLOSE_UP_M))
    # Figure 2: road and non-road
    classes = classified(points, is_road, grid)
    yield caption.figure("classes", "Road and non-road points", classes, _CLASSES)
    # Figure 3: density; figure 4: maximum height, also minimum and mean; intensity
    yield from _measured(raw, caption)
    bright = None if normal is None else rasterise(Points(points.xyz, intensity=normal), grid).intensity
    if bright is not None:
        yield caption.figure("intensity_normalised", "Intensity over that of asphalt", bright, _OVER_ASPHALT)
    above = rasterise(Points(points.xyz), grid, height_m=height_m).maximum
    yield caption.figure("height_above_road", "Highest point above the road", above, _ABOVE_ROAD)
    # Figure 5 without and with the candidate lines; figures 6 and 7: Radon image, dilation and peaks
    binary = in_height_band(points.xyz, height_m, grid, config.low_m, config.high_m)
    if config.by_maximum:
        # The maximum image tells houses from rails
        binary = Image((above.values >= config.low_m) & (above.values <= config.high_m), grid)
    found = find_candidate_lines(binary, config)
    if candidates is not None:
        candidates.append(found)
    yield from _candidates(binary, found, raw.density, caption, config)


@dataclass(frozen=True, slots=True)
class _Caption:
    """CRS name and close-ups, the same for all maps of a survey."""

    crs_name: str
    windows: tuple[ImageWindow, ...]

    def figure(
        self,
        name: str,
        title: str,
        image: Image,
        style: Style,
        *,
        drawn: Image | None = None,
        lines: OverlaidLines | None = None,
    ) -> RasterFigure:
        """Return the figure of an image; its picture shows `drawn` instead where that is given."""
        picture = draw_map(
            drawn or image, style, title=title, crs_name=self.crs_name, windows=self.windows, lines=lines
        )
        return RasterFigure(name, image, picture)


_CLASSES = Style(
    classes=((ROAD_CLASS, "#d6301f", "road"), (OFF_ROAD, "#2b5fc4", "non-road")), keep="smallest"
)
_OVER_ASPHALT = Style(
    unit="mean intensity, asphalt = 1, white from 3", colours="gray", empty="#bcd3e0", limits=(0.0, 3.0)
)
_ABOVE_ROAD = Style(
    unit="height above the road [m], colour scale ends at 6 m",
    colours="turbo",
    limits=(0.0, 6.0),
)


def _measured(raw: RasterImages, caption: _Caption) -> Iterator[RasterFigure]:
    density = Style(unit="points per cell", logarithmic=True)
    yield caption.figure("density", "Density: points per cell", raw.density, density)
    style, lowest = Style(unit="height [m]"), Style(unit="height [m]", keep="smallest")
    for name, title, image, look in (
        ("maximum_height", "Maximum height", raw.maximum, style),
        ("minimum_height", "Minimum height", raw.minimum, lowest),
        ("mean_height", "Mean height", raw.mean, style),
    ):
        in_world = (image.values.astype(np.float64) + raw.height_origin_m).astype(np.float32)
        yield caption.figure(name, title, Image(in_world, image.grid), look)
    if raw.intensity is not None:
        grey = Style(unit="mean intensity, as recorded", colours="gray", empty="#bcd3e0")
        yield caption.figure("intensity", "Intensity", raw.intensity, grey)


def _candidates(
    binary: Image, found: CandidateLines, density: Image, caption: _Caption, config: FigureConfig
) -> Iterator[RasterFigure]:
    band = f"{config.low_m:g} to {config.high_m:g} m above the road"
    style = Style(classes=((1, "#cfcfca", "points, none in the band"), (2, "black", f"points {band}")))
    drawn = Image((density.values > 0).astype(np.uint8) + binary.values, binary.grid)
    zero_or_one = Image(binary.values.astype(np.uint8), binary.grid)
    yield caption.figure("binary", "Binary image", zero_or_one, style, drawn=drawn)
    peaks, radon, dilated = found.peaks, found.radon, found.dilated
    names = [str(k + 1) for k in range(len(peaks))]
    ends = line_ends(peaks, radon)
    lines = OverlaidLines(ends, names, "candidate line, the strongest is 1")
    title = "Candidate lines over the binary image"
    yield caption.figure("binary_lines", title, with_lines(binary, ends), style, drawn=drawn, lines=lines)
    picture = draw_radon(radon.values, radon.angles_rad, radon.rho_m, title="Radon image of the binary image")
    yield RasterFigure("radon", radon_as_image(radon), picture, in_world=False)
    picture = draw_radon(
        dilated.values,
        dilated.angles_rad,
        dilated.rho_m,
        title="Dilated ridges of the Radon image with their peaks",
        peaks=(peaks.theta_rad, peaks.rho_m),
        names=names,
    )
    yield RasterFigure("radon_dilated", radon_as_image(dilated), picture, in_world=False)
