"""From a survey to its tile store: every point that a header promises is used, or left out and counted."""

import os
import shutil
import subprocess
import sys
from collections import namedtuple
from pathlib import Path

import laspy
import numpy as np
import pytest

from linework.errors import InputError, MachineError
from linework.files.las.decoder import DecoderLimits
from linework.files.las.write import write_las
from linework.files.store import build as spill
from linework.files.store.build import build_store
from linework.files.store.facts import facts_of_store
from linework.files.store.layout import Limits
from linework.files.store.read import PointStore
from linework.files.survey.open import open_survey
from linework.model.points import Points

UTM = "EPSG:25832+7837"


def points(seed=1, n=600, *, time=3e8):
    rng = np.random.default_rng(seed)
    xyz = np.round(rng.uniform(0, 150, (n, 3)) + np.array([500_000, 5_400_000, 100]), 3)
    light = rng.integers(1, 4000, n).astype(np.float32)
    return Points(xyz, intensity=light, time_s=None if time is None else time + np.arange(n) * 0.5)


@pytest.fixture
def drive(tmp_path):
    """Two sound files, written one after the other."""
    write_las(points(1), tmp_path / "drive" / "a.laz", crs=UTM)
    write_las(points(2, time=3e8 + 400), tmp_path / "drive" / "b.las", crs=UTM)
    return tmp_path / "drive"


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "store").mkdir()
    return tmp_path / "store"


def spilled(drive, folder, *, crs=None, **settings):
    return build_store(open_survey([drive], crs=crs), folder, n_threads=1, **settings)


def odd_points(path, classes=(), times=None, n=40):
    """A file with classes and times of its own."""
    data = laspy.LasData(laspy.LasHeader(version="1.4", point_format=6))
    data.header.global_encoding.gps_time_type = laspy.header.GpsTimeType.STANDARD
    data.x, data.y, data.z = np.arange(n) % 7 * 10.0, np.arange(n) * 1.0, np.zeros(n)
    data.intensity = np.arange(n) + 1
    data.classification[: len(classes)] = classes
    data.gps_time = 3e8 + np.arange(n) if times is None else times
    path.parent.mkdir(exist_ok=True)
    data.write(path)


def test_the_facts_are_kept_in_the_store(drive, folder):
    seen = []
    facts = spilled(drive, folder, progress=lambda done, total: seen.append((done, total)))
    store = PointStore.open(folder)
    assert facts == facts_of_store(store)
    assert [(f.path.name, f.n_promised, f.n_points) for f in facts.files] == [
        ("a.laz", 600, 600),
        ("b.las", 600, 600),
    ]
    assert (facts.n_points, facts.rejected, facts.warnings, facts.failures) == (1200, {}, (), ())
    assert (facts.has_intensity, facts.has_time, facts.in_time_order) == (True, True, True)
    assert (facts.times.low_s, facts.times.high_s) == (3e8, 3e8 + 400 + 599 * 0.5)
    assert seen == [(600, 1200), (1200, 1200)]
    found = store.points()
    expected = np.concatenate([points(1).xyz, points(2).xyz])
    np.testing.assert_array_equal(np.sort(found.xyz, axis=0), np.sort(np.round(expected, 4), axis=0))
    assert facts.bounds == found.bounds
    assert facts.files[0].bounds == points(1).bounds


@pytest.mark.parametrize("name", ["Straße.laz", os.fsdecode(b"\xff\xfe.laz")])
def test_files_of_any_name(drive, folder, name):
    (drive / "a.laz").rename(drive / name)
    (drive / os.fsdecode(b"bad\xff.laz")).write_bytes(b"LASF")
    facts = spilled(drive, folder)
    assert {f.path for f in facts.files} == {drive / name, drive / "b.las"}
    assert [path for path, _ in facts.failures] == [drive / os.fsdecode(b"bad\xff.laz")]
    assert facts == facts_of_store(PointStore.open(folder))


