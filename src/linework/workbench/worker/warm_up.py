"""Warming up: each worker runs its usual requests once, so that the first user need not wait for code and data.

Separate from `serve`, because it knows which requests are usual.
"""

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
from linework.workbench.server.app_state import AppState
from linework.workbench.views.heights import heights_at
from linework.workbench.views.points import points_of_place, section_at
from linework.workbench.views.pyramid import FINEST, IMAGES, TILE_BLOCK_M, MapTile
from linework.workbench.views.tiles import tile_png
from linework.workbench.worker.open import open_in_worker
from linework.workbench.worker.session import SurveySession

#: What a page waits for; it shows "Still ...".
OPENING = "opening the survey for following lines"
PICTURES = "getting the pictures ready"
COMPILING = "compiling the programs for this machine: once after an installation, a minute or two"
#: Points, and distance around a place [m], that are enough to run all code of `warm_up_pictures` once.
_MOST, _AROUND_M = 1000, 4.0
#: Thickness of the section that is made. [m]
_THICKNESS_M = 1.0
#: Steps of `warm_up_pictures`: tiles, points, sections, heights.
STEPS = 4


class StartupProgress:
    """What the server is still preparing.

    Parameters
    ----------
    report
        Called with a description of it whenever that changes, "" when nothing is left.
    """

    def __init__(self, report: Callable[[str], None]) -> None:
        self._report = report
        self._activities: dict[str, str] = {}

    def change(self, name: str, activity: str, is_running: bool) -> None:
        """Note that an activity has begun, or has ended, under a name of its own."""
        before = self.text
        if is_running:
            self._activities[name] = activity
        else:
            self._activities.pop(name, None)
        if self.text != before:
            self._report(self.text)

    @property
    def text(self) -> str:
        """All activities, each once."""
        return "; ".join(sorted(set(self._activities.values())))


async def warm_up(app_state: AppState, progress: StartupProgress) -> None:
    """Open the survey in the tracing worker too, and let both workers run their usual requests."""
    for name, worker in (("pictures", app_state.pictures), ("tracing", app_state.tracing)):
        worker.on_compiling = partial(progress.change, f"{name} compile", COMPILING)
    await asyncio.gather(_tracing(app_state, progress), _pictures(app_state, progress))


async def _tracing(app_state: AppState, progress: StartupProgress) -> None:
    progress.change("tracing", OPENING, True)
    # What is wrong with the survey was reported when it was opened, and a click reports it again
    with contextlib.suppress(LineworkError):
        await app_state.tracing.ask(open_in_worker)
    with contextlib.suppress(LineworkError):
        await warm_up_tracing(app_state)
    progress.change("tracing", OPENING, False)


async def _pictures(app_state: AppState, progress: StartupProgress) -> None:
    path: Any = app_state.facts.path
    if not app_state.facts.n_points or len(path) == 0:
        return
    east, north, _ = path[len(path) // 2]
    progress.change("pictures", PICTURES, True)
    with contextlib.suppress(LineworkError):
        for step in range(STEPS):
            await app_state.pictures.ask(warm_up_pictures, step, (east, north))
    progress.change("pictures", PICTURES, False)


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
