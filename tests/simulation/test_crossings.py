"""Independent crossings of a line, counted from the true scan lines."""

import numpy as np
import pytest

from linework.simulation.sensors.crossings import count_crossings
from linework.simulation.simulate import simulate_survey


@pytest.mark.parametrize("scanner", ["default", "tilted", "spinning16"])
def test_crossings_equal_a_brute_force_count(scanner):
    survey = simulate_survey("bends", 4, 40.0, points_per_m=2000.0, scanner=scanner)
    stations = survey.truth.xyz[:: len(survey.truth.xyz) // 60]
    found = count_crossings(survey, stations, 0.3)
    xyz = survey.points.xyz
    for i, place in enumerate(stations):
        near = np.linalg.norm(xyz - place, axis=1) <= 0.3
        assert found.n_points[i] == np.count_nonzero(near)
        for count, column in (("n_sweeps", "sweep"), ("n_strips", "strip"), ("n_beams", "beam")):
            assert getattr(found, count)[i] == len(np.unique(getattr(survey, column)[near])), count
    assert found.n_sweeps.max() > 1


def test_a_lane_line_is_crossed_as_often_as_the_mirror_turns():
    """One head with its plane across the road: a scan line every v / turns metres, and each is one crossing."""
    survey = simulate_survey("straight", 7, 60.0, points_per_m=4000.0, scanner="one")
    assert len(survey.scenario.passes) == 1
    head = survey.scenario.scanners[0]
    way = survey.trajectory.xyz[60:-60:10]
    found = count_crossings(survey, way, 0.5)
    speed = np.linalg.norm(np.diff(survey.trajectory.xyz[60:-60], axis=0), axis=1).mean() * 100.0
    # The scan lines within the sphere's diameter, across their direction on the ground
    apart = speed / head.turns_per_s * np.cos(np.radians(head.yaw_deg))
    assert np.mean(found.n_sweeps) == pytest.approx(1.0 / apart, rel=0.1)


def test_no_points_near_a_place_are_no_crossings():
    survey = simulate_survey("straight", 1, 40.0, points_per_m=2000.0, scanner="one")
    found = count_crossings(survey, survey.points.xyz[:2] + 1e4, 1.0)
    assert found.n_sweeps.tolist() == found.n_points.tolist() == [0, 0]
