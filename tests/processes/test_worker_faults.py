"""Workers that die at random, stall, come late or are of another version, and what listens: a run on several processes.

There is no cluster: workers are processes of this machine. What would happen to a cluster is tried on them.
"""

from __future__ import annotations

import os
import signal
import struct
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from tests.processes.test_pool import _lives, modules

from linework.processes.child import Child, ChildEndedError
from linework.processes.executors import Serial
from linework.processes.forked import ForkServer
from linework.processes.pool import Processes

#: What the processes of the pool run.
WORKER = "linework.processes.pool:tile_worker_main"
WORK = """
import os, pickle, random, resource, signal, struct, time
from pathlib import Path

from linework.processes import forked

NOTES = Path(os.environ.get("LINEWORK_TEST_NOTES", "."))


def square(task):
    return task * task


def mortal(task):
    # Each task kills its process once, in one of three ways, two tasks in three
    note = NOTES / f"{task}"
    with note.open("a") as file:
        file.write("x")
    if task % 3 and note.stat().st_size == 1:
        (lambda: os.kill(os.getpid(), signal.SIGKILL), lambda: os.kill(os.getpid(), signal.SIGSEGV),
         lambda: os._exit(3))[task % 7 % 3]()
    return task * task


def poison(task):
    with (NOTES / f"{task}").open("a") as file:
        file.write("x")
    if task == 5:
        os.kill(os.getpid(), signal.SIGSEGV)
    return task * task


def eat(task):
    if task == 1:
        import numpy
        used = int(Path("/proc/self/statm").read_text().split()[0]) * 4096
        resource.setrlimit(resource.RLIMIT_AS, (used + (64 << 20),) * 2)
        return numpy.ones(1 << 30).sum()
    return task * task


def late(task):
    # Thought dead: it stops, is given up, and may not come back with a second result
    with (NOTES / f"{task}").open("a") as file:
        file.write(f"{os.getpid()} ")
    if task == 0 and len((NOTES / "0").read_text().split()) == 1:
        os.kill(os.getpid(), signal.SIGSTOP)
    return task * task


def unreachable(task):
    return Path(task).read_bytes()


def half_an_answer(channel, arguments):
    channel.receive()
    channel._socket.sendall(struct.pack("!Q", 1000) + b"half")
    if arguments == ["cut"]:
        os._exit(0)
    time.sleep(60)


def nonsense(channel, arguments):
    channel.receive()
    channel._socket.sendall(struct.pack("!Q", 1 << 62))
    time.sleep(60)


def talk_nonsense(what):
    # The process that workers are forked from says how they end, until its memory is damaged
    def tell(channel, handles):
        channel._socket.sendall({"length": struct.pack("!Q", 1 << 62), "words": struct.pack("!Q", 3) + b"abc",
                                 "number": struct.pack("!Q", len(pickle.dumps(7))) + pickle.dumps(7)}[what])
        time.sleep(60)

    forked._tell = tell
"""


