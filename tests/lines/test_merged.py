"""Lines of two methods: each feature once, nothing averaged."""

import numpy as np
import pytest

from linework.lines.merged import merge_line_sets
from linework.model.lines import LineSet


def straight(north_m, start_m=0.0, end_m=100.0, sigma_m=0.02, method="obb", kind="lane_marking"):
    x = np.arange(start_m, end_m + 0.5, 1.0)
    xyz = np.stack([x, np.full(len(x), north_m), np.zeros(len(x))], axis=1) + np.array([5e5, 5.4e6, 100.0])
    return LineSet.from_lines([xyz], kind=[kind], method=[method], sigma_xy_m=np.full(len(x), sigma_m))


def test_the_smaller_sigma_stays_and_says_where_the_other_is():
    both = merge_line_sets(straight(0.0), straight(0.06, method="stereo", sigma_m=0.05))
    assert both.method.tolist() == ["obb"]
    assert both.disagreement_mean_m[0] == pytest.approx(0.06, abs=1e-6)
    assert both.disagreement_rms_m[0] == pytest.approx(0.06, abs=1e-6)
    other = merge_line_sets(straight(0.0, sigma_m=0.08), straight(0.06, method="stereo", sigma_m=0.05))
    assert other.method.tolist() == ["stereo"]
    assert other.disagreement_mean_m[0] == pytest.approx(-0.06, abs=1e-6)


def test_no_vertex_moves():
    one = straight(0.0)
    both = merge_line_sets(one, straight(0.06, method="stereo", sigma_m=0.05))
    np.testing.assert_array_equal(both.xyz, one.xyz)


def test_what_goes_on_beyond_the_other_is_one_line_with_it():
    both = merge_line_sets(
        straight(0.0, 0.0, 60.0), straight(0.05, 20.0, 100.0, sigma_m=0.05, method="stereo")
    )
    assert both.method.tolist() == ["obb+stereo"]
    assert both.length_m[0] == pytest.approx(100.0, abs=0.1)
    beyond = both.xyz[:, 0] > 500_060.1
    np.testing.assert_allclose(both.xyz[beyond, 1] - 5.4e6, 0.05, atol=1e-6)
    np.testing.assert_array_equal(both.sigma_xy_m, np.where(beyond, 0.05, 0.02))
    assert not both.bridged.any()


def test_a_gap_that_the_other_saw_is_closed_by_it():
    one = LineSet.concatenate([straight(0.0, 0.0, 30.0), straight(0.0, 70.0, 100.0)])
    other = straight(0.05, 0.0, 100.0, sigma_m=0.05, method="stereo")
    for both in (
        merge_line_sets(one, other),
        merge_line_sets(one, turned(other)),
        merge_line_sets(turned(one.take([0])), other),
    ):
        assert both.method.tolist() == ["obb+stereo"]
        assert both.length_m[0] == pytest.approx(100.0, abs=0.2)
        assert (np.abs(np.diff(np.sign(np.diff(both.xyz[:, 0])))) == 0).all()


def turned(line):
    return line.with_columns(xyz=line.xyz[::-1])


def test_neighbours_a_lane_apart_are_two_features():
    both = merge_line_sets(straight(0.0), straight(3.5, method="stereo"))
    assert len(both) == 2
    assert np.isnan(both.disagreement_rms_m).all()


def test_both_lines_of_a_double_line_find_their_own():
    one = LineSet.concatenate([straight(0.0), straight(0.3)])
    other = LineSet.concatenate([straight(0.04, method="stereo", sigma_m=0.05),
                                 straight(0.34, method="stereo", sigma_m=0.05)])  # fmt: skip
    both = merge_line_sets(one, other)
    assert both.method.tolist() == ["obb", "obb"]
    assert both.disagreement_mean_m.tolist() == pytest.approx([0.04, 0.04], abs=1e-6)


def test_dashes_stay_whole():
    one = straight(0.0, 0.0, 4.0, kind="lane_marking_dash")
    other = straight(0.02, 1.0, 7.0, kind="lane_marking_dash", method="stereo", sigma_m=0.05)
    assert merge_line_sets(one, other).method.tolist() == ["obb"]
    far = straight(0.02, 3.5, 9.0, kind="lane_marking_dash", method="stereo", sigma_m=0.05)
    assert merge_line_sets(one, far).length_m.tolist() == pytest.approx([4.0, 5.0])


def test_unknown_sigmas_give_way_and_empty_sets_are_fine():
    both = merge_line_sets(straight(0.0, sigma_m=np.nan), straight(0.05, method="stereo", sigma_m=0.05))
    assert both.method.tolist() == ["stereo"]
    assert len(merge_line_sets(LineSet.empty(), straight(0.0))) == 1
    assert len(merge_line_sets(LineSet.empty(), LineSet.empty())) == 0


def test_kinds_are_apart():
    both = merge_line_sets(straight(0.0), straight(0.0, kind="guardrail", sigma_m=0.001))
    assert sorted(both.kind.tolist()) == ["guardrail", "lane_marking"]
