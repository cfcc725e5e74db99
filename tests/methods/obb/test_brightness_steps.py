"""Edges of pavements where points are far apart: steps of brightness that the beam's spot has blurred over half a metre."""

from __future__ import annotations

import numpy as np
import pytest

from linework.kernels.boundaries.brightness_steps import (
    STEP_BIN_M,
    STEP_BINS,
    STEP_BRIGHT,
    STEP_CLEAR,
    STEP_REACH_M,
    STEP_SIGMA,
    STEP_V,
    chance_of_verge,
    place_of_step,
    step_of_brightness,
)
from linework.methods.obb.kerbs_and_edges import BoundaryConfig, find_boundary_boxes
from linework.model.boxes import BoxForm, BoxSet
from linework.model.points import Points
from linework.model.tile import TileData
from linework.surface.road import RoadConfig, find_ground

CORNER = np.array([600_020.0, 5_400_020.0, 100.0])
ROAD, GRASS, NOISE = 26_000.0, 40_000.0, 2_000.0


def seen_from_the_air(level_of, *, per_m2=20.0, spot_m=0.12, seed=1) -> BoxSet:
    """Boxes on level ground of 30 by 16 m, 4 cm of noise, with the brightness at each v of the cross profile."""
    rng = np.random.default_rng(seed)
    n = int(30 * 16 * per_m2)
    uvh = np.column_stack([rng.uniform(0, 30, n), rng.uniform(-8, 8, n), rng.normal(0, 0.04, n)])
    # The spot of the beam
    intensity = level_of(uvh[:, 1] + rng.normal(0, spot_m, n)) + rng.normal(0, NOISE, n)
    points = Points(uvh + CORNER, intensity=intensity.astype(np.float32))
    ground = find_ground(points, None, RoadConfig())
    tile = TileData("t", points.bounds, points, surface=ground, origin=(600_000.0, 5_400_000.0, 0.0))
    return find_boundary_boxes(tile, ground, BoundaryConfig())


def sure_edges(boxes: BoxSet) -> BoxSet:
    return boxes.take((boxes.form == BoxForm.EDGE) & (boxes.score > 0.7))


def across(boxes: BoxSet) -> np.ndarray:
    """Distances of boxes from v = 0."""
    return np.asarray(boxes.centre[:, 1] + 5_400_000.0 - CORNER[1])


def test_the_edge_from_asphalt_to_grass_is_found_where_it_is():
    edges = sure_edges(seen_from_the_air(lambda v: np.where(v > 0.0, ROAD, GRASS)))
    off = across(edges)
    assert np.count_nonzero(np.abs(off) < 0.3) >= 40 and np.mean(np.abs(off) < 0.3) > 0.9
    near = edges.take(np.abs(off) < 0.3)
    assert np.sqrt(np.mean(across(near) ** 2)) < 0.06
    assert 0.4 < np.sqrt(np.mean((across(near) / near.sigma_v_m) ** 2)) < 1.6
    assert np.median(np.abs(near.u[:, 0])) > 0.99
    # The carriageway lies to the left
    assert np.all(near.u[:, 0] > 0.9)


@pytest.mark.parametrize(
    "level_of",
    [
        lambda v: np.where(v > 0.0, ROAD, 1.1 * ROAD),
        lambda v: ROAD + 400.0 * (8.0 - v),
        lambda v: np.where(np.abs(v) < 0.15, GRASS, ROAD),
    ],
    ids=["asphalt of another year", "brightness that falls off", "a stripe of paint"],
)
def test_what_is_no_verge_has_no_sure_edge(level_of):
    off = across(sure_edges(seen_from_the_air(level_of)))
    assert np.count_nonzero(np.abs(off) < 4.0) <= 3


def test_a_verge_of_two_levels_begins_at_the_first():
    # Cut grass, and taller one a metre behind it
    def level_of(v):
        return np.where(v > 0.0, ROAD, np.where(v > -1.0, 38_000.0, 44_000.0))

    off = across(sure_edges(seen_from_the_air(level_of)))
    near = off[np.abs(off) < 0.5]
    assert len(near) >= 25
    assert np.median(np.abs(near)) < 0.12


