"""Warming up: both desks do something for nobody, so that whoever asks first need not wait; pages are told of it."""

from __future__ import annotations

import asyncio
import contextlib
import math
from collections.abc import Callable
from functools import partial
from typing import Any

from linework.errors import LineworkError
from linework.model.grid import Bounds
from linework.model.lines import KINDS
from linework.workbench.following.routes import warm_up_tracing
from linework.workbench.server.bench import AppState
from linework.workbench.views.heights import heights_at
from linework.workbench.views.points import points_of_place, section_at
from linework.workbench.views.pyramid import FINEST, IMAGES, TILE_BLOCK_M, MapTile
from linework.workbench.views.tiles import tile_png
from linework.workbench.worker.open import open_in_worker
from linework.workbench.worker.session import SurveySession

#: What a page waits for, as "Still ..." says it.
OPENING = "opening the survey for following lines"
PICTURES = "getting the pictures ready"
COMPILING = "compiling the programs for this machine: once after an installation, a minute or two"


class StartupProgress:
    """What the server is still doing.

    Parameters
    ----------
    tell
        Called with the words for it whenever they change, "" when nothing is left.
    """

    def __init__(self, tell: Callable[[str], None]) -> None:
        self._tell = tell
        self._doing: dict[str, str] = {}

    def change(self, who: str, what: str, is_so: bool) -> None:
        """Note that somebody does something, or does so no more."""
        before = self.words
        if is_so:
            self._doing[who] = what
        else:
            self._doing.pop(who, None)
        if self.words != before:
            self._tell(self.words)

    @property
    def words(self) -> str:
        """All of it, each once."""
        return "; ".join(sorted(set(self._doing.values())))


async def warm_up(bench: AppState, busy: StartupProgress) -> None:
    """Open the survey at the tracing desk too, and let both desks run through what they are asked for most."""
    for name, desk in (("pictures", bench.pictures), ("tracing", bench.tracing)):
        desk.on_compiling = partial(busy.change, f"{name} compile", COMPILING)
    await asyncio.gather(_tracing(bench, busy), _pictures(bench, busy))


async def _tracing(bench: AppState, busy: StartupProgress) -> None:
    busy.change("tracing", OPENING, True)
    # What is wrong with the survey was told before; a click would tell it again
    with contextlib.suppress(LineworkError):
        await bench.tracing.ask(open_in_worker)
    with contextlib.suppress(LineworkError):
        await warm_up_tracing(bench)
    busy.change("tracing", OPENING, False)


async def _pictures(bench: AppState, busy: StartupProgress) -> None:
    path: Any = bench.facts.path
    if not bench.facts.n_points or len(path) == 0:
        return
    east, north, _ = path[len(path) // 2]
    busy.change("pictures", PICTURES, True)
    with contextlib.suppress(LineworkError):
        for step in range(STEPS):
            await bench.pictures.ask(warm_up_pictures, step, (east, north))
    busy.change("pictures", PICTURES, False)


# Warming up the desk of pictures: what it is asked for most is made once for nobody

#: So many points, and so much of the survey around its middle, are enough to run all code once.
_MOST, _AROUND_M = 1000, 4.0
#: Steps of `warm_up_pictures`: tiles, points, sections, heights.
STEPS = 4


def warm_up_pictures(table: SurveySession, step: int, place: tuple[float, float]) -> None:
    """Make some pictures about a place [m, world]; one step at a time, so that who asks for some need not wait long."""
    east, north = place
    around = Bounds(east, north, east, north).grown(_AROUND_M)
    points = table.recordings.points
    if points is None:
        return
    # What is wrong with the survey is told to whoever asks for a picture
    with contextlib.suppress(LineworkError):
        if step == 0:
            size_m = math.ldexp(TILE_BLOCK_M, FINEST)
            tile = MapTile(FINEST, math.floor(east / size_m), math.floor(north / size_m))
            for image, _, _ in IMAGES:
                tile_png(table, image, tile)
        elif step == 1:
            points_of_place(table, around, _MOST, (-float("inf"), float("inf")))
        elif step == 2:
            section_at(table, place, 0.0, _AROUND_M, 1.0)
        else:
            for kind in KINDS:
                heights_at(table, kind, [place])
