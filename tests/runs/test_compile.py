"""Compiling as a stage: complete for every method, only what is missing, and never from outdated sources."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path

import pytest
from tests.scenes.places import ROOT

import linework.kernels
from linework.files import compiled
from linework.files.las.write import write_las
from linework.kernels.called_with import CALLED_WITH
from linework.kernels.compiling import _type_of, called_kernels, signature_of
from linework.library.read import read_points
from linework.library.simulate import simulate
from linework.methods.kinds import ALL_KINDS
from linework.model.points import Points
from linework.runs.compile import _GROUP_OF, COMPILED_FOR


def table_of(beginning: str) -> str:
    """Return the part of the table for kernels whose names begin so: to compile a whole group takes minutes."""
    kernels = re.split(r"\n(?=\S)", CALLED_WITH.strip())
    return "\n".join(kernel for kernel in kernels if kernel.startswith(beginning))


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a short motorway with everything that a van records."""
    folder = tmp_path_factory.mktemp("compiled") / "drive"
    simulate(
        folder,
        road="motorway",
        seed=1,
        length_m=60,
        points_per_m=2500,
        image_size="732x484",
        image_every_m=20,
    )
    return folder


@pytest.mark.parametrize(
    ("names", "command"),
    [
        (
            ("lane_marking",),
            ("extract", "--features", "lane_marking,lane_marking_dash,road_marking_other", "--method", "obb"),
        ),
        (("road_boundary",), ("extract", "--features", "road_boundary,kerb_top")),
        (("kerb_top", "columns"), ("extract", "--features", "kerb_top", "--carry", "classification")),
        (("guardrail",), ("extract", "--features", "guardrail,barrier")),
        (("cable",), ("extract", "--features", "cable")),
        (("stereo",), ("extract", "--method", "stereo")),
        (("trajectory",), ("locate",)),
        (("classes", "points"), ("classify", "--lines", "truth.gpkg")),
    ],
)
def test_the_table_holds_every_kernel_that_a_method_calls(drive, tmp_path, names, command):
    """What is missing was compiled when it was called, in silence: add the lines to `linework.kernels.called_with`."""
    output = tmp_path / {"locate": "trajectory.csv", "classify": "classified"}.get(command[0], "lines.gpkg")
    command = [drive / word if word == "truth.gpkg" else word for word in command]
    work = () if command[0] == "locate" else ("--work", tmp_path / "work", "--workers", "1")
    assert_known(
        [command[0], drive, "-o", output, *command[1:], *work, "--quiet"], tmp_path / "called.txt", names
    )


def test_the_table_holds_what_is_called_for_points_without_times(drive, tmp_path):
    """As airborne ones often are: an array made in the place of a column is not read-only as columns are."""
    points = read_points(drive)
    file = tmp_path / "untimed.laz"
    write_las(Points(points.xyz, intensity=points.intensity), file, crs="local")
    work = ("--work", tmp_path / "work", "--workers", "1")
    assert_known(
        ["extract", file, "--crs", "local", "-o", tmp_path / "lines.gpkg", *work, "--quiet"],
        tmp_path / "called.txt",
        (*ALL_KINDS, "points"),
    )


