"""Which channels are boundaries: small streets whose ground falls to the edge, to the middle, or before a parking strip."""

import warnings

import numpy as np
import pytest

import linework

LENGTH_M = 26.0
FALL = 0.025


def street(height_m, brightness=lambda v: np.ones(len(v))):
    """Lines of a street with heights and brightness over the distance v to the left, the van 1.75 m right of its middle.

    Middle places across of paint and of boundaries (form, confidence), without pieces.
    """
    rng = np.random.default_rng(5)
    n = int(LENGTH_M * 14 * 300)
    u, v = rng.uniform(0, LENGTH_M, n), rng.uniform(-7, 7, n)
    points = linework.Points(
        np.column_stack([u, v, 100.0 + height_m(v) + rng.normal(0, 0.004, n)]),
        intensity=brightness(v) * 1000 * np.exp(rng.normal(0, 0.15, n)),
        time_s=u / 10.0,
        crs="local",
    )
    t = np.linspace(-1, 4, 101)
    path = linework.Trajectory(t, np.column_stack([10 * t, np.full(101, -1.75), np.full(101, 102.0)]))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        lines = linework.extract(
            points, trajectory=path, kinds=["lane_marking", "road_boundary"], workers=1, on_problem="warn"
        )
    found = {"lane_marking": {}, "road_boundary": {}}
    for i in range(len(lines)):
        xyz = lines[i].xyz
        if np.ptp(xyz[:, 0]) > 0.6 * LENGTH_M:
            found[lines.kind[i]][round(float(np.median(xyz[:, 1])), 1)] = lines.form[i], lines.confidence[i]
    return found["lane_marking"], found["road_boundary"]


def to_edges(v):
    """A carriageway of 7 m with a crown, and ground that rises beyond."""
    return np.where(np.abs(v) < 3.5, -FALL * np.abs(v), FALL * (np.abs(v) - 7.0))


def kerb(v, y):
    return 0.12 * (np.abs(v) > y)


def test_flush_edges_are_boundaries_but_no_sure_ones():
    _, bounds = street(to_edges)
    assert sorted(bounds) == [-3.5, 3.5]
    assert all(form == "edge" and 0.5 < confidence <= 0.8 for form, confidence in bounds.values())


@pytest.mark.parametrize(
    ("middle", "edge"),
    # A lane that drains to its middle; two lanes that drain between them, and the van on the right one
    [(0.0, 3.5), (1.75, 5.3)],
)
def test_a_channel_between_kerbs_is_no_boundary(middle, edge):
    _, bounds = street(lambda v: FALL * np.abs(v - middle) + kerb(v, edge))
    assert sorted(bounds) == [-edge, edge]
    assert {form for form, _ in bounds.values()} == {"kerb"}


def test_a_lane_that_drains_below_the_van_has_no_boundary_there():
    _, bounds = street(lambda v: FALL * np.abs(v + 0.75))
    assert not bounds


def test_a_parking_strip_before_a_kerb_keeps_its_line():
    paint, bounds = street(
        lambda v: to_edges(v) + kerb(v, 5.5), lambda v: np.where(np.abs(np.abs(v) - 3.65) < 0.06, 2.5, 1.0)
    )
    assert sorted(bounds) == [-5.5, 5.5]
    assert sorted(paint) in ([-3.7, 3.7], [-3.6, 3.6], [-3.7, 3.6], [-3.6, 3.7])


def test_a_channel_alone_takes_no_paint_close_behind_it():
    # No kerb: the line may be a parking strip's, and the stone of a gutter
    paint, bounds = street(to_edges, lambda v: np.where(np.abs(v - 3.65) < 0.06, 2.5, 1.0))
    assert len(paint) == 1 and sorted(bounds) == [-3.5, 3.5]


def test_bright_stones_of_a_gutter_are_not_paint():
    def brightness(v):
        stones, line = np.abs(np.abs(v) - 3.5) < 0.16, np.abs(np.abs(v) - 2.9) < 0.06
        return np.where(stones, 1.8, np.where(line, 2.5, 1.0))

    paint, bounds = street(to_edges, brightness)
    assert sorted(bounds) == [-3.5, 3.5]
    assert sorted(paint) == [-2.9, 2.9]


def test_a_line_beside_a_channel_stays():
    paint, bounds = street(to_edges, lambda v: np.where(np.abs(np.abs(v) - 3.35) < 0.06, 2.5, 1.0))
    assert sorted(bounds) == [-3.5, 3.5]
    assert len(paint) == 2
