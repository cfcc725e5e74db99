"""Routes for following lines."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from contextlib import suppress
from typing import Any

from fastapi import APIRouter, WebSocket, WebSocketDisconnect

from linework.errors import LineworkError, UsageError
from linework.methods.templates.template import CrossTemplate
from linework.workbench.following.messages import (
    FollowBridge,
    FollowOrder,
    FollowPixel,
    StopFollowing,
    order_of,
    refusal_message,
    stopped_message,
)
from linework.workbench.following.templates import template_of_survey
from linework.workbench.following.traces import INTERRUPT
from linework.workbench.server.app_state import AppState, state_of_socket

follow_router = APIRouter(prefix="/api")


@follow_router.websocket("/follow")
async def follow_lines(socket: WebSocket) -> None:
    """Follow lines as a page orders (its type FollowOrder), and send how they grow (FollowNews).

    A new order of a page cancels its last one; an order of another page is interrupted.
    """
    app_state = state_of_socket(socket)
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
                    await _interrupted(app_state, socket, turn, None if begun.is_set() else ordered)
                continue
            await _cancelled(turn)
            ordered, begun = order, asyncio.Event()
            turn = asyncio.create_task(_followed(app_state, order, socket, begun))
    except (WebSocketDisconnect, KeyError):
        # KeyError: bytes instead of text, which the page does not send
        pass
    finally:
        await _cancelled(turn)


async def _interrupted(
    app_state: AppState, socket: WebSocket, turn: asyncio.Task[None], waits: FollowOrder | None
) -> None:
    """Interrupt a page's line at its next step; an order that still `waits` for the worker is dropped."""
    if waits is None:
        app_state.traces.interrupt()
        return
    await _cancelled(turn)
    with suppress(LineworkError):
        await socket.send_text(dropped_order_message(app_state, waits))


async def _followed(app_state: AppState, order: FollowOrder, socket: WebSocket, begun: asyncio.Event) -> None:
    """Carry out an order and send its messages, or the refusal."""
    try:
        if isinstance(order, FollowBridge):
            app_state.traces.get(order.trace)
        await run_follow_order(app_state, order, socket.send_text, begun)
    except LineworkError as error:
        await socket.send_text(refusal_message(error))


async def _cancelled(turn: asyncio.Task[None] | None) -> None:
    """Cancel the order of a page and wait for it to end."""
    if turn is None:
        return
    turn.cancel()
    with suppress(asyncio.CancelledError, WebSocketDisconnect, RuntimeError):
        await turn


async def run_follow_order(
    app_state: AppState, order: FollowOrder, send: Callable[[str], Awaitable[None]], begun: asyncio.Event
) -> None:
    """Carry out an order in the tracing worker as soon as it is free; its current request is interrupted.

    Parameters
    ----------
    send
        Called with each message for the page.
    begun
        Set when the worker is free.

    Raises
    ------
    LineworkError
        The trace to bridge is no longer kept, or the worker died.
    """
    name = "" if isinstance(order, FollowPixel | StopFollowing) else order.template
    template = await asyncio.to_thread(template_of_survey, app_state, name)
    function, arguments, trace_id = _request_of(app_state, order, template)
    app_state.traces.interrupt()
    async with app_state.tracing.request(function, *arguments, trace_id) as request:
        begun.set()
        with app_state.traces.interruptible(lambda: request.send(INTERRUPT)):
            async for message in request:
                if message.trace is not None:
                    app_state.traces.keep(trace_id, message.trace)
                if message.text:
                    await send(message.text)


def dropped_order_message(app_state: AppState, order: FollowOrder) -> str:
    """Return the message to a page whose order is dropped before the worker is free: a line to bridge stays as it was."""
    if isinstance(order, FollowBridge):
        kept = app_state.traces.get(order.trace)
        return stopped_message(order.trace, kept, distance_m=0.0, is_interrupted=True)
    return refusal_message(
        UsageError("interrupted before it had begun", where="workbench", advice="click again")
    )


async def warm_up_tracing(app_state: AppState) -> None:
    """Follow some lines in the tracing worker, so that the first click need not wait; a click ends that.

    Raises
    ------
    LineworkError
        The survey cannot be used.
    """
    async with app_state.tracing.request("linework.workbench.following.follow:warm_up_in_worker") as request:
        with app_state.traces.interruptible(lambda: request.send(INTERRUPT)):
            async for _ in request:
                pass


def _request_of(
    app_state: AppState, order: FollowOrder, template: CrossTemplate | None
) -> tuple[str, tuple[Any, ...], str]:
    """Return the name of the function of an order, its arguments, and the id of its trace."""
    assert not isinstance(order, StopFollowing)
    if isinstance(order, FollowBridge):
        end = ("start", "end").index(order.end)
        return (
            "linework.workbench.following.follow:bridge_in_worker",
            (app_state.traces.get(order.trace), end, template),
            order.trace,
        )
    if isinstance(order, FollowPixel):
        return (
            "linework.workbench.following.follow:follow_image_in_worker",
            (order,),
            app_state.traces.new_id(),
        )
    return (
        "linework.workbench.following.follow:follow_in_worker",
        (order, template),
        app_state.traces.new_id(),
    )