def assert_known(arguments: list[object], noted: Path, names: Iterable[str]) -> None:
    """Run a command, note the kernels that it calls, and look them up in the table."""
    done = subprocess.run(
        [sys.executable, "-m", "tests.scenes.called_kernels", noted, *map(str, arguments)],
        cwd=ROOT, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    called = {tuple(line.split("\t")) for line in noted.read_text(encoding="utf-8").splitlines()}
    known = {
        (kernel.name, signature)
        for kernel in called_kernels({_GROUP_OF[name] for name in names})
        for signature in kernel.signatures
    }
    assert called
    assert called <= known, "\n".join(f"{name}\n    {types}" for name, types in sorted(called - known))


def test_there_is_a_group_for_every_kind():
    assert set(COMPILED_FOR) == {*ALL_KINDS, "points", "columns", "stereo", "trajectory", "classes"}
    for group in _GROUP_OF.values():
        assert called_kernels([group])


def test_the_types_of_the_table_are_read_as_they_are_written():
    for kernel in called_kernels(_GROUP_OF.values()):
        for signature in kernel.signatures:
            assert signature_of(map(_type_of, signature.split())) == signature


def test_a_stage_of_its_own_with_progress_and_then_nothing(tmp_path):
    """In a cache of its own: kernels are compiled, found again without numba, and again when the cache was emptied."""
    table = table_of("cells.planes.").replace("points", "trajectory")
    code = f"""
import sys
from linework.kernels import called_with

called_with.CALLED_WITH = {table!r}
from linework.runs.compile import compile_stage
from linework.runs.steps import RunSteps

class Watcher:
    def begin(self, step, unit): print("begin", step, unit)
    def advance(self, done, total): print("advance", done, total)
    def end(self, step, seconds): print("end")

print(compile_stage(["trajectory"], RunSteps(Watcher())))
print("numba" in sys.modules)
"""
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}

    def printed() -> list[str]:
        done = subprocess.run(
            [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True
        )
        return done.stdout.splitlines()

    n = table.count("=")
    assert n > 1
    expected = [
        "begin compile kernels kernels",
        *(f"advance {i} {n}" for i in range(n + 1)),
        "end",
        "True",
        "True",
    ]
    assert printed() == expected
    assert printed() == ["False", "False"]  # nothing is shown, nothing is loaded
    for index in tmp_path.rglob("*.nbi"):
        index.unlink()
    assert printed() == expected  # the cache was emptied since


def test_a_kernel_that_fails_to_compile_is_named(tmp_path):
    """A warning where a method may do without it; an error where all are to be compiled: nothing says "compiled"."""
    code = """
import sys, warnings
from linework.kernels import compiling

compiling.CALLED_WITH = "cables.catenary.wire_height = trajectory cables\\n    f8 f8:1C"
import linework
from linework.errors import MachineError
from linework.runs.compile import compile_stage
from linework.runs.steps import RunSteps

with warnings.catch_warnings(record=True) as caught:
    warnings.simplefilter("always")
    compile_stage(["trajectory"], RunSteps())
for warning in caught:
    print(warning.category.__name__, warning.message)
try:
    linework.compile_kernels()
except MachineError as error:
    print("MachineError", error)
sys.argv[1:] = ["compile", "--quiet"]
from linework.cli.app import main
sys.exit(main())
"""
    done = subprocess.run(
        [sys.executable, "-c", code], env=os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    expected = "1 of 1 kernels could not be compiled, first cables.catenary.wire_height: TypingError: "
    warned, raised = done.stdout.splitlines()
    assert warned.startswith(f"LineworkWarning {expected}")
    assert raised.startswith(f"MachineError {expected}")
    assert done.stderr.splitlines()[-1].startswith(f"error: {expected}"), done.stderr
    assert done.returncode == 5
    assert not any('"compiled": {"' in note.read_text() for note in tmp_path.glob("linework-compiled-*.json"))


# The note beside the cache


@pytest.fixture
def kernels(tmp_path, monkeypatch):
    """Return a folder of three modules of which `paint.a` imports `paint.b`, with compiled code beside each."""
    folder = tmp_path / "kernels"
    (folder / "paint" / "__pycache__").mkdir(parents=True)
    (folder / "paint" / "__init__.py").touch()
    (folder / "paint" / "a.py").write_text("from linework.kernels.paint.b import x\n")
    for name in ("b", "c", "a_far"):
        (folder / "paint" / f"{name}.py").write_text("import numpy\n")
    (folder / "paint" / "d.py").write_text("from linework.kernels.paint.a import y\n")
    monkeypatch.setattr(linework.kernels, "__path__", [str(folder)])
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    compile_all(folder)
    return folder


def compile_all(folder: Path) -> None:
    """Put compiled code beside each module, and note it."""
    for name in ("a", "b", "c", "d", "a_far"):
        for end in ("nbi", "1.nbc"):
            (folder / "paint" / "__pycache__" / f"{name}.f-1.py311.{end}").touch()
    compiled.note_compiled(["paint"], [folder / "paint" / "__pycache__"])


def cache_of(folder: Path):
    return lambda module: folder / module.split(".")[0] / "__pycache__"


def code_in(folder: Path) -> set[str]:
    return {path.name.split(".")[0] for path in (folder / "paint" / "__pycache__").glob("*.nb*")}


def test_a_changed_source_outdates_what_imports_it(kernels):
    assert compiled.is_compiled(["paint"])
    assert not compiled.is_compiled(["paint", "rails"])
    assert compiled.remove_stale(cache_of(kernels)) == []
    (kernels / "paint" / "b.py").write_text("import numpy  # changed\n")
    assert not compiled.is_compiled(["paint"])
    assert compiled.remove_stale(cache_of(kernels)) == ["paint.a", "paint.b", "paint.d"]
    assert code_in(kernels) == {"c", "a_far"}
    assert not compiled.is_compiled(["paint"])
    compile_all(kernels)
    assert compiled.is_compiled(["paint"])


def test_code_that_nothing_vouches_for_is_removed(kernels):
    note = next(kernels.rglob("linework-compiled-*.json"))
    for content in ("", "[]", "{", json.dumps(json.loads(note.read_text()) | {"made_by": ["0.1"]})):
        compile_all(kernels)
        note.write_text(content)
        assert not compiled.is_compiled(["paint"])
        assert len(compiled.remove_stale(cache_of(kernels))) == 5
        assert code_in(kernels) == set()


def test_an_emptied_cache_is_noticed(kernels):
    for path in kernels.rglob("*.nbi"):
        path.unlink()
    assert not compiled.is_compiled(["paint"])


def test_the_note_goes_where_numba_caches(kernels, tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "numba"))
    compile_all(kernels)
    assert len(list((tmp_path / "numba").glob("linework-compiled-*.json"))) == 1
    monkeypatch.delenv("NUMBA_CACHE_DIR")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "user"))
    monkeypatch.setattr(os, "access", lambda *_: False)  # an installation that only root may write to
    compile_all(kernels)
    assert len(list((tmp_path / "user" / "linework").glob("linework-compiled-*.json"))) == 1
    assert compiled.is_compiled(["paint"])


