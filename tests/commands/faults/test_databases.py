"""Databases: there is no output to PostGIS, so an address of one is refused in one line, unconnected, its password unsaid."""

from __future__ import annotations

import sqlite3
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from tests.scenes.drawing_scenes import some_lines

from linework.errors import LineworkError, MachineError
from linework.files.vectors.read_write import read_lines, write_lines
from linework.model.lines import LineSet

CANARY = "Pa55.word-canary"
#: Addresses of a server on a port of this machine.
PLACES = (
    "postgresql://me:{pw}@127.0.0.1:{port}/roads", "postgres://me:{pw}@127.0.0.1:{port}/roads.gpkg",
    "PG:host=127.0.0.1 port={port} user=me password={pw}", "PG:host=127.0.0.1,port={port},password={pw}/x.gpkg",
    "postgresql+psycopg://me:{pw}@127.0.0.1:{port}/roads.geojson", "MYSQL:roads,user=me,password={pw},port={port}",
)  # fmt: skip


class Trap:
    """A server on the loopback address that counts who connects."""

    def __init__(self) -> None:
        import socket

        self.listener = socket.create_server(("127.0.0.1", 0))
        self.port = self.listener.getsockname()[1]
        self.hits = 0
        threading.Thread(target=self._count, daemon=True).start()

    def _count(self) -> None:
        while True:
            try:
                connected, _ = self.listener.accept()
            except OSError:
                return
            self.hits += 1
            connected.close()


@pytest.fixture
def trap() -> Iterator[Trap]:
    found = Trap()
    yield found
    found.listener.close()


@pytest.fixture
def lines(tmp_path: Path) -> Path:
    write_lines(some_lines(), tmp_path / "lines.gpkg")
    return tmp_path / "lines.gpkg"


@pytest.mark.parametrize("place", PLACES)
def test_a_database_is_refused_unconnected_and_its_password_unsaid(
    linework, las_file, lines, tmp_path, trap, place, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    address = place.format(pw=CANARY, port=trap.port)
    before = sorted(tmp_path.rglob("*"))
    commands = (
        ("convert", lines, address), ("convert", address, "out.gpkg"), ("evaluate", address, lines),
        ("evaluate", lines, lines, "--picture", address), ("extract", las_file, "-o", address, "--quiet"),
        ("extract", address, "-o", "out.gpkg", "--quiet"), ("extract", las_file, "-o", "out.gpkg", "--crs", address),
        ("extract", las_file, "-o", "out.gpkg", "--trajectory", address, "--quiet"),
        ("raster", las_file, "-o", address, "--quiet"), ("simulate", "-o", address, "--quiet"),
    )  # fmt: skip
    for command in commands:
        found = linework(*command)
        assert found.code in (2, 3), (command, found)
        assert len(found.line) <= 300
        assert CANARY.lower() not in (found.stdout + found.stderr).lower(), command
    assert trap.hits == 0
    assert sorted(p for p in tmp_path.rglob("*") if ".linework" not in p.parts) == before


def test_the_trap_would_notice(trap):
    import socket

    socket.create_connection(("127.0.0.1", trap.port)).close()
    for _ in range(200):
        if trap.hits:
            break
        time.sleep(0.01)
    assert trap.hits == 1


@pytest.mark.parametrize("suffix", [".gpkg", ".geojson", ".dxf", ".fgb", ".kml"])
@pytest.mark.parametrize(
    "kind", ['x"; DROP TABLE gpkg_contents; --', "a'b", "Bordürßtein 縁石", "select", "a]b[c", "%s{0}"]
)
def test_names_with_quotes_and_sql_are_names(tmp_path, suffix, kind):
    """Read back as they are, or refused; the table that they would drop lives."""
    xyz = np.array([[500_000.0, 5_400_000.0, 1.0], [500_001.0, 5_400_001.0, 1.0]])
    lines = LineSet.from_lines([xyz, xyz + 5.0], kind=[kind, "cable"], crs="EPSG:25832+7837")
    path = tmp_path / f"lines{suffix}"
    try:
        write_lines(lines, path)
    except LineworkError as error:
        assert "\n" not in str(error) and path.name in str(error)
        assert not path.exists()
        return
    if suffix != ".kml":  # not read
        assert sorted(read_lines(path).kind) == sorted([kind, "cable"])
    if suffix == ".gpkg":
        with closing(sqlite3.connect(path)) as db:
            names = {row[0] for row in db.execute("SELECT table_name FROM gpkg_contents")}
            assert {"cable"} <= names
            assert db.execute("PRAGMA integrity_check").fetchone() == ("ok",)


def test_a_line_file_that_another_session_has_locked_is_one_line(lines):
    """The nearest thing to a lock in a database: a transaction of another program holds the GeoPackage."""
    code = (
        "import sqlite3, sys; db = sqlite3.connect(sys.argv[1], isolation_level=None); db.execute('BEGIN EXCLUSIVE');"
        "print('locked', flush=True); sys.stdin.read()"
    )
    with subprocess.Popen(
        [sys.executable, "-c", code, str(lines)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as other:
        assert other.stdout is not None and other.stdin is not None
        assert other.stdout.readline() == "locked\n"
        with pytest.raises((MachineError, LineworkError)) as caught:
            read_lines(lines)
        other.stdin.close()
    assert lines.name in str(caught.value) and "\n" not in str(caught.value)
    assert len(read_lines(lines)) == len(some_lines())
