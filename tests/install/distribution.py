"""Check what `make dist` built: run it as ``python -m tests.install.distribution dist``.

The wheel holds the workbench's page and nothing of the tests; the source distribution builds the same wheel; the wheel,
installed into an empty environment, extracts lines with the core alone. Prints the size of that environment.
"""

from __future__ import annotations

import hashlib
import json
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

from tests.conftest import CRS, road_points
from tests.scenes.places import ROOT

from linework.files.las.write import write_las

#: Not counted: an empty environment has them.
_OF_PIP = ("pip", "setuptools", "pkg_resources", "_distutils_hack")
#: Largest number of packages of the core (CONTRIBUTING.md).
MOST_PACKAGES = 22


def run(*command: object) -> str:
    """Run a command that must not fail, and return what it prints."""
    return subprocess.run([*map(str, command)], check=True, capture_output=True, text=True).stdout


def contents(wheel: Path) -> dict[str, str]:
    """Return the SHA-256 of every file in a wheel, by its name."""
    with zipfile.ZipFile(wheel) as archive:
        return {name: hashlib.sha256(archive.read(name)).hexdigest() for name in sorted(archive.namelist())}


def check_wheel(dist: Path) -> Path:
    """Return the wheel, after comparing it with the sources and with what the source distribution builds."""
    (wheel,), (source,) = dist.glob("*.whl"), dist.glob("*.tar.gz")
    names = contents(wheel)
    page = [
        path
        for path in (ROOT / "src/linework/workbench").rglob("*")
        if path.suffix in (".js", ".css", ".html")
    ]
    wanted = {
        path.relative_to(ROOT / "src").as_posix() for path in [*page, *(ROOT / "src/linework").rglob("*.j2")]
    }
    assert page and wanted <= set(names), sorted(wanted - set(names))
    assert not [name for name in names if name.startswith(("tests", "docs")) or "__pycache__" in name]
    with tempfile.TemporaryDirectory() as folder:
        run(sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--wheel-dir", folder, source)
        (again,) = Path(folder).glob("*.whl")
        assert contents(again) == names
    return wheel


def check_core(wheel: Path) -> None:
    """Install the wheel alone into an empty environment and extract lines there."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        run(sys.executable, "-m", "venv", folder / "env")
        binaries = folder / "env" / ("Scripts" if sys.platform == "win32" else "bin")
        run(binaries / "python", "-m", "pip", "install", "--quiet", wheel)
        listed = json.loads(run(binaries / "python", "-m", "pip", "list", "--format=json"))
        packages = [one["name"] for one in listed if one["name"] not in _OF_PIP]
        (site,) = (folder / "env").rglob("site-packages")
        files = [
            f for f in site.rglob("*") if f.is_file() and not f.relative_to(site).parts[0].startswith(_OF_PIP)
        ]
        size = sum(f.stat().st_size for f in files)
        compiled = sum(f.stat().st_size for f in files if f.suffix == ".pyc")
        print(
            f"core: {len(packages)} packages, {size / 1e6:.0f} MB, of these {compiled / 1e6:.0f} MB bytecode"
        )
        assert len(packages) <= MOST_PACKAGES, packages
        write_las(road_points(4000), folder / "points.laz", crs=CRS)
        print(run(binaries / "linework", "--version").strip())
        run(
            binaries / "linework",
            "extract",
            folder / "points.laz",
            "-o",
            folder / "lines.gpkg",
            "--features",
            "guardrail",
        )
        print(run(binaries / "linework", "info", folder / "points.laz").splitlines()[0])


if __name__ == "__main__":
    check_core(check_wheel(Path(sys.argv[1])))
