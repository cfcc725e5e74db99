"""The main job where modules and functions of Unix are missing: the fallbacks that Windows and macOS use.

What those systems lack is taken away from this one: no test can show what else is different there.
"""

from __future__ import annotations

import contextlib
import os
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest
from tests.scenes.blocked import environment_without, run_linework

from linework.processes import connection
from linework.processes.connection import _Loopback, offer_connection

MODULES = ("fcntl", "resource", "pwd", "grp", "msvcrt")
ATTRIBUTES = (
    "os.fork", "os.preadv", "os.pread", "os.sched_getaffinity", "os.nice", "os.getuid", "os.O_NONBLOCK", "os.O_CLOEXEC",
    "os.O_DIRECTORY", "socket.AF_UNIX", "select.poll", "select.epoll", "signal.SIGHUP",
)  # fmt: skip


@pytest.fixture(scope="module")
def elsewhere(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Return the environment of a Python without what only Unix has."""
    return environment_without(tmp_path_factory.mktemp("elsewhere"), MODULES, ATTRIBUTES)


@pytest.fixture(scope="module")
def survey(tmp_path_factory: pytest.TempPathFactory, elsewhere: dict[str, str]) -> Path:
    """Return a folder with a simulated street of 40 m and a run file that splits it into tiles."""
    folder = tmp_path_factory.mktemp("street")
    made = run_linework(
        elsewhere, "simulate", "-o", folder / "survey", "--road", "urban", "--length-m", 40, "--points-per-m", 2000,
        "--no-images",
    )  # fmt: skip
    assert made.returncode == 0, made.stderr
    (folder / "run.toml").write_text("[tiling]\nmax_points = 30000\n")
    return folder


def test_lines_are_the_same_byte_for_byte_with_two_workers(survey, elsewhere):
    content = []
    for name, environment in (("here", dict(os.environ)), ("there", elsewhere)):
        found = run_linework(
            environment, "extract", survey / "survey" / "points", "-o", survey / "lines.geojson", "--workers", 2,
            "--config", survey / "run.toml", "--work", survey / f"work-{name}", "--overwrite",
        )  # fmt: skip
        assert found.returncode == 0, found.stderr
        content.append((survey / "lines.geojson").read_bytes())
    assert content[0] == content[1]
    assert content[0].count(b'"LineString"') > 5


HOLD = """
import sys
from pathlib import Path
from types import SimpleNamespace
from linework.errors import OutputExistsError
from linework.files.output.locks import fcntl, hold_lock, reserve_output
assert fcntl is None
how, path = sys.argv[1:]
busy = OutputExistsError("held by another")
held = reserve_output(Path(path)) if how == "output" else hold_lock(Path(path), busy, shared=how == "shared")
try:
    with held:
        print("held", flush=True)
        sys.stdin.read()
except OutputExistsError as error:
    print(error.problem, flush=True)
"""


@pytest.fixture
def holders(elsewhere: dict[str, str]) -> Iterator[list[subprocess.Popen[str]]]:
    """Return a list of processes that hold locks; they are ended with the test."""
    processes: list[subprocess.Popen[str]] = []
    yield processes
    for process in processes:
        process.kill()
        process.communicate()


def start(holders, environment, how: str, path: Path) -> tuple[subprocess.Popen[str], str]:
    """Start a process that takes a lock, and return it with what it says of that."""
    process = subprocess.Popen(
        [sys.executable, "-c", HOLD, how, str(path)],
        env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    holders.append(process)
    assert process.stdout is not None
    return process, process.stdout.readline().strip()


def test_an_output_that_another_run_writes_is_refused_until_that_ends(survey, elsewhere, holders):
    output = survey / "taken.geojson"
    holder, said = start(holders, elsewhere, "output", output)
    assert said == "held"
    refused = run_linework(elsewhere, "extract", survey / "survey" / "points", "-o", output)
    assert refused.returncode != 0
    assert "another run is writing it" in refused.stderr
    holder.kill()
    holder.communicate()
    assert start(holders, elsewhere, "output", output)[1] == "held"


def test_shared_locks_are_shared_and_keep_others_out(tmp_path, elsewhere, holders):
    lock = tmp_path / "store.lock"
    sharing = [start(holders, elsewhere, "shared", lock) for _ in range(2)]
    assert [said for _, said in sharing] == ["held", "held"]
    assert start(holders, elsewhere, "alone", lock)[1] == "held by another"
    for process, _ in sharing:
        process.kill()
        process.communicate()
    assert start(holders, elsewhere, "alone", lock)[1] == "held"
    assert start(holders, elsewhere, "shared", lock)[1] == "held by another"


# The connection with a child

CHILD = """
import sys
from linework.processes.connection import connect_to_parent
connected = connect_to_parent(sys.argv[1])
connected.sendall(b"it is me")
connected.recv(1)
"""


def test_a_child_is_told_from_a_stranger_by_the_secret():
    offer = _Loopback()
    try:
        address = ("127.0.0.1", int(offer.address.rpartition(":")[2]))
        stranger = socket.create_connection(address)
        stranger.sendall(b"x" * 32)
        process = subprocess.Popen([sys.executable, "-c", CHILD, offer.address], **offer.popen)
        with offer.accept(process) as connected, stranger:
            connected.settimeout(60)
            assert connected.recv(100) == b"it is me"
        assert process.wait(60) == 0
    finally:
        offer.close()


@pytest.mark.parametrize("n_strangers", [0, 2])
def test_a_child_that_ends_before_it_connects_leaves_a_connection_at_its_end(n_strangers):
    """Also where other programs have taken all places of the queue: nothing waits for one to be free."""
    offer = _Loopback()
    address = ("127.0.0.1", int(offer.address.rpartition(":")[2]))
    with contextlib.ExitStack() as held:
        held.callback(offer.close)
        process = subprocess.Popen([sys.executable, "-c", "pass"], **offer.popen)
        process.wait(60)
        for _ in range(n_strangers):
            held.enter_context(socket.create_connection(address))
        held.callback(socket.setdefaulttimeout, socket.getdefaulttimeout())
        socket.setdefaulttimeout(2.0)
        with offer.accept(process) as connected:
            assert connected.recv(1) == b""


def test_children_of_windows_connect_by_loopback(monkeypatch):
    monkeypatch.setattr(connection, "os", SimpleNamespace(name="nt"))
    assert hasattr(socket, "AF_UNIX")
    offer = offer_connection()
    offer.close()
    assert isinstance(offer, _Loopback)


WATCHING = """
import socket, sys, time
from linework.processes import system
system._ENDS_WITH_PARENT = False
connected = socket.create_connection(("127.0.0.1", int(sys.argv[1])))
system.watch_parent(connected)
connected.sendall(b"x")
time.sleep(600)
"""


def test_a_child_ends_with_the_connection_where_the_system_does_not_end_it():
    with socket.create_server(("127.0.0.1", 0)) as listener:
        process = subprocess.Popen([sys.executable, "-c", WATCHING, str(listener.getsockname()[1])])
        connected, _ = listener.accept()
        with connected:
            assert connected.recv(1) == b"x"
        assert process.wait(60) == 1
