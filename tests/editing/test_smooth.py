"""Smoothing by hand, and the dashes that a rhythm lacks."""

import numpy as np
import pytest

from linework.editing.edits.dashes import with_missing_dashes
from linework.editing.edits.vertices import CLICKED_M, smooth_by_sigmas
from linework.errors import UsageError
from linework.model.lines import LineSet


def wavy(sigma, *, n=101, off=None, **columns):
    t = np.linspace(0.0, 100.0, n)
    rng = np.random.default_rng(3)
    y = rng.normal(0.0, 0.03, n) if off is None else off
    xyz = np.column_stack([500_000.0 + t, 5_800_000.0 + y, 0.5 * y])
    return LineSet.from_lines(
        [xyz], kind=["lane_marking"], sigma_xy_m=np.full(n, sigma), sigma_z_m=np.full(n, sigma), **columns
    )


def test_a_smoothed_line_is_smoother_and_holds_its_ends():
    one = wavy(0.03)
    after = smooth_by_sigmas(one)
    rough = [np.diff(x.xyz[:, 1], 2).std() for x in (one, after)]
    assert rough[1] < 0.2 * rough[0]
    assert np.array_equal(after.xyz[[0, -1]], one.xyz[[0, -1]])
    assert (
        np.abs(after.xyz[5:-5, 1] - 5_800_000.0).mean() < 0.6 * np.abs(one.xyz[5:-5, 1] - 5_800_000.0).mean()
    )


@pytest.mark.parametrize(("sigma", "most"), [(0.005, 0.015), (np.nan, 3 * CLICKED_M)])
def test_no_vertex_moves_further_than_three_sigma(sigma, most):
    off = np.zeros(101)
    off[50] = 1.0
    one = wavy(sigma, off=off)
    step = smooth_by_sigmas(one).xyz - one.xyz
    assert np.hypot(step[:, 0], step[:, 1]).max() <= most + 1e-9
    assert np.abs(step[50, 1]) == pytest.approx(most, rel=0.1)


def test_a_bridged_vertex_goes_where_the_others_lead():
    off = np.zeros(101)
    off[48:53] = 0.8
    bridged = (off > 0).tolist()
    after = smooth_by_sigmas(wavy(0.01, off=off, bridged=bridged))
    assert np.abs(after.xyz[48:53, 1] - 5_800_000.0).max() < 0.02


def test_a_cable_and_a_line_of_two_vertices_are_refused():
    with pytest.raises(UsageError, match="catenaries"):
        smooth_by_sigmas(wavy(0.01).with_columns(kind=np.array(["cable"])))
    with pytest.raises(UsageError, match="no vertex between"):
        smooth_by_sigmas(wavy(0.01, n=2))


def dashed(length=120.0, period=9.0, dash=3.0, gone=(), shift=lambda k: 0.0):
    line = LineSet.from_lines(
        [np.array([[0.0, 0.0, 0.0], [length, 0.0, 1.2]])], kind=["lane_marking"], pattern=["dashed"],
        role=["centre"],
    )  # fmt: skip
    starts = [k * period + shift(k) for k in range(int((length - dash) / period) + 1) if k not in gone]
    dashes = LineSet.from_lines(
        [np.array([[s, 0.0, 0.0], [s + dash, 0.0, 0.0]]) for s in starts],
        kind=["lane_marking_dash"] * len(starts), width_m=[0.12] * len(starts),
    )  # fmt: skip
    return line, dashes


def test_dashes_that_are_gone_come_back_where_the_rhythm_says():
    new = with_missing_dashes(*dashed(gone=(3, 4, 8)))
    assert new.xyz[::2, 0].tolist() == pytest.approx([27.0, 36.0, 72.0], abs=0.01)
    assert new.length_m.tolist() == pytest.approx([3.0] * 3)
    assert new.bridged.all()
    assert new.role.tolist() == ["centre"] * 3
    assert new.width_m.tolist() == [0.12] * 3
    assert new.xyz[0, 2] == pytest.approx(0.27)


def test_no_dash_is_made_up_where_the_phase_changes():
    # A crossing: the painter began anew 2 m late
    new = with_missing_dashes(*dashed(gone=(5, 6, 10), shift=lambda k: 2.0 if k > 6 else 0.0))
    assert new.xyz[::2, 0].tolist() == pytest.approx([92.0], abs=0.3)


def test_a_whole_line_and_one_without_rhythm_are_refused():
    with pytest.raises(UsageError, match="no dash is missing"):
        with_missing_dashes(*dashed())
    with pytest.raises(UsageError, match="for a rhythm"):
        with_missing_dashes(*dashed(gone=range(3, 20)))
    rng = np.random.default_rng(1)
    with pytest.raises(UsageError, match="for a rhythm"):
        with_missing_dashes(*dashed(shift=lambda _: rng.uniform(0.0, 6.0)))
