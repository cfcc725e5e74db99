"""The measures on cases small enough to work out by hand."""

import math

import numpy as np
import pytest

from linework.errors import CrsError, InputError, UsageError
from linework.evaluation.measures import evaluate, kinds_in
from linework.model.lines import LineSet

MIDDLE = np.array([50.25, 0.0, 0.0])


def lines(*vertices, kind="guardrail", **columns):
    n = len(vertices)
    kinds = [kind] * n if isinstance(kind, str) else kind
    return LineSet.from_lines([np.array(v, dtype=float) for v in vertices], kind=kinds, **columns)


def straight(y=0.0, x0=0.0, x1=100.0, z=0.0, step=100.0):
    x = np.linspace(x0, x1, max(round((x1 - x0) / step), 1) + 1)
    return np.stack([x, np.full_like(x, y), np.full_like(x, z)], axis=1)


def arc(radius, degrees=90.0, step_deg=0.25, z=0.0):
    """Anticlockwise about the origin, from the east."""
    a = np.radians(np.arange(0, degrees + step_deg / 2, step_deg))
    return np.stack([radius * np.cos(a), radius * np.sin(a), np.full_like(a, z)], axis=1)


def test_a_line_on_itself_is_perfect():
    s = evaluate(lines(straight()), lines(straight())).overall
    assert (s.at.completeness, s.at.correctness, s.at.quality, s.at.redundancy) == (1, 1, 1, 0)
    assert (s.at.gaps_per_km, s.at.pieces_per_line, s.at.n_missed) == (0, 1, 0)
    assert s.at.lateral.rmse_m == s.at.height.rmse_m == s.hausdorff_m == 0
    assert s.n_stations == 200
    assert s.chamfer_ap == {0.2: 1.0, 0.5: 1.0, 1.0: 1.0}


def test_a_parallel_line_has_the_offset_as_its_bias():
    # To the left of a line drawn eastward is north: +
    s = evaluate(lines(straight(0.04, z=1.02)), lines(straight(z=1.0))).overall.at
    for errors, bias in ((s.lateral, 0.04), (s.height, 0.02)):
        assert errors.n == 200
        assert errors.bias_m == pytest.approx(bias, abs=1e-9)
        assert errors.rmse_m == pytest.approx(bias, abs=1e-9)
        assert errors.median_m == pytest.approx(bias, abs=1e-9)
        assert errors.p95_m == pytest.approx(bias, abs=1e-9)


def test_the_lateral_sign_follows_the_reference_alone():
    found = lines(straight(0.04))
    back = lines(straight()[::-1])
    assert evaluate(found, back).overall.at.lateral.bias_m == pytest.approx(-0.04, abs=1e-9)
    found = lines(straight(0.04)[::-1])
    assert evaluate(found, lines(straight())).overall.at.lateral.bias_m == pytest.approx(0.04, abs=1e-9)


@pytest.mark.parametrize(("reverse_e", "reverse_r"), [(False, False), (True, False), (False, True)])
def test_in_a_bend_positive_is_left_of_the_reference(reverse_e, reverse_r):
    # Anticlockwise, left is the inside: a smaller radius is +, whichever way the extracted line was drawn
    found, truth = arc(49.95), arc(50.0)
    s = evaluate(lines(found[:: -1 if reverse_e else 1]), lines(truth[:: -1 if reverse_r else 1]))
    assert s.overall.at.lateral.bias_m == pytest.approx(-0.05 if reverse_r else 0.05, abs=2e-4)
    assert s.overall.at.lateral.rmse_m == pytest.approx(0.05, abs=2e-4)
    assert s.overall.at.completeness == 1


def test_two_sides_cancel_in_the_bias_and_not_in_the_rmse():
    found = lines(straight(0.03, 0, 50), straight(-0.03, 50, 100))
    s = evaluate(found, lines(straight())).overall.at
    assert s.lateral.bias_m == pytest.approx(0, abs=1e-9)
    assert s.lateral.rmse_m == pytest.approx(0.03, abs=1e-9)
    assert s.pieces_per_line == 2


