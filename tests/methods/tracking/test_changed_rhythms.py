"""Lines whose dashes change before a junction."""

import itertools

import numpy as np
import pytest

from linework.methods.tracking.pattern import find_stretches


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
