"""The picture of a tile: colours and brightness for its layers."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import PIL.Image
from scipy.ndimage import uniform_filter

from linework.arrays import AnyArray, Float32Array
from linework.workbench.views.layers import SLOPE_SPAN_M, TileLayers

#: Level of compression: zlib's fastest, since pictures stay on this machine.
_COMPRESS = 1
#: Objects higher than this hide the ground in the picture of heights. [m]
_STANDS_M = 0.25
#: Cells from this size on show the ground alone: nearly each holds some object. [m]
_NO_THINGS_M = 1.0
#: Range of heights over which colours run once; in a survey that climbs more they run up and down again. [m]
_CLIMB_M = 24.0
#: Limits on the slope and the darkness of the shading, so that a wall or a stray point does not look like a hole.
_STEEPEST, _DARKEST = 1.5, 0.4
#: Density at the end of its colours, which begin at 1, on a logarithmic scale. [1/m2]
_DENSEST = 4000.0
#: Light comes from the north-west, 45 degrees high, as on maps.
_LIGHT = np.array([-0.5, 0.5, math.sqrt(0.5)])
#: Heights above the road [m] and their colours: below it blue, on it grey, a kerb of 5 cm green, of 15 cm yellow, a
#: guardrail orange, a car red, objects above the road violet.
_ABOVE = (
    (-0.60, "#12306e"), (-0.15, "#3f78c4"), (-0.04, "#7d93a8"), (-0.015, "#8b8e90"), (0.015, "#8b8e90"),
    (0.05, "#5fae7c"), (0.10, "#a8d05a"), (0.16, "#f2e34c"), (0.45, "#f7b237"), (0.80, "#f07c2a"),
    (1.60, "#d8392b"), (3.00, "#a3195b"), (4.49, "#7a1fa2"), (4.51, "#c9a7e8"), (12.0, "#ece2f7"),
)  # fmt: skip
_HEIGHT = ((0.0, "#2f6f8f"), (0.25, "#5fa777"), (0.5, "#d9d68a"), (0.75, "#c98f58"), (1.0, "#f4efe9"))
_DENSITY = ((0.0, "#1b1f4b"), (0.3, "#5a2f86"), (0.55, "#b6376f"), (0.8, "#f0803c"), (1.0, "#fbe08a"))


@dataclass(frozen=True, slots=True)
class ColourScale:
    """The range of values of a whole survey, so that all tiles have the same colours.

    Parameters
    ----------
    dark, asphalt, paint
        Intensities of the darkest road, of most of it, and of paint.
    low_m, high_m
        Heights between which most of the ground lies, above the survey's height origin.
    """

    dark: float
    asphalt: float
    paint: float
    low_m: float
    high_m: float

    def shine(self, bright: AnyArray) -> Float32Array:
        """Return intensities from 0 to 1: asphalt at 0.35, paint at 0.95.

        On a logarithmic scale, so that paint stands out although intensity falls with distance.
        """
        places = np.log([max(self.dark, 1e-3) * 0.5, self.dark, self.asphalt, self.paint, self.paint * 1.5])
        places = np.maximum.accumulate(places + np.arange(5) * 1e-3)
        with np.errstate(divide="ignore", invalid="ignore"):
            value = np.interp(np.log(bright), places, (0.0, 0.18, 0.35, 0.92, 1.0))
        return np.asarray(value, dtype=np.float32)


def tile_picture(image: str, layers: TileLayers, scale: ColourScale, cell_m: float, margin: int) -> bytes:
    """Return the PNG of an image of a tile; transparent in cells without points.

    Parameters
    ----------
    layers
        Its layers, filled, with `margin` more cells on each side.
    """
    inner = slice(margin, layers.density.shape[0] - margin)
    inside = layers.part(inner, inner)
    if image == "height":
        shade = _shade(layers, cell_m)[inner, inner]
        return _coloured(_surface(inside, cell_m), shade, scale)
    if image == "above_road":
        return indexed_png(_ramp_index(inside.above, _ABOVE_PLACES), _ABOVE_PALETTE)
    if image == "density":
        with np.errstate(divide="ignore"):
            part = np.log(inside.density) / math.log(_DENSEST)
        part[inside.density == 0] = np.nan
        return indexed_png(_index(part), _DENSITY_PALETTE)
    return indexed_png(_index(scale.shine(inside.bright)), _GREY_PALETTE)


def _surface(layers: TileLayers, cell_m: float) -> AnyArray:
    """Return the height of the surface as it looks from above: of the ground and of objects on it."""
    if cell_m >= _NO_THINGS_M:
        return layers.ground
    return layers.ground + np.where(layers.stands > _STANDS_M, layers.stands, np.float32(0.0))


def _shade(layers: TileLayers, cell_m: float) -> Float32Array:
    """Return the shading of each cell, 1 on level ground."""
    z = _surface(layers, cell_m)
    known = np.isfinite(z)
    # Unknown cells get the mean height, so that there is no large step at their edge
    z = np.where(known, z, np.float32(z[known].mean() if known.any() else 0.0))
    size = max(1, round(SLOPE_SPAN_M / cell_m))
    if size > 1:
        weight = uniform_filter(known.astype(np.float32), size)
        z = uniform_filter(np.where(known, z, 0.0), size) / np.maximum(weight, 1e-6)
    # Coarse cells hold only gentle slopes, which are exaggerated
    steep = 2.0 * max(1.0, cell_m) ** 0.5 / cell_m
    dx, dy = np.zeros_like(z), np.zeros_like(z)
    both = known[:, 1:] & known[:, :-1]
    dx[:, :-1] = np.where(both, z[:, 1:] - z[:, :-1], 0.0)
    both = known[1:] & known[:-1]
    dy[:-1] = np.where(both, z[:-1] - z[1:], 0.0)
    dx[:, -1], dy[-1] = dx[:, -2], dy[-2]
    dx, dy = (np.clip(slope * steep, -_STEEPEST, _STEEPEST) for slope in (dx, dy))
    light = (-_LIGHT[0] * dx - _LIGHT[1] * dy + _LIGHT[2]) / np.sqrt(1.0 + dx * dx + dy * dy)
    return np.asarray(np.clip(light / _LIGHT[2], _DARKEST, 1.5), dtype=np.float32)


def _coloured(z: AnyArray, shade: Float32Array, scale: ColourScale) -> bytes:
    """Return the PNG of heights in colours, shaded."""
    climb = scale.high_m - scale.low_m
    part = (z - scale.low_m) / min(climb, _CLIMB_M)
    if climb > _CLIMB_M:
        part = 1.0 - np.abs(part % 2.0 - 1.0)
    index = _index(part)
    rgb = _HEIGHT_PALETTE[index].astype(np.float32)
    lit = np.where(
        shade[..., None] <= 1.0, rgb * shade[..., None], 255.0 - (255.0 - rgb) * (2.0 - shade[..., None])
    )
    out = np.empty((*z.shape, 4), np.uint8)
    out[..., :3] = np.clip(lit, 0.0, 255.0)
    out[..., 3] = np.where(index > 0, 255, 0)
    return _png(PIL.Image.fromarray(out))


def _index(part: AnyArray) -> AnyArray:
    """Return uint8 palette indices of values from 0 to 1: 1 to 255, and 0 for NaN."""
    with np.errstate(invalid="ignore"):
        index = 1.0 + np.clip(part, 0.0, 1.0) * 254.0
    return np.where(np.isnan(part), 0, np.nan_to_num(index)).astype(np.uint8)


def _ramp_index(values: AnyArray, places: AnyArray) -> AnyArray:
    return _index(np.interp(values, places, np.linspace(0.0, 1.0, len(places))))


def indexed_png(index: AnyArray, palette: AnyArray) -> bytes:
    """Return the PNG of uint8 indices (n, m) into a palette (256, 3); 0 is transparent."""
    image = PIL.Image.fromarray(index)
    image.putpalette(palette.tobytes())
    return _png(image, transparency=0)


def _png(image: PIL.Image.Image, **options: int) -> bytes:
    kept = io.BytesIO()
    image.save(kept, format="PNG", compress_level=_COMPRESS, **options)
    return kept.getvalue()


def _palette(ramp: Sequence[tuple[float, str]], *, even: bool = False) -> AnyArray:
    """Return (256, 3) uint8 colours along a ramp at 1 to 255; `even`: with its colours evenly spaced."""
    at = np.linspace(0.0, 1.0, len(ramp)) if even else np.array([place for place, _ in ramp])
    rgb = np.array([[int(colour[k : k + 2], 16) for k in (1, 3, 5)] for _, colour in ramp], dtype=np.float64)
    along = np.linspace(0.0, 1.0, 255)
    out = np.zeros((256, 3), np.uint8)
    out[1:] = np.round(np.stack([np.interp(along, at, rgb[:, k]) for k in range(3)], axis=1))
    return out


_ABOVE_PLACES = np.array([place for place, _ in _ABOVE])
_ABOVE_PALETTE = _palette(_ABOVE, even=True)
_HEIGHT_PALETTE, _DENSITY_PALETTE = _palette(_HEIGHT), _palette(_DENSITY)
_GREY_PALETTE = _palette(((0.0, "#000000"), (1.0, "#ffffff")))
