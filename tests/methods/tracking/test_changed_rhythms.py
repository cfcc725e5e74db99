"""Lines whose dashes change before a junction."""

import itertools

import numpy as np
import pytest

from linework.methods.tracking.marking_lines import _paint_of
from linework.methods.tracking.pattern import PaintRhythm, PatternStretch, find_stretches


def dashes(*parts):
    """Return paint of (start, dash, gap, number) in order, with ends that are 5 cm off."""
    paint = [
        [start + k * (dash + gap), start + k * (dash + gap) + dash]
        for start, dash, gap, n in parts
        for k in range(n)
    ]
    return np.array(paint) + np.random.default_rng(0).normal(0.0, 0.05, (len(paint), 2))


@pytest.mark.parametrize(
    ("parts", "periods_m"),
    [
        (((0, 3, 6, 3), (26, 1.5, 1.5, 7), (49, 3, 6, 3)), [9, 3, 9]),
        (((0, 6, 12, 5), (92, 3, 3, 6), (132, 6, 12, 5)), [18, 6, 18]),
        (((0, 4, 12, 6), (97, 6, 3, 6)), [16, 9]),
        # Missing dashes are no other rhythm
        (((0, 3, 6, 8), (81, 3, 15, 1), (99, 3, 6, 8)), [9]),
    ],
)
def test_dashes_that_change_have_several_rhythms(parts, periods_m):
    stretches = find_stretches(dashes(*parts))
    found = [s.rhythm.period_m if s.rhythm else 0.0 for s in stretches]
    assert len(found) == len(periods_m)
    np.testing.assert_allclose(found, periods_m, rtol=0.03)
    assert all(a.end_m == b.start_m for a, b in itertools.pairwise(stretches))


@pytest.mark.parametrize(("parts", "is_dashed"), [((0, 1, 5, 12), True), ((0, 0.7, 17.3, 7), False)])
def test_covers_in_a_row_are_no_dashes(parts, is_dashed):
    (stretch,) = find_stretches(dashes(parts))
    assert (stretch.rhythm is not None) == is_dashed


def test_paint_that_ends_where_a_stretch_begins_is_not_in_it():
    # Distances from another start: 3.0 and what is left of 59.3 less 56.3
    paint = np.array([[0.0, 59.3 - 56.3], [9.0, 12.0], [18.0, 21.0]])
    assert paint[0, 1] > 2.999999999999996
    stretch = PatternStretch(2.999999999999996, 30.0, PaintRhythm(9.0, 3.0, 0.9))
    assert _paint_of(paint, stretch).tolist() == [[9.0, 12.0], [18.0, 21.0]]
