"""SIGTERM ends a command soon whatever a library does, and nothing half written stays."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from tests.scenes.drawing_scenes import some_lines
from tests.workbench.serve_process import wait_until

from linework.files.vectors.read_write import write_lines

#: Calls into C that do not return, whatever signals come: waiting for a lock that it holds itself, with the interpreter's
#: lock, so that no thread of Python runs; and computing without the interpreter's lock.
WAITS = "import ctypes; m = ctypes.create_string_buffer(64); c = ctypes.PyDLL(None); c.pthread_mutex_lock(m)"
CALLS = {
    "waits": (WAITS, "(print('stuck', flush=True), c.pthread_mutex_lock(m))"),
    "computes": (
        "import hashlib",
        "(print('stuck', flush=True), hashlib.pbkdf2_hmac('md5', b'', b'', 1 << 30))",
    ),
}
#: Where each command is stuck: while it reads, and while its output is half written.
PLACES = {
    "reading": "import linework.files.vectors.gdal_input as g; g.pyogrio.list_layers = lambda *_: {stuck}",
    "writing": "import linework.files.vectors.geojson as g; old = g.write_geojson;"
    "g.write_geojson = lambda *a, **k: (old(*a, **k), {stuck})",
}
CODE = "import sys; {place}; from linework.cli.app import main; sys.exit(main())"


def ended(process: subprocess.Popen, number: int, within_s: float) -> None:
    """Send a signal and wait for the process to end."""
    process.send_signal(number)
    process.wait(timeout=within_s)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    write_lines(some_lines(), tmp_path / "lines.gpkg")
    return tmp_path / "lines.gpkg"


def start(place: str, stuck: str, *arguments: object) -> subprocess.Popen:
    first, call = CALLS[stuck]
    code = CODE.format(place=f"{first}; {PLACES[place].format(stuck=call)}")
    command = [sys.executable, "-c", code, *map(str, arguments)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert process.stdout.readline() == "stuck\n"
    return process


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere nothing ends a process that is in C")
@pytest.mark.parametrize("stuck", CALLS)
@pytest.mark.parametrize("place", PLACES)
def test_a_call_that_does_not_return_is_ended(path, tmp_path, place, stuck):
    output = tmp_path / "new" / "folder" / "out.geojson"
    process = start(place, stuck, "convert", path, output)
    try:
        if place == "writing":
            assert len(list(output.parent.iterdir())) >= 1
        ended(process, signal.SIGTERM, 10)
        _, said = process.communicate(timeout=10)
    finally:
        process.kill()
    # As a shell reports it: 143
    assert process.returncode in (-signal.SIGTERM, 128 + signal.SIGTERM)
    assert said == "interrupted: nothing was written; run the same command again\n"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["lines.gpkg"]


#: A command that saves for longer than one that is stuck may take to end.
SAVES = """
import signal, sys, threading, time
import linework.files.vectors.gdal_input as g
from linework.cli.app import main
from linework.processes.forced_end import wait_until_saved

def save(*_):
    told = threading.Event()
    signal.signal(signal.SIGTERM, lambda *_: (wait_until_saved(), told.set()))
    print("stuck", flush=True)
    told.wait()
    time.sleep(3.0)
    sys.exit(143)

g.pyogrio.list_layers = save
sys.exit(main())
"""


def test_a_command_that_saves_may_take_its_time(path, tmp_path):
    command = [sys.executable, "-c", SAVES, "convert", str(path), str(tmp_path / "out.geojson")]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        assert process.stdout.readline() == "stuck\n"
        ended(process, signal.SIGTERM, 60)
        _, said = process.communicate(timeout=10)
    finally:
        process.kill()
    assert process.returncode == 143
    assert "nothing was written" not in said


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere nothing ends a process that is in C")
def test_the_second_interrupt_ends_a_call_that_does_not_return(path, tmp_path):
    process = start("reading", "waits", "convert", path, tmp_path / "out.geojson")
    try:
        wait_until(lambda: sleeps(process.pid))
        process.send_signal(signal.SIGINT)
        with pytest.raises(subprocess.TimeoutExpired):
            process.wait(timeout=0.5)
        ended(process, signal.SIGINT, 10)
    finally:
        process.kill()
        process.communicate()
    assert process.returncode == -signal.SIGINT


def sleeps(pid: int) -> bool:
    """Return whether the first thread waits, here for the lock; until then, a signal may come before the call."""
    return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] == "S"


def children_of(pid: int) -> list[int]:
    tasks = Path(f"/proc/{pid}/task").iterdir()
    return [int(child) for task in tasks for child in (task / "children").read_text().split()]


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_the_watching_process_ends_with_the_command(path, tmp_path):
    process = start("reading", "waits", "convert", path, tmp_path / "out.geojson")
    watching = children_of(process.pid)
    assert len(watching) == 1
    process.kill()
    process.communicate()
    until = time.monotonic() + 10
    while Path(f"/proc/{watching[0]}/cmdline").exists() and Path(f"/proc/{watching[0]}/cmdline").read_bytes():
        assert time.monotonic() < until
        time.sleep(0.01)


def test_a_command_that_ends_by_itself_leaves_no_process(path, tmp_path):
    command = [sys.executable, "-m", "linework", "convert", str(path), str(tmp_path / "out.geojson")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, env=os.environ, check=False)
    assert (done.returncode, done.stderr) == (0, "")
