"""A disk that is full never gives a file: one line, exit code 5, nothing left."""

import contextlib
import errno
import os
import shutil
import sqlite3
import subprocess
import sys

import numpy as np
import pytest

from linework.cli.failures import failure_of
from linework.errors import MachineError
from linework.files.images.geotiff import write_geotiff
from linework.files.las.write import write_las
from linework.files.line_file.file import LineFile
from linework.files.output.journal import Journal, JournalEntry
from linework.files.output.publish import machine_errors, publish
from linework.files.trajectories.read import write_trajectory
from linework.files.vectors.read_write import write_lines
from linework.model.changes import Change
from linework.model.grid import Grid, Image
from linework.model.lines import LineSet
from linework.model.points import Points
from linework.model.trajectory import Trajectory

#: Runs with a limit on the size of files, which the system treats as a full disk does.
CODE = """
import resource, signal, sys
from pathlib import Path
import numpy as np
from linework.errors import LineworkError
from linework.files.las.write import write_las
from linework.files.images.geotiff import write_geotiff
from linework.files.output.record import write_json
from linework.files.trajectories.read import write_trajectory
from linework.files.vectors.read_write import write_lines
from linework.model.grid import Grid, Image
from linework.model.lines import LineSet
from linework.model.points import Points
from linework.model.trajectory import Trajectory

folder, size, names = Path(sys.argv[1]), int(sys.argv[2]), sys.argv[3:]
rng = np.random.default_rng(0)
line = np.cumsum(rng.random((4000, 3)), axis=0)


def make(path):
    if path.suffix in (".las", ".laz"):
        write_las(Points(rng.random((20000, 3)) * 100), path, crs="local")
    elif path.suffix == ".tif":
        write_geotiff(Image(rng.random((300, 300)), Grid(0, 0, 1, 1, 300, 300)), path, crs="local")
    elif path.suffix == ".csv":
        write_trajectory(Trajectory(np.arange(4000.0), line), path)
    elif path.name == "run.json":
        write_json({"values": line.tolist()}, path)
    else:
        write_lines(LineSet.from_lines([line], kind=["cable"], crs="local"), path)


signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))
for name in names:
    try:
        make(folder / name)
    except LineworkError as error:
        print(error.exit_code, error)
"""
NAMES = ["a.gpkg", "a.geojson", "a.dxf", "a.fgb", "a.laz", "a.las", "a.tif", "a.csv", "run.json"]


@pytest.mark.parametrize("size", [1000, 30_000])
def test_full_disk(tmp_path, size):
    done = subprocess.run(
        [sys.executable, "-c", CODE, str(tmp_path), str(size), *NAMES], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert len(lines) == len(NAMES)
    for name, line in zip(NAMES, lines, strict=True):
        assert line.startswith(f"5 {tmp_path / name}: cannot be written: "), line
    assert list(tmp_path.iterdir()) == []


LOSSY = [
    ("linework.files.vectors.read_write", [".gpkg", ".geojson", ".dxf", ".fgb", ".kml"]),
    ("linework.files.trajectories.read", [".csv"]),
    ("linework.files.las.write", [".las", ".laz"]),
    ("linework.files.images.geotiff", [".tif"]),
]


@pytest.mark.parametrize(("module", "suffix"), [(name, suffix) for name, many in LOSSY for suffix in many])
def test_what_the_disk_lost_when_the_file_was_closed_is_found(tmp_path, monkeypatch, module, suffix):
    """Some disks report a failure only then, or to nobody: the end of the file is not there."""

    def lossy(path, write, verify, **options):
        def cut(part):
            write(part)
            os.truncate(part, part.stat().st_size * 9 // 10)

        publish(path, cut, verify, **options)

    rng = np.random.default_rng(0)
    line = np.cumsum(rng.random((400, 3)), axis=0) + np.array([500_000.0, 5_400_000.0, 100.0])
    path = tmp_path / f"a{suffix}"
    path.write_bytes(b"old")
    monkeypatch.setattr(f"{module}.publish", lossy)
    with pytest.raises(MachineError) as caught:
        if suffix == ".csv":
            write_trajectory(Trajectory(np.arange(400.0), line), path, overwrite=True)
        elif suffix in (".las", ".laz"):
            write_las(Points(rng.random((2000, 3)) * 100), path, crs="local", overwrite=True)
        elif suffix == ".tif":
            write_geotiff(
                Image(rng.random((300, 300)), Grid(5, 5, 1, 1, 300, 300)), path, crs="local", overwrite=True
            )
        else:
            write_lines(LineSet.from_lines([line], kind="cable", crs="EPSG:25832+7837"), path, overwrite=True)
    assert (caught.value.exit_code, caught.value.where) == (5, path)
    assert path.read_bytes() == b"old"
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


# Libraries that say it in their own words

FULL = "free some space, or write to another disk"


@pytest.mark.parametrize(
    "error",
    [
        sqlite3.OperationalError("database or disk is full"),
        RuntimeError("CPLE_FileIO: /x.gpkg: No space left on device"),
        OSError(errno.EDQUOT, os.strerror(errno.EDQUOT)),
        OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)),
    ],
)
def test_a_full_disk_is_said_as_full_whoever_says_it(tmp_path, error):
    with pytest.raises(MachineError, match="ree some space") as caught, machine_errors(tmp_path / "a.gpkg"):
        raise error
    assert (caught.value.exit_code, caught.value.where) == (5, tmp_path / "a.gpkg")
    failed = failure_of(error)
    assert (failed.exit_code, failed.is_bug) == (5, False)
    assert "ree some" in failed.line
    assert len(failed.line.splitlines()) == 1


