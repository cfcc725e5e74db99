"""Tasks on a Dask cluster: each is done by a process of ours beside the Dask worker that was given it.

The only file that imports Dask. A tile that dies, hangs or takes all memory then costs its own process and not the Dask
worker with all that it holds, and what a process keeps open belongs to one run.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import math
import pickle
import platform
import queue
import re
import threading
import time
import uuid
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from linework.errors import InputError, MachineError, UsageError, argument, needed
from linework.processes.executors import Outcome, Receipt, Task
from linework.processes.pool import LIMIT_S, Processes

#: Time for a scheduler to answer: longer than a machine of a cluster that is busy needs. [s]
_ANSWER_S = 10.0
#: Time for the first worker to come, and for one to come back: batch systems start them within minutes. [s]
_WORKERS_S = 300.0
#: Time for workers that are busy with something else to answer, where others have answered. [s]
_BUSY_S = 30.0
#: How often it is looked whether there still are workers. [s]
_LOOK_S = 5.0
#: Tasks that wait at each thread of the cluster: it never idles, and schedulers that add workers see that they could.
_WAITING = 4
#: A process that no task has needed for so long belongs to a run whose command is gone. [s]
_IDLE_S = 300.0
#: How the scheduler is written: a protocol of Dask, host and port.
_ADDRESS = re.compile(r"(?:tcp|tls|ws|wss|ucx)://\S+:\d{1,5}")
_GO_ON = f"start it again, then run with {argument('resume', True)}: what is finished stays"
#: Futures that have ended, of one call: those that a call has cancelled must not come to the next.
_Ended = queue.SimpleQueue[Any]


@contextlib.contextmanager
def open_client(scheduler: Any, n_workers: int) -> Iterator[Any]:
    """Open a client of a Dask cluster.

    Parameters
    ----------
    scheduler
        ``tcp://HOST:PORT`` or ``tls://HOST:PORT`` (with the certificates of Dask's own configuration); "local": a
        cluster on this machine, for the time of the context; or a `distributed.Client`, which stays open.
    n_workers
        Worker processes of a local cluster.

    Raises
    ------
    UsageError
        It is none of these.
    MachineError
        No scheduler answers there.
    """
    where = argument("scheduler")
    distributed = needed("distributed", "dask", where=where)
    if isinstance(scheduler, distributed.Client):
        yield scheduler
        return
    if not isinstance(scheduler, str) or not (scheduler == "local" or _ADDRESS.fullmatch(scheduler)):
        raise UsageError(
            f"'{scheduler!s:.60}' is not the address of a Dask scheduler", where=where,
            advice="give tcp://HOST:PORT, or local for a cluster on this machine",
        )  # fmt: skip
    # Dask tells its log what it then raises
    log = logging.getLogger("distributed")
    level = log.level
    log.setLevel(logging.CRITICAL + 1)
    try:
        with contextlib.ExitStack() as held:
            if scheduler == "local":
                # On loopback alone, its page too, which takes any free port
                cluster = distributed.LocalCluster(
                    n_workers=n_workers, threads_per_worker=1, host="127.0.0.1", dashboard_address="127.0.0.1:0",
                    silence_logs=logging.CRITICAL,
                )  # fmt: skip
                scheduler = held.enter_context(cluster).scheduler_address
            else:
                _check_answers(distributed, scheduler)
            yield held.enter_context(distributed.Client(scheduler, timeout=_ANSWER_S, set_as_default=False))
    finally:
        log.setLevel(level)


def _check_answers(distributed: Any, address: str) -> None:
    """Refuse an address at which no scheduler answers; a client that gives up would print a traceback of its own.

    Raises
    ------
    MachineError
        The message says what the system, or Dask, said.
    """

    async def ask() -> Any:
        secured = distributed.Security().get_connection_args("client")
        async with distributed.rpc(address, timeout=_ANSWER_S, connection_args=secured) as scheduler:
            return await asyncio.wait_for(scheduler.identity(), _ANSWER_S)

    try:
        # In a thread: that of a notebook has a loop already
        with ThreadPoolExecutor(max_workers=1) as thread:
            kind = thread.submit(asyncio.run, ask()).result().get("type")
        said = "" if kind == "Scheduler" else f"a {kind} answers"
    except Exception as error:
        # Dask adds the object that has tried: "in <...TCPConnector object at 0x...>: ConnectionRefusedError: ..."
        text = " ".join(str(error.__cause__ or error).split())
        said = re.sub(r"^in <[^>]*>: (?:\w+: )?", "", text) or "no answer"
    if said:
        raise MachineError(
            f"no Dask scheduler answers there ({said:.120})", where=address,
            advice="check the address, and that the scheduler is running",
        )  # fmt: skip


class Cluster:
    """Runs tasks on the workers of a Dask cluster (see `linework.processes.executors.Executor`).

    Parameters
    ----------
    client
        A `distributed.Client`.
    check
        Called on each worker before its first task; it raises where the worker must not take part.
    modules
        What the processes import before their first task.
    limit_s
        A task that takes longer is given up and its process killed. [s]

    Raises
    ------
    MachineError
        There are no workers, or `check` has refused one.

    Notes
    -----
    A worker that is lost loses its tasks of the moment: Dask gives them to others, three times as it is configured by
    default. A task that has outlived so many workers is run once more when all others are done, alone: it may have been
    there by chance. What a task writes must be the same whoever writes it, and whole or not at all.
    """

    def __init__(
        self, client: Any, check: Callable[[], None], *, modules: Sequence[str] = (), limit_s: float = LIMIT_S
    ) -> None:
        self._client, self._check = client, pickle.dumps(check)
        self._name = f"linework-{uuid.uuid4().hex}"
        self._how = self._name, tuple(modules), limit_s
        self._n_sent = 0
        try:
            client.wait_for_workers(1, timeout=_WORKERS_S)
        except TimeoutError as error:
            raise MachineError(
                f"no worker within {_WORKERS_S:g} s",
                where=self._address,
                advice="start workers (dask worker)",
            ) from error
        self._check_workers()

    def _check_workers(self) -> None:
        """Check all workers before the run; those that are busy with something else, and later ones, at their first task."""
        ended: _Ended = queue.SimpleQueue()
        asked = {
            self._submit(ended, _nothing, None, workers=[worker], allow_other_workers=False)
            for worker in self._threads()
        }
        is_checked = False
        while asked:
            future = self._next_ended(ended, _BUSY_S if is_checked else _WORKERS_S)
            if future is None:
                break
            asked.discard(future)
            if future.status == "lost" or _has_killed_workers(future):
                continue
            _, problem, _ = self._answer(future)
            if problem:
                raise MachineError(problem, where=self._address)
            is_checked = True
        self._client.cancel(list(asked))
        if not is_checked:
            raise MachineError(
                f"no worker has answered within {_WORKERS_S:g} s", where=self._address,
                advice="wait until they are free, or add some",
            )  # fmt: skip

    @property
    def n_workers(self) -> int:
        """Number of tasks that run at a time: threads of the workers that are there now."""
        return max(sum(self._threads().values()), 1)

    def run(self, work: Callable[[Task], Receipt], tasks: Sequence[Task]) -> Iterator[Outcome[Task, Receipt]]:
        """Yield the outcome of each task as it ends (see `linework.processes.executors.Executor`)."""
        waiting, alone = deque(tasks), deque[Task]()
        running: dict[Any, Task] = {}
        tried: list[Task] = []
        ended: _Ended = queue.SimpleQueue()
        try:
            while waiting or alone or running:
                room = _WAITING * self.n_workers - len(running)
                while waiting and room > 0:
                    task, room = waiting.popleft(), room - 1
                    running[self._submit(ended, work, task)] = task
                if alone and not running:
                    task = alone.popleft()
                    running[self._submit(ended, work, task)] = task
                future = self._next_ended(ended)
                task = running.pop(future)
                if future.status == "lost":  # with the worker that had its receipt; it may be done once more
                    waiting.append(task)
                elif _has_killed_workers(future):
                    if task in tried:
                        yield Outcome(task, None, "its workers were lost, one after the other")
                    else:
                        tried.append(task)
                        alone.append(task)
                else:
                    data, problem, trace = self._answer(future)
                    yield Outcome(task, None if data is None else pickle.loads(data), problem, trace)
        finally:
            if running and self._client.status == "running":
                self._client.cancel(list(running), force=True)

    def close(self) -> None:
        """End the processes of this run on the workers; the cluster and its client stay."""
        with contextlib.suppress(Exception):  # they end by themselves, if later
            self._client.run(end_processes, self._name, on_error="ignore")

    def _submit(self, ended: _Ended, work: Callable[[Task], Receipt], task: Task, **where: Any) -> Any:
        """Send a task as bytes, which neither the scheduler nor the Dask worker opens."""
        self._n_sent += 1
        data = pickle.dumps((self._check, pickle.dumps((work, task), pickle.HIGHEST_PROTOCOL)))
        future = self._client.submit(
            do_on_worker, data, *self._how, key=f"{self._name}-{self._n_sent}", pure=False, **where
        )
        future.add_done_callback(ended.put)
        return future

    def _next_ended(self, ended: _Ended, within_s: float = math.inf) -> Any:
        """Wait for the next task that ends, as long as there are workers; None: none has within a time [s]."""
        start = seen = time.monotonic()
        while (now := time.monotonic()) - start < within_s:
            with contextlib.suppress(queue.Empty):
                return ended.get(timeout=_LOOK_S)
            if self._threads():
                seen = now
            elif now - seen > _WORKERS_S:
                raise MachineError(
                    f"no worker has been there for {_WORKERS_S:g} s", where=self._address, advice=_GO_ON
                )
        return None

    def _answer(self, future: Any) -> tuple[bytes | None, str, str]:
        """Return receipt, problem and traceback of a task that has ended.

        Raises
        ------
        MachineError
            A machine refused, the connection is lost, or a worker does not have this linework.
        """
        if future.status == "cancelled":
            raise self._lost()
        if future.status == "error":
            error = future.exception()
            said = f"({type(error).__name__}: {error!s:.120})"
            if isinstance(error, (ImportError, AttributeError, pickle.UnpicklingError)):
                raise MachineError(
                    f"a worker cannot load linework {said}", where=self._address,
                    advice="install the same version of it on all workers and at the scheduler",
                ) from error  # fmt: skip
            raise MachineError(
                f"a worker failed {said}", where=self._address,
                advice="see the log of the worker, then resume the run",
            ) from error  # fmt: skip
        answer = future.result()
        if isinstance(answer, OSError):
            raise answer
        data, problem, trace = answer
        return data, problem, trace

    def _threads(self) -> dict[str, int]:
        """Return the number of threads of each worker that is there, by its address."""
        try:
            return dict(self._client.nthreads())
        except (OSError, TimeoutError, RuntimeError) as error:
            raise self._lost() from error

    def _lost(self) -> MachineError:
        return MachineError("the connection to the scheduler is lost", where=self._address, advice=_GO_ON)

    @property
    def _address(self) -> str:
        return str(self._client.scheduler.address)


def _has_killed_workers(future: Any) -> bool:
    """Return whether Dask has given a task up, because workers were lost while they had it."""
    return future.status == "error" and type(future.exception()).__name__ == "KilledWorker"


def _nothing(_: None) -> None:
    """Do nothing: for a worker that is only to be checked."""


# What runs on a Dask worker

_free: dict[str, list[tuple[Processes, threading.Timer]]] = {}
_lock = threading.Lock()


def do_on_worker(
    data: bytes, run: str, modules: tuple[str, ...], limit_s: float
) -> tuple[bytes | None, str, str] | OSError:
    """Do a task in a process that this Dask worker keeps for a run; return receipt, problem and traceback.

    Parameters
    ----------
    data
        Check and task, as bytes.
    run
        Name of the run.

    Returns
    -------
    A refusal of the machine instead, which ends the run.
    """
    process = _taken(run) or Processes(1, modules=modules, limit_s=limit_s)
    try:
        (outcome,) = process.run(_do_sent, [data])
    except OSError as refusal:
        process.__exit__(None, None, None)
        return refusal
    except BaseException:
        process.__exit__(None, None, None)
        raise
    _give_back(run, process)
    return outcome.receipt, outcome.problem, outcome.trace


def _do_sent(data: bytes) -> bytes:
    """Check this machine and do a task; runs in a process beside the Dask worker."""
    check, sent = pickle.loads(data)
    # First, and by itself: a task of another version may not even load
    try:
        refuse_to_differ = pickle.loads(check)
    except Exception as error:
        raise MachineError(
            f"the worker there has another linework ({type(error).__name__}: {error!s:.120})", where=platform.node(),
            advice="install the same version on all workers",
        ) from error  # fmt: skip
    refuse_to_differ()
    try:
        work, task = pickle.loads(sent)
    except Exception as error:  # of the user: a module that is not there
        raise InputError(f"cannot be loaded on a worker: {type(error).__name__}: {error}") from error
    return pickle.dumps(work(task), pickle.HIGHEST_PROTOCOL)


def _taken(run: str) -> Processes | None:
    with _lock:
        if not _free.get(run):
            return None
        process, timer = _free[run].pop()
    timer.cancel()
    return process


def _give_back(run: str, process: Processes) -> None:
    timer = threading.Timer(_IDLE_S, end_processes, [run])
    timer.daemon = True
    timer.start()
    with _lock:
        _free.setdefault(run, []).append((process, timer))


def end_processes(run: str) -> None:
    """End the idle processes that this Dask worker keeps for a run."""
    with _lock:
        held = _free.pop(run, [])
    for process, timer in held:
        timer.cancel()
        process.__exit__(None, None, None)
