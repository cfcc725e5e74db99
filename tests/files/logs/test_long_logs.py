"""Logs of hundreds of megabytes are read in the memory of their numbers, or refused with numbers, in either case soon."""

from __future__ import annotations

import resource
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import linework as lw
from linework.errors import InputError
from linework.files.images.lists import read_image_list
from linework.files.logs import tables, text
from linework.files.logs.keys import read_events

HEADER = "time_s,easting_m,northing_m,height_m\n"
#: Longest that a reader may take with a line of these files, on a machine that is busy. [s]
_MOST_S = 300.0
_READ = """
import resource, sys
import linework as lw
base = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
try:
    said = len(lw.read_trajectory(sys.argv[1]))
except lw.LineworkError as error:
    said = error
print(said)
print((resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - base) * 1024)
"""


def rows(n: int) -> Iterator[str]:
    for i in range(n):
        yield f"{3e8 + 0.01 * i:.2f},{5e5 + 0.1 * i:.1f},5400000.0,100.0\n"


def read_alone(path: Path) -> tuple[str, int]:
    """Read a trajectory in a process of its own; return what it gave, and by how much the process grew [bytes]."""
    done = subprocess.run(
        [sys.executable, "-c", _READ, str(path)], capture_output=True, text=True, timeout=_MOST_S, check=True
    )
    said, grown = done.stdout.splitlines()
    return said, int(grown)


def test_memory_is_that_of_the_numbers(tmp_path):
    """200 MB would take a minute here: a sixth of that shows the slope."""
    path = tmp_path / "a.csv"
    with path.open("w") as file:
        file.write(HEADER)
        file.writelines(rows(800_000))
    said, grown = read_alone(path)
    assert said == "800000"
    # Five columns of numbers, and at most five copies of them on the way; as texts the cells would take 200 bytes more
    assert grown < 800_000 * 5 * 8 * 6 + (64 << 20)


def test_a_file_of_nothing_usable_is_given_up_at_once(tmp_path, monkeypatch):
    path = tmp_path / "a.csv"
    path.write_text(HEADER + "x,y,z,w\n" * 3_000_000)
    monkeypatch.setattr(tables, "MAX_BAD", 10_000)
    with pytest.raises(
        InputError, match=r"no usable rows \(\d{5} lines cannot be read, the first is line 2\)"
    ):
        lw.read_trajectory(path)


def test_more_lines_than_a_day_has_are_refused(tmp_path, monkeypatch):
    path = tmp_path / "a.csv"
    path.write_text(HEADER + "".join(rows(50_000)))
    monkeypatch.setattr(text, "MAX_LINES", 50_000)
    assert len(lw.read_trajectory(path)) == 50_000
    monkeypatch.setattr(text, "MAX_LINES", 49_000)
    with pytest.raises(
        InputError, match=r"more than 49,000 lines \(a day at 100 Hz\)\. Split it, or write fewer"
    ):
        lw.read_trajectory(path)


def test_texts_of_more_than_a_million_lines_are_refused_before_they_fill_the_memory(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("time_s,key,note\n" + "300000000.0,m,note\n" * 1_200_000)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(InputError, match=r"more than 1,000,000 lines\. Split the survey"):
        read_events(path)
    path.write_text("file,time_s\n" + "left/000000001.png,300000000.0\n" * 1_200_000)
    with pytest.raises(InputError, match=r"more than 1,000,000 lines"):
        read_image_list({"images": path.name}, tmp_path, "cameras.left")
    assert (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) * 1024 < 600 << 20


def test_a_folder_of_very_many_images(tmp_path, monkeypatch):
    """C18: counted while it is listed, mixed cases and all; one too many is refused, not listed to its end."""
    from linework.files.images import lists

    (tmp_path / "left").mkdir()
    for i in range(20_000):
        (tmp_path / "left" / f"{i}.{'PNG' if i % 2 else 'png'}").touch()
    found = read_image_list({"images": "left/*.png", "rate_hz": 10.0}, tmp_path, "cameras.left")
    assert len(found.files) == 20_000
    assert np.all(np.diff(found.time_s) > 0)
    monkeypatch.setattr(lists, "MAX_ROWS", 19_999)
    with pytest.raises(InputError, match=r"more than 19,999 images\. Split the survey"):
        read_image_list({"images": "left/*.png", "rate_hz": 10.0}, tmp_path, "cameras.left")
