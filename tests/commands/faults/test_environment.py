"""What surrounds a command: language, time zone, clock, current folder, network, processors, umask. None of it changes a byte."""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from tests.conftest import CRS
from tests.scenes.drawing_scenes import some_lines

from linework.files.las.write import write_las
from linework.files.vectors.read_write import write_lines
from linework.simulation.simulate import simulate_survey

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="set up with the tools of Linux")
COMMAND = (sys.executable, "-m", "linework")
#: A time a day ago, to whoever asks for it.
A_DAY_AGO = "import sys, time; now = time.time; time.time = lambda: now() - 86_400.0\n"


@pytest.fixture(scope="module")
def points(tmp_path_factory) -> Path:
    """Return a folder with two laser files of a short drive."""
    folder = tmp_path_factory.mktemp("environment") / "points"
    found = simulate_survey("bends", 612, 40.0, points_per_m=300).points
    half = len(found) // 2
    for name, part in (("a", slice(0, half)), ("b", slice(half, None))):
        write_las(found.take(part), folder / f"{name}.laz", crs=CRS)
    return folder


@pytest.fixture(scope="module")
def undisturbed(points, tmp_path_factory) -> str:
    return lines_of(points, tmp_path_factory.mktemp("undisturbed"))


def extraction(points: Path, folder: Path, *, workers: int = 1) -> list[str]:
    """Return the arguments of a run that writes its lines and its work into a folder."""
    where = ["-o", str(folder / "lines.gpkg"), "--work", str(folder / "work")]
    return ["extract", str(points), *where, "--quiet", "--workers", str(workers)]


def lines_of(
    points: Path, folder: Path, *, before: tuple[str, ...] = (), workers: int = 1, **environment: str
) -> str:
    """Return the SHA-256 of the lines that a run in this environment writes."""
    said = subprocess.run(
        [*before, *COMMAND, *extraction(points, folder, workers=workers)], env=os.environ | environment,
        capture_output=True, text=True, check=False, timeout=600,
    )  # fmt: skip
    assert said.returncode == 0, said.stderr
    return hashlib.sha256((folder / "lines.gpkg").read_bytes()).hexdigest()


@pytest.mark.parametrize(
    "environment",
    [
        {"LC_ALL": "C", "TZ": "Pacific/Auckland", "PYTHONHASHSEED": "1", "PYTHONUTF8": "0"},
        {"LC_ALL": "POSIX", "LANG": "", "TZ": "UTC", "PYTHONHASHSEED": "2"},
        {"LC_ALL": "de_DE.UTF-8", "LC_NUMERIC": "de_DE.UTF-8", "TZ": "Europe/Berlin", "PYTHONHASHSEED": "77"},
        {"LC_ALL": "tr_TR.ISO-8859-9", "TZ": "America/St_Johns", "PYTHONIOENCODING": "ascii"},
    ],
    ids=lambda one: one["LC_ALL"],
)
def test_language_time_zone_and_hash_seed_change_no_byte(points, undisturbed, tmp_path, environment):
    assert lines_of(points, tmp_path, **environment) == undisturbed


def test_one_processor_and_two_workers_change_no_byte(points, undisturbed, tmp_path):
    taskset = shutil.which("taskset")
    before = (taskset, "-c", str(min(os.sched_getaffinity(0)))) if taskset else ()
    assert lines_of(points, tmp_path, before=before, workers=2) == undisturbed


def test_without_a_network_nothing_changes(points, undisturbed, tmp_path):
    unshare = shutil.which("unshare")
    if (
        unshare is None
        or subprocess.run([unshare, "-n", "true"], capture_output=True, check=False).returncode
    ):
        pytest.skip("a process without a network may not be made here")
    assert lines_of(points, tmp_path, before=(unshare, "-n")) == undisturbed


def test_without_home_and_temporary_folder_nothing_changes(points, undisturbed, tmp_path):
    assert (
        lines_of(points, tmp_path, HOME="/nonexistent", TMPDIR="/nonexistent", XDG_CACHE_HOME="")
        == undisturbed
    )


def test_a_clock_that_is_set_back_between_two_runs_changes_nothing(linework, points, undisturbed, tmp_path):
    """The store of a run of tomorrow is used, and its unfinished run is resumed."""
    assert linework(*extraction(points, tmp_path)).code == 0
    (tmp_path / "lines.gpkg").unlink()
    code = A_DAY_AGO + "from linework.cli.app import main; sys.exit(main(sys.argv[1:]))"
    said = subprocess.run(
        [sys.executable, "-c", code, *extraction(points, tmp_path), "--resume"],
        capture_output=True, text=True, check=False, timeout=600,
    )  # fmt: skip
    assert said.returncode == 0, said.stderr
    assert hashlib.sha256((tmp_path / "lines.gpkg").read_bytes()).hexdigest() == undisturbed


def test_a_run_that_was_moved_is_known_again(linework, points, undisturbed, tmp_path):
    first, second = tmp_path / "first", tmp_path / "second"
    first.mkdir()
    shutil.copytree(points, first / "points")
    assert linework(*extraction(first / "points", first)).code == 0
    first.rename(second)
    (second / "lines.gpkg").unlink()
    assert lines_of(second / "points", second) == undisturbed


def test_a_current_folder_that_is_gone(tmp_path):
    write_lines(some_lines(), tmp_path / "lines.gpkg")
    gone = tmp_path / "gone"
    gone.mkdir()
    shell = f'cd "{gone}" && rmdir "{gone}" && exec "$@"'
    words = ["sh", "-c", shell, "sh", *COMMAND]
    whole = [str(tmp_path / "lines.gpkg"), str(tmp_path / "out.geojson")]
    said = subprocess.run(
        [*words, "convert", *whole], capture_output=True, text=True, check=False, timeout=300
    )
    assert said.returncode in (0, 5), said.stderr
    gone.mkdir(exist_ok=True)
    said = subprocess.run(
        [*words, "convert", "lines.gpkg", "out.geojson"],
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    assert said.returncode in (3, 5), said.stderr
    # The shell, too, says that its folder is gone
    (line,) = (line for line in said.stderr.splitlines() if not line.startswith("sh: "))
    assert line.startswith("error: ")


@pytest.mark.parametrize(("mask", "mode"), [(0o077, 0o600), (0o022, 0o644), (0o000, 0o666)])
def test_outputs_have_the_permissions_that_umask_leaves(tmp_path, mask, mode):
    lines = tmp_path / "lines.gpkg"
    write_lines(some_lines(), lines)
    outputs = [tmp_path / f"out{suffix}" for suffix in (".gpkg", ".geojson", ".fgb", ".dxf")]
    # One process for all formats, whose umask is its own
    code = (
        f"import os; os.umask({mask}); from linework.cli.app import main;"
        f"raise SystemExit(max(main(['convert', {str(lines)!r}, output]) for output in {[*map(str, outputs)]}))"
    )
    subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, timeout=300)
    for output in outputs:
        assert output.stat().st_mode & 0o777 == mode, output.suffix
