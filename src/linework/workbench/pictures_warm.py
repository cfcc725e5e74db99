"""Warming up the desk of pictures: what it is asked for most is made once for nobody."""

from __future__ import annotations

import contextlib
import math

from linework.errors import LineworkError
from linework.model.grid import Bounds
from linework.model.lines import KINDS
from linework.workbench.heights import heights_at
from linework.workbench.pictures import tile_png
from linework.workbench.point_detail import points_of_place
from linework.workbench.sections import section_at
from linework.workbench.table import Table
from linework.workbench.tiles import BLOCK_M, FINEST, IMAGES, Tile

#: So many points, and so much of the survey around its middle, are enough to run all code once.
_MOST, _AROUND_M = 1000, 4.0
#: Steps of `warm_pictures`: tiles, points, sections, heights.
STEPS = 4


def warm_pictures(table: Table, step: int, place: tuple[float, float]) -> None:
    """Make some pictures about a place [m, world]; one step at a time, so that who asks for some need not wait long."""
    east, north = place
    around = Bounds(east, north, east, north).grown(_AROUND_M)
    points = table.recordings.points
    if points is None:
        return
    # What is wrong with the survey is told to whoever asks for a picture
    with contextlib.suppress(LineworkError):
        if step == 0:
            size_m = math.ldexp(BLOCK_M, FINEST)
            tile = Tile(FINEST, math.floor(east / size_m), math.floor(north / size_m))
            for image, _, _ in IMAGES:
                tile_png(table, image, tile)
        elif step == 1:
            points_of_place(table, around, _MOST, (-float("inf"), float("inf")))
        elif step == 2:
            section_at(table, place, 0.0, _AROUND_M, 1.0)
        else:
            for kind in KINDS:
                heights_at(table, kind, [place])
