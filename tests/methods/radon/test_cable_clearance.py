"""Clearances of cables over ground that is known, and over ground that is not."""

import numpy as np
import pytest

from linework.methods.cables.lines import with_known_clearance
from linework.model.grid import Grid
from linework.model.ground import Ground
from linework.model.lines import LineSet


def wires():
    east = np.linspace(1.0, 99.0, 50)
    parts = [np.column_stack([east, np.full(50, north), np.full(50, 8.0)]) for north in (5.0, 25.0, 45.0)]
    return LineSet.from_lines(parts, kind=["cable"] * 3, clearance_m=[8.0, 8.0, 8.0])


@pytest.mark.parametrize("unknown_m", [40.0, 60.0])
def test_a_clearance_needs_known_ground_below(unknown_m):
    """Beyond 20 m north nothing is known of the ground for a part of the way, and beyond 40 m nothing at all."""
    heights = np.zeros((60, 100))
    heights[: 60 - 20, : int(unknown_m)] = np.nan
    heights[: 60 - 40] = np.nan
    ground = Ground.from_heights(heights, Grid(0.0, 60.0, 1.0, 1.0, 60, 100))
    found = with_known_clearance(wires(), ground).clearance_m
    assert found[0] == pytest.approx(8.0)
    assert np.isnan(found[1]) == (unknown_m > 50.0)
    assert np.isnan(found[2])


def test_no_wires_have_no_clearance():
    ground = Ground.from_heights(np.zeros((4, 4)), Grid(0.0, 4.0, 1.0, 1.0, 4, 4))
    assert len(with_known_clearance(LineSet.empty("local"), ground)) == 0
