"""`extract` on a Dask cluster of this machine: the same lines, whatever happens to workers and runs."""

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import distributed
import pytest
from tests.scenes.blocked import environment_without, run_linework

import linework
from linework.errors import MachineError
from linework.files.las.write import write_las
from linework.files.trajectories.read import write_trajectory
from linework.runs.opened.cluster import WorkerCheck, cluster_executor
from linework.simulation.simulate import simulate_survey

#: Several tiles, whatever the survey.
SMALL = ("--set", "tiling.core_m=64", "--set", "tiling.high_core_m=100", "--set", "tiling.max_points=10000")
KINDS = ("--features", "guardrail,cable,lane_marking")


@pytest.fixture(scope="module")
def survey(tmp_path_factory):
    simulated = simulate_survey("bends", 611, 100.0, points_per_m=1000)
    folder = tmp_path_factory.mktemp("cluster") / "survey"
    write_las(simulated.points, folder / "p.laz", crs=simulated.crs)
    write_trajectory(simulated.trajectory, folder / "trajectory.csv")
    (folder / "survey.toml").write_text(
        'name = "s"\n[points]\nfiles = ["*.laz"]\n[trajectory]\nfile = "trajectory.csv"\n'
    )
    return folder


@pytest.fixture(scope="module")
def cluster():
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, host="127.0.0.1", dashboard_address="127.0.0.1:0"
    ) as cluster:
        yield cluster


@pytest.fixture(scope="module")
def lines_here(survey):
    """Return the bytes of the lines that this machine finds without a cluster."""
    output = survey.parent / "here.gpkg"
    arguments = ["extract", survey, "-o", output, "--workers", "1", *SMALL, *KINDS, "--quiet"]
    subprocess.run([sys.executable, "-m", "linework", *arguments], check=True, stdout=subprocess.DEVNULL)
    return output.read_bytes()


def extraction(survey, output, address, *more):
    """Return the command line of a run on a cluster, in the folder of the survey, so that paths are relative."""
    return [
        sys.executable, "-m", "linework", "extract", survey.name, "-o", str(output), "--scheduler", address,
        *SMALL, *KINDS, "--quiet", *more,
    ]  # fmt: skip


def test_a_local_cluster_finds_the_lines_of_one_machine_to_the_byte(survey, lines_here, tmp_path):
    command = extraction(survey, tmp_path / "there.gpkg", "local", "--workers", "1")
    done = subprocess.run(command, cwd=survey.parent, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert (tmp_path / "there.gpkg").read_bytes() == lines_here
    assert not list((survey / ".linework").glob("cluster-*")), "nothing is left in the work folder"


def test_a_run_that_is_killed_is_resumed_by_other_workers(survey, cluster, lines_here, tmp_path):
    command = extraction(survey, tmp_path / "there.gpkg", cluster.scheduler_address)
    runs = survey / ".linework" / "runs"
    with subprocess.Popen(command, cwd=survey.parent, stdout=subprocess.DEVNULL) as process:
        while not list(runs.glob("*/tiles/*.arrays")) and process.poll() is None:
            time.sleep(0.01)
        process.send_signal(signal.SIGKILL)
    assert process.returncode == -signal.SIGKILL
    done = {path: path.stat().st_mtime_ns for path in runs.glob("*/tiles/*.arrays")}
    assert done
    subprocess.run([*command, "--resume"], cwd=survey.parent, check=True, stdout=subprocess.DEVNULL)
    assert (tmp_path / "there.gpkg").read_bytes() == lines_here


def test_a_client_serves_from_python_and_stays_open(survey, cluster, tmp_path):
    settings = {"tiling": {"core_m": 64.0, "high_core_m": 100.0, "max_points": 10_000}}
    with distributed.Client(cluster, set_as_default=False) as client:
        there = linework.extract(survey, kinds="cable", settings=settings, scheduler=client, work=tmp_path)
        assert client.status == "running"
    here = linework.extract(survey, kinds="cable", settings=settings, workers=1)
    assert len(here) > 0
    assert there == here


def test_a_worker_with_another_linework_is_refused_by_its_name(tmp_path):
    """A copy of the package in another state, as it may be installed on a machine of the cluster."""
    other = tmp_path / "other"
    shutil.copytree(
        Path(linework.__file__).parent, other / "linework", ignore=shutil.ignore_patterns("*.nb?")
    )
    with (other / "linework" / "arrays.py").open("a") as file:
        file.write("# patched\n")
    with (
        distributed.LocalCluster(
            n_workers=0, host="127.0.0.1", dashboard_address="127.0.0.1:0"
        ) as scheduler,
        subprocess.Popen(
            [sys.executable, "-m", "distributed.cli.dask_worker", scheduler.scheduler_address, "--nthreads", "1",
             "--no-dashboard", "--no-nanny"],
            env=os.environ | {"PYTHONPATH": str(other)}, cwd=tmp_path, stderr=subprocess.DEVNULL,
        ) as worker,
    ):  # fmt: skip
        try:
            with (
                pytest.raises(
                    MachineError, match=r"the worker there has source of linework \w{16}, here it is \w{16}"
                ),
                cluster_executor(scheduler.scheduler_address, None, tmp_path),
            ):
                pass
        finally:
            worker.kill()


def test_what_a_worker_must_have_in_common_is_named(tmp_path):
    from linework.runs.opened.cluster import _versions_here

    seen, here = tmp_path / "seen", str(Path.cwd())
    seen.touch()
    WorkerCheck(seen, here, _versions_here())()
    with pytest.raises(MachineError, match=r"there has numpy \d\S+, here it is 1\.0\. Install the same"):
        WorkerCheck(seen, here, _versions_here() | {"numpy": "1.0"})()
    with pytest.raises(MachineError, match=r"has linework \S+, here it is 9\.9"):
        WorkerCheck(seen, here, _versions_here() | {"linework": "9.9", "source of linework": "x"})()
    seen.unlink()
    with pytest.raises(
        MachineError, match=rf"cannot use the work folder {tmp_path} \(it is not the one .*work"
    ):
        WorkerCheck(seen, here, _versions_here())()


def test_a_number_of_workers_is_refused_with_an_address(linework, survey, tmp_path):
    out = linework(
        "extract", survey, "-o", tmp_path / "x.gpkg", "--scheduler", "tcp://127.0.0.1:9", "--workers", 2
    )
    assert out.code == 2
    assert out.line == "error: --workers: a cluster has its own workers. Omit it."


def test_without_the_extra_the_command_to_install_it_is_named(survey, tmp_path):
    without = environment_without(tmp_path, ["distributed"])
    done = run_linework(without, "extract", survey, "-o", tmp_path / "x.gpkg", "--scheduler", "local")
    assert done.returncode == 5
    assert done.stderr.splitlines()[-1] == (
        "error: --scheduler: needs the package distributed. pip install 'linework[dask]'"
    )