def test_other_errors_are_not_taken_for_a_full_disk(tmp_path):
    with pytest.raises(RuntimeError, match="bug"), machine_errors(tmp_path / "a.gpkg"):
        raise RuntimeError("a bug")
    assert failure_of(RuntimeError("a bug")).exit_code == 1


def full(db):
    """Let a database grow no more: SQLite answers as on a full disk."""
    pages = db.execute("PRAGMA page_count").fetchone()[0]
    db.execute(f"PRAGMA max_page_count = {pages}")


def test_a_line_file_on_a_full_disk_keeps_what_it_has(tmp_path):
    path = tmp_path / "lines.gpkg"
    line = np.cumsum(np.random.default_rng(0).random((5000, 3)), axis=0)
    new = LineSet.from_lines([line], kind="cable")
    with LineFile.opened(path, crs="local") as file:
        full(file._db)
        with pytest.raises(MachineError, match="disk is full") as caught:
            file.commit(Change("draw", new[:0], new), who="me")
        assert FULL in str(caught.value).lower()
        assert len(file.lines) == file.revision == 0
    with LineFile.opened(path, crs="local") as file:
        assert len(file.commit(Change("draw", new[:0], new), who="me").change.after) == 1


def test_a_journal_on_a_full_disk_is_said(tmp_path):
    journal = Journal(tmp_path / "journal.sqlite")
    full(journal._connection)
    with pytest.raises(MachineError, match=r"disk is full.*ree some space"):
        journal.enter(JournalEntry("a", "0" * 64, {"text": "x" * 100_000}))
    assert journal.done() == {}
    journal.close()


@contextlib.contextmanager
def small_disk(folder, options):
    """Mount a disk of its own where that is allowed."""
    folder.mkdir()
    if subprocess.run(
        ["mount", "-t", "tmpfs", "-o", options, "none", folder], capture_output=True
    ).returncode:
        pytest.skip("disks cannot be mounted here")
    try:
        yield folder
    finally:
        subprocess.run(["umount", folder], check=True)


@pytest.mark.parametrize(
    ("options", "fillings"),
    [("size=300k", (280, 200, 80, 8)), ("size=100m,nr_inodes=16", (14, 12, 8, 4))],
    ids=["bytes", "inodes"],
)
def test_a_disk_that_fills_up_is_said_and_a_rerun_gives_the_same_lines(
    las_file, tmp_path, options, fillings, linework
):
    assert linework("extract", las_file, "-o", tmp_path / "right.gpkg", "--work", tmp_path / "w").code == 0
    with small_disk(tmp_path / "disk", options) as disk:
        for n in fillings:
            # Room runs out at another place each time
            for path in disk.iterdir():
                shutil.rmtree(path) if path.is_dir() else path.unlink()
            if "inodes" in options:
                for i in range(n):
                    (disk / f"filler{i}").touch()
            else:
                (disk / "filler").write_bytes(bytes(1024 * n))
            ended = linework("extract", las_file, "-o", disk / "lines.gpkg", "--work", disk / "work")
            assert ended.code == 5, ended.stderr
            assert "ree some space" in ended.line
            assert not (disk / "lines.gpkg").exists()
        subprocess.run(["mount", "-o", "remount,size=100m,nr_inodes=1000", disk], check=True)
        ended = linework("extract", las_file, "-o", disk / "lines.gpkg", "--work", disk / "work", "--resume")
        assert ended.code == 0, ended.stderr
        assert (disk / "lines.gpkg").read_bytes() == (tmp_path / "right.gpkg").read_bytes()


def test_temporary_files_on_a_full_disk_do_not_matter_to_outputs(las_file, tmp_path):
    """Parts are written beside the output; the folder for temporary files may be full, or another disk."""
    with small_disk(tmp_path / "disk", "size=16k") as disk:
        (disk / "filler").write_bytes(bytes(16_384))
        for temporary in (disk, tmp_path / "missing"):
            output = tmp_path / f"{temporary.name}.gpkg"
            done = subprocess.run(
                [sys.executable, "-m", "linework", "extract", las_file, "-o", output, "--workers", "1"],
                env=os.environ | {"TMPDIR": str(temporary), "SQLITE_TMPDIR": str(temporary)},
                capture_output=True, text=True, check=False,
            )  # fmt: skip
            assert done.returncode == 0, done.stderr
            assert output.exists()
