"""No output is a file that is read, and a file never stands beside what belonged to an older one."""

import errno
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from linework.errors import MachineError, OutputExistsError, UsageError
from linework.files.output.inputs import InputFiles, note_inputs
from linework.files.output.locks import reserve_folder, reserve_output
from linework.files.output.publish import part_path, publish
from linework.files.survey.open import open_survey
from linework.files.vectors.read_write import read_lines, write_lines
from linework.model.lines import LineSet

CRS = "EPSG:25832+7837"
TOML = """
name = "drive"
crs = "EPSG:25832+7837"
[trajectory]
file = "poses.csv"
[navigation]
gnss = "logs/gnss.csv"
gyro = "logs/gyro.csv"
wheels = "logs/wheels.csv"
[events]
file = "keys.csv"
[cameras.left]
images = "left/*.png"
times = "left.txt"
[cameras.right]
images = "right.csv"
"""
NAMED = [
    "survey.toml", "truth.gpkg", "truth_images.gpkg", "poses.csv", "logs/gnss.csv", "logs/gyro.csv",
    "logs/wheels.csv", "keys.csv", "left/0.png", "left.txt", "right.csv", "images/r0.png",
]  # fmt: skip


@pytest.fixture
def survey(tmp_path):
    """Return a survey of which every file has its own name as content; nothing but the survey.toml is opened."""
    folder = tmp_path / "s"
    for name in NAMED:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(name)
    (folder / "survey.toml").write_text(TOML)
    (folder / "right.csv").write_text("file,time_s\nimages/r0.png,1.0\n")
    return folder


