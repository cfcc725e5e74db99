"""Worn dashes get the length of the whole ones near them."""

import numpy as np

from linework.methods.tracking.pattern import PaintRhythm, restore_worn_dashes


def test_worn_dashes_are_restored_from_those_around_them():
    rng = np.random.default_rng(7)
    start = 18.0 * np.arange(12.0)
    cut = rng.uniform(0.5, 3.0, (12, 2)) * (rng.random((12, 2)) < 0.5)
    worn = np.column_stack([start + cut[:, 0], start + 6.0 - cut[:, 1]])
    whole = restore_worn_dashes(worn, PaintRhythm(18.1, 6.2, 0.6))
    assert np.abs(worn - np.column_stack([start, start + 6.0])).max() > 2.0
    np.testing.assert_allclose(whole, np.column_stack([start, start + 6.0]), atol=0.6)


def test_dashes_of_which_none_is_whole_stay_or_are_restored_without_a_fault():
    start = 9.0 * np.arange(6.0)
    for seed in range(40):
        length = np.random.default_rng(seed).uniform(0.5, 3.0, 6)
        dashes = np.column_stack([start, start + length])
        whole = restore_worn_dashes(dashes, PaintRhythm(9.0, 3.2, 0.5))
        assert np.all(whole[:, 1] - whole[:, 0] >= 0.5) and np.isfinite(whole).all()
    # One dash of three metres beside ones of every other length is no group
    ladder = np.column_stack([start, start + np.array([0.5, 1.0, 1.5, 2.0, 2.5, 3.0])])
    np.testing.assert_array_equal(restore_worn_dashes(ladder, PaintRhythm(9.0, 3.2, 0.5)), ladder)
