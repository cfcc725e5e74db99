"""What we stand on and what we hand out: versions, unsafe patterns, the wheel, two copies of GDAL in one process."""

from __future__ import annotations

import ast
import hashlib
import re
import subprocess
import sys
import tomllib
import zipfile
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import pytest
from tests.scenes.places import ROOT

import linework

HOUSE = Path(linework.__file__).parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
#: Versions below which a weakness is known: CVE-2024-47874 and CVE-2025-62727 (bodies of forms, ranges) in starlette,
#: outside entities in lxml, sizes of chunk tables in lazrs, decoders in Pillow, request smuggling in h11.
FLOORS = {
    "starlette": "1.1",
    "lxml": "6.1",
    "lazrs": "0.7",
    "pillow": "10.3",
    "h11": "0.16",
    "jinja2": "3.1.6",
}
#: What no file of the package may call, by the name that it is called with.
UNSAFE_CALLS = {
    "eval", "exec", "compile", "os.system", "os.popen", "yaml.load", "marshal.loads", "shelve.open", "tempfile.mktemp",
    "torch.load", "joblib.load", "pandas.read_pickle", "pd.read_pickle", "dill.loads", "subprocess.getoutput",
}  # fmt: skip
#: Objects come over connections with processes that this program started, and with a cluster that the user has named
#: (processes/cluster.py), and from nowhere else.
UNPICKLES = {
    "processes/cluster.py",
    "processes/channel.py", "processes/child.py", "processes/own_code.py", "processes/pool.py",
    "workbench/worker/conversation.py",
}  # fmt: skip


def numbers(text: str) -> tuple[int, ...]:
    """Return the numbers of a version.

    >>> numbers("2.10.1rc1") > numbers("2.9")
    True
    """
    return tuple(int(part) for part in re.findall(r"\d+", text)[:3])


def requirements() -> dict[str, str]:
    """Return the lowest version that is supported of each package."""
    listed = [*PROJECT["dependencies"], *(r for rs in PROJECT["optional-dependencies"].values() for r in rs)]
    found = (re.match(r"([\w.-]+)(?:\[\w+\])?>=([\d.]+)", one) for one in listed)
    return {one[1].lower(): one[2] for one in found if one}


def pins() -> dict[str, str]:
    lines = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    return {name.lower(): at.split(";")[0].strip() for name, at in (line.split("==", 1) for line in lines)}


def test_no_version_with_a_known_weakness_is_allowed_pinned_or_installed():
    lowest, pinned = requirements(), pins()
    for name, floor in FLOORS.items():
        if name in pinned:
            assert numbers(pinned[name]) >= numbers(floor), name
        try:
            assert numbers(version(name)) >= numbers(floor), name
        except PackageNotFoundError:
            assert name not in lowest
    assert numbers(lowest["starlette"]) >= numbers(FLOORS["starlette"])


def test_what_is_installed_and_pinned_is_what_is_supported():
    pinned = pins()
    for name, lowest in requirements().items():
        if name in pinned:
            assert numbers(pinned[name]) >= numbers(lowest), name
        try:
            assert numbers(version(name)) >= numbers(lowest), name
        except PackageNotFoundError:
            assert name in (
                "build",
                "twine",
                "sphinx",
                "pydata-sphinx-theme",
                "numpydoc",
                "myst-parser",
                "sphinx-gallery",
            )


def unsafe(tree: ast.AST) -> list[str]:
    """Return the unsafe calls of a file, with their lines."""
    found = []
    for node in ast.walk(tree):
        if not isinstance(node, ast.Call):
            continue
        name = ast.unparse(node.func)
        given = {k.arg: ast.unparse(k.value) for k in node.keywords}
        is_odd = (
            name in UNSAFE_CALLS
            or name.endswith((".extractall", ".allow_pickle"))
            or given.get("shell") == "True"
            or given.get("verify") == "False"
            or given.get("allow_pickle") == "True"
            or (name in ("np.load", "numpy.load") and given.get("allow_pickle", "False") != "False")
        )
        if is_odd:
            found.append(f"{node.lineno}: {name}")
    return found


