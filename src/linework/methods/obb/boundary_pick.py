"""The boundary at one picked place, or why there is none."""

from __future__ import annotations

from enum import IntEnum

import numpy as np

from linework.kernels import places
from linework.kernels.boundary_boxes import boxes_around
from linework.methods.obb.boundary import BoundaryConfig, FloorPoints, boxes_of, limits_of, origin_of
from linework.model.boxes import BoxSet
from linework.model.surface import RoadSurface
from linework.model.tile import TileData

#: A picked place is this near to the boundary that is meant: the search area's radius. [m]
NEAR_M = 0.5


class BoundaryFound(IntEnum):
    """What a search area for a boundary comes to."""

    #: A box was found.
    FOUND = places.FOUND
    #: Holes in the data: too few points for a floor, or on one side of its edge.
    HOLES = places.HOLE
    #: No road in it: nothing smooth, or nothing level, that could be the carriageway's side.
    NO_ROAD = places.NO_ROAD
    #: All road: a floor without an edge.
    ALL_ROAD = places.ALL_ROAD


def boundary_box_at(
    tile: TileData, surface: RoadSurface, east_m: float, north_m: float, config: BoundaryConfig
) -> tuple[BoxSet, BoundaryFound]:
    """Return the boundary box nearest to a picked place, within 0.5 m of it; none and why if there is none.

    Parameters
    ----------
    tile
        The points around the place; those within `boundary.REACH_M` matter.
    east_m, north_m
        The picked place. [m, world]
    """
    if len(tile.points) == 0:
        return BoxSet.empty(), BoundaryFound.HOLES
    origin = origin_of(tile)
    base = FloorPoints.of(tile.points, surface, origin)
    picked = east_m - origin[0], north_m - origin[1]
    rows, why = boxes_around(base.data, base.ground, base.times, picked, limits_of(config))
    found = boxes_of(rows[why == places.FOUND])
    away_m = np.hypot(*(found.centre[:, :2] - picked).T)
    if len(found) and away_m.min() <= NEAR_M:
        return found.take(np.array([np.argmin(away_m)])), BoundaryFound.FOUND
    # An edge that passes the cell leaves it all road
    return BoxSet.empty(), _reason(int(why[0]))


def _reason(why: int) -> BoundaryFound:
    known = (places.HOLE, places.NO_ROAD)
    return BoundaryFound(why) if why in known else BoundaryFound.ALL_ROAD
