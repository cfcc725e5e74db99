"""The points along a line, by chainage and offset."""

from __future__ import annotations

import numpy as np
import pytest
from shapely import LineString, Point
from tests.workbench.views.test_pictures import unpacked

from linework.errors import UsageError
from linework.workbench.views.straightened import BEYOND_M, StraightAxis


def test_places_of_a_bend_are_by_chainage_and_offset_and_lead_back():
    turn = np.radians(np.arange(0.0, 91.0, 2.0))
    bend = np.column_stack([5e5 + 40.0 * np.sin(turn), 5e6 + 40.0 * (1.0 - np.cos(turn)), 100.0 + 0.0 * turn])
    axis = StraightAxis.of(bend)
    places = np.random.default_rng(3).uniform(-6.0, 46.0, (2000, 2)) + np.array([5e5, 5e6])

    chainage, offset = axis.on_axis(places, 5.0)

    near = np.isfinite(chainage)
    line = LineString(axis.xy)
    brute = np.array(
        [(line.project(Point(*place)) - BEYOND_M, line.distance(Point(*place))) for place in places]
    )
    assert near.sum() > 300
    np.testing.assert_array_equal(near, brute[:, 1] <= 5.0)
    np.testing.assert_allclose(np.column_stack([chainage, np.abs(offset)])[near], brute[near], atol=1e-6)
    # Left of a bend to the left is its centre
    inner = np.hypot(*(places - [5e5, 5e6 + 40.0]).T) < 39.9
    in_bend = near & (chainage > 0.5) & (chainage < float(axis.along_m[-1]) - BEYOND_M - 0.5)
    assert np.all(offset[in_bend & inner] < 0.0)


def test_an_axis_goes_on_straight_beyond_its_ends():
    axis = StraightAxis.of(np.array([[0.0, 0.0, 7.0], [0.0, 0.0, 8.0], [10.0, 0.0, 7.0]]))
    chainage, offset = axis.on_axis(np.array([[-12.0, 1.0], [25.0, -2.0], [-21.5, 0.0]]), 3.0)
    np.testing.assert_allclose(chainage, [-12.0, 25.0, -BEYOND_M])
    np.testing.assert_allclose(offset, [-1.0, 2.0, 0.0], atol=2.0)
    assert offset[0] == pytest.approx(-1.0)
    with pytest.raises(UsageError, match="without length"):
        StraightAxis.of(np.zeros((3, 3)))


def test_a_kerb_that_is_unrolled_is_a_step_along_zero(served):
    lines = served.get("/api/lines")["lines"]
    top = max((line for line in lines if line["kind"] == "kerb_top"), key=lambda line: line["length_m"])
    query = f"/api/straightened?line={top['id']}&from_m=5&to_m=35&half_width_m=1"

    n, origin, xyz, _, _ = unpacked(served.client.get(query).content)

    assert n > 1000
    np.testing.assert_allclose(origin[:2], [5.0, 0.0])
    assert xyz[:, 0].min() >= 0.0
    assert xyz[:, 0].max() <= 30.0
    assert np.ptp(xyz[:, 0]) > 29.0
    assert np.abs(xyz[:, 1]).max() <= 1.0
    # Metre by metre the side of the road is lower by the kerb
    steps = []
    for start in range(30):
        here = xyz[(xyz[:, 0] >= start) & (xyz[:, 0] < start + 1)]
        left, right = here[here[:, 1] < -0.15, 2], here[here[:, 1] > 0.15, 2]
        if min(len(left), len(right)) >= 5:
            steps.append(abs(np.median(left) - np.median(right)))
    assert len(steps) >= 20
    assert np.median(steps) == pytest.approx(top["height_m"], abs=0.05)


def test_the_road_is_unrolled_along_the_path_and_what_cannot_be_is_refused(served):
    n, _, xyz, above, _ = unpacked(
        served.client.get("/api/straightened?from_m=10&to_m=30&half_width_m=3").content
    )
    assert n > 5000
    on_road = np.abs(xyz[:, 1]) < 1.0
    assert np.median(np.abs(above[on_road])) <= 3
    assert served.client.get("/api/straightened?line=none&from_m=0&to_m=9&half_width_m=3").status_code == 404
    for stretch in ("from_m=9&to_m=9", "from_m=0&to_m=900"):
        assert served.client.get(f"/api/straightened?{stretch}&half_width_m=3").status_code == 400
