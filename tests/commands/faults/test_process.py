"""The command as the system sees it: streams, signals, exit codes, permissions."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest

COMMAND = (sys.executable, "-m", "linework")


def run(*arguments: object, **options) -> subprocess.CompletedProcess[str]:
    options = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE} | options
    return subprocess.run([*COMMAND, *map(str, arguments)], text=True, check=False, timeout=300, **options)


def test_help_and_version():
    said = run("--help")
    assert said.returncode == 0
    for command in ("info", "extract", "evaluate", "convert", "simulate", "config"):
        assert command in said.stdout
    assert run("--version").stdout.startswith("linework ")


def test_help_imports_nothing_heavy():
    code = (
        "import sys; from linework.cli.app import main; main(['--help']);"
        "heavy = {'numpy', 'numba', 'scipy', 'laspy', 'pyogrio', 'matplotlib', 'rich', 'pandas'};"
        "print(sorted(heavy & set(sys.modules)), file=sys.stderr)"
    )
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert said.stderr.strip() == "[]"


def test_extract_imports_nothing_it_does_not_need(las_file, tmp_path):
    code = (
        "import sys; from linework.cli.app import main;"
        f"code = main(['extract', {str(las_file)!r}, '-o', {str(tmp_path / 'a.gpkg')!r}, '--quiet']);"
        "heavy = {'matplotlib', 'scipy.stats', 'rasterio', 'ezdxf', 'rich', 'jinja2', 'embreex'};"
        "print(code, sorted(heavy & set(sys.modules)))"
    )
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert said.stdout.splitlines()[-1] == "0 []"


def test_the_main_job_as_a_user_runs_it(las_file, tmp_path):
    said = run("extract", las_file, "-o", tmp_path / "lines.gpkg", "--json")
    assert said.returncode == 0, said.stderr
    assert json.loads(said.stdout)["counts"]["points_used"] == 400


def test_an_error_is_one_line(tmp_path):
    said = run("extract", tmp_path / "no.laz", "-o", tmp_path / "lines.gpkg")
    assert said.returncode == 3
    assert said.stdout == ""
    assert said.stderr.splitlines() == [
        f"error: {tmp_path / 'no.laz'}: cannot be opened: No such file or directory. Check the name."
    ]


def test_debug_shows_the_traceback_wherever_it_stands(tmp_path):
    for place in (0, 4):
        arguments = ["extract", tmp_path / "no.laz", "-o", tmp_path / "lines.gpkg"]
        arguments.insert(place, "--debug")
        said = run(*arguments)
        assert said.returncode == 3
        assert "Traceback" in said.stderr
        assert said.stderr.splitlines()[-1].startswith("error: ")


def test_no_command_is_a_usage_error():
    said = run()
    assert said.returncode == 2
    assert said.stderr.splitlines() == ["error: linework: Missing command. See linework --help."]


def test_a_folder_that_may_not_be_written(las_file, tmp_path):
    locked = tmp_path / "locked"
    locked.mkdir(mode=0o555)
    # Root may write anywhere: be nobody, once a first refusal has loaded all that Python needs
    code = (
        "import os, sys; from linework.cli.app import main;"
        f"first = main(['extract', {str(las_file)!r}, '-o', {str(las_file)!r}]);"
        "os.geteuid() or os.setuid(65534);"
        f"sys.exit(main(['extract', {str(las_file)!r}, '-o', 'lines.gpkg']) if first == 6 else 1)"
    )
    said = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, cwd=locked
    )
    assert said.returncode == 5, said.stderr
    assert said.stderr.splitlines()[1].startswith("error: lines.gpkg: cannot be written: Permission denied")
    assert list(locked.iterdir()) == []


def test_a_full_stdout_is_an_error_and_a_closed_one_is_not(las_file):
    with Path("/dev/full").open("w") as full:
        said = run("info", las_file, "--json", "--quiet", stdout=full)
    assert said.returncode == 5
    (line,) = said.stderr.splitlines()
    assert line.startswith("error: standard output or a temporary file: no space left")
    closed = subprocess.run(
        ["sh", "-c", '"$@" >&-', "sh", *COMMAND, "info", str(las_file), "--quiet"],
        stderr=subprocess.PIPE, text=True, check=False, timeout=120,
    )  # fmt: skip
    assert closed.returncode == 0
    assert closed.stderr == ""


def test_a_reader_that_leaves_is_no_trouble(las_file):
    reading, writing = os.pipe()
    os.close(reading)
    with os.fdopen(writing, "w") as gone:
        said = run("info", las_file, "--quiet", stdout=gone)
        assert said.returncode == 141
        assert said.stderr == ""
        said = run("--help", stdout=gone)
    assert said.stderr == ""


@pytest.fixture
def slow(tmp_path, las_file):
    """Return a running extraction whose method waits for ever, and its output's folder."""
    code = (
        "import sys, time; from linework.cli.app import main; from linework.methods.radon.method import RailMethod;"
        "RailMethod.look = lambda self, piece: (print('waiting', flush=True), time.sleep(3600));"
        f"sys.exit(main(['extract', {str(las_file)!r}, '-o', {str(tmp_path / 'out' / 'a.gpkg')!r}, '--quiet', '--workers', '1']))"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "waiting\n"
    yield process, tmp_path / "out"
    process.kill()
    process.wait()
    process.stdout.close()
    process.stderr.close()


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_interrupted_leaves_nothing_behind(slow, number, code):
    process, folder = slow
    process.send_signal(number)
    _, said = process.communicate(timeout=300)
    assert process.returncode == code
    assert len(said.splitlines()) == 1
    assert said.startswith("interrupted")
    assert not folder.exists()


def test_two_runs_do_not_share_an_output(slow, las_file):
    _, folder = slow
    said = run("extract", las_file, "-o", folder / "a.gpkg", "--overwrite")
    assert said.returncode == 6
    assert "another run" in said.stderr


def test_a_killed_run_does_not_block_the_next(slow, las_file):
    process, folder = slow
    process.kill()
    process.wait()
    assert [p.name for p in folder.iterdir()] == [".a.gpkg.lock"]
    assert run("extract", las_file, "-o", folder / "a.gpkg").returncode == 0
    assert sorted(p.name for p in folder.iterdir()) == ["a.gpkg", "run.json"]


def test_our_own_fault_is_said_and_logged(las_file, tmp_path):
    code = (
        "import sys; from linework.cli.app import main; from linework.methods.radon.method import RailMethod;"
        "RailMethod.look = lambda self, piece: 1 / 0;"
        f"sys.exit(main(['extract', {str(las_file)!r}, '-o', {str(tmp_path / 'a.gpkg')!r}, '--quiet', '--features', 'guardrail']))"
    )
    said = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "TMPDIR": str(tmp_path)},
    )
    assert said.returncode == 1
    (line,) = said.stderr.splitlines()
    assert line.startswith(
        "error: linework: RuntimeError: ZeroDivisionError: division by zero (a bug in linework"
    )
    (log,) = tmp_path.glob("linework-*.log")
    assert str(log) in line
    assert "Traceback" in log.read_text()
    assert not (tmp_path / "a.gpkg").exists()


