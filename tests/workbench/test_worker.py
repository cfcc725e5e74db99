"""Workers: requests that are run, cancelled and killed, and processes that die."""

import asyncio
import os
import platform
import threading
from pathlib import Path

import numpy as np
import pytest
from tests.workbench import worker_requests as requests

from linework.errors import InputError, MachineError
from linework.workbench.worker import conversation
from linework.workbench.worker.conversation import SurveyWorker, start_worker_process
from linework.workbench.worker.order import SurveyOrder


@pytest.fixture(autouse=True)
def _requests_are_found(monkeypatch):
    """Let the worker process import the requests of these tests."""
    root = str(Path(__file__).parents[2])
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([root, *filter(None, [os.environ.get("PYTHONPATH")])]))


def in_worker(scene):
    """Run a coroutine function with a worker, for a time that no wait for a lost message fits into."""

    async def running():
        worker = SurveyWorker(SurveyOrder((Path("nowhere"),)))
        try:
            async with asyncio.timeout(60.0):
                return await scene(worker)
        finally:
            worker.kill()

    return asyncio.run(running())


def is_running(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def test_requests_run_one_after_the_other():
    async def scene(worker):
        return await asyncio.gather(*(worker.ask(requests.add, i, 1) for i in range(20)))

    assert in_worker(scene) == list(range(1, 21))


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="malloc_trim is glibc's")
def test_an_idle_worker_gives_freed_memory_back():
    async def scene(worker):
        held = await worker.ask(requests.free_memory)
        while requests.resident_bytes(worker.pid) > held - 150_000_000:
            await asyncio.sleep(0.05)
        return await worker.ask(requests.add, 1, 2)

    assert in_worker(scene) == 3


@pytest.mark.parametrize("died", [False, True])
def test_a_process_that_was_started_before_is_used_unless_it_has_died(died):
    process = start_worker_process()
    if died:
        process.kill()

    async def scene():
        worker = SurveyWorker(SurveyOrder((Path("nowhere"),)), process)
        try:
            assert await worker.ask(requests.add, 1, 2) == 3
            return worker.pid
        finally:
            worker.kill()

    assert (asyncio.run(scene()) == process.pid) is not died


def test_a_process_that_was_never_used_ends_with_its_worker():
    process = start_worker_process()
    SurveyWorker(SurveyOrder((Path("nowhere"),)), process).kill()
    assert not process.is_running


def test_a_request_reports_and_receives():
    async def scene(worker):
        reported = []
        async with worker.request(requests.count, 50) as request:
            async for i in request:
                reported.append(i)
                if i == 3:
                    request.send("hello")
        return reported, request.result

    reported, received = in_worker(scene)
    assert reported == list(range(50))
    assert received == ["hello"]


def test_errors_come_as_they_were_raised():
    async def scene(worker):
        with pytest.raises(InputError) as raised:
            await worker.ask(requests.refuse)
        with pytest.raises(RuntimeError, match="a fault of ours"):
            await worker.ask(requests.fault)
        return str(raised.value), await worker.ask(requests.kept)

    assert in_worker(scene) == ("a.laz: no such thing. Look.", 1)


def test_a_process_that_dies_fails_its_request_and_the_next_gets_another():
    async def scene(worker):
        first = await worker.ask(requests.pid)
        with pytest.raises(MachineError, match="died"):
            await worker.ask(requests.die)
        assert await worker.ask(requests.kept) == 1
        return first, await worker.ask(requests.pid)

    first, second = in_worker(scene)
    assert first != second


def test_a_process_that_dies_at_rest_costs_at_most_one_request():
    async def scene(worker):
        for _ in range(2):
            os.kill(await worker.ask(requests.pid), 9)
            try:
                await worker.ask(requests.add, 1, 1)
            except MachineError:
                assert await worker.ask(requests.add, 1, 1) == 2

    in_worker(scene)


def test_killing_a_worker_fails_its_request_without_waiting_for_it_to_leave(monkeypatch):
    # Both are longer than the test may take
    monkeypatch.setattr(conversation, "LEAVE_S", 3600.0)

    async def scene(worker):
        waiting = asyncio.ensure_future(worker.ask(requests.sleep, 3600.0))
        while not worker.pid:
            await asyncio.sleep(0.01)
        pid = worker.pid
        worker.kill()
        with pytest.raises(MachineError, match="died"):
            await waiting
        assert not is_running(pid)
        return await worker.ask(requests.add, 1, 2)

    assert in_worker(scene) == 3