def test_points_left_out_are_counted_by_reason(drive, folder):
    times = 3e8 + np.arange(40.0)
    times[[3, 10]] = np.nan, np.inf
    odd_points(drive / "odd.las", classes=[7, 18, 2, 7], times=times)
    facts = spilled(drive / "odd.las", folder, crs="local")
    assert facts.rejected == {"noise class": 3, "impossible time": 1}
    assert facts.n_points == len(PointStore.open(folder).points()) == 36
    assert facts.files[0].n_promised == 40


@pytest.mark.parametrize(
    ("times", "said"),
    [
        (3e17 + np.arange(40.0) * 1e9, "GPS times from 3e+17 to 3e+17 are not in seconds: left out"),
        (np.full(40, np.nan), "GPS times are not numbers: left out"),
    ],
)
def test_times_in_another_unit_cost_no_points(drive, folder, times, said):
    odd_points(drive / "odd.las", times=times)
    facts = spilled(drive / "odd.las", folder, crs="local")
    assert (facts.n_points, facts.rejected, facts.has_time) == (40, {}, False)
    assert f"odd.las: {said}" in facts.warnings


def test_a_damaged_time_costs_its_point(drive, folder):
    times = 3e8 + np.arange(40.0)
    times[7] = 1e100
    odd_points(drive / "odd.las", times=times)
    facts = spilled(drive / "odd.las", folder, crs="local")
    assert (facts.n_points, facts.rejected, facts.has_time) == (39, {"impossible time": 1}, True)


def test_times_that_cannot_be_used_cost_no_points(drive, folder):
    times = np.zeros(40)
    times[5] = np.nan
    odd_points(drive / "odd.las", times=times)
    facts = spilled(drive / "odd.las", folder, crs="local")
    assert (facts.n_points, facts.rejected, facts.has_time) == (40, {}, False)
    assert facts.warnings == ("odd.las: no GPS time (0 for all points)",)
    assert PointStore.open(folder).points().time_s is None


@pytest.mark.parametrize("shift", [[2e5, 0, 0], [0, -3e6, 0], [0, 0, 2e5], [0, 0, -5e3]])
def test_far_points_are_left_out_whole_blocks_at_a_time(tmp_path, folder, shift):
    near = points(n=3000)
    xyz = np.concatenate([near.xyz, near.xyz[:2] + shift])
    write_las(Points(xyz, intensity=np.ones(3002, np.float32)), tmp_path / "a.laz", crs=UTM)
    facts = spilled(tmp_path / "a.laz", folder)
    assert facts.n_points == len(PointStore.open(folder).points()) == 3000
    assert facts.rejected == {"far from all others": 2}
    assert facts.warnings[-1] == "2 points far from all others left out"
    # three times the size of the blocks that hold nearly all, at least a kilometre
    assert PointStore.open(folder).limits == Limits(
        west=7812 - 16, east=7815 + 16, south=84375 - 16, north=84378 + 16, low=1 - 16, high=4 + 16
    )


def test_a_file_that_grows_while_it_is_read_is_a_failure(drive, folder):
    def append(done, total):
        with (drive / "b.las").open("ab") as file:
            file.write(b"more")

    facts = spilled(drive, folder, progress=append)
    ((path, message),) = facts.failures
    assert path == drive / "b.las"
    assert message == f"{path}: changed while it was read. Run again when no program writes to it."
    assert facts.n_points == 600
    assert not (folder / "1.points").exists()


def test_a_file_that_goes_away_while_it_is_read_is_a_failure(drive, folder):
    facts = spilled(drive, folder, progress=lambda done, total: (drive / "b.las").unlink(missing_ok=True))
    ((path, message),) = facts.failures
    assert path == drive / "b.las"
    assert "cannot be opened" in message


