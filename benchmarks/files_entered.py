"""Count the files of linework entered by a survey in `linework extract`, and by a click in the workbench.

    python -m benchmarks.files_entered [--survey FOLDER] [--list]

Without ``--survey`` the demo's survey is simulated. `extract` runs with one worker; the click follows a lane marking
on a server that has opened the survey and is idle. A file is entered when one of its functions runs, in any process,
or when one of its compiled kernels is called from Python. Kernels called by other kernels, and functions that run
while a module is imported, are not counted. A call belongs to the nearest linework function below it on the stack, and
two files count as one pair however often one calls the other. `climbs` defines a climb. Being watched slows everything
down several times.
"""

from __future__ import annotations

import argparse
import ast
import contextlib
import functools
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import pyogrio
import shapely

import linework
from benchmarks.same_lines import DEMO

#: Measures the code, not its speed: run only when named.
ON_REQUEST = True
#: Time limit for a watched server to open the survey, kernels compiled. [s]
START_S = 600.0
#: Pause after the server reports that it is idle, so that the last replies are out. [s]
IDLE_S = 2.0
ROOT = Path(linework.__file__).resolve().parent
#: The calling file ("" for code that is not linework's) and the file that is entered.
Call = tuple[str, str]
#: The `sitecustomize.py` of every process: logs each new pair of calling and called function.
RECORDER = '''
import mmap, os, sys, threading

ROOT, FOLDER = os.environ["LINEWORK_ENTERED_ROOT"] + os.sep, os.environ["LINEWORK_ENTERED_FOLDER"]
with open(os.path.join(FOLDER, "part"), "rb") as file:
    part = mmap.mmap(file.fileno(), 1, access=mmap.ACCESS_READ)
log = open(os.path.join(FOLDER, f"{os.getpid()}.calls"), "a", buffering=1)
ours, seen, compiled, state = {}, set(), set(), {"part": 0, "patched": False}


def is_ours(code):
    if code not in ours:
        ours[code] = code.co_filename.startswith(ROOT)
    return ours[code]


def entered(code, frame):
    """Log a call of linework code from the nearest linework frame."""
    if part[0] != state["part"]:
        state["part"] = part[0]
        seen.clear()
    while frame is not None and not is_ours(frame.f_code):
        frame = frame.f_back
    key = (frame and frame.f_code, code)
    if key in seen:
        return
    caller = frame
    while frame is not None:
        if frame.f_code.co_name == "<module>" and is_ours(frame.f_code) and frame.f_globals["__name__"] != "__main__":
            return
        frame = frame.f_back
    if code.co_name == "<module>":
        return
    seen.add(key)
    names = [c.co_filename.removeprefix(ROOT) if c else "" for c in key]
    log.write("\\t".join([str(state["part"]), *names, code.co_name]) + "\\n")


def profile(frame, event, argument):
    if event == "call":
        # Numba reports its kernels by a frame without a caller: noted() has logged them
        if is_ours(frame.f_code) and frame.f_code not in compiled:
            entered(frame.f_code, frame.f_back)
        if not state["patched"] and "numba.core.registry" in sys.modules:
            note_kernels()


def note_kernels():
    dispatcher = sys.modules.get("numba.core.dispatcher")
    if not hasattr(dispatcher, "Dispatcher") or not hasattr(sys.modules["numba.core.registry"], "CPUDispatcher"):
        return
    state["patched"] = True
    call = dispatcher.Dispatcher.__call__

    def noted(self, *arguments, **named):
        if is_ours(self.py_func.__code__):
            compiled.add(self.py_func.__code__)
            entered(self.py_func.__code__, sys._getframe(1))
        return call(self, *arguments, **named)

    dispatcher.Dispatcher.__call__ = noted


threading.setprofile(profile)
sys.setprofile(profile)
'''


def main(arguments: tuple[str, ...] = ()) -> None:
    """Print a row for the command and one for the click."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.files_entered")
    parser.add_argument("--survey", type=Path, help="a simulated survey; the demo's if not given")
    parser.add_argument("--list", action="store_true", help="name the files and the climbs")
    options = parser.parse_args(list(arguments))
    with tempfile.TemporaryDirectory(prefix="linework-entered-") as name:
        folder = Path(name)
        survey = options.survey or simulated(folder / "survey")
        print(f"{'':8} files  without kernels  pairs  climbs  against imports")
        for job in (extract, click):
            calls = job(survey.resolve(), folder / job.__name__)
            report(job.__name__, calls, listed=options.list)


def simulated(folder: Path) -> Path:
    """Simulate the demo's survey."""
    command = [sys.executable, "-m", "linework", "simulate", "-o", folder, *DEMO.simulate.split(), "--quiet"]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return folder