def test_half_a_line():
    s = evaluate(lines(straight(0, 0, 50)), lines(straight())).overall
    # The end cap: up to one tolerance beyond the end still counts
    assert s.at.completeness == pytest.approx(0.5, abs=0.0011)
    assert s.at.correctness == 1
    assert s.at.quality == pytest.approx(50 / (50 + 50 - 0.1), abs=0.001)
    assert s.at.gaps_per_km == pytest.approx(1 / 0.1)
    assert (s.at.n_missed, s.n_stations) == (100, 200)
    assert s.at.lateral.n == 100
    assert s.hausdorff_m == pytest.approx(50, abs=0.06)
    assert s.hausdorff_p95_m == pytest.approx(45, abs=0.06)


def test_two_gaps_three_pieces():
    found = lines(straight(0, 0, 30), straight(0, 40, 60), straight(0, 70, 100))
    s = evaluate(found, lines(straight())).overall.at
    assert s.gaps_per_km == pytest.approx(20)
    assert s.pieces_per_line == 3
    assert s.completeness == pytest.approx(0.8, abs=0.005)


def test_a_doubled_line_is_half_redundant():
    s = evaluate(lines(straight(0.02), straight(-0.02)), lines(straight())).overall.at
    assert s.redundancy == pytest.approx(0.5)
    assert (s.completeness, s.correctness) == (1, 1)
    assert s.pieces_per_line == 2


def test_running_past_a_joint_is_no_second_piece():
    truth = lines(straight(0, 0, 50), straight(0, 50, 100))
    assert (
        evaluate(lines(straight(0, 0, 50.2), straight(0, 50.2, 100)), truth).overall.at.pieces_per_line == 1
    )
    assert evaluate(lines(straight(0, 0, 100)), truth).overall.at.pieces_per_line == 1


def test_a_line_beyond_the_tolerance_is_wrong_and_the_truth_missed():
    s = evaluate(lines(straight(0.3)), lines(straight())).overall
    assert (s.at.completeness, s.at.correctness, s.at.quality) == (0, 0, 0)
    assert s.at.redundancy is None
    assert s.at.pieces_per_line is None
    assert s.at.lateral.rmse_m is None
    assert s.at.n_missed == 200
    assert [c.completeness for c in s.curve] == [0, 0, 0, 1]
    assert s.curve[-1].lateral.bias_m == pytest.approx(0.3)
    assert s.chamfer_ap == {0.2: 0.0, 0.5: 1.0, 1.0: 1.0}


def test_a_tie_with_the_tolerance_counts_at_any_coordinates():
    shift = np.array([691_000.1, 5_336_000.7, 0])
    s = evaluate(lines(straight(0.1) + shift), lines(straight() + shift)).overall.at
    assert (s.completeness, s.correctness, s.n_missed) == (1, 1, 0)


@pytest.mark.parametrize(("angle_deg", "share"), [(19.9, 1.0), (20.1, 0.0), (90.0, 0.0)])
def test_another_direction_is_no_match(angle_deg, share):
    # A stitch of 0.2 m across the truth: every part of it is near enough, its direction decides
    half = 0.1 * np.array([math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg)), 0])
    found = lines([MIDDLE - half, MIDDLE + half])
    s = evaluate(found, lines(straight())).overall.at
    assert s.correctness == share
    assert (s.completeness > 0) == (share > 0)
    assert s.n_missed == 200 if share == 0 else s.n_missed < 200


def test_crossing_lines_do_not_match_each_other():
    north = np.array([[50, -50, 0], [50, 50, 0]], dtype=float)
    s = evaluate(lines(straight()), lines(north)).overall.at
    assert (s.completeness, s.correctness) == (0, 0)
    # With both there, each finds its own, and a perpendicular never takes the crossing line
    both = lines(straight(), north)
    s = evaluate(both, both).overall.at
    assert (s.completeness, s.correctness, s.redundancy, s.n_missed) == (1, 1, 0, 0)
    assert s.lateral.rmse_m == 0


def test_a_perpendicular_takes_the_nearest_of_several():
    s = evaluate(lines(straight(0.08), straight(-0.03)), lines(straight())).overall.at
    assert s.lateral.bias_m == pytest.approx(-0.03, abs=1e-9)


