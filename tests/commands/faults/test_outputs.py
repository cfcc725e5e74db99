"""Outputs of every command: never a file that is read, never two runs into one, never half of one."""

from __future__ import annotations

import os
import shutil
import sqlite3
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from linework.files.output import locks
from linework.files.output.locks import reserve_folder, reserve_output
from linework.files.vectors.read_write import read_lines, write_lines
from linework.model.lines import LineSet

CRS = "EPSG:25832+7837"


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Return a simulated survey with images."""
    from linework.library.simulate import simulate

    folder = tmp_path_factory.mktemp("made") / "s1"
    simulate(folder, length_m=40.0, points_per_m=100.0, image_size="732x484", image_every_m=20.0)
    return folder


@pytest.fixture
def survey(made, tmp_path):
    return Path(shutil.copytree(made, tmp_path / "s1"))


def contents(folder):
    return {
        path.relative_to(folder): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and ".linework" not in path.parts
    }


def drawn(path):
    write_lines(LineSet.from_lines([np.array([[0.0, 0, 0], [9, 0, 0]])], kind="cable", crs=CRS), path)
    return path


#: Commands, with {s} for the survey, and files of theirs that would be destroyed.
OVER_INPUTS = [
    "locate {s} -o {s}/gnss.csv",
    "locate {s} -o {s}/gyro.csv",
    "locate {s} -o {s}/wheels.csv",
    "locate {s} -o {s}/trajectory.csv",
    "locate {s} -o {s}/left.csv",
    "locate {s} -o {s}/t.csv --plot {s}/left/000000.png",
    "extract {s} -o {s}/truth.gpkg",
    "extract {s} -o {s}/../s1/truth_images.gpkg --resume",
    "extract {s}/survey.toml -o {s}/truth.gpkg",
    "extract {s} -o {s}/l.gpkg --report {s}/link.html",
    "extract {s} -o {s}/link.gpkg",
    "extract {s} -o {s}/hard.gpkg",
    "extract {s}/points -o {s}/pass.gpkg",
    "extract {s} -o {s}/run.gpkg --config {s}/run.toml",
    "extract {s} -o {s}/own.gpkg --trajectory {s}/own.csv",
    "trace {s} --at 1,2 -o {s}/truth.gpkg",
    "trace {s} --at 1,2 -o {s}/truth.gpkg --append",
    "trace {s} --image {s}/left/000000.png --at-px 1,2 -o {s}/truth.gpkg",
    "photolog {s} -o {s}/link.html",
    "raster {s} -o {s}",
    "raster {s} -o {s}/points",
    "raster {s} -o {s}/..",
    "raster {s} -o {s}/left",
    "raster {s}/points -o {s}",
    "convert {s}/truth.gpkg {s}/truth.gpkg",
    "convert {s}/truth.gpkg {s}/link.gpkg",
    "convert {s}/truth.gpkg {s}/hard.gpkg",
    "evaluate {s}/truth.gpkg {s}/truth.gpkg --picture {s}/link.png",
]  # fmt: skip


@pytest.mark.parametrize("command", OVER_INPUTS)
def test_no_command_replaces_what_it_reads(survey, linework, command):
    for name in ("link.gpkg", "link.html", "link.png"):
        (survey / name).symlink_to("truth.gpkg")
    (survey / "hard.gpkg").hardlink_to(survey / "truth.gpkg")
    (survey / "pass.gpkg").hardlink_to(survey / "points" / "pass_1.laz")
    (survey / "run.toml").write_text("")
    (survey / "run.gpkg").symlink_to("run.toml")
    shutil.copy(survey / "trajectory.csv", survey / "own.csv")
    (survey / "own.gpkg").symlink_to("own.csv")
    before = contents(survey)
    ended = linework(*command.format(s=survey).split(), "--overwrite")
    assert ended.code == 2, ended
    assert "the output is the input" in ended.line or "the output folder holds the input" in ended.line
    assert "hoose another" in ended.line
    assert contents(survey) == before
    assert sorted(p.name for p in survey.parent.iterdir()) == ["s1"]


#: Commands, with {o} for the output.
ALL = {
    "locate {s} -o {o}.csv": "{o}.csv",
    "locate {s} -o {s}/t.csv --plot {o}.png": "{o}.png",
    "extract {s} -o {o}.gpkg": "{o}.gpkg",
    "extract {s} -o {s}/l.gpkg --report {o}.html": "{o}.html",
    "trace {s} --at 1,2 -o {o}.gpkg": "{o}.gpkg",
    "trace {s} --image left/000000.png --at-px 1,2 -o {o}.gpkg": "{o}.gpkg",
    "photolog {s} -o {o}.html": "{o}.html",
    "convert {s}/truth.gpkg {o}.geojson": "{o}.geojson",
    "evaluate {s}/truth.gpkg {s}/truth.gpkg --picture {o}.png": "{o}.png",
    "raster {s} -o {o}": "{o}",
    "simulate -o {o} --length-m 40 --no-images": "{o}",
    "demo {o}": "{o}",
}


@pytest.mark.parametrize("command", ALL)
def test_the_second_of_two_runs_into_one_output_is_refused_at_once(survey, tmp_path, linework, command):
    output = Path(ALL[command].format(o=tmp_path / "new" / "out"))
    reserve = reserve_output if output.suffix else reserve_folder
    with reserve(output):
        ended = linework(*command.format(s=survey, o=tmp_path / "new" / "out").split())
        assert (ended.code, "another run is writing it" in ended.line) == (6, True), ended
    assert not output.parent.exists()


def test_of_two_simulations_into_one_folder_one_ends_well(tmp_path):
    words = [sys.executable, "-m", "linework", "simulate", "-o", tmp_path / "out", "--length-m", "40",
             "--points-per-m", "100", "--no-images", "--overwrite"]  # fmt: skip
    runs = [
        subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) for _ in range(2)
    ]
    said = [run.communicate(timeout=300)[1] for run in runs]
    codes = sorted(run.returncode for run in runs)
    # Where one has ended before the other begins, both end well
    assert codes in ([0, 6], [0, 0]), said
    assert codes == [0, 0] or "another run is writing it" in "".join(said)
    assert (tmp_path / "out" / "truth.gpkg").exists()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["out"]


@pytest.mark.parametrize("command", ALL)
def test_an_output_that_is_there_stays_without_overwrite(survey, tmp_path, linework, command):
    output = Path(ALL[command].format(o=tmp_path / "out"))
    kept = output if output.suffix else output / "mine.txt"
    kept.parent.mkdir(exist_ok=True)
    kept.write_text("mine")
    ended = linework(*command.format(s=survey, o=tmp_path / "out").split())
    assert ended.code == 6, ended
    assert kept.read_text() == "mine"


@pytest.mark.parametrize("command", ALL)
def test_a_place_that_cannot_be_written_is_refused_before_any_work(survey, tmp_path, linework, command):
    (tmp_path / "file").write_text("mine")
    for place, words in ((Path("/proc/new"), "cannot be written"), (tmp_path / "file", "not a ")):
        before = contents(survey)
        ended = linework(*command.format(s=survey, o=place / "out").split())
        assert ended.code == 5, ended
        assert words in ended.line.lower()
        assert contents(survey) == before


def test_a_reader_that_holds_the_output_keeps_the_old_one(tmp_path, linework):
    old, new = drawn(tmp_path / "old.gpkg"), tmp_path / "new.geojson"
    two = LineSet.from_lines([np.array([[0.0, 0, 0], [9, 0, 0]])] * 2, kind="cable", crs=CRS)
    write_lines(two, new)
    with sqlite3.connect(old) as reader:
        reader.execute("BEGIN")
        assert reader.execute("SELECT count(*) FROM cable").fetchone() == (1,)
        assert linework("convert", new, old, "--overwrite").code == 0
        assert reader.execute("SELECT count(*) FROM cable").fetchone() == (1,)
    reader.close()
    assert len(read_lines(old)) == 2


def test_where_the_file_system_has_no_locks_an_output_is_reserved_by_a_database(
    survey, tmp_path, linework, monkeypatch
):
    monkeypatch.setattr(locks, "fcntl", None)
    command = ("convert", survey / "truth.gpkg", tmp_path / "out.geojson")
    with reserve_output(tmp_path / "out.geojson"):
        assert linework(*command).code == 6
    assert linework(*command).code == 0


def test_a_folder_of_temporary_files_that_is_missing_does_not_matter(survey, tmp_path):
    done = subprocess.run(
        [sys.executable, "-m", "linework", "convert", survey / "truth.gpkg", tmp_path / "out.fgb"],
        env=os.environ | {"TMPDIR": str(tmp_path / "none"), "CPL_TMPDIR": str(tmp_path / "none")},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("suffix", [".gpkg", ".geojson", ".dxf", ".fgb"])
def test_an_output_without_features_is_a_whole_file(tmp_path, linework, suffix):
    empty = tmp_path / "empty.gpkg"
    write_lines(LineSet.empty(CRS), empty, kinds=["cable"])
    assert linework("convert", empty, tmp_path / f"out{suffix}").code == 0
    back = read_lines(tmp_path / f"out{suffix}")
    assert len(back) == 0