def contents(folder):
    return {path: path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def spellings(path, elsewhere):
    """Yield other ways to name a file."""
    yield path
    yield path.parent / ".." / path.parent.name / path.name
    yield Path(os.path.relpath(path))
    soft = elsewhere / f"soft_{path.name}"
    soft.symlink_to(path)
    yield soft
    hard = elsewhere / f"hard_{path.name}"
    hard.hardlink_to(path)
    yield hard
    (elsewhere / "folder").symlink_to(path.parent)
    yield elsewhere / "folder" / path.name


@pytest.mark.parametrize("name", NAMED)
def test_no_file_of_a_survey_becomes_an_output(survey, tmp_path, name):
    before = contents(survey)
    other = tmp_path / "other"
    other.mkdir()
    for output in spellings(survey / name, other):
        with (
            pytest.raises(UsageError, match="the output is the input file") as caught,
            reserve_output(output, overwrite=True),
        ):
            open_survey(survey)
        assert caught.value.exit_code == 2
        assert str(caught.value).startswith(f"{output}: ")
    assert contents(survey) == before
    with reserve_output(survey / "lines.gpkg"), reserve_output(survey / "track.csv"):
        open_survey(survey)


def test_a_file_that_would_join_the_images_is_no_output(survey):
    with pytest.raises(UsageError), reserve_output(survey / "left" / "plot.png"):
        open_survey(survey)


def test_laser_files_are_no_outputs(las_file):
    for named in (las_file, las_file.parent):
        with pytest.raises(UsageError, match="the input file"), reserve_output(las_file, overwrite=True):
            open_survey(named)


def test_no_folder_that_holds_the_input_is_an_output(survey, tmp_path, monkeypatch):
    before = contents(survey)
    (tmp_path / "link").symlink_to(survey)
    monkeypatch.chdir(survey)
    for folder in (
        survey, tmp_path, survey / "logs", survey / "left", survey / "images", tmp_path / "link",
        tmp_path / "link" / "left", Path(), Path(".."),
    ):  # fmt: skip
        with (
            pytest.raises(UsageError, match="the output folder holds the input"),
            reserve_folder(folder, overwrite=True),
        ):
            open_survey(survey)
    with reserve_folder(survey / "images2"):
        open_survey(survey)
    with reserve_folder(tmp_path / "other"):
        open_survey(survey)
    assert contents(survey) == before


def test_what_the_user_named_is_no_output(tmp_path):
    given = tmp_path / "a.csv"
    given.write_text("x")
    with (
        pytest.raises(UsageError, match="the input"),
        reserve_output(given, overwrite=True, inputs=[None, given]),
    ):
        pass
    with pytest.raises(UsageError, match="holds"), reserve_folder(tmp_path, overwrite=True, inputs=[given]):
        pass
    with reserve_output(tmp_path / "b.csv", inputs=[given, tmp_path / "none.csv"]):
        pass
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.csv"]


def test_write_lines_keeps_the_files_of_an_opened_survey(survey):
    lines = LineSet.from_lines([np.array([[0.0, 0, 0], [9, 0, 0]])], kind="cable")
    before = contents(survey)
    open_survey(survey)
    with pytest.raises(UsageError, match=r"truth\.gpkg, which is a part of"):
        write_lines(lines, survey / "truth.gpkg", overwrite=True)
    assert contents(survey) == before
    write_lines(lines, survey / "lines.gpkg")
    write_lines(lines, survey / "lines.gpkg", overwrite=True)


def test_a_list_that_is_not_there_and_odd_patterns_refuse_nothing_else(tmp_path):
    note_inputs(
        InputFiles(
            name=tmp_path, files=(tmp_path / "gone",), root=tmp_path, patterns=("a/[b/*.png", "*.jpg"),
            lists=(tmp_path / "gone.csv",),
        )
    )  # fmt: skip
    (tmp_path / "b.csv").write_text("x")
    with reserve_output(tmp_path / "b.csv", overwrite=True):
        pass


HOLD = """
import sys, time
from pathlib import Path
from linework.files.output.locks import reserve_folder
with reserve_folder(Path(sys.argv[1])):
    print("held", flush=True)
    sys.stdin.read()
"""


def test_a_folder_that_another_run_writes_is_refused_at_once(tmp_path):
    folder = tmp_path / "new" / "out"
    other = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(folder)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert other.stdout.readline() == "held\n"
    with pytest.raises(OutputExistsError, match="another run is writing it"), reserve_folder(folder):
        pass
    other.communicate("")
    assert other.returncode == 0
    with reserve_folder(folder):
        pass
    assert list(tmp_path.iterdir()) == []


# A file and those beside it


def text_of(path):
    return path.read_text() if path.exists() else None


def publish_pair(folder, text, side):
    publish(
        folder / "a.txt", lambda part: part.write_text(text), lambda part: None, overwrite=True,
        beside={folder / "a.side": lambda part: side and f"{side} of {part.read_text()}".encode()},
    )  # fmt: skip


@pytest.mark.parametrize("new_side", ["new", None])
@pytest.mark.parametrize("old_side", ["old", None])
@pytest.mark.parametrize("call", ["rename", "replace", "fsync", "link", "unlink", "open"])
def test_whatever_call_fails_a_file_never_stands_beside_the_side_of_an_older_one(
    tmp_path, monkeypatch, call, old_side, new_side
):
    old = ("old", f"{old_side} of old" if old_side else None)
    new = ("new", f"{new_side} of new" if new_side else None)
    real, n_failed = getattr(os, call), 0
    for k in range(1, 60):
        folder = tmp_path / str(k)
        folder.mkdir()
        publish_pair(folder, "old", old_side)
        left = [k]

        def failing(*arguments, left=left, **options):
            left[0] -= 1
            if left[0] == 0:
                raise OSError(errno.EIO, "Input/output error")
            return real(*arguments, **options)

        with monkeypatch.context() as patched:
            patched.setattr(os, call, failing)
            try:
                publish_pair(folder, "new", new_side)
                code = 0
            except MachineError as error:
                code, n_failed = error.exit_code, n_failed + 1
        found = (text_of(folder / "a.txt"), text_of(folder / "a.side"))
        assert found == new if code == 0 else found in (old, new), (k, found)
        publish_pair(folder, "new", new_side)
        if call != "unlink":
            assert sorted(p.name for p in folder.iterdir()) == (["a.side"] if new_side else []) + ["a.txt"]
        if left[0] > 0:
            break
    assert n_failed or call in ("rename", "unlink", "link", "open")


def test_without_power_old_or_new_but_no_new_file_without_its_side(tmp_path, monkeypatch):
    """What is renamed was synchronised before, and the folder between the renames and after them."""
    publish_pair(tmp_path, "old", "old")
    calls = []
    sync, replace = os.fsync, Path.replace
    monkeypatch.setattr(
        os, "fsync", lambda fd: (calls.append(Path(f"/proc/self/fd/{fd}").readlink().name), sync(fd))[1]
    )
    monkeypatch.setattr(Path, "replace", lambda a, b: (calls.append(f"rename {b.name}"), replace(a, b))[1])
    publish_pair(tmp_path, "new", "new")
    main, side = part_path(tmp_path / "a.txt").name, part_path(tmp_path / "a.side").name
    folder = tmp_path.name
    assert calls == [main, side, "rename a.side", folder, "rename a.txt", folder]


KILLED = """
import os, sys
from pathlib import Path
from linework.files.output import publish as module
folder, call, k = Path(sys.argv[1]), sys.argv[2], int(sys.argv[3])
real, left = getattr(os, call), [k]
def dying(*arguments, **options):
    left[0] -= 1
    if left[0] == 0:
        os.kill(os.getpid(), 9)
    return real(*arguments, **options)
setattr(os, call, dying)
module.publish(folder / "a.txt", lambda part: part.write_text("new"), lambda part: None, overwrite=True,
               beside={folder / "a.side": lambda part: b"new of new"})
"""


@pytest.mark.parametrize(("call", "k"), [("fsync", 2), ("link", 1), ("fsync", 3), ("fsync", 4)])
def test_killed_at_a_call_the_new_file_never_stands_alone_and_a_rerun_mends(tmp_path, call, k):
    publish_pair(tmp_path, "old", "old")
    done = subprocess.run([sys.executable, "-c", KILLED, str(tmp_path), call, str(k)], check=False)
    assert done.returncode == -9
    found = (text_of(tmp_path / "a.txt"), text_of(tmp_path / "a.side"))
    # Between the two renames the old file stands beside what belongs to the new one
    assert found in (("old", "old of old"), ("old", "new of new"), ("new", "new of new"))
    publish_pair(tmp_path, "newest", "newest")
    assert contents(tmp_path) == {
        tmp_path / "a.txt": b"newest", tmp_path / "a.side": b"newest of newest",
    }  # fmt: skip


def test_an_interrupt_just_after_the_rename_leaves_the_new_pair(tmp_path, monkeypatch):
    publish_pair(tmp_path, "old", "old")
    replace = Path.replace

    def interrupted(part, target):
        replace(part, target)
        if target.name == "a.txt":
            raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(Path, "replace", interrupted)
        with pytest.raises(KeyboardInterrupt):
            publish_pair(tmp_path, "new", "new")
    assert contents(tmp_path) == {tmp_path / "a.txt": b"new", tmp_path / "a.side": b"new of new"}


def test_a_dxf_without_crs_does_not_inherit_that_of_the_file_it_replaces(tmp_path):
    line = np.array([[5e5, 5.4e6, 100.0], [5e5 + 9, 5.4e6, 100.0]])
    path = tmp_path / "a.dxf"
    write_lines(LineSet.from_lines([line], kind="cable", crs=CRS), path)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.dxf", "a.prj"]
    write_lines(LineSet.from_lines([line], kind="cable", crs="local"), path, overwrite=True)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.dxf"]
    assert read_lines(path).crs == "local"


def test_a_prj_of_somebody_else_is_refused_before_anything_is_written(tmp_path):
    (tmp_path / "a.prj").write_text("mine")
    lines = LineSet.from_lines([np.array([[0.0, 0, 0], [9, 0, 0]])], kind="cable", crs=CRS)
    with pytest.raises(OutputExistsError, match=r"a\.prj: output exists already"):
        write_lines(lines, tmp_path / "a.dxf")
    assert contents(tmp_path) == {tmp_path / "a.prj": b"mine"}


DXF = """
import sys, time
time.time_ns()
import numpy as np
from linework.files.vectors.read_write import write_lines
from linework.model.lines import LineSet
line = np.array([[5e5, 5.4e6, 100.0], [5e5 + 9, 5.4e6, 100.0]])
kinds = ["cable", "fence", "guardrail", "lane_marking", "road_boundary"]
write_lines(LineSet.from_lines([line + i for i in range(5)], kind=kinds, crs=sys.argv[2]), sys.argv[1])
"""


def test_dxf_is_the_same_bytes_in_every_process(tmp_path):
    """Seeds of the hash differ between processes: the order of sets must not show."""
    found = set()
    for seed in (1, 4, 5):
        path = tmp_path / f"{seed}.dxf"
        environment = os.environ | {"PYTHONHASHSEED": str(seed), "TZ": f"UTC{seed}"}
        subprocess.run([sys.executable, "-c", DXF, str(path), CRS], check=True, env=environment)
        found.add((path.read_bytes(), path.with_suffix(".prj").read_bytes()))
    assert len(found) == 1
