"""One turn at the tracing desk: a line is followed, its traces are kept, its growth is told."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

from linework.errors import UsageError
from linework.workbench.bench import Bench
from linework.workbench.following import (
    INTERRUPT,
    bridge_at_desk,
    follow_at_desk,
    follow_image_at_desk,
)
from linework.workbench.following_orders import Bridge, Interrupt, Order, Pick
from linework.workbench.following_warm import warm_at_desk
from linework.workbench.following_words import refused_text, stopped_text


async def follow(
    bench: Bench, order: Order, tell: Callable[[str], Awaitable[None]], begun: asyncio.Event
) -> None:
    """Do an order at the tracing desk as soon as that is free; what is done there now is interrupted.

    Parameters
    ----------
    tell
        Called with what the page is to be told.
    begun
        Set when the desk is free.

    Raises
    ------
    LineworkError
        The trace to bridge is not kept any more, or the desk's process died.
    """
    work, arguments, trace_id = _work_of(bench, order)
    bench.traces.interrupt()
    async with bench.tracing.doing(work, *arguments, trace_id) as steps:
        begun.set()
        with bench.traces.interruptible(lambda: steps.say(INTERRUPT)):
            async for told in steps:
                if told.trace is not None:
                    bench.traces.keep(trace_id, told.trace)
                if told.text:
                    await tell(told.text)


def not_begun(bench: Bench, order: Order) -> str:
    """Return what a page is told whose order is dropped before the desk is free: a line to bridge is as it was."""
    if isinstance(order, Bridge):
        kept = bench.traces.get(order.trace)
        return stopped_text(order.trace, kept, distance_m=0.0, is_interrupted=True)
    return refused_text(
        UsageError("interrupted before it had begun", where="workbench", advice="click again")
    )


async def warm(bench: Bench) -> None:
    """Follow some line at the tracing desk, so that the first click finds everything at hand; a click ends it.

    Raises
    ------
    LineworkError
        The survey cannot be used.
    """
    async with bench.tracing.doing(warm_at_desk) as steps:
        with bench.traces.interruptible(lambda: steps.say(INTERRUPT)):
            async for _ in steps:
                pass


def _work_of(bench: Bench, order: Order) -> tuple[Callable[..., Any], tuple[Any, ...], str]:
    """Return the work of an order, what it is given, and the id of its trace."""
    assert not isinstance(order, Interrupt)
    if isinstance(order, Bridge):
        end = ("start", "end").index(order.end)
        return bridge_at_desk, (bench.traces.get(order.trace), end), order.trace
    work = follow_at_desk if isinstance(order, Pick) else follow_image_at_desk
    return work, (order,), bench.traces.new_id()
