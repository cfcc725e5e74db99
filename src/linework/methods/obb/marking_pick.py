"""The paint at one picked place, or why there is none."""

from __future__ import annotations

import math
from enum import IntEnum

import numpy as np

from linework.kernels import stripes
from linework.kernels.stripe_search import MOST_STRIPES
from linework.kernels.stripes_all import RADII_M, stripes_at
from linework.methods.obb.marking import LEAST_T, MarkingConfig, PaintPoints, boxes_of, origin_of
from linework.model.boxes import BoxSet
from linework.model.surface import RoadSurface
from linework.model.tile import TileData


class MarkingFound(IntEnum):
    """What a search area for paint comes to."""

    #: A box was found.
    FOUND = stripes.FOUND
    #: Too few points on the road, even within 2 m.
    TOO_FEW_POINTS = stripes.TOO_FEW_POINTS
    #: Points on the paint in fewer than 3 of 8 parts of the search area.
    HOLES = stripes.HOLES
    #: No intensities, or all points are equally bright.
    NO_BRIGHT = stripes.NO_BRIGHT
    #: Nothing that is brighter than the road on both its sides.
    NO_STRIPE = stripes.NO_STRIPE


def marking_box_at(
    tile: TileData, surface: RoadSurface, east_m: float, north_m: float, config: MarkingConfig
) -> tuple[BoxSet, MarkingFound]:
    """Return the box on the paint nearest to a picked place, within 0.5 m of it; none and why if there is none.

    Parameters
    ----------
    tile
        The points around the place; those within 4 m matter.
    east_m, north_m
        The picked place. [m, world]
    """
    if tile.points.intensity is None:
        return BoxSet.empty(), MarkingFound.NO_BRIGHT
    if len(tile.points) == 0:
        return BoxSet.empty(), MarkingFound.TOO_FEW_POINTS
    origin = origin_of(tile)
    paint = PaintPoints.of(tile.points, surface, origin, config)
    x, y = east_m - origin[0], north_m - origin[1]
    reach = RADII_M[0]
    rows = np.empty((MOST_STRIPES, stripes.N_COLUMNS))
    number, why, _ = stripes_at(
        paint.rows, paint.starts, paint.lattice, (x, y), (x - reach, y - reach, x + reach, y + reach),
        LEAST_T, np.empty((4096, 5)), rows,
    )  # fmt: skip
    boxes = boxes_of(rows[:number], config, has_time=False)
    if len(boxes) == 0:
        return boxes, MarkingFound(why) if number == 0 else MarkingFound.NO_STRIPE
    nearest = int(np.argmin([math.hypot(bx - x, by - y) for bx, by in boxes.centre[:, :2].tolist()]))
    return boxes.take(np.array([nearest])), MarkingFound.FOUND