@pytest.fixture
def work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Return a module of work that workers can import, which notes what was run in tmp_path/notes."""
    (tmp_path / "notes").mkdir()
    (tmp_path / "faulty_work.py").write_text(WORK)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path), prepend=os.pathsep)
    monkeypatch.setenv("LINEWORK_TEST_NOTES", str(tmp_path / "notes"))
    monkeypatch.syspath_prepend(str(tmp_path))
    sys.modules.pop("faulty_work", None)
    import faulty_work

    yield faulty_work
    sys.modules.pop("faulty_work", None)


__all__ = ["modules"]


def outcomes(executor: Any, function: Callable[[Any], Any], tasks: list[Any]) -> list[tuple[Any, Any, str]]:
    return sorted((o.task, o.receipt, o.problem) for o in executor.run(function, tasks))


def test_workers_that_die_at_random_change_nothing(work, tmp_path, modules):
    tasks = list(range(30))
    with Processes(2, modules=modules) as executor:
        found = outcomes(executor, work.mortal, tasks)
    assert found == outcomes(Serial(), work.square, tasks)
    runs = [len((tmp_path / "notes" / str(task)).read_text()) for task in tasks]
    assert runs == [2 if task % 3 else 1 for task in tasks], "each task that died is run once more, no other"


def test_a_task_that_kills_every_worker_fails_alone_by_name(work, tmp_path, modules):
    with Processes(2, modules=modules) as executor:
        found = outcomes(executor, work.poison, list(range(12)))
    assert [(task, problem) for task, _, problem in found if problem] == [(5, "the worker died (SIGSEGV)")]
    assert [(task, receipt) for task, receipt, problem in found if not problem] == [
        (task, task * task) for task in range(12) if task != 5
    ]
    assert len((tmp_path / "notes" / "5").read_text()) == 2
    assert sum(len(p.read_text()) for p in (tmp_path / "notes").iterdir()) == 13, "no neighbour is run again"


def test_workers_that_died_before_any_is_asked_are_all_told_of():
    """What the process they were forked from says of them comes in one piece, of which each takes its own."""
    server = ForkServer(WORKER, 2, modules=["linework.errors"])
    for worker in server.workers:
        os.kill(worker.pid, signal.SIGKILL)
        while Path(f"/proc/{worker.pid}").exists():
            time.sleep(0.01)
    endings = []
    for worker in server.workers:
        with pytest.raises(ChildEndedError) as caught:
            worker.read_object()
        endings.append(str(caught.value.ending))
    end_all(server)
    assert endings == ["died (SIGKILL)"] * 2


@pytest.mark.parametrize("what", ["length", "words", "number"])
def test_workers_end_with_a_process_that_says_nonsense_of_them(work, what):
    server = ForkServer(WORKER, 2, modules=["faulty_work"], prepare=["faulty_work:talk_nonsense", what])
    try:
        dead, other = server.workers
        os.kill(dead.pid, signal.SIGKILL)
        with pytest.raises(ChildEndedError, match=r"^died \(SIGKILL\)$"):
            dead.receive(60.0)
        with pytest.raises(ChildEndedError, match=r"^died \(SIGKILL\)$"):
            other.receive(60.0)
        assert not server.is_running
    finally:
        end_all(server)


def test_processes_that_stand_still_are_ended_all_at_once(work, modules, monkeypatch):
    waits = []
    monkeypatch.setattr(
        Child, "wait", lambda child, real=Child.wait: (waits.append(real(child)), waits[-1])[1]
    )
    with Processes(3, modules=modules) as executor:
        outcomes(executor, work.square, [1, 2, 3])
        pids = [worker.pid for worker in executor._workers]
        for pid in (executor._server._child.pid,) if executor._server else pids:
            os.kill(pid, signal.SIGSTOP)
    assert {str(ending) for ending in waits} == {"died (SIGKILL)"}
    wait_gone(pids)


def end_all(server: ForkServer) -> None:
    """End a process and the workers forked from it, and close their channels."""
    server.end()
    for worker in server.workers:
        worker.end()


def wait_gone(pids: list[int]) -> None:
    """Wait until processes have ended."""
    while any(map(_lives, pids)):
        time.sleep(0.01)


def test_a_worker_without_memory_fails_its_task_by_name(work, modules):
    with Processes(2, modules=modules) as executor:
        found = outcomes(executor, work.eat, [0, 1, 2])
    assert found == [(0, 0, ""), (1, None, "out of memory"), (2, 4, "")]


@pytest.mark.parametrize(
    ("how", "said"), [("stall", "hung (no answer for 0.7 s)"), ("cut", "died (exit code 0)")]
)
def test_half_an_answer_is_waited_for_no_longer_than_the_limit(work, how, said):
    child = Child("faulty_work:half_an_answer", how)
    child.send(b"go")
    start = time.monotonic()
    with pytest.raises(ChildEndedError) as caught:
        # Imports take a while: only an answer that has begun is to be cut short
        child.receive(60.0 if how == "cut" else 0.7)
    assert str(caught.value.ending) == said
    assert time.monotonic() - start < 60.0
    child.end()
    assert not _lives(child.pid)


def test_an_answer_of_absurd_length_is_refused_unread(work):
    child = Child("faulty_work:nonsense", longest_bytes=1 << 20)
    child.send(b"go")
    with pytest.raises(ChildEndedError) as caught:
        child.receive(60.0)
    assert "makes no sense" in str(caught.value.ending)
    child.end()


def test_a_worker_of_another_version_is_named(work, tmp_path, monkeypatch):
    """The worker finds a module of the same name, in which the function is missing."""
    other = tmp_path / "other"
    other.mkdir()
    (other / "faulty_work.py").write_text("VERSION = 2\n")
    monkeypatch.setenv("PYTHONPATH", str(other), prepend=os.pathsep)
    with Processes(1) as executor:
        (found,) = outcomes(executor, work.square, [3])
    assert found[:2] == (3, None)
    assert "cannot be loaded in a worker process" in found[2] and "square" in found[2]


def test_an_input_that_a_worker_cannot_reach_fails_its_task_and_is_named(work, tmp_path):
    gone, here = tmp_path / "mount" / "0.points", tmp_path / "faulty_work.py"
    with Processes(2) as executor:
        found = outcomes(executor, work.unreachable, [str(gone), str(here)])
    assert found[0][1:] == (WORK.encode(), "")
    assert found[1][1] is None
    assert str(gone) in found[1][2] and "No such file" in found[1][2]


def test_a_late_second_result_is_never_taken(work, tmp_path, modules):
    # Long enough for a process to start on a loaded machine
    with Processes(2, modules=modules, limit_s=5.0) as executor:
        found = outcomes(executor, work.late, [0, 1, 2, 3])
        pids = [int(pid) for pid in (tmp_path / "notes" / "0").read_text().split()]
        assert len(pids) == 2
        # Whoever wakes it finds nobody: it was killed when it was given up
        with pytest.raises(ProcessLookupError):
            os.kill(pids[0], signal.SIGCONT)
    assert found == [(task, task * task, "") for task in range(4)]


def test_nothing_listens_while_workers_run(work, modules):
    with Processes(2, modules=modules) as executor:
        outcomes(executor, work.square, [1, 2])
        pids = [os.getpid(), *(worker.pid for worker in executor._workers)]
        before = listening(pids)
    import socket

    with socket.create_server(("127.0.0.1", 0)) as server:
        assert listening([os.getpid()]) >= {("0100007F", server.getsockname()[1])}, "it would be seen"
    assert before == set()


def listening(pids: list[int]) -> set[tuple[str, int]]:
    """Return (address, port) of the TCP sockets on which processes listen."""
    inodes = set()
    for pid in pids:
        for link in Path(f"/proc/{pid}/fd").iterdir():
            try:
                target = str(link.readlink())
            except OSError:
                continue
            if target.startswith("socket:["):
                inodes.add(target[8:-1])
    found = set()
    for table in ("tcp", "tcp6"):
        path = Path(f"/proc/net/{table}")
        for row in path.read_text().splitlines()[1:] if path.exists() else ():
            cells = row.split()
            if cells[3] == "0A" and cells[9] in inodes:
                address, _, port = cells[1].rpartition(":")
                found.add((address, int(port, 16)))
    return found


def test_messages_are_framed_as_the_stalling_worker_does_it():
    """What the tests above send by hand is what a channel sends."""
    from linework.processes.channel import _LENGTH

    assert _LENGTH.format in ("!Q", b"!Q") and struct.calcsize("!Q") == _LENGTH.size
