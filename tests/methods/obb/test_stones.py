"""Flush edges and low kerbs beside bright stones: where the ground bends or steps at an edge of a stripe, or behind one."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import linework
from linework.methods.obb.kerbs_and_edges import BoundaryConfig, find_boundary_boxes
from linework.methods.obb.marking import MarkingConfig, find_marking_boxes
from linework.methods.obb.method import Obb
from linework.methods.protocol import tile_of, whole_tile
from linework.model.boxes import BoxForm, BoxSet
from linework.model.points import Points
from linework.model.tile import TileData
from linework.surface.road import RoadConfig, find_ground

#: The edge of the carriageway lies at v = 0, the carriageway on the side of positive v.
ORIGIN = (499_200.0, 5_400_000.0, 0.0)
CORNER = np.array([499_230.0, 5_400_030.0, 30.0])
LENGTH_M = 20.0
NOISE_M = 0.006


def flush(v, step_m=0.0, fall=0.02):
    """A carriageway and a footway that fall to their common edge, with a step up to the footway."""
    return np.where(v > 0.0, fall * v, step_m - fall * v)


def stones(first, last, shade=2.0):
    """Brightness of a road with stones between two distances."""
    return lambda v: np.where((v > first) & (v < last), shade, 1.0)


def boxes_beside(height_m, brightness, seed=1, noise_m=None):
    """Boxes of a street, the stripes given to the search for boundaries; 350 points/m2."""
    rng = np.random.default_rng(seed)
    n = int(LENGTH_M * 7.0 * 350)
    u, v = rng.uniform(0.0, LENGTH_M, n), rng.uniform(-2.5, 4.5, n)
    noise = NOISE_M if noise_m is None else noise_m(v)
    xyz = CORNER + np.column_stack([u, v, height_m(v) + noise * rng.normal(size=n)])
    points = Points(xyz, intensity=1000.0 * brightness(v) * np.exp(rng.normal(0.0, 0.1, n)))
    surface = find_ground(points, None, RoadConfig())
    tile = TileData("street", points.bounds, points, surface=surface, origin=ORIGIN)
    stripes = find_marking_boxes(tile, surface, MarkingConfig())
    return stripes, find_boundary_boxes(tile, surface, BoundaryConfig(), stripes=stripes)


def across(boxes: BoxSet):
    """Distance of the centres from the carriageway's edge [m], away from the ends of the street."""
    place = boxes.centre + ORIGIN - CORNER
    return place[(place[:, 0] > 1.5) & (place[:, 0] < LENGTH_M - 1.5), 1]


def of_form(boxes: BoxSet, form: BoxForm) -> BoxSet:
    return boxes.take(boxes.form == form)


@pytest.mark.parametrize(("first", "last"), [(-0.15, 0.0), (0.0, 0.15)], ids=["kerb stone", "gutter"])
def test_a_bend_at_an_edge_of_a_stripe_is_a_channel(first, last):
    stripes, boxes = boxes_beside(flush, stones(first, last))
    assert len(of_form(stripes, BoxForm.STRIPE)) > 30
    off = across(of_form(boxes, BoxForm.CHANNEL))
    assert len(off) >= 30 and np.abs(off).max() < 0.1
    assert np.sqrt(np.mean(off**2)) < 0.04


@pytest.mark.parametrize("side", [1.0, -1.0], ids=["north", "south"])
@pytest.mark.parametrize(("first", "last"), [(-0.15, 0.0), (0.0, 0.15)], ids=["kerb stone", "gutter"])
def test_a_low_step_at_an_edge_of_a_stripe_is_a_kerb(first, last, side):
    step_m = 0.018
    # In noise in which no kerb shows in one cell; the carriageway lies in the north, or in the south
    _, boxes = boxes_beside(
        lambda v: flush(side * v, step_m),
        lambda v: stones(first, last)(side * v),
        noise_m=lambda v: np.full(len(v), 0.010),
    )
    kerb = of_form(boxes, BoxForm.KERB)
    near = kerb.take(np.abs((kerb.centre + ORIGIN - CORNER)[:, 1]) < 0.1)
    off = across(near)
    assert len(off) >= 20 and np.sqrt(np.mean(off**2)) < 0.03
    assert np.median(near.height_m) == pytest.approx(step_m, abs=0.004)
    # The carriageway is on the left
    assert (side * near.u[:, 0] > 0.95).all()


