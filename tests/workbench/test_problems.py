"""What goes wrong, as the page is told of it."""

from __future__ import annotations

import asyncio
from pathlib import Path

import httpx
import pytest

from linework import errors
from linework.errors import InputError, LineworkError, MachineError, RefusedPickError, StaleError
from linework.workbench.server.app import create_app
from linework.workbench.server.guard import Guard
from linework.workbench.server.problems import FAULT, PROBLEMS, STATUS_OF, hide_paths, status_and_message
from linework.workbench.server.sessions import Sessions

PORT = 4711


def test_every_error_has_a_status():
    leaves = {
        leaf for leaf in vars(errors).values() if isinstance(leaf, type) and issubclass(leaf, LineworkError)
    } - {LineworkError}
    assert set(STATUS_OF) == leaves
    assert set(STATUS_OF.values()) <= set(PROBLEMS)
    assert status_and_message(LineworkError("x"))[0] == 400


def test_an_error_with_arguments_of_its_own_is_one_line():
    refused = RefusedPickError("no line", "at (1, 2)", where="a", advice="click beside it", works=(3.0, 4.0))
    assert status_and_message(refused) == (422, "a: no line at (1, 2). Click beside it.")


@pytest.mark.parametrize(
    ("error", "status", "line"),
    [
        (InputError("empty file", where=Path("/data/me/a.laz"), advice="copy it again"), 422,
         "a.laz: empty file. Copy it again."),
        (StaleError("line x has changed", where="lines", advice="look again"), 412,
         "lines: line x has changed. Look again."),
        (MachineError("no space left on /home/me/data: 0 bytes"), 503, "no space left on data: 0 bytes."),
        (InputError("tile 3: '/data/a b/c.laz' and /data/d/e.laz differ"), 422, "tile 3: 'a b/c.laz' and e.laz differ."),
    ],
)  # fmt: skip
def test_one_line_without_paths(error, status, line):
    assert status_and_message(error) == (status, line)


@pytest.mark.parametrize(
    "text",
    [
        "points/m²",
        "12/30 tiles",
        "and/or",
        "http://127.0.0.1:8000/x",
        "left/000.png is missing",
        "a / b",
        "/api",
    ],
)
def test_what_is_no_path_stays(text):
    assert hide_paths(text) == text


def test_a_fault_of_ours_is_told_without_what_it_is():
    """J17: the page hears that there is one, the log what it is; once."""
    app, faults = create_app(None), []

    @app.get("/api/bug")
    async def bug() -> None:
        raise ZeroDivisionError("/home/me/secret")

    @app.get("/api/own")
    async def own() -> None:
        raise InputError("no such thing", where="/home/me/secret/a.laz")

    sessions = Sessions(PORT)
    cookie = f"{sessions.cookie_name}={sessions.enter(sessions.token)}"
    guard = Guard(app, sessions, PORT, {}, faults.append)

    async def ask(path: str) -> httpx.Response:
        transport = httpx.ASGITransport(guard)
        url = f"http://127.0.0.1:{PORT}"
        async with httpx.AsyncClient(transport=transport, base_url=url, headers={"Cookie": cookie}) as client:
            return await client.get(path)

    answer = asyncio.run(ask("/api/bug"))
    assert answer.status_code == 500
    assert answer.json() == {"problem": FAULT, "status": 500}
    assert answer.headers["cache-control"] == "no-store"
    assert [str(fault) for fault in faults] == ["/home/me/secret"]
    told = asyncio.run(ask("/api/own"))
    assert told.json() == {"problem": "a.laz: no such thing.", "status": 422}
    assert len(faults) == 1
    assert asyncio.run(ask("/api/nothing")).json()["status"] == 404