def test_a_cache_that_cannot_be_written_is_no_error(kernels, tmp_path, monkeypatch):
    (tmp_path / "file").touch()
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "file" / "inside"))
    compiled.note_compiled(["paint"], [])
    assert not compiled.is_compiled(["paint"])


def test_compiled_for_one_command_where_nothing_can_be_kept(las_file, tmp_path):
    """Neither beside the package nor in the user's cache can files be made: numba looks for that just as we do."""
    (tmp_path / "sitecustomize.py").write_text(
        f"""
import os, tempfile
from pathlib import Path
open_file, access = tempfile.TemporaryFile, os.access

def refuse(*args, dir=None, **options):
    if dir is not None and any(Path(dir).is_relative_to(place) for place in ({str(ROOT)!r}, "/nowhere")):
        raise PermissionError(13, "Permission denied", str(dir))
    return open_file(*args, dir=dir, **options)

def readable(path, mode, **options):
    is_kept = any(Path(path).is_relative_to(place) for place in ({str(ROOT)!r}, "/nowhere", "/"))
    return access(path, mode, **options) and not (mode == os.W_OK and is_kept)

tempfile.TemporaryFile, os.access = refuse, readable
""",
        encoding="utf-8",
    )
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    search = os.pathsep.join([str(tmp_path), str(ROOT / "src")])
    environment = {
        "PATH": os.environ["PATH"],
        "PYTHONPATH": search,
        "HOME": "/nowhere",
        "TMPDIR": str(temporary),
    }
    # All that `info` calls
    code = f"""
from linework.kernels import called_with

called_with.CALLED_WITH = {table_of("store.")!r}
from linework.cli.app import main
from linework.runs.compile import compile_stage
from linework.runs.steps import RunSteps
compile_stage(["points"], RunSteps())
raise SystemExit(main())
"""
    done = subprocess.run(
        [sys.executable, "-c", code, "info", las_file, "--work", tmp_path / "work", "--quiet"],
        env=environment, capture_output=True, text=True, timeout=600, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stderr.count("kernels are compiled for this command alone") == 1
    assert list(temporary.iterdir()) == []
