"""One scale for all pictures of a survey, measured on a sample of its blocks."""

from __future__ import annotations

import numpy as np

from linework.kernels.tile_cells import GROUND_M
from linework.workbench.pictures_colours import Scale
from linework.workbench.tiles import Tile
from linework.workbench.tiles_points import PatchReader

#: So many blocks, evenly chosen, are the survey; of each so many points.
_N_BLOCKS, _N_POINTS = 12, 20_000
#: Shares of the road's points: the darkest; paint covers 2 to 5 % of a marked road, a hundredth is surely paint.
_DARK, _PAINT = 0.03, 0.99
#: Paint is at least so much brighter than asphalt: on a road without any the rest must not look like paint.
_LEAST_PAINT = 2.0
#: Shares of the ground's heights that the colours reach from and to, and how far at least. [m]
_LOW, _HIGH, _LEAST_M = 0.01, 0.99, 8.0


def measured_scale(reader: PatchReader) -> Scale:
    """Return the scale of a survey: how bright its road is, how high its ground."""
    blocks = sorted(reader.counts, key=lambda block: block[::-1])
    chosen = blocks[:: max(1, len(blocks) // _N_BLOCKS)]
    heights, brights = [], []
    for east, north in chosen:
        for patch in reader.patches(Tile(0, east, north).bounds, keep=False):
            ground = np.flatnonzero(np.abs(patch.above) <= GROUND_M)
            if reader.surface is None or len(ground) == 0:
                ground = np.arange(len(patch))
            heights.append(np.sort(patch.z[ground])[:: _step(len(ground))])
            # What is level with the road: neither kerbs nor grass
            level = np.flatnonzero(np.abs(patch.above) <= 0.03)
            brights.append(np.sort(patch.intensity[level])[:: _step(len(level))])
    z = np.concatenate([np.zeros(0, np.float32), *heights])
    bright = np.concatenate([np.zeros(0, np.uint16), *brights])
    low, high = np.quantile(z, (_LOW, _HIGH)) if len(z) else (0.0, 0.0)
    high = max(high, low + _LEAST_M)
    dark, asphalt, paint = np.quantile(bright, (_DARK, 0.5, _PAINT)) if len(bright) else (1.0, 1.0, 1.0)
    asphalt = max(asphalt, 1.0)
    paint = max(paint, _LEAST_PAINT * asphalt)
    return Scale(float(max(dark, 0.1 * asphalt)), float(asphalt), float(paint), float(low), float(high))


def _step(n: int) -> int:
    return max(1, n // _N_POINTS)
