"""The server is killed while somebody edits: what was answered is on the disk (J21)."""

from __future__ import annotations

import contextlib
import random
import sqlite3
import threading

import httpx
import pyogrio
import pytest
from tests.workbench.serve_process import Served, served_survey

from linework.files.line_file.file import LineFile
from linework.files.vectors.read_write import read_lines

#: How often it is killed, and after how long. [s]
ROUNDS, LONGEST_S = 3, 1.5


def edit_until_it_dies(served: Served, first: int, killing: threading.Timer) -> list[int]:
    """Draw line after line, each with its number in its height; return the numbers that were answered.

    The time until it is killed runs from the first answer, for which the server imports what edits need.
    """
    saved: list[int] = []
    number = first
    while True:
        east = 500_000.0 + number % 40
        order = {
            "action": "draw", "kind": "guardrail",
            "xyz": [[east, 5_400_000.0, float(number)], [east + 0.5, 5_400_001.0, float(number)]],
        }  # fmt: skip
        try:
            answer = served.client.post("/api/changes", json={"revision": 0, "edit": order})
        except httpx.HTTPError:
            return saved
        assert answer.status_code == 200, answer.text
        if not saved:
            killing.start()
        saved.append(number)
        number += 1


@pytest.mark.parametrize("seed", [1])
def test_what_was_answered_is_on_the_disk(las_file, seed):
    rng = random.Random(seed)
    survey = las_file.parent
    answered: list[int] = []
    for _ in range(ROUNDS):
        with served_survey(survey) as served:
            lines = served.lines
            there = {int(line["xyz"][0][2]) for line in served.get("/api/lines")["lines"]}
            assert there >= set(answered)
            killing = threading.Timer(rng.uniform(0.3, LONGEST_S), served.process.kill)
            answered += edit_until_it_dies(served, max(there, default=0) + 1, killing)
            killing.join()
            assert served.process.wait(120) == -9
        # A change that was half written is rolled back by the first program that may write to the file, whichever it is
        with contextlib.closing(sqlite3.connect(lines)) as other:
            other.execute("SELECT count(*) FROM gpkg_contents").fetchone()
        # Then it is as it should be, by nobody's repair: all that was answered, and at most the one in flight
        layers = {name for name, _ in pyogrio.list_layers(lines)}
        assert "guardrail" in layers
        heights = sorted(int(line.xyz[0, 2]) for line in read_lines(lines))
        assert set(answered) <= set(heights)
        assert len(heights) == len(set(heights)) <= len(answered) + ROUNDS
        crs = read_lines(lines).crs
        with LineFile.opened(lines, crs=crs) as line_file:
            assert line_file.revision == len(line_file.lines) == len(heights)
    assert len(answered) > 10
