"""The scanner of a survey from a part of its points, and lines that one or two scan lines drew."""

import numpy as np
import pytest

import linework
from linework.files.store.from_points import store_points
from linework.files.store.read import PointStore
from linework.methods.rails.stretches import drawn_often
from linework.model.lines import LineSet
from linework.model.points import Points
from linework.model.tile import AIRBORNE, PROFILE, SPINNING, UNORDERED
from linework.scanlines.crossings import crossings_in_time
from linework.scanlines.fields import laser_column
from linework.scanlines.recover import recover_scan_lines
from linework.scanlines.sampled import pieces_to_sample, sampled_timing, timing_of_points
from linework.simulation.simulate import simulate_survey

KINDS = {"default": PROFILE, "one": PROFILE, "spinning32": SPINNING, "airborne": AIRBORNE}


@pytest.fixture(scope="module", params=KINDS)
def simulated(request):
    density = None if request.param == "airborne" else 1500.0
    survey = simulate_survey("urban", 31, 80.0, points_per_m=density, scanner=request.param)
    return request.param, survey


def test_the_scanner_is_told_from_pieces(simulated):
    scanner, survey = simulated
    timing = timing_of_points(survey.points)
    assert timing.kind == KINDS[scanner]
    if scanner == "spinning32":
        assert 0.04 < float(timing.turn_s[0]) < 0.25


def test_neither_order_nor_tile_changes_what_is_known(simulated, tmp_path):
    _, survey = simulated
    points = survey.points
    shuffled = points.take(np.random.default_rng(3).permutation(len(points)))
    store_points(points, tmp_path)
    store = PointStore.open(tmp_path)
    times = float(points.time_s.min()), float(points.time_s.max())
    first, *others = [
        timing_of_points(points), timing_of_points(shuffled), sampled_timing(*store.block_counts, store.points, times)
    ]  # fmt: skip
    for other in others:
        assert other.kind == first.kind
        np.testing.assert_array_equal(other.is_merged, first.is_merged)
        np.testing.assert_allclose(other.turn_s, first.turn_s, rtol=1e-6)
        np.testing.assert_allclose(other.pulse_s, first.pulse_s, rtol=1e-6)


def test_lines_inside_a_tile_are_those_of_the_whole(simulated):
    scanner, survey = simulated
    points, timing = survey.points, timing_of_points(survey.points)
    x = points.xyz[:, 0]
    mine = np.flatnonzero((x > np.quantile(x, 0.3)) & (x < np.quantile(x, 0.7)))
    # What is 5 m from the edges of the tile
    inner = (x[mine] > x[mine].min() + 5.0) & (x[mine] < x[mine].max() - 5.0)
    whole = recover_scan_lines(points, timing).line[mine][inner]
    part = recover_scan_lines(points.take(mine), timing).line[inner]
    apart = np.flatnonzero(np.diff(whole) != 0), np.flatnonzero(np.diff(part) != 0)
    shared = len(np.intersect1d(*apart))
    assert shared > 0.95 * max(map(len, apart)), scanner


def test_few_points_of_a_dense_block_are_read():
    areas = pieces_to_sample(np.array([[4, 7], [5, 7]]), np.array([50_000_000, 10]))
    assert len(areas) == 1
    assert areas[0].width_m < 10.0


def test_points_without_times_have_no_lines():
    timing = timing_of_points(Points(np.random.default_rng(1).uniform(size=(500, 3)) * (10.0, 10.0, 0.1)))
    assert timing.kind == UNORDERED
    assert 0.2 < timing.spacing_m < 1.0


def test_user_data_is_a_laser_only_if_it_draws_rings():
    survey = simulate_survey("urban", 32, 40.0, points_per_m=800.0, scanner="spinning16")
    points = survey.points
    laser = points.columns[laser_column(points)]
    other = {"intensity": points.intensity, "time_s": points.time_s}
    assert laser_column(Points(points.xyz, **other, user_data=laser)) == "user_data"
    drawn = np.random.default_rng(2).integers(0, 16, len(points))
    assert laser_column(Points(points.xyz, **other, user_data=drawn)) == ""


def test_the_laser_is_read_without_being_asked_for(tmp_path):
    linework.simulate(
        tmp_path / "s",
        road="urban",
        seed=33,
        length_m=40.0,
        points_per_m=800,
        scanner="spinning16",
        images=False,
    )
    assert laser_column(linework.read_points(tmp_path / "s"))


def test_crossings_by_pauses_and_by_lasers():
    xyz = np.stack([np.arange(4.0), np.zeros(4), np.zeros(4)], axis=1)
    assert crossings_in_time(np.zeros(0), xyz[:0]) == 0.0
    assert crossings_in_time(np.array([0.0, 1e-5, 0.01, 0.02]), xyz) == pytest.approx(16.0 / 6.0)
    assert crossings_in_time(np.arange(4) * 1e-5, xyz, np.array([1, 1, 2, 3])) == pytest.approx(16.0 / 6.0)


def test_times_that_do_not_follow_the_points_tell_nothing():
    along = np.random.default_rng(5).uniform(0.0, 20.0, 300)
    xyz = np.stack([along, 0.0 * along, 0.0 * along], axis=1)
    assert np.isnan(crossings_in_time(np.arange(300) * 1e-5, xyz))
    assert crossings_in_time(np.arange(300) * 1e-5, np.sort(xyz, axis=0)) == 1.0
    # The same time for all: in whatever order they come
    shuffled = np.random.default_rng(6).permutation(300)
    assert np.isnan([crossings_in_time(np.zeros(300), points) for points in (xyz, xyz[shuffled])]).all()


def test_a_lidar_that_was_not_seen_to_turn_draws_one_line_a_laser():
    survey = simulate_survey("urban", 34, 60.0, points_per_m=1500.0, scanner="spinning16")
    start = float(np.median(survey.points.time_s))
    turn = survey.points.take((survey.points.time_s >= start) & (survey.points.time_s < start + 0.06))
    timing = timing_of_points(turn)
    assert timing.kind == SPINNING
    assert np.isnan(timing.turn_s).all()
    own = turn.columns[laser_column(turn)]
    one = own == np.bincount(own.astype(int)).argmax()
    assert crossings_in_time(turn.time_s[one], turn.xyz[one], own[one], timing) == 1.0


def test_a_rail_that_one_scan_line_drew_is_left_out():
    x = np.linspace(0.0, 10.0, 200)
    xyz = np.stack([x, np.zeros(200), np.full(200, 0.7)], axis=1)
    lines = LineSet.from_lines([xyz[[0, 100, 199]] * 1.0, xyz[::5]])
    once = Points(xyz, time_s=np.arange(200) * 1e-5)
    often = Points(xyz, time_s=np.arange(200) * 0.01)
    timing = timing_of_points(simulate_survey("urban", 31, 40.0, points_per_m=800.0).points)
    assert len(drawn_often(lines, once, timing)) == 0
    assert len(drawn_often(lines, often, timing)) == 2
    assert len(drawn_often(lines, Points(xyz), timing)) == 2
