"""Rhythms of dashed markings some of whose dashes are not whole."""

import numpy as np
import pytest

from linework.lines.dashes import middle_of_pairs, rhythm_of_whole


def dashes_of(lengths, *, period=18.0):
    """Return dashes (k, 2) that begin a period apart."""
    begin = period * np.arange(len(lengths))
    return np.column_stack([begin, begin + lengths])


def test_longer_dashes_in_the_same_places_are_the_whole_ones():
    """Worn dashes were restored like each other, and outnumber the whole ones."""
    lengths = [5.35, 5.38, 5.38, 6.07, 5.51, 5.94, 6.05, 5.4, 5.38, 5.25, 4.77]
    rhythm = rhythm_of_whole(dashes_of(lengths))
    assert rhythm[:2] == pytest.approx((6.02, 11.98), abs=0.06)
    # One or two of them may have been drawn too long
    for few in ([5.35, 5.38, 6.07, 5.4, 5.38], [5.35, 5.38, 6.07, 5.4, 5.38, 6.0, 5.4]):
        assert rhythm_of_whole(dashes_of(few)).dash_m == pytest.approx(5.38, abs=0.03)
    # Three that cover nothing of the others are elsewhere
    aside = dashes_of([3.0, 3.0, 3.0, 3.0, 3.0, 3.0, 3.0, 4.0, 4.0, 4.0], period=12.0)
    aside[7:] += 6.0
    assert rhythm_of_whole(aside).dash_m == pytest.approx(3.0)


def test_dashes_that_lost_a_little_do_not_shorten_the_rhythm():
    lengths = [3.01, 3.0, 2.99, 3.02, 2.9, 2.98, 2.84, 3.0, 2.79, 3.01, 2.99]
    assert rhythm_of_whole(dashes_of(lengths, period=9.0)).dash_m == pytest.approx(3.0, abs=0.015)


def test_what_is_left_within_the_places_of_whole_dashes_belongs_to_them():
    rhythm = rhythm_of_whole(dashes_of([3.0, 3.01, 2.99, 0.7, 1.5, 2.1, 1.1, 0.8, 2.4], period=9.0))
    assert rhythm[:2] == pytest.approx((3.0, 6.0), abs=0.02)


def test_dashes_that_scan_lines_cut_to_two_lengths_are_as_long_as_the_truth_between():
    """Scan lines 0.2 m apart hit 15 or 16 places of dashes of 3.0 m: more dashes have the longer of both lengths."""
    lengths = np.where(np.arange(21) % 5 < 3, 3.1, 2.9)
    found = rhythm_of_whole(dashes_of(lengths + 0.01 * np.sin(np.arange(21)), period=9.0))
    assert found.dash_m == pytest.approx(3.0, abs=0.025)


def test_the_middle_of_many_lengths_needs_no_square_of_their_number():
    lengths = np.random.default_rng(3).normal(3.0, 0.1, 200_000)
    assert middle_of_pairs(lengths) == pytest.approx(3.0, abs=0.002)
