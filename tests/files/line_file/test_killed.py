"""A process that is killed, or a disk that is full, costs at most the change in flight."""

import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from tests.scenes.drawing_scenes import none, same, shifted, some_lines, whole

from linework.errors import MachineError
from linework.files.line_file.file import LineFile
from linework.files.vectors.read_write import read_lines, write_lines
from linework.model.changes import Change

#: Moves line after line for ever, and says after each commit that it is done.
EDITING = """
import sys
from pathlib import Path
from linework.files.line_file.file import LineFile
from linework.model.changes import Change

with LineFile.opened(Path(sys.argv[1]), crs="local") as line_file:
    for k in range(10**9):
        one = line_file.lines.take([k % 6])
        edit = line_file.commit(Change("move", one, one.with_columns(xyz=one.xyz + 1.0)), who="Ann")
        print(edit.number, flush=True)
"""


def killed_while_editing(path: Path, after_s: float) -> int:
    """Return the number of the last commit that was said to be done before the process was killed."""
    arguments = [sys.executable, "-c", EDITING, str(path)]
    with subprocess.Popen(arguments, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        said = process.stdout.readline()
        time.sleep(after_s)
        process.kill()
        said += process.stdout.read()
    return int(said.split()[-1])


def test_killed_at_any_moment_at_most_the_change_in_flight_is_lost(tmp_path):
    path = tmp_path / "lines.gpkg"
    write_lines(some_lines(), path)
    chance = random.Random(5)
    done = 0
    for _ in range(6):
        done = killed_while_editing(path, chance.uniform(0.02, 0.3))
        copy = tmp_path / "copy"
        shutil.copytree(path.parent, copy, ignore=shutil.ignore_patterns("copy", "*.lock"))
        # A reader that comes first sees whole changes, too
        assert len(read_lines(copy / path.name)) == 6
        shutil.rmtree(copy)
        with LineFile.opened(path, crs="local") as line_file:
            assert done <= line_file.revision <= done + 1
            assert same(read_lines(path), line_file.lines)
            moved = line_file.lines.xyz.sum() - some_lines().xyz.sum()
            n = sum(3 * len(e.change.after.xyz) for e in line_file.history(most=10_000))
            assert abs(moved - n) < 1e-3
    assert done > 6
    whole(path)


@pytest.mark.skipif(os.name != "posix", reason="limits the size of files")
def test_a_full_disk_takes_nothing_away(tmp_path):
    path = tmp_path / "lines.gpkg"
    write_lines(some_lines(), path)
    before = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    try:
        with LineFile.opened(path, crs="local") as line_file:
            one = line_file.lines.take([0])
            moved = line_file.commit(Change("move", one, shifted(one)), who="").change.after
            held = line_file.lines
            for room in (0, 3000, 20_000):
                resource.setrlimit(resource.RLIMIT_FSIZE, (path.stat().st_size + room, limits[1]))
                with pytest.raises(MachineError, match="cannot be written"):
                    while True:
                        note = moved.with_columns(note=[os.urandom(400).hex()], id=[""])
                        line_file.commit(Change("draw", none(), note), who="")
                        held = line_file.lines
                resource.setrlimit(resource.RLIMIT_FSIZE, limits)
                assert same(line_file.lines, held)
                assert same(read_lines(path), held)
            line_file.commit(Change("delete", moved, none()), who="")
            held = line_file.lines
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        signal.signal(signal.SIGXFSZ, before)
    with LineFile.opened(path, crs="local") as line_file:
        assert same(line_file.lines, held)
    whole(path)