def test_a_steep_street_has_them_too():
    grade = 0.10
    rng = np.random.default_rng(3)
    n = int(LENGTH_M * 7.0 * 350)
    u, v = rng.uniform(0.0, LENGTH_M, n), rng.uniform(-2.5, 4.5, n)
    xyz = CORNER + np.column_stack([u, v, flush(v) + grade * u + NOISE_M * rng.normal(size=n)])
    intensity = 1000.0 * stones(0.0, 0.15)(v) * np.exp(rng.normal(0.0, 0.1, n))
    points = Points(xyz, intensity=intensity)
    surface = find_ground(points, None, RoadConfig())
    tile = TileData("street", points.bounds, points, surface=surface, origin=ORIGIN)
    stripes = find_marking_boxes(tile, surface, MarkingConfig())
    boxes = find_boundary_boxes(tile, surface, BoundaryConfig(), stripes=stripes)
    channels = of_form(boxes, BoxForm.CHANNEL)
    assert np.count_nonzero(np.abs(across(channels)) < 0.06) >= 30
    # On the ground, which is 2 m higher at the end
    place = channels.centre + ORIGIN - CORNER
    near = np.abs(place[:, 1]) < 0.06
    assert np.abs(place[near, 2] - grade * place[near, 0]).max() < 0.02


def test_a_flush_edge_before_a_wall_is_found():
    """A footway of 0.65 m, and a house with thirty times as many points a metre: no stones, no difference of brightness."""
    rng = np.random.default_rng(4)
    n, n_wall = int(LENGTH_M * 5.15 * 350), int(LENGTH_M * 0.65 * 350 * 30)
    u, v = rng.uniform(0.0, LENGTH_M, n), rng.uniform(-0.65, 4.5, n)
    road = np.column_stack([u, v, flush(v) + 0.004 * rng.normal(size=n)])
    house = np.column_stack(
        [rng.uniform(0.0, LENGTH_M, n_wall), rng.normal(-0.65, 0.004, n_wall), rng.uniform(0.0, 3.0, n_wall)]
    )
    xyz = CORNER + np.concatenate([road, house])
    points = Points(xyz, intensity=1000.0 * np.exp(rng.normal(0.0, 0.1, len(xyz))))
    surface = find_ground(points, None, RoadConfig())
    tile = TileData("street", points.bounds, points, surface=surface, origin=ORIGIN)
    boxes = find_boundary_boxes(tile, surface, BoundaryConfig())
    off = across(of_form(boxes, BoxForm.CHANNEL))
    assert np.count_nonzero(np.abs(off) < 0.10) >= 25
    # Neither the wall's points nor its shadow make a change of the ground on the footway
    change = across(of_form(boxes, BoxForm.CHANGE))
    assert np.count_nonzero((change > -0.5) & (change < -0.12)) <= 2


def test_behind_the_front_of_a_wide_gutter_lies_its_back():
    _, boxes = boxes_beside(flush, stones(0.0, 0.40, shade=1.8))
    off = across(of_form(boxes, BoxForm.CHANNEL))
    assert np.count_nonzero(np.abs(off) < 0.06) >= 25


