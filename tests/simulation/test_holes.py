"""Stretches without points: of the length they say, everywhere the same, and the truth knows."""

import numpy as np
import pytest

from linework.simulation.roads.draw import ROADS, draw_scenario
from linework.simulation.sensors.rigs import equipped
from linework.simulation.simulate import simulate_survey


def test_pieces_and_holes_are_10_to_60_m_long():
    lengths = []
    for seed in range(40):
        for kind in ROADS:
            # A ring is 250 m at most
            for length_m in (40.0, 250.0 if kind == "roundabout" else 300.0):
                scenario = equipped(draw_scenario(kind, seed, length_m), holes=True)
                ends = np.array([0.0, *np.ravel(scenario.holes_m), length_m])
                assert np.all(np.diff(ends) >= 10.0)
                assert np.all(np.diff(ends)[:-1] <= 60.0)
                # After the last piece, another hole did not fit
                assert length_m - ends[-2] <= 130.0 or length_m < 60.0
                lengths += np.diff(ends)[:-1].tolist()
    assert min(lengths) < 12.0
    assert max(lengths) > 58.0


@pytest.mark.parametrize("scanner", ["default", "airborne"])
def test_a_hole_has_no_points_and_its_lines_are_not_observed(scanner):
    options = {"points_per_m": 3000.0, "scanner": scanner}
    whole = simulate_survey("urban", 1, 150.0, **options)
    cut = simulate_survey("urban", 1, 150.0, **options, holes=True)
    holes = cut.scenario.holes_m
    assert len(holes) >= 1
    road, origin = cut.scenario.layout.road, np.asarray(cut.scenario.origin_m)

    def chainage(xyz):
        return road.alignment.locate(xyz[:, :2] - origin[:2])[0]

    def inside(s, margin_m):
        return np.any([(s > a + margin_m) & (s < b - margin_m) for a, b in holes], axis=0)

    stray = cut.scenario.sensor.stray_share
    assert np.mean(inside(chainage(cut.points.xyz), 0.1)) < 2.0 * stray
    assert np.mean(inside(chainage(whole.points.xyz), 0.1)) > 0.05
    s = chainage(cut.truth.xyz)
    deep = inside(s, 1.1)  # a wire is observed by one hit within 1 m
    assert not cut.truth.observed[deep].any()
    assert whole.truth.observed[deep].any()
    assert np.array_equal(cut.truth.observed[~inside(s, -1.1)], whole.truth.observed[~inside(s, -1.1)])
    if cut.trajectory is not None:
        assert np.array_equal(cut.trajectory.xyz, whole.trajectory.xyz)