def test_an_edge_line_at_the_end_of_a_pavement_belongs_to_the_road():
    def level_of(v):
        return np.where(v > 0.0, ROAD, np.where(v > -0.35, 52_000.0, GRASS))

    boxes = seen_from_the_air(level_of, spot_m=0.03)
    off = across(boxes.take((boxes.form == BoxForm.EDGE) & (boxes.score > 0.5)))
    near = off[np.abs(off + 0.2) < 0.5]
    assert len(near) >= 20
    assert np.median(near) == pytest.approx(-0.35, abs=0.12)


def profile(*levels_of_bins, hole=False):
    """Running sums of a profile with five points a bin, which differ by 200; none in a hole."""
    bins = np.zeros((STEP_BINS + 1, 3))
    level = np.array(levels_of_bins)[:, None] + np.array([-200.0, -100.0, 0.0, 100.0, 200.0])
    rows = np.column_stack([np.full(STEP_BINS, 5.0), level.sum(axis=1), (level**2).sum(axis=1)])
    bins[1:] = np.cumsum(np.where(np.broadcast_to(hole, STEP_BINS)[:, None], 0.0, rows), axis=0)
    return bins


def test_the_place_of_a_step_is_that_of_the_profile():
    at = (np.arange(STEP_BINS) + 0.5) * STEP_BIN_M - STEP_REACH_M
    for v in (-0.4, 0.0, 0.3):
        bins, out = profile(*np.where(at > v, 1000.0, 2000.0)), np.zeros(7)
        step_of_brightness(bins, out)
        assert out[STEP_CLEAR] > 100.0
        place_of_step(bins, out)
        assert out[STEP_V] == pytest.approx(v, abs=0.03) and out[STEP_SIGMA] < 0.06
    bins, out = profile(*np.full(STEP_BINS, 1000.0)), np.zeros(7)
    step_of_brightness(bins, out)
    assert out[STEP_CLEAR] < 24.0


def test_a_hole_beyond_the_edge_does_not_move_it():
    at = (np.arange(STEP_BINS) + 0.5) * STEP_BIN_M - STEP_REACH_M
    for near, far in ((-0.5, -1.0), (-0.1, -1.0), (-0.1, -0.6)):
        bins, out = (
            profile(*np.where(at > 0.0, 26_000.0, 40_000.0), hole=(at > far) & (at < near)),
            np.zeros(7),
        )
        step_of_brightness(bins, out)
        assert place_of_step(bins, out)
        assert abs(out[STEP_V]) < 0.45 and out[STEP_SIGMA] > 0.0
        assert out[STEP_BRIGHT] == pytest.approx(40_000.0, rel=0.05)


def test_a_step_within_a_hole_has_no_place():
    at = (np.arange(STEP_BINS) + 0.5) * STEP_BIN_M - STEP_REACH_M
    bins, out = profile(*np.where(at > 0.0, 1000.0, 2000.0), hole=np.abs(at) < 0.7), np.zeros(7)
    step_of_brightness(bins, out)
    assert not place_of_step(bins, out)


def test_dense_points_are_left_to_usual_search_areas():
    found = seen_from_the_air(lambda v: np.where(v > 0.0, ROAD, GRASS), per_m2=150.0)
    assert np.all(found.half_u_m[found.form == BoxForm.EDGE] <= 0.25)
    sparse = sure_edges(seen_from_the_air(lambda v: np.where(v > 0.0, ROAD, GRASS)))
    assert np.median(sparse.half_u_m) > 0.3, "as long as other boxes among so few points"


def test_road_beside_road_differs_by_little():
    assert chance_of_verge(900.0, 1000.0, 20.0) < 0.4
    assert chance_of_verge(1100.0, 1000.0, 20.0) < 0.3
    assert chance_of_verge(1550.0, 1000.0, 100.0) > 0.9
    assert chance_of_verge(1500.0, 1000.0, 400.0) < 0.3
