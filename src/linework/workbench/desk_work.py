"""A work at a desk, as the server sees it: what it tells, and how long one waits for that."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import Any

from linework.errors import LineworkError, MachineError

#: What takes longer without a word hangs: the process is killed, and another one started. [s]
SILENT_S = 120.0
#: Compiling the kernels that one of them needs takes no longer, on a slow machine that has more to do. [s]
COMPILE_S = 900.0
#: A work that nobody waits for any more has so long to end.
LEAVE_S = 3.0


class Work:
    """A work that is being done: what it tells comes by ``async for``, what it ends with is `value`.

    Parameters
    ----------
    told
        What its process says: ("told", value), ("compiling", is_so), and at last ("done", value) or ("failed", error).
    say
        Says something to the process.
    kill
        Kills it.
    """

    def __init__(
        self, told: asyncio.Queue[Any], say: Callable[[Any], None], kill: Callable[[], None]
    ) -> None:
        self._told, self._say, self._kill = told, say, kill
        self.value: Any = None
        self.is_over = self.is_compiling = False
        self._limit: asyncio.Timeout | None = None

    def say(self, value: Any) -> None:
        """Say something to the work: it comes out of its next ``yield``."""
        self._say(value)

    def __aiter__(self) -> AsyncIterator[Any]:
        return self

    async def __anext__(self) -> Any:
        kind, value = await self._heard()
        while kind == "compiling":
            self._compiles(value)
            kind, value = await self._heard()
        if kind == "told":
            return value
        self.is_over = True
        if kind == "done":
            self.value = value
            raise StopAsyncIteration
        if isinstance(value, LineworkError):
            raise value
        raise RuntimeError(value)

    async def _heard(self) -> tuple[str, Any]:
        """Wait for the next message; a process that is silent for too long is killed."""
        limit_s = COMPILE_S if self.is_compiling else SILENT_S
        try:
            # Not wait_for: up to Python 3.11 it forgets that it is cancelled where an answer comes at the same time
            async with asyncio.timeout(limit_s):
                message: tuple[str, Any] = await self._told.get()
                return message
        except TimeoutError:
            self._kill()
            self.is_over = True
            raise MachineError(
                f"no answer for {limit_s:.0f} s", where="workbench", advice="try again"
            ) from None

    @asynccontextmanager
    async def leaving(self) -> AsyncIterator[None]:
        """Give the work `LEAVE_S` to end, but not while it compiles: the next would have to begin that anew.

        Raises
        ------
        TimeoutError
            It has not ended.
        """
        async with asyncio.timeout(None) as self._limit:
            self._compiles(self.is_compiling)
            yield

    def _compiles(self, is_so: bool) -> None:
        self.is_compiling = is_so
        if self._limit is not None:
            self._limit.reschedule(None if is_so else asyncio.get_running_loop().time() + LEAVE_S)
