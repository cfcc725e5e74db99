"""Warming up: both desks do something for nobody, so that whoever asks first need not wait; pages are told of it."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable
from functools import partial
from typing import Any

from linework.errors import LineworkError
from linework.workbench.bench import Bench
from linework.workbench.following_turn import warm
from linework.workbench.opening import open_at_desk
from linework.workbench.pictures_warm import STEPS, warm_pictures

#: What a page waits for, as "Still ..." says it.
OPENING = "opening the survey for following lines"
PICTURES = "getting the pictures ready"
COMPILING = "compiling the programs for this machine: once after an installation, a minute or two"


class Busy:
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


async def warm_up(bench: Bench, busy: Busy) -> None:
    """Open the survey at the tracing desk too, and let both desks run through what they are asked for most."""
    for name, desk in (("pictures", bench.pictures), ("tracing", bench.tracing)):
        desk.on_compiling = partial(busy.change, f"{name} compile", COMPILING)
    await asyncio.gather(_tracing(bench, busy), _pictures(bench, busy))


async def _tracing(bench: Bench, busy: Busy) -> None:
    busy.change("tracing", OPENING, True)
    # What is wrong with the survey was told before; a click would tell it again
    with contextlib.suppress(LineworkError):
        await bench.tracing.ask(open_at_desk)
    with contextlib.suppress(LineworkError):
        await warm(bench)
    busy.change("tracing", OPENING, False)


async def _pictures(bench: Bench, busy: Busy) -> None:
    path: Any = bench.facts.path
    if not bench.facts.n_points or len(path) == 0:
        return
    east, north, _ = path[len(path) // 2]
    busy.change("pictures", PICTURES, True)
    with contextlib.suppress(LineworkError):
        for step in range(STEPS):
            await bench.pictures.ask(warm_pictures, step, (east, north))
    busy.change("pictures", PICTURES, False)
