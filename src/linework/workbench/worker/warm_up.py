"""Warming up: each worker runs its usual requests once, so that the first user need not wait for code and data.

Separate from `serve`, because it knows which requests are usual.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable
from functools import partial
from typing import Any

from linework.errors import LineworkError
from linework.workbench.edits.routes import import_edits
from linework.workbench.following.routes import warm_up_tracing
from linework.workbench.server.app_state import AppState
from linework.workbench.worker.open import open_in_worker

#: Steps of `linework.workbench.worker.usual_pictures.warm_up_pictures`: tiles, points, sections, heights.
USUAL_STEPS = 4
#: What a page waits for; it shows "Still ...".
OPENING = "opening the survey for following lines"
PICTURES = "getting the pictures ready"
COMPILING = "compiling the programs for this machine: once after an installation, a minute or two"


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
    # In a thread: pages are answered meanwhile, and the first edit need not wait
    imports = asyncio.to_thread(import_edits)
    await asyncio.gather(imports, _tracing(app_state, progress), _pictures(app_state, progress))


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
        for step in range(USUAL_STEPS):
            await app_state.pictures.ask(
                "linework.workbench.worker.usual_pictures:warm_up_pictures", step, (east, north)
            )
    progress.change("pictures", PICTURES, False)