@pytest.mark.parametrize("how", ["break", "raise", "cancel"])
def test_a_request_that_is_left_ends_and_its_process_stays(how):
    async def left(worker):
        async with worker.request(requests.count, 100_000) as request:
            async for i in request:
                if i == 2 and how == "break":
                    break
                if i == 2 and how == "raise":
                    raise InputError("an error of the caller")

    async def scene(worker):
        pid = await worker.ask(requests.pid)
        leaving = asyncio.ensure_future(left(worker))
        if how == "cancel":
            await asyncio.sleep(0.2)
            leaving.cancel()
        done, _ = await asyncio.wait({leaving}, timeout=300.0)
        assert done
        if not leaving.cancelled():
            assert isinstance(leaving.exception(), InputError) == (how == "raise")
        assert leaving.cancelled() == (how == "cancel")
        return pid, await worker.ask(requests.pid)

    before, after = in_worker(scene)
    assert before == after


def test_a_request_that_does_not_leave_loses_its_process():
    async def left(worker):
        async with worker.request(requests.report_then_sleep, 600.0) as request:
            async for _ in request:
                break

    async def scene(worker):
        pid = await worker.ask(requests.pid)
        await left(worker)
        assert not is_running(pid)
        return await worker.ask(requests.add, 1, 2)

    assert in_worker(scene) == 3


def test_silence_is_borne_while_kernels_are_compiled_and_only_then(monkeypatch):
    async def scene(worker):
        pid = await worker.ask(requests.pid)
        compiling = []
        worker.on_compiling = compiling.append
        monkeypatch.setattr(conversation, "SILENT_S", 1.0)
        assert await worker.ask(requests.compile_for, 4.0) == 2
        assert compiling == [True, False]
        assert is_running(pid)
        with pytest.raises(MachineError, match=r"the worker hung \(no answer for 1 s\)"):
            await worker.ask(requests.sleep, 60.0)

    in_worker(scene)


def test_a_request_that_is_left_while_it_compiles_may_end_that(monkeypatch):
    async def left(worker):
        async with worker.request(requests.report_then_compile, 4.0) as request:
            async for _ in request:
                break

    async def scene(worker):
        pid = await worker.ask(requests.pid)
        monkeypatch.setattr(conversation, "LEAVE_S", 2.0)
        await left(worker)
        return pid, await worker.ask(requests.pid)

    before, after = in_worker(scene)
    assert before == after


def test_cancelling_while_another_waits_gives_the_turn_on():
    async def scene(worker):
        first = asyncio.ensure_future(worker.ask(requests.count, 100_000))
        second = asyncio.ensure_future(worker.ask(requests.add, 1, 2))
        third = asyncio.ensure_future(worker.ask(requests.add, 3, 4))
        await asyncio.sleep(0.5)
        second.cancel()
        first.cancel()
        return await third

    assert in_worker(scene) == 7


def test_much_is_sent_to_a_process_that_does_not_read_yet_without_holding_the_server_up():
    async def scene(worker):
        much = np.zeros(4_000_000)
        worker._start()
        os.kill(worker.pid, 19)  # it is stopped, as one that imports for long
        # A server that is held up would otherwise be so for ever
        goes_on = threading.Timer(60.0, os.kill, (worker.pid, 18))
        goes_on.start()
        asking = asyncio.ensure_future(worker.ask(requests.add, much, 1.0))
        for _ in range(20):
            await asyncio.sleep(0.02)
        is_held_up = goes_on.finished.is_set()
        goes_on.cancel()
        os.kill(worker.pid, 18)
        return is_held_up, (await asking).sum()

    assert in_worker(scene) == (False, 4_000_000)


def test_killing_a_worker_many_times_in_the_middle_never_loses_an_answer():
    async def scene(worker):
        for i in range(8):
            asking = asyncio.ensure_future(worker.ask(requests.count, 5))
            await asyncio.sleep(0.05 * i)
            worker.kill()
            try:
                await asking
            except MachineError:
                continue
        return await worker.ask(requests.add, 1, 2)

    assert in_worker(scene) == 3


def test_being_cancelled_is_not_forgotten_where_the_process_dies_at_the_same_time():
    async def scene(worker):
        asking = asyncio.ensure_future(worker.ask(requests.sleep, 60.0))
        await asyncio.sleep(1.0)
        worker.kill()
        asking.cancel()
        await asyncio.wait({asking})
        return asking.cancelled()

    assert in_worker(scene)