def test_our_own_fault_in_a_tile_is_named_and_the_rest_is_written(las_file, tmp_path):
    code = (
        "import sys; from linework.cli.app import main; from linework.methods.radon.method import RailMethod;"
        "RailMethod.look = lambda self, piece: 1 / 0;"
        f"sys.exit(main(['extract', {str(las_file)!r}, '-o', {str(tmp_path / 'a.gpkg')!r}, '--quiet']))"
    )
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert said.returncode == 4
    assert "1 of 3 tiles left out: tile guardrail+barrier+fence-" in said.stderr.splitlines()[-1]
    assert "ZeroDivisionError: division by zero. See run.json." in said.stderr.splitlines()[-1]
    (failure,) = json.loads((tmp_path / "run.json").read_text())["failures"]
    assert "Traceback" in failure["trace"]
    assert (tmp_path / "a.gpkg").exists()


#: Bytes that are no text; an option, a line's end, a colour of the terminal, and what means something in addresses,
#: shells and SQL.
NAMES = [b"n\xff\xfe", "-d new\nline red\x1b[31m ü #;%?'\".laz".encode()]


@pytest.mark.parametrize("name", NAMES)
def test_names_of_any_bytes(linework, las_file, tmp_path, name):
    """Files and folders of any name are read and written, and no record breaks on them."""
    folder = tmp_path / os.fsdecode(name)
    folder.mkdir()
    shutil.copy(las_file, folder / os.fsdecode(name + b".laz"))
    output = folder / os.fsdecode(name + b".gpkg")
    found = linework("extract", folder, "-o", output, "--features", "cable", "--quiet")
    assert (found.code, output.is_file()) == (0, True), found.stderr
    json.loads((folder / "run.json").read_text(encoding="utf-8"))
    assert linework("raster", folder, "-o", folder / os.fsdecode(name), "--quiet").code == 0
    described = linework("info", folder, "--json", "--quiet")
    assert json.loads(described.stdout)["points"] > 0
    assert linework("evaluate", output, output, "--quiet").code in (0, 2)  # no lines to score


@pytest.mark.parametrize("pattern", ["a**b.laz", "**.laz", "**b/*.laz"])
def test_a_pattern_that_is_none(linework, tmp_path, pattern):
    found = linework("info", tmp_path / pattern)
    assert (found.code, "** stands for folders" in found.line) == (3, True)
