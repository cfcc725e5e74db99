"""The page that is shipped is the page of these sources."""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
SOURCES = ROOT / "page"
BUILT = ROOT / "src" / "linework" / "workbench" / "page"
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
