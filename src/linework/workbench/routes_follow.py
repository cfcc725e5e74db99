"""Routes of the workbench: follow."""

from __future__ import annotations

import asyncio
from contextlib import suppress

from fastapi import APIRouter, WebSocket, WebSocketDisconnect

from linework.errors import LineworkError, UsageError
from linework.workbench.bench import Bench, bench_of_socket
from linework.workbench.following_orders import Bridge, Interrupt, Order, order_of
from linework.workbench.following_turn import follow, not_begun
from linework.workbench.following_words import refused_text

router = APIRouter(prefix="/api")


@router.websocket("/follow")
async def follow_lines(socket: WebSocket) -> None:
    """Follow lines as the page orders (documents FollowOrder), and tell how they grow (FollowNews).

    A new order of a page leaves what it had ordered before; whatever another page had ordered is interrupted.
    """
    bench = bench_of_socket(socket)
    await socket.accept()
    turn: asyncio.Task[None] | None = None
    ordered: Order | None = None
    begun = asyncio.Event()
    try:
        while True:
            text = await socket.receive_text()
            try:
                order = order_of(text)
            except UsageError as error:
                await socket.send_text(refused_text(error))
                continue
            if isinstance(order, Interrupt):
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
    bench: Bench, socket: WebSocket, turn: asyncio.Task[None], waits: Order | None
) -> None:
    """Interrupt a page's line at its next step; an order that still `waits` for the desk is dropped."""
    if waits is None:
        bench.traces.interrupt()
        return
    await _left(turn)
    with suppress(LineworkError):
        await socket.send_text(not_begun(bench, waits))


async def _followed(bench: Bench, order: Order, socket: WebSocket, begun: asyncio.Event) -> None:
    """Do what is ordered and tell it; what cannot be done is told too."""
    try:
        if isinstance(order, Bridge):
            bench.traces.get(order.trace)
        await follow(bench, order, socket.send_text, begun)
    except LineworkError as error:
        await socket.send_text(refused_text(error))


async def _left(turn: asyncio.Task[None] | None) -> None:
    """End what a page does not wait for any more."""
    if turn is None:
        return
    turn.cancel()
    with suppress(asyncio.CancelledError, WebSocketDisconnect, RuntimeError):
        await turn
