"""A PostgreSQL server of the tests' own, from Debian's packages: a private cluster that ends with them."""

from __future__ import annotations

import os
import pwd
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import psycopg
import pytest

#: Versions of Debian 12 and 13.
FOLDERS = [Path(f"/usr/lib/postgresql/{version}/bin") for version in (17, 15)]
POSTGIS = [Path(f"/usr/share/postgresql/{version}/extension/postgis.control") for version in (17, 15)]


def binaries() -> Path:
    """Return the folder of the server's programs; skip without them, fail in continuous integration."""
    for folder, postgis in zip(FOLDERS, POSTGIS, strict=True):
        if (folder / "initdb").exists() and postgis.exists():
            return folder
    text = "no PostgreSQL with PostGIS: apt install postgresql-15-postgis-3"
    if os.environ.get("CI") == "true":
        pytest.fail(text)
    pytest.skip(text)


class Server:
    """A running server; `url(database)` is the address of a database, `stop("immediate")` kills it."""

    def __init__(self, folder: Path, programs: Path, port: int, durable: bool) -> None:
        self.folder, self.programs, self.port, self.durable = folder, programs, port, durable

    def control(self, *arguments: str) -> None:
        # PostgreSQL refuses to run as root
        user = {"user": "postgres", "group": "postgres"} if os.geteuid() == 0 else {}
        subprocess.run(
            [self.programs / arguments[0], *arguments[1:]], check=True, capture_output=True, cwd="/", **user
        )

    def start(self) -> None:
        fsync = "on" if self.durable else "off"
        options = f"-p {self.port} -c listen_addresses=127.0.0.1 -c unix_socket_directories={self.folder} -c fsync={fsync}"
        self.control(
            "pg_ctl",
            "-D",
            str(self.folder / "data"),
            "-o",
            options,
            "-l",
            str(self.folder / "log"),
            "-w",
            "start",
        )

    def stop(self, how: str = "fast") -> None:
        self.control("pg_ctl", "-D", str(self.folder / "data"), "-m", how, "-w", "stop")

    def url(self, database: str = "lines", user: str = "postgres") -> str:
        return f"postgresql://{user}@127.0.0.1:{self.port}/{database}"

    def run(self, sql: str, database: str = "lines") -> list[tuple]:
        with closing(psycopg.connect(self.url(database), autocommit=True)) as connection:
            cursor = connection.execute(sql)
            return cursor.fetchall() if cursor.description else []


def free_port() -> int:
    import socket

    with closing(socket.socket()) as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])


@contextmanager
def running_server(*, durable: bool = False) -> Iterator[Server]:
    """Yield a server with a database `lines` that has PostGIS; a durable one waits for its disk."""
    programs = binaries()
    folder = Path(tempfile.mkdtemp(prefix="linework-pg-"))
    try:
        if os.geteuid() == 0:
            owner = pwd.getpwnam("postgres")
            os.chown(folder, owner.pw_uid, owner.pw_gid)
        server = Server(folder, programs, free_port(), durable)
        server.control(
            "initdb", "-D", str(folder / "data"), "-U", "postgres", "-A", "trust", "-E", "UTF8", "--no-sync"
        )
        server.start()
        server.run("CREATE DATABASE lines", "postgres")
        server.run("CREATE EXTENSION postgis")
        yield server
    finally:
        if (folder / "data" / "postmaster.pid").exists():
            server.stop("immediate")
        shutil.rmtree(folder, ignore_errors=True)
