"""Tasks in processes that die, hang and fail: each costs its own task, by name."""

import ctypes
import os
import queue
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from linework.errors import MachineError
from linework.processes import executors, pool
from linework.processes.executors import Serial, Threads
from linework.processes.pool import Processes

HERE = Path(__file__).parent
WORK = """
import os, signal, time
from linework.errors import MachineError

def work(task):
    if task.startswith("signal"):
        os.kill(os.getpid(), int(task.split()[1]))
    if task == "once":  # dies the first time only
        if not os.path.exists(os.environ["DIED"]):
            open(os.environ["DIED"], "w").close()
            os._exit(7)
    if task == "leave":
        os._exit(0)
    if task == "hang":
        time.sleep(60)
    if task == "stop":
        os.kill(os.getpid(), signal.SIGSTOP)
    if task == "fail":
        raise KeyError("x")
    if task == "eat":
        raise MemoryError
    if task == "full":
        raise MachineError("cannot be written: no space", where="tile", advice="free some")
    if task == "pid":
        return os.getpid()
    return task.upper()
"""


@pytest.fixture
def work(tmp_path, monkeypatch):
    (tmp_path / "some_work.py").write_text(WORK)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path), prepend=os.pathsep)
    monkeypatch.setenv("DIED", str(tmp_path / "died"))
    monkeypatch.syspath_prepend(str(tmp_path))
    sys.modules.pop("some_work", None)
    import some_work

    return some_work.work


@pytest.fixture(params=["forked", "started"])
def modules(request, monkeypatch):
    """Return what workers load: they are forked from one that has loaded it, or started where that cannot be."""
    monkeypatch.setattr(pool, "can_fork", lambda: request.param == "forked")
    return ("linework.errors",)


def outcomes(executor, work, tasks):
    return {o.task: (o.receipt, o.problem) for o in executor.run(work, tasks)}


def test_what_dies_or_fails_costs_its_own_task(work, modules):
    tasks = [
        "a",
        f"signal {signal.SIGKILL:d}",
        "b",
        f"signal {signal.SIGSEGV:d}",
        "leave",
        "fail",
        "once",
        "c",
        "eat",
    ]
    with Processes(2, modules=modules) as executor:
        found = outcomes(executor, work, tasks)
    assert set(found) == set(tasks)
    assert [found[task] for task in ("a", "b", "c")] == [("A", ""), ("B", ""), ("C", "")]
    assert found["once"] == ("ONCE", ""), "a task that died once is tried again"
    assert found["signal 9"] == (None, "the worker died (SIGKILL)")
    assert found["signal 11"] == (None, "the worker died (SIGSEGV)")
    assert found["leave"] == (None, "the worker died (exit code 0)")
    assert found["fail"] == (None, "KeyError: 'x'")
    assert found["eat"] == (None, "out of memory")


@pytest.mark.parametrize("task", ["hang", "stop"])
def test_what_hangs_is_given_up(work, modules, task):
    with Processes(2, modules=modules) as executor:
        assert len(outcomes(executor, work, ["b", "c"])) == 2
        executor._limit_s = 0.7  # once they are there: tasks take time alone
        found = outcomes(executor, work, [task, "a"])
    assert found == {task: (None, "the worker hung (no answer for 0.7 s)"), "a": ("A", "")}


@pytest.mark.parametrize("make", [Serial, lambda: Threads(2), lambda: Processes(1)])
def test_a_full_disk_ends_the_run_and_leaves_no_process(work, make):
    executor = make()
    with pytest.raises(MachineError, match=r"tile: cannot be written: no space. Free some."):
        outcomes(executor, work, ["a", "full", "b"])
    if isinstance(executor, Processes):
        executor.__exit__(None, None, None)


def test_the_order_of_tasks_and_the_number_of_processes_change_nothing(work):
    tasks = [f"task {i}" for i in range(20)]
    with Processes(2, modules=["linework.errors"]) as executor:
        assert outcomes(executor, work, tasks) == outcomes(Serial(), work, tasks[::-1])
    assert outcomes(Threads(2), work, tasks) == outcomes(Serial(), work, tasks[::-1])


def test_what_fails_in_a_thread_costs_its_own_task(work):
    found = outcomes(Threads(2), work, ["a", "fail", "eat", "b"])
    assert found == {
        "a": ("A", ""), "b": ("B", ""), "fail": (None, "KeyError: 'x'"), "eat": (None, "out of memory"),
    }  # fmt: skip


def test_threads_do_tasks_at_the_same_time():
    both = threading.Barrier(2, timeout=60.0)
    assert [o.problem for o in Threads(2).run(lambda _: both.wait() < 2, ["a", "b"])] == ["", ""]


def test_a_task_at_which_the_interpreter_failed_is_done_once_more():
    """CPython 3.11 fails at parsing Python in two threads at once (python/cpython#106905)."""
    done: list[str] = []

    def failing(task):
        done.append(task)
        if done.count(task) <= len(task):
            raise SystemError("AST constructor recursion depth mismatch")
        return task

    (once,) = Serial().run(failing, ["a"])
    (twice,) = Serial().run(failing, ["bb"])
    assert (once.receipt, once.problem) == ("a", "")
    assert twice.problem.startswith("SystemError: ")
    assert done == ["a", "a", "bb", "bb"]


def test_threads_end_with_a_run_that_ends_early():
    begun, before = threading.Event(), threading.active_count()

    def work(task):
        begun.set()
        while task == "forever":
            time.sleep(0.001)
        begun.wait()
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        list(Threads(2).run(work, ["forever", "interrupted"]))
    assert threading.active_count() == before


