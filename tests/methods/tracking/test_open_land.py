"""The ground beside a boundary is a road or open land, by how even it is."""

from dataclasses import replace

import numpy as np
import pytest

from linework.methods.obb.candidates import OPEN_LAND
from linework.methods.obb.method import Obb
from linework.methods.protocol import SurveyContext, context_of_tile, tile_of, whole_tile
from linework.methods.tracking.boundary_lines import POOR_ROAD_M, chance_of_road, facing
from linework.methods.tracking.neighbours import LineAxis
from linework.model.boxes import BoxForm, BoxSet
from linework.model.lines import CANDIDATE
from linework.model.points import Points
from linework.model.trajectory import Trajectory


def boxes_with(uneven_m, right_m=np.nan, *, y=0.0):
    """Boxes of a change of the ground along 40 m of the x-axis, with the unevenness to their left and right."""
    x = np.arange(0.0, 40.0, 0.5)
    square = np.broadcast_to(np.sign(uneven_m) * np.square(uneven_m), len(x))
    return BoxSet(
        centre=np.column_stack([x, np.full(len(x), y), np.zeros(len(x))]),
        u=np.tile([1.0, 0.0], (len(x), 1)),
        form=np.full(len(x), BoxForm.CHANGE),
        uneven_m2=square,
        uneven_right_m2=np.full(len(x), right_m**2),
        height_m=np.zeros(len(x)),
        contrast=np.ones(len(x)),
    )


def chance(uneven_m):
    return chance_of_road(boxes_with(uneven_m), np.arange(80))


def test_classes_of_roads_and_of_land():
    # Classes B and C, D, E and F of ISO 8608: each has twice the height of the one before
    heights = POOR_ROAD_M * np.array([0.25, 0.5, 1.0, 2.0, 4.0])
    found = [chance(h) for h in heights]
    assert found == pytest.approx([0.9997, 0.982, 0.5, 0.018, 0.0003], abs=5e-4)


def test_what_is_not_known_speaks_for_neither():
    assert chance(np.nan) == 1.0
    assert chance(-0.01) == 1.0
    # Windows that differ much say less than windows that agree
    rng = np.random.default_rng(1)
    scattered = np.abs(rng.normal(2.0, 1.2, 80))
    assert 0.02 < chance(2.0 * POOR_ROAD_M * scattered / np.median(scattered)) < 0.3


def test_the_side_of_the_path_counts_and_without_one_the_more_even_side():
    boxes = boxes_with(0.02, 0.001)
    t = np.linspace(0.0, 40.0, 81)
    for y, expected in ((3.0, 0.02), (-3.0, 0.001)):
        path = LineAxis.of(t, np.column_stack([t, np.full(81, y), np.zeros(81)]))
        turned = facing(boxes, [path])
        assert np.sqrt(turned.uneven_m2) == pytest.approx(expected)
        assert np.sqrt(turned.uneven_right_m2) == pytest.approx(0.021 - expected)
    assert np.sqrt(facing(boxes, []).uneven_m2) == pytest.approx(0.001)


def lines_of(x, y, z, intensity, path_m):
    """Boundaries and candidates of points, measured along scan lines one after another, with a path along the x-axis."""
    order = np.argsort(x, kind="stable")
    points = Points(np.column_stack([x, y, z])[order], intensity=intensity[order], time_s=x[order] / 10.0)
    s = np.linspace(0.0, 60.0, 61)
    path = Trajectory(s / 10.0, np.column_stack([s, np.full(61, path_m), np.full(61, 2.0)]))
    tile = whole_tile(tile_of(points, path))
    obb = Obb(kinds=("road_boundary", CANDIDATE))
    return obb.join(obb.look(tile), context_of_tile(tile))


def strip(rough_m, *, seed=3):
    """Lines of 60 m with a smooth strip of 7 m between stony land, and waves of 2 and 3 m that are `rough_m` high."""
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(0.0, 60.0, 150_000), rng.uniform(-10.0, 10.0, 150_000)
    waves = np.sin(np.pi * (x + 0.3 * y)) + np.sin(2.0 * np.pi / 3.0 * (0.5 * x - 0.9 * y))
    z = rough_m * waves + rng.normal(0.0, np.where(np.abs(y) < 3.5, 0.004, 0.03), len(x))
    return lines_of(x, y, z, np.full(len(x), 100.0), -1.5)


def test_a_smooth_strip_of_open_land_has_no_boundaries_and_a_road_has():
    road, land = strip(0.0), strip(0.012)
    assert road["road_boundary"].length_m.sum() > 100.0
    assert land["road_boundary"].length_m.sum() == 0.0
    kept = land[CANDIDATE]
    kept = kept.take(kept.reason == OPEN_LAND)
    assert kept.length_m.sum() > 60.0
    assert (kept.confidence < 0.5).all()


@pytest.mark.parametrize("width_m", [2.6, 3.0])
def test_a_narrow_road_above_ditches_keeps_its_edges(width_m):
    rng = np.random.default_rng(3)
    n = 150_000
    x, y = rng.uniform(0.0, 60.0, n), rng.uniform(-8.0, 8.0, n)
    out = np.maximum(np.abs(y) - width_m / 2, 0.0)
    is_verge = out > 0.0
    tufts = np.where(is_verge, 0.02 * np.sin(5 * x + 2 * y) * np.sin(6 * y - 3 * x), 0.0)
    z = -0.025 * np.minimum(np.abs(y), width_m / 2) - 0.3 * np.minimum(out, 2.5) + tufts
    z += rng.normal(0.0, np.where(is_verge, 0.02, 0.004))
    found = lines_of(x, y, z, np.where(is_verge, 160.0, 60.0) * rng.lognormal(0.0, 0.1, n), 0.0)
    edges = found["road_boundary"]
    assert edges.length_m.sum() > 115.0
    assert (edges.confidence > 0.9).all()


def test_an_edge_of_open_land_does_not_outweigh_that_of_a_road():
    edge = replace(boxes_with(0.001), half_u_m=np.full(80, 0.25), half_v_m=np.full(80, 0.25))
    edge = replace(
        edge, sigma_v_m=np.full(80, 0.02), sigma_z_m=np.full(80, 0.01), sigma_u_rad=np.full(80, 0.05)
    )
    land = replace(
        edge,
        centre=edge.centre - np.array([0.0, 1.5, 0.0]),
        form=np.full(80, BoxForm.EDGE),
        uneven_m2=np.full(80, 0.05**2),
        score=np.full(80, 0.999),
    )
    edge = replace(edge, score=np.full(80, 0.9))
    t = np.linspace(0.0, 40.0, 81)
    survey = SurveyContext(path=np.column_stack([t, np.full(81, 2.5), np.zeros(81)]))
    for boxes in (edge, BoxSet.concatenate([edge, land])):
        found = Obb(kinds=("road_boundary",)).join(boxes, survey)
        assert len(found) == 1
        assert np.abs(found.xyz[:, 1]).max() < 0.1