def test_no_unsafe_call_stands_in_the_package():
    found = {
        path.relative_to(HOUSE).as_posix(): calls
        for path in sorted(HOUSE.rglob("*.py"))
        if (calls := unsafe(ast.parse(path.read_text(encoding="utf-8"))))
    }
    assert found == {}


def test_objects_are_unpickled_from_own_processes_only():
    found = set()
    for path in HOUSE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and re.fullmatch(
                r"(?:\w+\.)?(?:loads?|Unpickler)", ast.unparse(node.func)
            ):
                name = ast.unparse(node.func)
                if name.startswith(("pickle.", "cloudpickle.")):
                    found.add(path.relative_to(HOUSE).as_posix())
    assert found == UNPICKLES


@pytest.mark.parametrize(
    "code",
    ["eval('1')", "yaml.load(f)", "subprocess.run('x', shell=True)", "np.load(f, allow_pickle=True)",
     "httpx.get(url, verify=False)", "zipfile.ZipFile(f).extractall('.')"],
)  # fmt: skip
def test_an_unsafe_call_would_be_found(code):
    assert unsafe(ast.parse(code))


def test_the_wheel_holds_the_package_and_nothing_else(tmp_path):
    wheel_builder = pytest.importorskip("hatchling.builders.wheel")
    (built,) = wheel_builder.WheelBuilder(str(ROOT)).build(directory=str(tmp_path), versions=["standard"])
    with zipfile.ZipFile(built) as archive:
        names = archive.namelist()
        texts = {n: archive.read(n) for n in names if n.endswith((".py", ".html", ".js", ".toml", ".j2"))}
    tops = {name.split("/")[0] for name in names}
    assert tops == {"linework", f"linework-{linework.__version__}.dist-info"}
    assert [
        n
        for n in names
        if "__pycache__" in n or n.endswith((".laz", ".las", ".gpkg", ".pyc", ".env", ".pem"))
    ] == []
    assert sum(n.endswith(".py") for n in names) == sum(1 for _ in HOUSE.rglob("*.py"))
    secret = re.compile(rb"BEGIN [A-Z ]*PRIVATE KEY|AKIA[0-9A-Z]{16}|ghp_[A-Za-z0-9]{36}|xox[bp]-[0-9]")
    assert [n for n, text in texts.items() if secret.search(text)] == []


#: Writes a raster and a line file, and reads both back, in a process that imports the two copies of GDAL in one order.
BOTH = """
import sys
from pathlib import Path
for name in sys.argv[2:]:
    __import__(name)
import numpy as np
from linework.files.images.geotiff import write_geotiff
from linework.files.vectors.read_write import read_lines, write_lines
from linework.model.grid import Grid, Image
from tests.scenes.drawing_scenes import some_lines
folder = Path(sys.argv[1])
write_geotiff(Image(np.arange(64.0).reshape(8, 8), Grid(0, 0, 1, 1, 8, 8)), folder / "a.tif", crs="EPSG:25832")
lines = some_lines()
for suffix in (".fgb", ".gpkg"):
    write_lines(lines, folder / f"a{suffix}")
    assert len(read_lines(folder / f"a{suffix}")) == len(lines)
import pyogrio, rasterio
print(pyogrio.__gdal_version_string__, rasterio.__gdal_version__, file=sys.stderr)
"""


def test_two_gdals_in_one_process_give_the_same_in_either_order(tmp_path):
    found = []
    for order in (["pyogrio", "rasterio"], ["rasterio", "pyogrio"], []):
        folder = tmp_path / ("-".join(order) or "own")
        folder.mkdir()
        subprocess.run([sys.executable, "-c", BOTH, str(folder), *order], check=True, cwd=ROOT)
        found.append({p.name: hashlib.sha256(p.read_bytes()).hexdigest() for p in folder.iterdir()})
    assert set(found[0]) == {"a.tif", "a.fgb", "a.gpkg"}
    assert found[0] == found[1] == found[2]
