"""The pictures that every page asks for first, made once by the pictures worker.

Separate from `warm_up`, which runs in the server: the worker imports none of the server's packages.
"""

from __future__ import annotations

import contextlib
import math

from linework.errors import LineworkError
from linework.model.grid import Bounds
from linework.model.lines import KINDS
from linework.workbench.views.heights import heights_at
from linework.workbench.views.points import points_of_place, section_at
from linework.workbench.views.pyramid import FINEST, IMAGES, TILE_BLOCK_M, MapTile
from linework.workbench.views.tiles import tile_png
from linework.workbench.worker.session import SurveySession

#: Points, and distance around a place [m], that are enough to run all code of `warm_up_pictures` once.
_MOST, _AROUND_M = 1000, 4.0
#: Thickness of the section that is made. [m]
_THICKNESS_M = 1.0


def warm_up_pictures(session: SurveySession, step: int, place: tuple[float, float]) -> None:
    """Make some pictures around a place (east, north) [m, world], one step per request: others come in between."""
    east, north = place
    around = Bounds(east, north, east, north).grown(_AROUND_M)
    points = session.recordings.points
    if points is None:
        return
    # What is wrong with the survey is reported when a page asks for a picture
    with contextlib.suppress(LineworkError):
        if step == 0:
            size_m = math.ldexp(TILE_BLOCK_M, FINEST)
            tile = MapTile(FINEST, math.floor(east / size_m), math.floor(north / size_m))
            for image, _, _ in IMAGES:
                tile_png(session, image, tile)
        elif step == 1:
            points_of_place(session, around, _MOST, (-float("inf"), float("inf")))
        elif step == 2:
            section_at(session, place, 0.0, _AROUND_M, _THICKNESS_M)
        else:
            for kind in KINDS:
                heights_at(session, kind, [place])
