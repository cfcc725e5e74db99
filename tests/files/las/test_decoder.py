"""A decoder that dies, hangs or eats memory costs its file, by name, and nothing else."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from tests.scenes.places import ROOT

from linework.errors import InputError, MachineError
from linework.files.las.decoder import DecoderLimits
from linework.files.las.write import write_las
from linework.files.store.build import build_store
from linework.files.store.read import PointStore
from linework.files.survey.open import open_survey
from linework.model.points import Points
from linework.processes import child

DYING = "tests.scenes.dying_decoder:dying_decoder_main"


@pytest.fixture(autouse=True)
def _decoder_is_found(monkeypatch):
    """Let child processes import the decoder of these tests."""
    monkeypatch.setenv("PYTHONPATH", str(ROOT), prepend=os.pathsep)


def points(seed, n=300):
    rng = np.random.default_rng(seed)
    xyz = rng.uniform(0, 40, (n, 3)) + np.array([500_000, 5_400_000, 100])
    return Points(
        xyz, intensity=rng.integers(1, 4000, n).astype(np.float32), time_s=3e8 + np.arange(n) * 0.001
    )


@pytest.fixture
def survey(tmp_path):
    for i, name in enumerate(("a", "bad", "c")):
        write_las(points(i), tmp_path / "drive" / f"{name}.laz", crs="EPSG:25832+7837")
    return open_survey([tmp_path / "drive"])


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "store").mkdir()
    return tmp_path / "store"


def dying(how, name="bad", **limits):
    """Limits with a decoder that dies of files of this name, after 100 of their points."""
    return DecoderLimits(batch_points=100, target=(DYING, how, name), **limits)


def spill(survey, folder, limits, **others):
    return build_store(survey, folder, n_threads=2, limits=limits, **others)


@pytest.mark.parametrize(
    ("how", "words"),
    [
        ("SIGKILL", "the decoder died (SIGKILL) after 100 points"),
        ("SIGABRT", "the decoder died (SIGABRT) after 100 points"),
        ("SIGSEGV", "the decoder died (SIGSEGV) after 100 points"),
        ("exit", "the decoder died (exit code 3) after 100 points"),
        ("memory", "the decoder failed (out of memory) after 100 points"),
        ("panic", "the decoder failed (Panic: index out of bounds) after 100 points"),
        ("{garbage", "the decoder failed (its answer makes no sense) after 100 points"),
        ("unframed garbage", "the decoder failed (its answer makes no sense) after 100 points"),
        ('{"what": 1}', "the decoder failed (its answer makes no sense) after 100 points"),
        ('{"done": {"n_points": 5}}', "the decoder failed (its answer makes no sense) after 100 points"),
        ("SIGSTOP", "the decoder hung (no answer for 4 s) after 100 points"),
    ],
)
def test_the_file_is_named_and_the_others_are_used(survey, folder, how, words):
    stall_s = 4.0 if "hung" in words else 60.0
    facts = spill(survey, folder, dying(how, stall_s=stall_s, address_bytes=3 << 30))
    ((path, message),) = facts.failures
    assert path == survey.point_files[1]
    assert message == f"{path}: {words} (damaged). Copy the file again, or leave it out."
    assert [f.path.name for f in facts.files] == ["a.laz", "c.laz"]
    assert facts.n_points == len(PointStore.open(folder).points()) == 600
    assert sorted(p.name for p in folder.glob("*.points")) == ["0.points", "2.points"]


def test_what_kills_the_parallel_decoder_is_decoded_alone(survey, folder):
    facts = spill(survey, folder, dying("once-SIGSEGV"))
    assert facts.failures == ()
    assert facts.n_points == 900


def test_a_process_that_closes_its_pipe_is_not_waited_for(survey, folder, monkeypatch):
    # Long enough for a killed process to end on a loaded machine
    monkeypatch.setattr(child, "ENDING_S", 2.0)
    facts = spill(survey, folder, dying("silence"))
    assert "the decoder hung (it closed its connection) after 100 points" in facts.failures[0][1]


def test_nothing_is_left_of_a_survey_of_which_every_file_kills(survey, folder):
    with pytest.raises(InputError, match=r"a\.laz: the decoder died \(SIGABRT\) after 100 points"):
        spill(survey, folder, dying("SIGABRT", name=""))
    assert list(folder.iterdir()) == []


def test_what_a_decoder_prints_is_not_heard(survey, folder, capfd):
    facts = spill(survey, folder, dying("talk"))
    assert facts.n_points == 900
    assert capfd.readouterr() == ("", "")


def test_a_fault_of_ours_is_no_damaged_file(survey, folder):
    with pytest.raises(RuntimeError, match="ValueError: a fault of ours"):
        spill(survey, folder, dying("fault"))
    assert not (folder / "1.points").exists()


def test_a_process_that_does_not_start_is_no_damaged_file(survey, folder):
    with pytest.raises(
        MachineError, match=r"does not start: it died \(exit code 1\); .*No module named 'nowhere'"
    ):
        spill(survey, folder, DecoderLimits(target=("nowhere:main",)))
    assert list(folder.iterdir()) == []


def test_too_little_memory_to_begin_is_no_damaged_file(survey, folder):
    limits = DecoderLimits(address_bytes=400 << 20)
    with pytest.raises(MachineError) as caught:
        spill(survey, folder, limits)
    assert "(ulimit -" in str(caught.value)
    assert list(folder.iterdir()) == []


def test_interrupted_the_process_is_gone_and_its_part_removed(survey, folder):
    (folder / "notes.txt").write_text("not ours")
    # Other tests of this process may have left one that ends with it
    others = set(children_of(os.getpid()))

    def interrupt(done, total):
        if done > 300:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        spill(survey, folder, DecoderLimits(batch_points=100), progress=interrupt)
    assert set(children_of(os.getpid())) <= others
    assert "1.points" not in [p.name for p in folder.iterdir()]
    assert (folder / "notes.txt").exists()


def children_of(pid):
    return [int(n) for n in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


PARENT = """
import sys
from pathlib import Path
from linework.files.las.decoder import DecoderLimits
from linework.files.store.build import build_store
from linework.files.survey.open import open_survey
limits = DecoderLimits(batch_points=100, target=(sys.argv[1], "hang", ""))
say = lambda done, total: print(done, flush=True)
build_store(open_survey([Path(sys.argv[2])]), Path(sys.argv[3]), n_threads=1, limits=limits, progress=say)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="asks the system by /proc")
def test_killed_the_run_takes_the_process_along(survey, folder):
    command = [sys.executable, "-c", PARENT, DYING, str(survey.root), str(folder)]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as run:
        assert run.stdout.readline() == b"100\n"
        (child,) = children_of(run.pid)
        assert os.getpgid(child) == os.getpgid(run.pid) == os.getpgid(0)
        run.send_signal(signal.SIGKILL)
    end = time.monotonic() + 120.0
    while Path(f"/proc/{child}").exists() and time.monotonic() < end:
        time.sleep(0.02)
    assert not Path(f"/proc/{child}").exists()
