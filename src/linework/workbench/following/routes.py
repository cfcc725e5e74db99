"""Routes of the workbench: follow."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from contextlib import suppress
from typing import Any

from fastapi import APIRouter, WebSocket, WebSocketDisconnect

from linework.errors import LineworkError, UsageError
from linework.workbench.following.follow import (
    INTERRUPT,
    bridge_in_worker,
    follow_image_in_worker,
    follow_in_worker,
    warm_up_in_worker,
)
from linework.workbench.following.messages import (
    FollowBridge,
    FollowOrder,
    FollowPlace,
    StopFollowing,
    order_of,
    refusal_message,
    stopped_message,
)
from linework.workbench.server.bench import AppState, state_of_socket

follow_router = APIRouter(prefix="/api")


@follow_router.websocket("/follow")
async def follow_lines(socket: WebSocket) -> None:
    """Follow lines as the page orders (documents FollowOrder), and tell how they grow (FollowNews).

    A new order of a page leaves what it had ordered before; whatever another page had ordered is interrupted.
    """
    bench = state_of_socket(socket)
    await socket.accept()
    turn: asyncio.Task[None] | None = None
    ordered: FollowOrder | None = None
    begun = asyncio.Event()
    try:
        while True:
            text = await socket.receive_text()
            try:
                order = order_of(text)
            except UsageError as error:
                await socket.send_text(refusal_message(error))
                continue
            if isinstance(order, StopFollowing):
                if turn is not None and not turn.done():
                    await _interrupted(bench, socket, turn, None if begun.is_set() else ordered)
                continue
            await _left(turn)
            ordered, begun = order, asyncio.Event()
            turn = asyncio.create_task(_followed(bench, order, socket, begun))
    except (WebSocketDisconnect, KeyError):
        # Also when bytes come instead of text: whoever sends them is not the page
        pass
    finally:
        await _left(turn)


async def _interrupted(
    bench: AppState, socket: WebSocket, turn: asyncio.Task[None], waits: FollowOrder | None
) -> None:
    """Interrupt a page's line at its next step; an order that still `waits` for the desk is dropped."""
    if waits is None:
        bench.traces.interrupt()
        return
    await _left(turn)
    with suppress(LineworkError):
        await socket.send_text(dropped_order_message(bench, waits))


async def _followed(bench: AppState, order: FollowOrder, socket: WebSocket, begun: asyncio.Event) -> None:
    """Do what is ordered and tell it; what cannot be done is told too."""
    try:
        if isinstance(order, FollowBridge):
            bench.traces.get(order.trace)
        await run_follow_order(bench, order, socket.send_text, begun)
    except LineworkError as error:
        await socket.send_text(refusal_message(error))


async def _left(turn: asyncio.Task[None] | None) -> None:
    """End what a page does not wait for any more."""
    if turn is None:
        return
    turn.cancel()
    with suppress(asyncio.CancelledError, WebSocketDisconnect, RuntimeError):
        await turn


# One turn at the tracing desk: a line is followed, its traces are kept, its growth is told


async def run_follow_order(
    bench: AppState, order: FollowOrder, tell: Callable[[str], Awaitable[None]], begun: asyncio.Event
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


def dropped_order_message(bench: AppState, order: FollowOrder) -> str:
    """Return what a page is told whose order is dropped before the desk is free: a line to bridge is as it was."""
    if isinstance(order, FollowBridge):
        kept = bench.traces.get(order.trace)
        return stopped_message(order.trace, kept, distance_m=0.0, is_interrupted=True)
    return refusal_message(
        UsageError("interrupted before it had begun", where="workbench", advice="click again")
    )


async def warm_up_tracing(bench: AppState) -> None:
    """Follow some line at the tracing desk, so that the first click finds everything at hand; a click ends it.

    Raises
    ------
    LineworkError
        The survey cannot be used.
    """
    async with bench.tracing.doing(warm_up_in_worker) as steps:
        with bench.traces.interruptible(lambda: steps.say(INTERRUPT)):
            async for _ in steps:
                pass


def _work_of(bench: AppState, order: FollowOrder) -> tuple[Callable[..., Any], tuple[Any, ...], str]:
    """Return the work of an order, what it is given, and the id of its trace."""
    assert not isinstance(order, StopFollowing)
    if isinstance(order, FollowBridge):
        end = ("start", "end").index(order.end)
        return bridge_in_worker, (bench.traces.get(order.trace), end), order.trace
    work = follow_in_worker if isinstance(order, FollowPlace) else follow_image_in_worker
    return work, (order,), bench.traces.new_id()
