"""Desks: processes that do works, and what becomes of works that are left, killed, or die."""

import asyncio
import os
import time
from pathlib import Path

import numpy as np
import pytest
from tests.workbench import desk_works as works

from linework.errors import InputError, MachineError
from linework.workbench.worker import conversation as desk_work
from linework.workbench.worker.conversation import LEAVE_S, SurveyWorker
from linework.workbench.worker.session import SurveyOrder


@pytest.fixture(autouse=True)
def _works_are_found(monkeypatch):
    """Let the desk's process import the works of these tests."""
    root = str(Path(__file__).parents[2])
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([root, *filter(None, [os.environ.get("PYTHONPATH")])]))


def at_desk(scene):
    """Run a coroutine function with a desk, for a time that no wait for a lost message fits into."""

    async def running():
        desk = SurveyWorker(SurveyOrder((Path("nowhere"),)))
        try:
            async with asyncio.timeout(60.0):
                return await scene(desk)
        finally:
            desk.kill()

    return asyncio.run(running())


def is_running(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def test_works_are_done_one_after_the_other():
    async def scene(desk):
        return await asyncio.gather(*(desk.ask(works.add, i, 1) for i in range(20)))

    assert at_desk(scene) == list(range(1, 21))


def test_what_a_work_tells_and_hears():
    async def scene(desk):
        told = []
        async with desk.doing(works.count, 50) as steps:
            async for i in steps:
                told.append(i)
                if i == 3:
                    steps.say("hello")
        return told, steps.value

    told, heard = at_desk(scene)
    assert told == list(range(50))
    assert heard == ["hello"]


def test_errors_come_as_they_were_raised():
    async def scene(desk):
        with pytest.raises(InputError) as raised:
            await desk.ask(works.refuse)
        with pytest.raises(RuntimeError, match="a fault of ours"):
            await desk.ask(works.fault)
        return str(raised.value), await desk.ask(works.kept)

    assert at_desk(scene) == ("a.laz: no such thing. Look.", 1)


def test_a_process_that_dies_fails_its_work_and_the_next_gets_another():
    async def scene(desk):
        first = await desk.ask(works.pid)
        with pytest.raises(MachineError, match="died"):
            await desk.ask(works.die)
        assert await desk.ask(works.kept) == 1
        return first, await desk.ask(works.pid)

    first, second = at_desk(scene)
    assert first != second


def test_a_process_that_dies_at_rest_costs_at_most_one_work():
    async def scene(desk):
        for _ in range(2):
            os.kill(await desk.ask(works.pid), 9)
            try:
                await desk.ask(works.add, 1, 1)
            except MachineError:
                assert await desk.ask(works.add, 1, 1) == 2

    at_desk(scene)


def test_killing_a_desk_fails_the_work_it_is_at_at_once():
    async def scene(desk):
        waiting = asyncio.ensure_future(desk.ask(works.sleep, 60.0))
        while not desk.memory_pid:
            await asyncio.sleep(0.01)
        pid = desk.memory_pid
        began = time.monotonic()
        desk.kill()
        with pytest.raises(MachineError, match="died"):
            await waiting
        assert not is_running(pid)
        return time.monotonic() - began, await desk.ask(works.add, 1, 2)

    seconds, answer = at_desk(scene)
    assert seconds < LEAVE_S
    assert answer == 3


@pytest.mark.parametrize("how", ["break", "raise", "cancel"])
def test_a_work_that_is_left_ends_and_its_process_stays(how):
    async def left(desk):
        async with desk.doing(works.count, 100_000) as steps:
            async for i in steps:
                if i == 2 and how == "break":
                    break
                if i == 2 and how == "raise":
                    raise InputError("an error of whoever reads the steps")

    async def scene(desk):
        pid = await desk.ask(works.pid)
        leaving = asyncio.ensure_future(left(desk))
        if how == "cancel":
            await asyncio.sleep(0.2)
            leaving.cancel()
        done, _ = await asyncio.wait({leaving}, timeout=20.0)
        assert done
        if not leaving.cancelled():
            assert isinstance(leaving.exception(), InputError) == (how == "raise")
        assert leaving.cancelled() == (how == "cancel")
        return pid, await desk.ask(works.pid)

    before, after = at_desk(scene)
    assert before == after


def test_a_work_that_does_not_leave_loses_its_process():
    async def left(desk):
        async with desk.doing(works.tell_then_sleep, 600.0) as steps:
            async for _ in steps:
                break

    async def scene(desk):
        pid = await desk.ask(works.pid)
        await left(desk)
        assert not is_running(pid)
        return await desk.ask(works.add, 1, 2)

    assert at_desk(scene) == 3


def test_silence_is_borne_while_kernels_are_compiled_and_only_then(monkeypatch):
    async def scene(desk):
        pid = await desk.ask(works.pid)
        compiling = []
        desk.on_compiling = compiling.append
        monkeypatch.setattr(desk_work, "SILENT_S", 1.0)
        assert await desk.ask(works.compile_for, 4.0) == 2
        assert compiling == [True, False]
        assert is_running(pid)
        with pytest.raises(MachineError, match="no answer for 1 s"):
            await desk.ask(works.sleep, 60.0)

    at_desk(scene)


def test_a_work_that_is_left_while_it_compiles_may_end_that(monkeypatch):
    async def left(desk):
        async with desk.doing(works.tell_then_compile, 4.0) as steps:
            async for _ in steps:
                break

    async def scene(desk):
        pid = await desk.ask(works.pid)
        monkeypatch.setattr(desk_work, "LEAVE_S", 2.0)
        await left(desk)
        return pid, await desk.ask(works.pid)

    before, after = at_desk(scene)
    assert before == after


def test_cancelling_while_another_waits_gives_the_turn_on():
    async def scene(desk):
        first = asyncio.ensure_future(desk.ask(works.count, 100_000))
        second = asyncio.ensure_future(desk.ask(works.add, 1, 2))
        third = asyncio.ensure_future(desk.ask(works.add, 3, 4))
        await asyncio.sleep(0.5)
        second.cancel()
        first.cancel()
        return await third

    assert at_desk(scene) == 7


def test_much_is_sent_to_a_process_that_does_not_read_yet_without_holding_the_server_up():
    async def scene(desk):
        slowest = 0.0

        async def beat():
            nonlocal slowest
            while True:
                before = time.monotonic()
                await asyncio.sleep(0.01)
                slowest = max(slowest, time.monotonic() - before)

        beating = asyncio.ensure_future(beat())
        much = np.zeros(4_000_000)
        desk._start()
        os.kill(desk.memory_pid, 19)  # it is stopped, as one that imports for long
        asking = asyncio.ensure_future(desk.ask(works.add, much, 1.0))
        await asyncio.sleep(1.0)
        os.kill(desk.memory_pid, 18)
        total = (await asking).sum()
        beating.cancel()
        return slowest, total

    slowest, total = at_desk(scene)
    assert total == 4_000_000
    assert slowest < 0.9


def test_killing_a_desk_many_times_in_the_middle_never_loses_an_answer():
    async def scene(desk):
        for i in range(8):
            asking = asyncio.ensure_future(desk.ask(works.count, 5))
            await asyncio.sleep(0.05 * i)
            desk.kill()
            try:
                await asking
            except MachineError:
                continue
        return await desk.ask(works.add, 1, 2)

    assert at_desk(scene) == 3


def test_being_cancelled_is_not_forgotten_where_the_process_dies_at_the_same_time():
    async def scene(desk):
        asking = asyncio.ensure_future(desk.ask(works.sleep, 60.0))
        await asyncio.sleep(1.0)
        desk.kill()
        asking.cancel()
        await asyncio.wait({asking})
        return asking.cancelled()

    assert at_desk(scene)
