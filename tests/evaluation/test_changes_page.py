"""The page of changes stays small however much has moved."""

import base64
import re
import struct

import numpy as np
import pytest

from linework.evaluation.changes.epoch_change import EpochChange
from linework.evaluation.changes.registration import Registration
from linework.model.lines import LineSet

pytest.importorskip("matplotlib")
from linework.evaluation.changes.changes_page import changes_page

UNMOVED = Registration(
    np.zeros((0, 2), np.int64), np.zeros((0, 3)), np.zeros(0), np.zeros((0, 2)), np.zeros(0, np.int64)
)


def moves(n):
    lines = LineSet.from_lines(
        [np.array([[10.0 * k, 0.0, 5.0], [10.0 * k + 5.0, 0.0, 5.0]]) for k in range(n)], kind="road_boundary"
    ).with_columns(id=[f"line {k:05}" for k in range(n)])  # fmt: skip
    found = [
        EpochChange(
            line=lines[k : k + 1], status="moved", from_m=0.0, to_m=5.0, across_m=0.02 + 0.0001 * k, up_m=0.0,
            sigma_across_m=0.01, sigma_up_m=0.01, what="",
        )
        for k in range(n)
    ]  # fmt: skip
    return lines, found


def heights_of_pictures(page):
    for code in re.findall(r"data:image/png;base64,([^\"']+)", page):
        yield struct.unpack(">I", base64.b64decode(code)[20:24])[0]


@pytest.mark.parametrize("n", [3, 2500])
def test_the_largest_moves_are_drawn_and_all_are_listed(n):
    lines, found = moves(n)
    page = changes_page(found, UNMOVED, lines, lines, {}, title="changes")
    assert max(heights_of_pictures(page)) < 4000
    assert ("of 2,500 moves" in page) == (n == 2500)
    assert all(f"line {k:05}" in page for k in (0, n // 2, n - 1))
    assert len(page) < 4_000_000