def test_a_file_that_is_not_what_its_header_was_is_a_failure(drive, folder):
    shutil.copy(drive / "a.laz", drive / "c.laz")
    replaced = []

    def replace(done, total):
        if not replaced:
            write_las(points(3, n=1500), drive / "b.las", crs=UTM, overwrite=True)
            replaced.append(done)

    facts = spilled(drive, folder, progress=replace)
    assert [message.split(": ")[1] for _, message in facts.failures] == [
        "changed while it was read. Run again when no program writes to it."
    ]


def test_points_that_do_not_add_up_are_a_failure(drive, folder, monkeypatch):
    decode = spill.Decoder.decode

    def losing(self, task, progress):
        result = decode(self, task, progress)
        lost = {"n_rejected": {"lost": 1}} if task.path.name == "a.laz" else {}
        return type(result)(**{name: getattr(result, name) for name in result.__slots__} | lost)

    monkeypatch.setattr(spill.Decoder, "decode", losing)
    ((path, message),) = spilled(drive, folder).failures
    assert path == drive / "a.laz"
    assert "601 points read and 600 written of 600 that the header promises" in message


def test_too_little_space_is_said_before_anything_is_decoded(drive, folder, monkeypatch):
    space = namedtuple("space", "total used free")
    monkeypatch.setattr(spill.shutil, "disk_usage", lambda _: space(100_000, 95_000, 5_000))
    with pytest.raises(MachineError) as caught:
        spilled(drive, folder)
    assert "1,200 points need 2.16e-05 GB of disk, 5e-06 GB are free" in str(caught.value)
    assert 'work="DIR"' in str(caught.value)
    assert list(folder.iterdir()) == []


FULL = """
import resource, signal, sys
from pathlib import Path
from linework.files.store.build import build_store
from linework.files.survey.open import open_survey
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[3]), int(sys.argv[3])))
try:
    build_store(open_survey([Path(sys.argv[1])]), Path(sys.argv[2]), n_threads=1)
except Exception as error:
    print(error.exit_code, error)
"""


@pytest.mark.parametrize("size", [0, 5000])
def test_a_disk_that_fills_up_is_no_damaged_file(drive, folder, size):
    command = [sys.executable, "-c", FULL, str(drive), str(folder), str(size)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout.startswith(f"5 {folder}/"), done
    assert "cannot be written: File too large" in done.stdout
    assert list(folder.iterdir()) == []


def test_no_file_can_be_used(drive, folder):
    survey = open_survey([drive])
    (drive / "a.laz").write_bytes(b"LASF")
    (drive / "b.las").write_bytes(b"")
    with pytest.raises(InputError, match=r"a\.laz: cut off inside the header"):
        build_store(survey, folder, n_threads=1)


def test_times_out_of_order_are_told(drive, folder):
    (drive / "a.laz").rename(drive / "c.laz")
    facts = spilled(drive, folder)
    assert not facts.in_time_order
    assert facts.has_time


@pytest.mark.skipif(sys.platform != "linux", reason="asks the system by /proc")
def test_memory_is_bounded_by_the_batch(tmp_path, folder):
    n = 2_000_000
    header = laspy.LasHeader(version="1.4", point_format=6)
    header.scales = [0.001] * 3
    record = laspy.ScaleAwarePointRecord.zeros(n, header=header)
    record["X"] = np.arange(n) % 100_000
    with laspy.open(tmp_path / "large.las", mode="w", header=header) as writer:
        writer.write_points(record)
    peaks_kb = []
    children = Path(f"/proc/self/task/{os.getpid()}/children")
    others = set(children.read_text().split())

    def look(done, total):
        (child,) = set(children.read_text().split()) - others
        status = Path(f"/proc/{child}/status").read_text()
        peaks_kb.append(int(status.split("VmHWM:")[1].split()[0]))

    limits = DecoderLimits(batch_points=50_000)
    facts = spilled(tmp_path / "large.las", folder, crs="local", limits=limits, progress=look)
    assert facts.n_points == n
    assert len(peaks_kb) == 40
    # 60 MB of records go through; beyond the first batches a table of 100 bytes per run is all that grows
    assert peaks_kb[-1] - peaks_kb[2] < 3_000