def test_a_dashed_line_is_one_line_through_its_gaps():
    truth = lines(straight(), kind="lane_marking", pattern=["dashed"])
    whole = lines(straight(0.01), kind="lane_marking", pattern=["dashed"])
    assert evaluate(whole, truth).overall.at.completeness == 1
    dashes = [straight(0.01, x, x + 3) for x in np.arange(0, 100, 9)]
    s = evaluate(lines(*dashes, kind="lane_marking"), truth).overall.at
    # 12 dashes of 3 m, the last one from 99 to 102, and caps of sqrt(0.1^2 - 0.01^2) m at the inner ends
    assert s.completeness == pytest.approx(0.34, abs=12 * 2 * 0.001)
    assert s.gaps_per_km == pytest.approx(11 / 0.1)
    assert s.pieces_per_line == 12
    assert s.correctness == pytest.approx((33 + 1.1) / 36, abs=0.003)


def test_cables_are_matched_in_space_and_rails_in_plan():
    low, high = straight(z=6.0), straight(z=6.5)
    s = evaluate(lines(high, kind="cable"), lines(low, kind="cable")).overall.at
    assert (s.completeness, s.correctness) == (0, 0)
    s = evaluate(lines(high), lines(low)).overall.at
    assert (s.completeness, s.correctness) == (1, 1)
    assert s.height.bias_m == pytest.approx(0.5)
    # Two wires above one another: each meets its own
    found = lines(straight(0.03, z=6.04), straight(0.03, z=6.54), kind="cable")
    s = evaluate(found, lines(low, high, kind="cable")).overall.at
    assert s.completeness == 1
    assert s.lateral.rmse_m == pytest.approx(0.03, abs=1e-9)
    assert s.height.rmse_m == pytest.approx(0.04, abs=1e-9)
    assert s.space.rmse_m == pytest.approx(0.05, abs=1e-9)
    assert s.space.bias_m is None


def test_a_sagging_cable_is_measured_along_itself():
    x = np.linspace(0, 40, 81)
    wire = np.stack([x, np.zeros_like(x), 6 + 4 * (x / 20 - 1) ** 2], axis=1)
    s = evaluate(lines(wire, kind="cable"), lines(wire, kind="cable")).overall
    assert s.reference_m == pytest.approx(np.linalg.norm(np.diff(wire, axis=0), axis=1).sum())
    assert s.at.completeness == 1
    assert s.at.space.rmse_m == pytest.approx(0, abs=1e-12)


def test_a_kind_matches_its_own_kind_only():
    truth = lines(straight(), straight(10), kind=["guardrail", "fence"])
    found = lines(straight(), straight(10), kind=["guardrail", "guardrail"])
    s = evaluate(found, truth)
    assert [k.kind for k in s.kinds] == ["guardrail", "fence"]
    assert (s["guardrail"].at.completeness, s["guardrail"].at.correctness) == (1, 0.5)
    assert (s["fence"].at.completeness, s["fence"].at.correctness) == (0, None)
    assert (s.overall.at.completeness, s.overall.at.correctness) == (0.5, 0.5)
    assert [k.kind for k in evaluate(found, truth, kinds=["guardrail"]).kinds] == ["guardrail"]
    with pytest.raises(KeyError):
        s["cable"]


def test_completeness_is_over_the_observed_truth():
    # Vertices every metre; 40 of the 100 m hidden, and nothing extracted there
    truth = lines(straight(step=1.0), observed=np.arange(101) <= 60)
    s = evaluate(lines(straight(0, 0, 60)), truth).overall
    assert s.observed_m == pytest.approx(60)
    assert s.at.completeness == 1
    assert s.at.completeness_all == pytest.approx(0.601)
    assert s.at.quality == 1
    assert s.at.quality_all == pytest.approx(60 / 99.9)
    assert s.at.gaps_per_km == 0
    assert (s.at.n_missed, s.at.n_missed_observed) == (80, 0)
    assert (s.n_stations, s.n_stations_observed) == (200, 120)
    assert s.hausdorff_m == pytest.approx(0)


def test_what_runs_on_where_nothing_was_seen_is_neither_wrong_nor_redundant():
    truth = lines(straight(step=1.0), observed=np.arange(101) <= 60)
    bridged = np.array([False, False, True])
    s = evaluate(lines([[0, 0, 0], [60, 0, 0], [100, 0, 0]], bridged=bridged), truth).overall
    assert (s.at.completeness, s.at.completeness_all, s.at.correctness) == (1, 1, 1)
    assert s.at.redundancy == 0
    assert s.bridged_m == 40


