"""Publishing a million vertices to PostGIS: seconds, and how many times as long as a bare COPY of the same rows.

``python -m benchmarks.publish`` starts a server of its own from Debian's packages, which writes to the disk as one in use
does. Lines are published for the first time, again as they are, and again with every tenth of them moved. Then the same
rows are copied into an empty table with the same indices, as ``psql`` would do it from a file. Wall time is what users
wait; processor time, of this process and of the server together, says more on a shared machine.
"""

import argparse
import sys
import time
from pathlib import Path

import numpy as np
import psycopg
from tests.files.postgis.server import running_server

from linework.files.postgis.address import database_address
from linework.files.postgis.write import publish_lines
from linework.model.lines import LineSet

#: Vertices of a line: 50 m of a marking with one a metre.
VERTICES = 50
#: Bytes sent at once in the bare COPY.
BLOCK = 1 << 16


def main(arguments=()):
    parser = argparse.ArgumentParser(prog="python -m benchmarks.publish")
    parser.add_argument("--vertices", type=int, default=1_000_000)
    options = parser.parse_args(list(arguments))
    lines = many_lines(options.vertices // VERTICES)
    moved = lines.with_columns(
        xyz=lines.xyz + (np.repeat(np.arange(len(lines)) % 10 == 0, VERTICES) * 0.01)[:, None]
    )
    with running_server(durable=True) as server:
        address = database_address(server.url())
        print(
            f"{len(lines.xyz):,} vertices in {len(lines):,} lines; seconds: wall, processor, processor of the server"
        )
        spent = {
            what: timed(server, lambda given=given: publish_lines(given, address, "drive"))
            for what, given in (("first", lines), ("the same again", lines), ("a tenth moved", moved))
        }
        rows = copied_out(server)
        server.run("CREATE TABLE bare (LIKE linework.line INCLUDING ALL)")
        spent["bare COPY"] = timed(server, lambda: copied_in(server, rows))
    wall = spent["bare COPY"][0]
    for what, (s, own, other) in spent.items():
        print(f"  {what:<16}{s:7.1f}{own + other:7.1f}{other:7.1f}   {s / wall:5.1f} times the bare COPY")


def many_lines(n):
    """Return lines of all kinds of columns, in rows beside each other."""
    s = np.arange(VERTICES, dtype=np.float64)
    k = np.arange(n)
    x = 500_000.0 + 60.0 * (k[:, None] % 100) + s
    y = 5_400_000.0 + 3.5 * (k[:, None] // 100) + 0.1 * np.sin(0.1 * s)
    z = 100.0 + 0.01 * s + 0.0 * y
    size = n * VERTICES
    return LineSet.from_lines(
        list(np.stack([x, y, z], axis=-1)), crs="EPSG:25832+7837", kind=["lane_marking"] * n, id=[f"line-{i}" for i in k],
        confidence=0.5 + 0.4 * (k % 7) / 7, pattern=["dashed"] * n, width_m=np.full(n, 0.12),
        sigma_xy_m=np.full(size, 0.01), sigma_z_m=np.full(size, 0.02),
    )  # fmt: skip


def timed(server, call):
    """Return wall time, own processor time and that of the server's ended processes. [s]"""
    before = time.perf_counter(), time.process_time(), of_server(server)
    call()
    done = time.perf_counter(), time.process_time()
    time.sleep(0.5)  # until the server has seen its process end
    return *(b - a for a, b in zip(before, done, strict=False)), of_server(server) - before[2]


def of_server(server):
    """Return the processor time of the processes that the server has ended. [s]"""
    pid = (server.folder / "data" / "postmaster.pid").read_text().split()[0]
    values = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(values[13]) + int(values[14])) / 100.0


def copied_out(server):
    command = "COPY linework.line TO STDOUT (FORMAT BINARY)"
    with psycopg.connect(server.url()) as connection, connection.cursor().copy(command) as copy:
        return b"".join(bytes(part) for part in copy)


def copied_in(server, rows):
    command = "COPY bare FROM STDIN (FORMAT BINARY)"
    with psycopg.connect(server.url()) as connection, connection.cursor().copy(command) as copy:
        for at in range(0, len(rows), BLOCK):
            copy.write(rows[at : at + BLOCK])


if __name__ == "__main__":
    main(sys.argv[1:])
