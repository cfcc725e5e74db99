"""Tiles that nobody has asked for yet: made at the desk of pictures while it has nothing else to do."""

from __future__ import annotations

import asyncio
import time
from contextlib import suppress

from linework.errors import LineworkError
from linework.workbench.bench import Bench
from linework.workbench.pictures import prepare_tiles

#: Nobody has asked for so long: then the desk is idle. [s]
IDLE_S = 0.3
#: Pages are told how far it is so often. [s]
TOLD_S = 1.0


class Ahead:
    """Makes all tiles of a survey, one by one, whenever nobody asks for a picture.

    Pages are told ``{"type": "pictures", "done": n, "total": m}``: when all are there, also those of the coarse tiles
    that were shown in part are whole.
    """

    def __init__(self, bench: Bench) -> None:
        self._bench = bench
        self._task: asyncio.Task[None] | None = None
        self._asked_s = 0.0
        #: Held by whoever asks for a tile; the others wait.
        self.turn = asyncio.Lock()

    def asked(self) -> None:
        """Note that somebody asks now; the first who asks starts it."""
        self._asked_s = time.monotonic()
        if self._task is None and self._bench.facts.n_points:
            self._task = asyncio.create_task(self._run())

    async def _run(self) -> None:
        told_s, done, total, n_made = 0.0, 0, 1, 0
        # Without them there are pictures all the same: whoever asks for one is told what is wrong
        with suppress(LineworkError, RuntimeError):
            while total:
                while (idle_s := time.monotonic() - self._asked_s) < IDLE_S:
                    await asyncio.sleep(IDLE_S - idle_s)
                before, n_made = total, n_made + 1
                done, total = await self._bench.pictures.ask(prepare_tiles)
                if total and time.monotonic() - told_s >= TOLD_S:
                    told_s = time.monotonic()
                    self._tell(done, total)
            # The last step makes none: of what was there already nobody need be told
            if n_made > 1:
                self._tell(before, before)

    def _tell(self, done: int, total: int) -> None:
        self._bench.hub.tell({"type": "pictures", "done": done, "total": total})