def test_an_unobserved_end_makes_its_segment_unobserved():
    observed = np.ones(11, dtype=bool)
    observed[5] = False
    truth = lines(straight(0, 0, 10, step=1.0), observed=observed)
    assert evaluate(lines(straight(0, 0, 10)), truth).overall.observed_m == pytest.approx(8)


def test_nothing_extracted_is_nothing_complete():
    s = evaluate(LineSet.empty(), lines(straight())).overall
    assert (s.at.completeness, s.at.correctness, s.at.quality) == (0, None, 0)
    assert s.hausdorff_m is None
    assert s.chamfer_ap[1.0] == 0
    assert s.confidence.calibration_error is None


def test_no_reference_leaves_only_wrong_lines():
    s = evaluate(lines(straight()), LineSet.empty()).overall
    assert (s.at.completeness, s.at.correctness, s.at.quality) == (None, 0, 0)
    assert s.chamfer_ap[1.0] is None
    assert s.n_stations == 0


def test_nothing_at_all_is_undefined():
    s = evaluate(LineSet.empty(), LineSet.empty(), kinds=["cable"])
    assert s.overall.at.completeness is None
    assert s.to_dict()["overall"]["at"]["quality"] is None


def test_lines_of_no_length_are_ignored():
    truth = lines(straight(), [[5, 5, 0]], [[7, 7, 0], [7, 7, 0]])
    s = evaluate(truth, truth).overall
    assert (s.at.completeness, s.at.correctness, s.reference_m) == (1, 1, 100)


def test_average_precision_by_confidence():
    truth = lines(straight(0), straight(10), straight(20), straight(30))
    # By confidence: right, wrong, right, and a second copy of a line that is taken
    found = lines(straight(0), straight(50), straight(10), straight(0.1), confidence=[0.9, 0.8, 0.7, 0.6])
    ap = evaluate(found, truth).overall.chamfer_ap
    assert ap[0.5] == pytest.approx((1 / 1 + 2 / 3) / 4)


def test_average_precision_wants_whole_lines():
    halves = lines(straight(0, 0, 50), straight(0, 50, 100))
    assert evaluate(halves, lines(straight())).overall.chamfer_ap[1.0] == 0
    # Chamfer distance: the mean of the two directed means, here 0 and (2 * 1 / 2 * 1 m) / 100 m
    nearly = lines(straight(0, 1, 99))
    assert evaluate(nearly, lines(straight())).overall.chamfer_ap[0.2] == 1


def test_height_attribute_is_compared_where_both_have_it():
    truth = lines(straight(), straight(10), straight(20), height_m=[0.75, 0.75, np.nan])
    found = lines(
        straight(), straight(10, 0, 50), straight(20), height_m=[0.78, 0.72, 0.9], width_m=[1, 1, 1]
    )
    attributes = evaluate(found, truth).overall.attributes
    assert attributes["height_m"].n == 2
    assert attributes["height_m"].bias_m == pytest.approx((100 * 0.03 - 50 * 0.03) / 150)
    assert attributes["height_m"].rmse_m == pytest.approx(0.03)
    assert attributes["width_m"].rmse_m is None


def test_sigma_is_judged_per_tercile():
    truth = lines(straight(0, 0, 30), straight(10, 0, 30), straight(20, 0, 30))
    found = lines(
        *(straight(y, 0, 30) for y in (0.01, 10.02, 20.06)), sigma_xy_m=np.repeat([0.01, 0.02, 0.03], 2)
    )
    terciles = evaluate(found, truth).overall.sigma_xy
    assert [t.n for t in terciles] == [60, 60, 60]
    assert [t.rms_ratio for t in terciles] == pytest.approx([1, 1, 2])
    assert [t.sigma_low_m for t in terciles] == pytest.approx([0.01, 0.02, 0.03])


def test_equal_sigmas_are_one_class():
    found = lines(straight(0.02), sigma_xy_m=[0.01, 0.01])
    terciles = evaluate(found, lines(straight())).overall.sigma_xy
    assert [(t.n, t.rms_ratio) for t in terciles] == [(200, pytest.approx(2))]
    assert evaluate(found, lines(straight())).overall.sigma_z == ()


