"""The ground beside a boundary is a road or open land, by how even it is."""

import numpy as np
import pytest

from linework.methods.obb.candidates import OPEN_LAND
from linework.methods.obb.method import Obb
from linework.methods.protocol import context_of_tile, tile_of, whole_tile
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
    scattered = np.abs(rng.normal(0.0136, 0.008, 80))
    scattered *= 0.0136 / np.median(scattered)
    assert 0.018 < chance(scattered) < 0.3


def test_the_side_of_the_path_counts_and_without_one_the_more_even_side():
    boxes = boxes_with(0.02, 0.001)
    t = np.linspace(0.0, 40.0, 81)
    for y, expected in ((3.0, 0.02), (-3.0, 0.001)):
        path = LineAxis.of(t, np.column_stack([t, np.full(81, y), np.zeros(81)]))
        turned = facing(boxes, [path])
        assert np.sqrt(turned.uneven_m2) == pytest.approx(expected)
    assert np.sqrt(facing(boxes, []).uneven_m2) == pytest.approx(0.001)


def strip(rough_m, *, seed=3):
    """60 m of ground with a smooth strip of 7 m between stony land; waves of 2 and 3 m that are `rough_m` high on it."""
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(0.0, 60.0, 150_000), rng.uniform(-10.0, 10.0, 150_000)
    waves = np.sin(np.pi * (x + 0.3 * y)) + np.sin(2.0 * np.pi / 3.0 * (0.5 * x - 0.9 * y))
    z = rough_m * waves + rng.normal(0.0, np.where(np.abs(y) < 3.5, 0.004, 0.03), len(x))
    # Measured along scan lines, one after another
    order = np.argsort(x, kind="stable")
    points = Points(
        np.column_stack([x, y, z])[order], intensity=np.full(len(x), 100.0), time_s=x[order] / 10.0
    )
    s = np.linspace(0.0, 60.0, 61)
    return points, Trajectory(s / 10.0, np.column_stack([s, np.full(61, -1.5), np.full(61, 2.0)]))


def found_on(rough_m):
    points, path = strip(rough_m)
    tile = whole_tile(tile_of(points, path))
    obb = Obb(kinds=("road_boundary", CANDIDATE))
    return obb.join(obb.look(tile), context_of_tile(tile))


def test_a_smooth_strip_of_open_land_has_no_boundaries_and_a_road_has():
    road, land = found_on(0.0), found_on(0.012)
    assert road["road_boundary"].length_m.sum() > 100.0
    assert land["road_boundary"].length_m.sum() == 0.0
    kept = land[CANDIDATE]
    kept = kept.take(kept.reason == OPEN_LAND)
    assert kept.length_m.sum() > 60.0
    assert (kept.confidence < 0.5).all()
