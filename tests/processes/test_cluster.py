"""Tasks on a Dask cluster of this machine: workers that die, refuse, are missing or have another linework."""

import os
import subprocess
import sys
import time

import distributed
import pytest

from linework.errors import MachineError, UsageError
from linework.processes import cluster as on_cluster
from linework.processes.cluster import Cluster, open_client
from linework.processes.executors import Serial

WORK = """
import os, signal, time
from linework.errors import MachineError

def work(task):
    if task.startswith("die"):
        os.kill(os.getpid(), signal.SIGKILL)
    if task == "lost" or (task == "lost once" and not os.path.exists(os.environ["DIED"])):
        open(os.environ["DIED"], "w").close()
        os.kill(os.getppid(), signal.SIGKILL)  # the Dask worker beside which this process stands
        time.sleep(60)
    if task == "slow":
        time.sleep(1)
    if task == "fail":
        raise KeyError("x")
    if task == "full":
        raise MachineError("cannot be written: no space", where="tile", advice="free some")
    if task == "pid":
        return os.getpid()
    return task.upper()

def check():
    pass

def refuse():
    raise MachineError("the worker there is not ours", where="host")
"""


@pytest.fixture(scope="module")
def some(tmp_path_factory):
    """Return a module with work for tasks, which processes of workers find too."""
    folder = tmp_path_factory.mktemp("some")
    (folder / "cluster_work.py").write_text(WORK)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", str(folder), prepend=os.pathsep)
        patch.setenv("DIED", str(folder / "died"))
        patch.syspath_prepend(str(folder))
        import cluster_work

        yield cluster_work


@pytest.fixture(scope="module")
def client(some):
    """Return a client of two workers; a task that loses its worker once is given up by Dask."""
    import dask

    with (
        dask.config.set({"distributed.scheduler.allowed-failures": 0}),
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address="127.0.0.1:0"
        ) as cluster,
        distributed.Client(cluster, set_as_default=False) as client,
    ):
        yield client


@pytest.fixture
def executor(client, some):
    executor = Cluster(client, some.check)
    yield executor
    executor.close()


def outcomes(executor, work, tasks):
    return {o.task: (o.receipt, o.problem) for o in executor.run(work, tasks)}


def lives(pid):
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def test_it_does_what_another_executor_does(executor, some):
    tasks = [f"task {i}" for i in range(40)]
    assert executor.n_workers == 2
    assert outcomes(executor, some.work, tasks) == outcomes(Serial(), some.work, tasks)


def test_what_dies_or_fails_costs_its_own_task_and_no_worker(executor, client, some):
    before = set(client.nthreads())
    found = outcomes(executor, some.work, ["a", "die", "b", "fail", "c"])
    assert found == {
        "a": ("A", ""),
        "b": ("B", ""),
        "c": ("C", ""),
        "die": (None, "the worker died (SIGKILL)"),
        "fail": (None, "KeyError: 'x'"),
    }
    assert set(client.nthreads()) == before


def test_a_lost_worker_loses_nothing_and_a_task_that_loses_them_is_named(executor, some):
    tasks = ["a", "lost once", "b", "c", "lost", "d"]
    found = outcomes(executor, some.work, tasks)
    assert found.pop("lost") == (None, "its workers were lost, one after the other")
    assert found == {task: (task.upper(), "") for task in tasks if task != "lost"}


def test_a_full_disk_ends_the_run_and_the_next_one_goes_on(executor, some):
    with pytest.raises(MachineError, match=r"tile: cannot be written: no space. Free some."):
        outcomes(executor, some.work, ["a", "full", *("slow" for _ in range(8))])
    start = time.monotonic()
    assert outcomes(executor, some.work, ["b"]) == {"b": ("B", "")}
    assert time.monotonic() - start < 60  # not behind what was cancelled, of which two may be running


def test_its_processes_end_with_it_and_those_of_a_lost_command_by_themselves(client, some, monkeypatch):
    executor = Cluster(client, some.check)
    (pid,) = (o.receipt for o in executor.run(some.work, ["pid"]))
    assert lives(pid)
    executor.close()
    assert not lives(pid)

    def forget_soon():
        from linework.processes import cluster

        cluster._IDLE_S = 0.5

    client.run(forget_soon)
    (pid,) = (o.receipt for o in Cluster(client, some.check).run(some.work, ["pid"]))
    deadline = time.monotonic() + 120
    while lives(pid) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not lives(pid)


def test_a_worker_that_the_check_refuses_ends_the_run_before_its_first_task(client, some):
    with pytest.raises(MachineError, match="host: the worker there is not ours"):
        Cluster(client, some.refuse)


def test_a_cluster_without_workers_is_waited_for_and_then_refused(some, monkeypatch):
    monkeypatch.setattr(on_cluster, "_WORKERS_S", 0.3)
    with (
        distributed.LocalCluster(n_workers=0, host="127.0.0.1", dashboard_address="127.0.0.1:0") as cluster,
        distributed.Client(cluster, set_as_default=False) as client,
        pytest.raises(MachineError, match=r"no worker within 0.3 s\. Start workers"),
    ):
        Cluster(client, some.check)


CLUSTER = """
import distributed, time
if __name__ == "__main__":
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, host="127.0.0.1", dashboard_address="127.0.0.1:0"
    ) as cluster:
        print(cluster.scheduler_address, flush=True)
        time.sleep(120)
"""


def test_a_scheduler_that_is_gone_is_named(some, tmp_path):
    script = tmp_path / "start.py"
    script.write_text(CLUSTER)
    with subprocess.Popen(
        [sys.executable, script], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    ) as there:
        assert there.stdout is not None
        address = there.stdout.readline().strip()
        with (
            open_client(address, 1) as client,
            pytest.raises(
                MachineError, match=rf"{address}: the connection to the scheduler is lost\. .*resume"
            ),
        ):
            for outcome in Cluster(client, some.check).run(some.work, [*("slow" for _ in range(60))]):
                assert outcome.receipt == "SLOW"
                there.kill()


@pytest.mark.parametrize("given", ["10.0.0.1:8786", "http://host:8786", "tcp://host", "", 8786, None])
def test_what_is_not_an_address_is_refused(given):
    with pytest.raises(UsageError, match="is not the address of a Dask scheduler"), open_client(given, 1):
        pass


def test_an_address_where_no_scheduler_answers_is_refused(client, monkeypatch):
    monkeypatch.setattr(on_cluster, "_ANSWER_S", 4.0)
    with (
        pytest.raises(MachineError, match=r"tcp://127.0.0.1:9: no Dask scheduler answers there"),
        open_client("tcp://127.0.0.1:9", 1),
    ):
        pass
    worker = next(iter(client.nthreads()))
    with pytest.raises(MachineError, match=r"\(a Worker answers\)"), open_client(worker, 1):
        pass