def extract(survey: Path, folder: Path) -> set[Call]:
    """Return the calls of `linework extract` with one worker."""
    with recorded(folder):
        command = [sys.executable, "-m", "linework", "extract", survey, "-o", folder / "lines.gpkg"]
        command += ["--work", folder / "work", "--workers", "1", "--quiet"]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return calls_of(folder, 0)


def click(survey: Path, folder: Path) -> set[Call]:
    """Return the calls of a click on a lane marking, from the page's request to the end of the line."""
    from tests.workbench import serve_process
    from tests.workbench.follow_talk import talk_with

    serve_process.START_S = START_S
    _, _, shapes, _ = pyogrio.raw.read(survey / "truth.gpkg", layer="lane_marking", columns=[])
    longest = max(shapely.from_wkb(shapes), key=lambda line: line.length)
    at = longest.interpolate(0.5, normalized=True)
    with (
        recorded(folder),
        serve_process.served_survey(survey, "--work", folder / "work", lines=folder / "lines.gpkg") as served,
        talk_with(served) as talk,
    ):
        while served.get("/api/survey")["busy"]:
            time.sleep(1.0)
        time.sleep(IDLE_S)
        (folder / "part").write_bytes(b"\1")
        talk.say(type="pick", at=[at.x, at.y], kind="lane_marking")
        end = talk.hear_all()[-1]
        assert end["type"] == "stopped", end
    return calls_of(folder, 1)


@contextlib.contextmanager
def recorded(folder: Path) -> Iterator[None]:
    """Make all processes that are started inside log their calls to a folder."""
    folder.mkdir()
    (folder / "sitecustomize.py").write_text(RECORDER, encoding="utf-8")
    (folder / "part").write_bytes(b"\0")
    before = dict(os.environ)
    path = os.pathsep.join([str(folder), str(ROOT.parent), before.get("PYTHONPATH", "")])
    os.environ.update(PYTHONPATH=path, LINEWORK_ENTERED_ROOT=str(ROOT), LINEWORK_ENTERED_FOLDER=str(folder))
    try:
        yield
    finally:
        os.environ.clear()
        os.environ.update(before)


def calls_of(folder: Path, part: int) -> set[Call]:
    """Return the calls logged in one part of a recording."""
    rows = [row.split("\t") for log in folder.glob("*.calls") for row in log.read_text().splitlines()]
    return {(caller, entered) for number, caller, entered, _ in rows if int(number) == part}


def report(name: str, calls: set[Call], *, listed: bool) -> None:
    files = {file for call in calls for file in call} - {""}
    between = {(a, b) for a, b in calls if a and a != b}
    up, against = climbs(calls), against_imports(between)
    n_no_kernels = sum(not file.startswith("kernels/") for file in files)
    print(
        f"{name:8} {len(files):5}  {n_no_kernels:15}  {len(between):5}  {len(up):6}  {len(against):15}",
        flush=True,
    )
    if listed:
        for title, rows in (
            ("files", sorted(files)),
            ("climbs", [f"{a} -> {b}" for a, b in sorted(up)]),
            ("against imports", [f"{a} -> {b}" for a, b in sorted(against)]),
        ):
            print("\n  ".join([title, *rows]))


def climbs(calls: set[Call]) -> set[Call]:
    """Return the calls that lead back to a file nearer to the start than the calling one.

    The distance of a file from the start is the least number of calls between files that lead to it from a file that no
    other calls. `model` and `errors` hold values that all files use: calls to them are no climbs.
    """
    called = {b for a, b in calls if a and a != b}
    depth = {a: 0 for a, _ in calls if a and a not in called}
    front = set(depth)
    while front:
        front = {b for a, b in calls if a in front and b not in depth}
        depth |= dict.fromkeys(front, max(depth.values()) + 1)
    both = {(a, b) for a, b in calls if a in depth and depth[b] < depth[a]}
    return {(a, b) for a, b in both if not b.startswith(("model/", "errors.py"))}


def against_imports(between: set[Call]) -> set[Call]:
    """Return the calls to a file that imports the calling one, directly or through others."""
    return {(a, b) for a, b in between if a in reached(b)}


@functools.cache
def reached(file: str) -> frozenset[str]:
    """Return all files that a file imports, directly or through others."""
    found: set[str] = set()
    front = {file}
    while front:
        front = {other for one in front for other in imported(one)} - found
        found |= front
    return frozenset(found)


@functools.cache
def imported(file: str) -> frozenset[str]:
    """Return the files that a file imports directly."""
    names = set()
    for node in ast.walk(ast.parse((ROOT / file).read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module:
            names |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
        elif isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
    paths = {
        name.removeprefix("linework.").replace(".", "/") + ".py"
        for name in names
        if name.startswith("linework.")
    }
    return frozenset(path for path in paths if (ROOT / path).is_file())


if __name__ == "__main__":
    main(tuple(sys.argv[1:]))
