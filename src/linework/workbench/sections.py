"""Works of the desk of pictures: a slice of the points, seen along the road."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from linework.errors import UsageError
from linework.model.grid import Bounds
from linework.workbench.pictures import patch_reader
from linework.workbench.point_detail import by_lot, packed
from linework.workbench.table import Table

#: A slice is no wider and no thicker. [m]
WIDEST_M, THICKEST_M = 60.0, 20.0
#: Points that a slice shows at most: a dozen for every pixel.
MOST_POINTS = 200_000


def section_at(
    table: Table, place: tuple[float, float], heading_deg: float, half_width_m: float, thickness_m: float
) -> bytes:
    """Return the points of a slice across a heading, as `points_of_place` does: x to the right of it, y along it.

    Parameters
    ----------
    place
        Its middle [m, world], from which points are counted.
    heading_deg
        Clockwise from grid north.

    Raises
    ------
    UsageError
        The slice is wider than `WIDEST_M` to a side, or thicker than `THICKEST_M`.
    """
    if not 0.0 < half_width_m <= WIDEST_M or not 0.0 < thickness_m <= THICKEST_M:
        raise UsageError(
            f"a slice of {half_width_m:g} m to each side and {thickness_m:g} m thick",
            advice=f"up to {WIDEST_M:g} m to each side and {THICKEST_M:g} m thick can be shown",
        )
    reader = patch_reader(table)
    origin = (*place, reader.z0_m if reader else 0.0)
    if reader is None:
        return packed(origin, [], table, MOST_POINTS)
    sin, cos = math.sin(math.radians(heading_deg)), math.cos(math.radians(heading_deg))
    half_m = 0.5 * thickness_m
    reach = abs(cos) * half_width_m + abs(sin) * half_m, abs(sin) * half_width_m + abs(cos) * half_m
    bounds = Bounds(place[0] - reach[0], place[1] - reach[1], place[0] + reach[0], place[1] + reach[1])
    found = []
    for patch in reader.patches(bounds):
        east = patch.x + np.float32(patch.corner[0] - place[0])
        north = patch.y + np.float32(patch.corner[1] - place[1])
        right, ahead = east * cos - north * sin, east * sin + north * cos
        inside = (np.abs(right) <= half_width_m) & (np.abs(ahead) <= half_m)
        part = by_lot(patch, inside, 1.0, origin)
        xyz = np.stack([right[inside], ahead[inside], part.xyz[:, 2]], axis=1).astype(np.float32)
        found.append(replace(part, xyz=xyz))
    return packed(origin, found, table, MOST_POINTS)
