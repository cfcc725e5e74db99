"""New lines from old: beside another line, and a wire through three places."""

import numpy as np
import pytest

from linework.editing.edits.new_lines import line_beside, places_beside, wire_through, with_heights
from linework.errors import UsageError
from linework.model.lines import LineSet


def straight(length=40.0):
    t = np.linspace(0.0, length, 5)
    return LineSet.from_lines([np.column_stack([t, 0.0 * t, 0.05 * t])], kind=["lane_marking"], id=["a"])


def bend(radius=50.0):
    t = np.radians(np.linspace(-90.0, 0.0, 200))
    xyz = np.column_stack([radius * np.cos(t), radius * np.sin(t), 0.0 * t])
    return LineSet.from_lines([xyz], kind=["road_boundary"], id=["a"])


def test_through_one_place_it_is_as_long_as_the_line():
    new = line_beside(straight(), "road_boundary", np.array([[10.0, 3.0]]))
    assert new.kind.tolist() == ["road_boundary"]
    assert new.id.tolist() == [""]
    assert np.allclose(new.xyz[:, 1], 3.0)
    assert new.xyz[[0, -1], 0].tolist() == pytest.approx([0.0, 40.0])
    assert np.diff(new.xyz[:, 0]).max() <= 2.0
    assert new.xyz[-1, 2] == pytest.approx(2.0)


@pytest.mark.parametrize("order", [[0, 1], [1, 0]])
def test_from_one_place_to_another_the_distance_goes_over_evenly(order):
    new = line_beside(straight(), "lane_marking", np.array([[10.0, -3.0], [30.0, -4.0]])[order])
    assert new.xyz[[0, -1], :2].ravel().tolist() == pytest.approx([10.0, -3.0, 30.0, -4.0])
    assert new.xyz[5, 1] == pytest.approx(-3.5)


def test_beside_a_bend_it_bends_about_the_same_centre():
    new = line_beside(bend(), "lane_marking", np.array([[0.0, -46.0]]))
    assert np.abs(np.hypot(*new.xyz[:, :2].T) - 46.0).max() < 0.01


def test_no_line_beside_one_of_another_road_or_of_no_length():
    with pytest.raises(UsageError, match="90 m from"):
        line_beside(straight(), "lane_marking", np.array([[10.0, 90.0]]))
    with pytest.raises(UsageError, match="would be 1"):
        line_beside(straight(), "lane_marking", np.array([[10.0, 1.0], [11.0, 1.0]]))
    with pytest.raises(UsageError, match="does not exist"):
        line_beside(straight(), "wall", np.array([[10.0, 1.0]]))


def test_it_is_as_high_as_measured_and_ends_where_nothing_was():
    new = line_beside(straight(), "lane_marking", np.array([[10.0, 3.0]]))
    heights = np.full((len(new.xyz), 2), np.nan)
    heights[[3, 4, 8]] = [[1.0, 0.01], [1.1, 0.02], [1.5, 0.03]]
    placed = with_heights(new, heights)
    assert placed.xyz[:, 0].tolist() == pytest.approx([6.0, 8.0, 10.0, 12.0, 14.0, 16.0])
    assert placed.xyz[:, 2].tolist() == pytest.approx([1.0, 1.1, 1.2, 1.3, 1.4, 1.5])
    assert placed.bridged.tolist() == [False, False, True, True, True, False]
    assert placed.sigma_z_m[[0, 1, 5]].tolist() == [0.01, 0.02, 0.03]
    # Without points nobody knows better than the line
    assert with_heights(new, np.zeros((0, 2))).xyz[-1, 2] == pytest.approx(2.0)


def test_the_height_of_a_line_tells_only_which_wire_is_meant():
    at = np.array([[10.0, 0.3], [30.0, 0.3]])
    for kind, beside in (("guardrail", straight()), ("cable", straight()), ("lane_marking", straight())):
        places = places_beside(beside, kind, at)
        assert np.isnan(places[:, 2]).all()
        assert places[:, :2].tolist() == line_beside(beside, kind, at).xyz[:, :2].tolist()
    wire = straight().with_columns(kind=np.array(["cable"]))
    assert places_beside(wire, "cable", at)[-1, 2] == pytest.approx(1.5)


def hanging(span=40.0, lowest=16.0, a=250.0):
    s = np.array([0.0, 13.0, span])
    z = 6.0 + a * (np.cosh((s - lowest) / a) - 1.0)
    return np.column_stack([0.6 * s, 0.8 * s, z]), lambda t: 6.0 + a * (np.cosh((t - lowest) / a) - 1.0)


@pytest.mark.parametrize("order", [[0, 1, 2], [2, 0, 1], [1, 2, 0]])
def test_a_wire_is_the_catenary_through_its_places_in_any_order(order):
    places, height = hanging()
    line = wire_through(places[order], "EPSG:25832")
    s = np.hypot(*line.xyz[:, :2].T)
    assert line.kind.tolist() == ["cable"]
    assert np.sort(s)[[0, -1]].tolist() == pytest.approx([0.0, 40.0])
    assert np.abs(line.xyz[:, 2] - height(s)).max() < 0.002


def test_places_of_no_span_are_refused():
    places, _ = hanging()
    aside = places + np.array([[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    with pytest.raises(UsageError, match="not on one span"):
        wire_through(aside, "EPSG:25832")
    with pytest.raises(UsageError, match="a span of 4000 m"):
        wire_through(places * 100.0, "EPSG:25832")
    with pytest.raises(UsageError, match="a span of 0 m"):
        wire_through(np.ones((3, 3)), "EPSG:25832")


def test_a_place_above_the_chord_makes_a_straight_wire():
    places, _ = hanging()
    places[1, 2] = places[[0, 2], 2].max() + 0.1
    line = wire_through(places, "EPSG:25832")
    assert np.ptp(np.diff(line.xyz[:, 2])) < 1e-9
