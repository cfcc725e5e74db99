"""The page that is shipped is built from these sources, and the sources import one another without circles."""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import subprocess
from graphlib import TopologicalSorter
from pathlib import Path, PurePosixPath

import pytest

ROOT = Path(__file__).parents[3]
SOURCES = ROOT / "page"
BUILT = ROOT / "src" / "linework" / "workbench" / "page"
#: An import of another source of the page: ``from "./map"``, ``import "./bar.css"``, ``import("./api")``.
IMPORT = re.compile(r"""(?:\bfrom|\bimport\(?)\s*"(\.[^"]+)\"""")
PARTS = (
    "bundle",
    "index.html",
    "package-lock.json",
    "package.json",
    "src",
    "tsconfig.json",
    "vite.config.ts",
)


def hash_of_sources(root: Path) -> str:
    """Return the sum of page/bundle/source-hash.ts: of every file its name, its length, its bytes."""
    names = []
    for part in PARTS:
        found = (
            [root / part] if (root / part).is_file() else [p for p in (root / part).rglob("*") if p.is_file()]
        )
        names += [path.relative_to(root).as_posix() for path in found]
    total = hashlib.sha256()
    for name in sorted(names):
        content = (root / name).read_bytes()
        total.update(f"{name}\n{len(content)}\n".encode())
        total.update(content)
    return total.hexdigest()


def imports() -> dict[PurePosixPath, set[PurePosixPath]]:
    """Return the scripts of the page, relative to src, and the scripts that each imports."""
    src = SOURCES / "src"
    scripts = {PurePosixPath(path.relative_to(src).as_posix()) for path in src.rglob("*.ts")}
    found: dict[PurePosixPath, set[PurePosixPath]] = {}
    for script in scripts:
        named = (
            os.path.normpath(script.parent / name) for name in IMPORT.findall((src / script).read_text())
        )
        targets = {PurePosixPath(name if name.endswith(".css") else f"{name}.ts") for name in named}
        assert all((src / target).is_file() for target in targets), (script, targets)
        found[script] = targets & scripts
    return found


def test_scripts_and_rooms_import_without_circles():
    """No script imports itself by way of others, and no folder another one that imports it."""
    scripts = imports()
    assert sum(map(len, scripts.values())) > 100
    rooms: dict[str, set[str]] = {}
    for script, targets in scripts.items():
        room = str(script.parent)
        rooms.setdefault(room, set()).update(str(target.parent) for target in targets)
        rooms[room].discard(room)
    TopologicalSorter(scripts).prepare()  # raises CycleError, which names the circle
    TopologicalSorter(rooms).prepare()


def test_page_is_built_of_these_sources():
    said = (BUILT / "SOURCES.sha256").read_text().strip()
    assert said == hash_of_sources(SOURCES), "page/ has changed since the page was built: run `make page`"


def test_page_asks_nobody_else():
    page = (BUILT / "index.html").read_text()
    assert not re.search(r"(src|href)=\"(?!\./|data:,\")", page), "everything comes from the server itself"
    assert not re.search(r"<script(?![^>]*\ssrc=)|<style|\sstyle=|\son\w+=", page), (
        "nothing inline: see the policy"
    )
    sheets = "".join(path.read_text() for path in BUILT.glob("*.css"))
    assert not re.search(r"url\(|@import", sheets)


def test_licences_of_what_is_shipped():
    notices = (BUILT / "THIRD_PARTY_LICENSES.txt").read_text()
    for package in ("ol ", "three ", "rbush ", "quickselect "):
        assert re.search(rf"^{package}\d", notices, re.MULTILINE), package
    assert "Permission is hereby granted" in notices


def test_page_is_built_anew(tmp_path):
    """Where Node and the packages are there, the same bytes come out."""
    vite = SOURCES / "node_modules" / ".bin" / "vite"
    if shutil.which("node") is None or not vite.exists():
        pytest.skip("needs Node and `npm ci` in page/")
    subprocess.run(
        [str(vite), "build", "--outDir", str(tmp_path), "--emptyOutDir", "--logLevel", "error"],
        cwd=SOURCES, check=True, timeout=300, env=os.environ | {"NODE_ENV": "production"},
    )  # fmt: skip
    built = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    shipped = {path.name: path.read_bytes() for path in BUILT.iterdir()}
    assert sorted(built) == sorted(shipped)
    assert [name for name in built if built[name] != shipped[name]] == []
