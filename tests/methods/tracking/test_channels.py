"""Channels within a carriageway, and those that have a footway behind them."""

import numpy as np
import pytest

from linework.methods.tracking.channels import has_footway_behind, within_carriageway
from linework.methods.tracking.neighbours import LineAxis


def axis(y, *, turned=False):
    """A line along the x-axis, its left side to the north unless it is turned."""
    t = np.linspace(0.0, 40.0, 81)
    return LineAxis.of(t, np.column_stack([t[::-1] if turned else t, np.full(81, y), np.zeros(81)]))


@pytest.mark.parametrize(
    ("paint", "path", "is_within"),
    [
        # The van keeps clear of the end of the carriageway, whatever the stones of its gutter look like
        ([], [1.5], False),
        ([-0.1, 0.7, 3.5], [1.5], False),
        # It drives over the channel; it comes back on the other side
        ([], [0.6], True),
        ([], [1.0], True),
        ([], [1.7, -1.7], True),
        # There are lanes on both sides
        ([3.5, -3.5], [1.7], True),
    ],
)
def test_a_channel_with_carriageway_on_both_sides_is_within_it(paint, path, is_within):
    found = within_carriageway([axis(0.0)], [axis(y) for y in paint], [axis(y) for y in path])
    assert found.tolist() == [is_within]


@pytest.mark.parametrize(
    ("behind", "has_footway"),
    [
        ([axis(-1.3)], True),
        ([axis(-2.5)], False),
        ([axis(-1.3, turned=True)], False),
        ([axis(1.3)], False),
        ([], False),
    ],
)
def test_a_footway_is_narrower_than_a_vehicle(behind, has_footway):
    assert has_footway_behind([axis(0.0)], behind).tolist() == [has_footway]