@pytest.mark.parametrize(
    "height_m",
    [
        # A plane, a crown below the stripe, the step of a joint from which both sides fall away, a kerb at some distance
        lambda v: 0.02 * v,
        lambda v: -0.02 * np.abs(v - 1.0),
        lambda v: np.where(v < 1.06, 0.02 * v, 0.02 - 0.02 * (v - 1.06)),
        lambda v: 0.02 * v + 0.10 * (v < 0.75),
    ],
    ids=["plane", "crown", "joint", "kerb"],
)
def test_paint_has_no_boundary_at_its_edges(height_m):
    stripes, boxes = boxes_beside(height_m, stones(0.94, 1.06))
    assert len(of_form(stripes, BoxForm.STRIPE)) > 30
    found = boxes.take((boxes.form == BoxForm.KERB) | (boxes.form == BoxForm.CHANNEL))
    assert np.count_nonzero(np.abs(across(found) - 1.0) < 0.12) <= 2


def test_a_verge_behind_paint_is_no_footway():
    # As steep as a footway, and rougher than the road
    _, boxes = boxes_beside(flush, stones(0.0, 0.12), noise_m=lambda v: np.where(v > 0.0, 0.006, 0.015))
    assert len(across(of_form(boxes, BoxForm.CHANNEL))) <= 2


@pytest.mark.parametrize(("step_m", "first", "last"), [(0.0, 3.5, 3.65), (0.0, 3.35, 3.5), (0.02, 3.1, 3.5)])
def test_lines_of_a_street_with_bright_stones(step_m, first, last):
    # An edge line 0.7 m before them stays paint; the carriageway ends where the ground does, not at a wall behind
    rng = np.random.default_rng(5)
    n = int(30.0 * 11.0 * 350)
    u, v = rng.uniform(0.0, 30.0, n), rng.uniform(-5.5, 5.5, n)
    z = np.where(np.abs(v) < 3.5, -0.025 * np.abs(v), step_m + 0.025 * (np.abs(v) - 7.0)) + 1.2 * (
        np.abs(v) > 4.6
    )
    is_bright = (np.abs(v) > first) & (np.abs(v) < last) | (np.abs(np.abs(v) - 2.7) < 0.06)
    points = linework.Points(
        np.column_stack([u, v, 100.0 + z + rng.normal(0.0, 0.004, n)]),
        intensity=1000.0 * np.where(is_bright, 2.2, 1.0) * np.exp(rng.normal(0.0, 0.1, n)),
        time_s=u / 10.0,
        crs="local",
    )
    t = np.linspace(-1.0, 4.0, 101)
    path = linework.Trajectory(t, np.column_stack([10.0 * t, np.full(101, -1.6), np.full(101, 102.0)]))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        lines = linework.extract(points, trajectory=path, kinds=["lane_marking", "road_boundary"], workers=1)
    long = lines.take(lines.length_m > 20.0)
    middle = {
        kind: sorted(round(float(np.median(line.xyz[:, 1])), 1) for line in long if line.kind == kind)
        for kind in ("lane_marking", "road_boundary")
    }
    assert middle == {"lane_marking": [-2.7, 2.7], "road_boundary": [-3.5, 3.5]}


def test_boundaries_asked_for_alone_are_sought_along_stripes_too():
    rng = np.random.default_rng(6)
    n = int(LENGTH_M * 7.0 * 350)
    u, v = rng.uniform(0.0, LENGTH_M, n), rng.uniform(-2.5, 4.5, n)
    xyz = CORNER + np.column_stack([u, v, flush(v, 0.018) + 0.010 * rng.normal(size=n)])
    intensity = 1000.0 * stones(-0.15, 0.0)(v) * np.exp(rng.normal(0.0, 0.1, n))
    tile = whole_tile(tile_of(Points(xyz, intensity=intensity)))
    alone, both = (
        Obb(kinds=kinds).find_boxes(tile) for kinds in (("road_boundary",), ("lane_marking", "road_boundary"))
    )
    found = [of_form(boxes, BoxForm.KERB) for boxes in (alone, both)]
    assert len(found[0]) == len(found[1]) >= 20
    np.testing.assert_array_equal(found[0].centre, found[1].centre)
    assert len(of_form(alone, BoxForm.STRIPE)) == 0