def test_threads_whose_tasks_are_done_are_not_stopped(monkeypatch):
    # Stopped as it ends, a thread prints a traceback
    do_tasks, stopped, may_end, looked_at = executors._do_tasks, [], threading.Event(), []

    def ending_late(*given):
        do_tasks(*given)
        may_end.wait()

    class Ending(threading.Thread):
        def join(self, timeout=None):
            # Whether it has to be stopped was decided while it was alive
            looked_at.append(may_end.is_set() or self.is_alive())
            may_end.set()
            super().join(timeout)

    monkeypatch.setattr(executors, "_do_tasks", ending_late)
    monkeypatch.setattr(executors.threading, "Thread", Ending)
    monkeypatch.setattr(executors.ctypes.pythonapi, "PyThreadState_SetAsyncExc", lambda *a: stopped.append(a))
    list(Threads(2).run(len, ["a", "b"]))
    assert looked_at == [True, True]
    assert stopped == []


@pytest.mark.parametrize("given", ["", ", modules=['linework.errors']"])
def test_processes_end_with_their_parent_however_it_ends(work, tmp_path, given):
    script = tmp_path / "parent.py"
    script.write_text(
        "import some_work, sys, time\n"
        "from linework.processes.pool import Processes\n"
        f"executor = Processes(2{given})\n"
        "pids = [o.receipt for o in executor.run(some_work.work, ['pid'])]\n"
        "print(*[w.pid for w in executor._workers], flush=True)\n"
        "time.sleep(3600)\n"
    )
    with subprocess.Popen([sys.executable, script], stdout=subprocess.PIPE, text=True) as parent:
        assert parent.stdout is not None
        pids = [int(word) for word in parent.stdout.readline().split()]
        parent.send_signal(signal.SIGKILL)
    assert len(pids) == 2
    deadline = time.monotonic() + 120.0
    while any(map(_lives, pids)) and time.monotonic() < deadline:
        time.sleep(0.02)
    assert not any(map(_lives, pids))


WHO = """
import os, sys, threading

PARENT = os.getpid()
LOADED = []
# As a library's thread would be there before anything is forked
if os.environ.get("THREAD"):
    threading.Thread(target=threading.Event().wait, daemon=True).start()

def prepare(*words):
    LOADED.extend(words)

def who(task):
    return os.getpid(), os.getppid(), PARENT, LOADED
"""


@pytest.fixture
def loaded_work(work, tmp_path, monkeypatch):
    (tmp_path / "loaded_work.py").write_text(WHO)
    sys.modules.pop("loaded_work", None)
    import loaded_work

    yield loaded_work
    sys.modules.pop("loaded_work", None)


def test_what_workers_load_is_loaded_once(loaded_work):
    with Processes(2, modules=["loaded_work"], prepare=["loaded_work:prepare", "a", "b"]) as executor:
        found = [o.receipt for o in executor.run(loaded_work.who, range(20))]
    for pid, server, loader, prepared in found:
        assert loader == server != pid
        assert server != os.getpid()
        assert prepared == ["a", "b"]


def test_a_process_with_threads_is_not_forked(loaded_work, monkeypatch):
    monkeypatch.setenv("THREAD", "1")
    with Processes(2, modules=["loaded_work"]) as executor:
        found = [o.receipt for o in executor.run(loaded_work.who, range(4))]
    for pid, server, loader, _ in found:
        assert loader == pid, "it has loaded for itself"
        assert server != os.getpid()


@pytest.mark.parametrize("when", ["before", "after"])
def test_tasks_are_done_when_the_process_that_was_forked_is_killed(work, when):
    with Processes(2, modules=["linework.errors"]) as executor:
        if when == "after":
            assert outcomes(executor, work, ["a"]) == {"a": ("A", "")}
        os.kill(executor._server._child.pid, signal.SIGKILL)
        assert outcomes(executor, work, ["a", "b"]) == {"a": ("A", ""), "b": ("B", "")}


def test_a_worker_that_replaces_another_loads_for_itself(loaded_work, work):
    with Processes(2, modules=["loaded_work"]) as executor:
        outcomes(executor, work, ["leave", f"signal {signal.SIGKILL:d}"])
        found = [o.receipt for o in executor.run(loaded_work.who, range(2))]
    assert all(server == os.getpid() for _, server, _, _ in found)


def _lives(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def test_processes_are_gone_when_the_executor_is_left(work, modules):
    with Processes(2, modules=modules) as executor:
        (pid,) = (o.receipt for o in executor.run(work, ["pid"]))
        assert _lives(pid)
        assert pid != os.getpid()
    assert not _lives(pid)


def test_a_survey_of_one_tile_gets_threads_unless_own_code_is_called():
    from linework.runs.opened.store import executor_for
    from linework.runs.settings import RunSettings

    few = RunSettings().tiling.max_points
    for n_workers, own, kind in ((2, False, Threads), (2, True, Serial), (1, False, Serial)):
        with executor_for(few, n_workers, RunSettings(), has_own_code=own) as executor:
            assert type(executor) is kind


def test_a_thread_that_is_stopped_while_it_ends_says_nothing():
    ending = executors._Ending(threading.Lock(), set())
    queues = queue.SimpleQueue(), queue.SimpleQueue()
    thread = threading.Thread(target=executors._do_tasks, args=(abs, *queues, ending))
    with ending.lock:
        thread.start()
        # It has no task, and waits to say that it ends
        thread.join(0.2)
        stopped = ctypes.c_ulong(thread.ident), ctypes.py_object(executors._StoppedError)
        assert ctypes.pythonapi.PyThreadState_SetAsyncExc(*stopped) == 1
    # An exception that it left unhandled would be a warning, so a failure
    thread.join()
    assert queues[1].empty()
