"""The other carriageway of a divided road, and the kerbs of a raised median, one of which hides its own foot."""

from __future__ import annotations

import numpy as np
import pytest
from tests.scenes.divided_road import KERB_M, KERBS_M, LENGTH_M, ORIGIN, divided_road, driven

import linework


@pytest.fixture(scope="module")
def points():
    return divided_road(9891)


@pytest.fixture(scope="module")
def lines(points):
    return linework.extract(points, trajectory=driven(), kinds=("road_boundary",), adjust=False)


def test_both_carriageways_are_road_and_nothing_else_is(points):
    ground = linework.find_ground(points, driven())
    rows, _ = np.nonzero(ground.is_road)
    y = ground.grid.north_m - (rows + 0.5) * ground.grid.cell_height_m - ORIGIN[1]
    part = np.searchsorted(KERBS_M, y)
    inside = np.abs(y[:, None] - np.array(KERBS_M)).min(axis=1) > 0.5
    assert set(part[inside]) == {1, 3}
    assert min(np.mean(part == 1), np.mean(part == 3)) > 0.4


def test_kerbs_are_found_on_both_sides_of_the_median(lines):
    ends = np.delete(np.arange(len(lines.xyz) - 1), lines.offsets[1:-1] - 1)
    middle = 0.5 * (lines.xyz[ends] + lines.xyz[ends + 1]) - ORIGIN
    length = np.hypot(*(lines.xyz[ends + 1] - lines.xyz[ends])[:, :2].T)
    off = np.abs(middle[:, 1, None] - np.array(KERBS_M))
    for k in range(len(KERBS_M)):
        assert length[off[:, k] <= 0.05].sum() >= 0.9 * LENGTH_M
    assert length[off.min(axis=1) > 0.10].sum() <= 1.0


def test_a_kerb_that_hides_its_foot_lies_at_its_upper_edge(lines):
    hidden = lines.xyz[np.abs(lines.xyz[:, 1] - ORIGIN[1] - KERBS_M[2]) <= 0.10] - ORIGIN
    assert len(hidden) > 2
    assert np.abs(hidden[:, 1] - KERBS_M[2]).max() <= 0.04
    assert np.abs(hidden[:, 2]).max() <= 0.02 < KERB_M