def test_confidence_is_judged_per_ten_metres():
    # 10 right pieces said to be sure by 0.9, 5 wrong ones said to be sure by 0.2
    found = lines(straight(), straight(50, 0, 50), confidence=[0.9, 0.2])
    c = evaluate(found, lines(straight())).overall.confidence
    assert (c.n_pieces, c.n_correct, c.auc) == (15, 10, 1)
    assert c.calibration_error == pytest.approx((10 * 0.1 + 5 * 0.2) / 15)
    assert [(k.n, round(k.said, 9), k.was) for k in c.classes] == [(5, 0.2, 0.0), (10, 0.9, 1.0)]
    same = evaluate(found.with_columns(confidence=[0.5, 0.5]), lines(straight())).overall.confidence
    assert same.auc == 0.5
    assert evaluate(lines(straight()), lines(straight())).overall.confidence.auc is None


def test_a_piece_is_judged_by_where_it_lies():
    # The first half of the line is right, the second turns away
    found = lines([[0, 0, 0], [50, 0, 0], [100, 30, 0]])
    c = evaluate(found, lines(straight())).overall.confidence
    assert (c.n_pieces, c.n_correct) == (11, 5)


def test_different_crs_are_refused():
    a, b = straight(), straight()
    with pytest.raises(CrsError, match=r"not georeferenced.*crs="):
        evaluate(lines(a, crs="EPSG:25832"), lines(b))
    with pytest.raises(CrsError, match=r"UTM zone 32N.*UTM zone 33N"):
        evaluate(lines(a, crs="EPSG:25832"), lines(b, crs="EPSG:25833"))
    with pytest.raises(CrsError, match=r"DHHN2016.*DHHN92"):
        evaluate(lines(a, crs="EPSG:25832+7837"), lines(b, crs="EPSG:25832+5783"))


def test_a_crs_without_heights_agrees_with_a_warning():
    with pytest.warns(UserWarning, match="heights"):
        evaluate(lines(straight(), crs="EPSG:25832+7837"), lines(straight(), crs="EPSG:25832"))


def test_bad_numbers_are_refused():
    truth = lines(straight())
    for b in (0.0, -1.0, 10.1, math.nan, math.inf):
        with pytest.raises(UsageError, match="tolerance"):
            evaluate(truth, truth, tolerance_m=b)
    with pytest.raises(InputError, match="not finite"):
        evaluate(lines([[0, 0, 0], [np.nan, 0, 0]]), truth)
    with pytest.raises(InputError, match="need heights"):
        evaluate(lines([[0, 0, np.nan], [1, 0, 0]], kind="cable"), truth)


def test_a_plan_without_heights_is_scored_in_plan():
    flat = straight()
    flat[:, 2] = np.nan
    s = evaluate(lines(straight(0.02)), lines(flat)).overall.at
    assert s.completeness == 1
    assert s.lateral.bias_m == pytest.approx(0.02)
    assert s.height.rmse_m is None


def test_blocks_of_queries_do_not_show(monkeypatch):
    truth = lines(straight(), straight(5), straight(-5))
    found = lines(straight(0.04), straight(4.9, 0, 70), straight(-5.3))
    whole = evaluate(found, truth).to_dict()
    monkeypatch.setattr("linework.evaluation.match._QUERY_BLOCK_M", 1.0)
    assert evaluate(found, truth).to_dict() == whole


def test_kinds_come_in_the_order_of_the_layers():
    found = lines(straight(), straight(), straight(), kind=["cable", "ditch", "guardrail"])
    assert kinds_in(found, lines(straight(), kind="fence")) == ("guardrail", "fence", "cable", "ditch")


@pytest.mark.parametrize("kind", ["edge_other", "pole"])
def test_what_comes_unasked_is_wrong_only_where_the_reference_has_some(kind):
    other = straight(9.0) if kind == "edge_other" else np.array([[0.0, 9.0, 0.0], [0.0, 9.0, 8.0]])
    found = lines(straight(), other, kind=["cable", kind])
    truth = lines(straight(), kind="cable")
    assert [k.kind for k in evaluate(found, truth).kinds] == ["cable"]
    assert evaluate(found, truth, kinds=["cable", kind])[kind].at.correctness == 0
    elsewhere = lines(straight(), other + np.array([0.0, 50.0, 0.0]), kind=["cable", kind])
    assert evaluate(found, elsewhere)[kind].at.correctness == 0


def test_nothing_against_nothing_is_refused():
    with pytest.raises(UsageError, match="contain a line"):
        evaluate(LineSet.empty(), LineSet.empty())
