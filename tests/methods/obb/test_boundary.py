"""Boundary boxes on streets made by hand: where the kerb's foot is, and how high it is, is known exactly."""

from __future__ import annotations

import numpy as np
import pytest

from linework.kernels.boundaries.kerbs.steps import CLEAREST_COLUMNS, MOST_TRIED, best_step
from linework.methods.obb.kerbs_and_edges import BoundaryConfig, find_boundary_boxes
from linework.methods.tracking.boundary_lines import form_by_ground, smooth_boundaries
from linework.methods.tracking.track import TrackConfig, track_lines
from linework.model.boxes import BoxForm, BoxSet
from linework.model.points import Points
from linework.model.tile import TileData
from linework.surface.road import RoadConfig, find_ground

ORIGIN = (600_000.0, 5_400_000.0, 0.0)
CORNER = np.array([600_020.0, 5_400_020.0, 100.0])


def street(rng, step_m=0.12, lean_m=0.02, noise_m=0.006, heading_deg=30.0, per_m2=250):
    """A carriageway 5 m wide up to v = 0, a kerb, a footway 2 m wide; (n, 3) points along u, v, h."""
    u, v = rng.uniform(0, 20, (2, int(20 * 7 * per_m2)))
    v = v / 20 * 7 - 2
    h = step_m * np.clip(-v / lean_m, 0, 1)
    face = np.column_stack([rng.uniform(0, 20, 1200), -lean_m * (t := rng.uniform(0, 1, 1200)), step_m * t])
    uvh = np.concatenate([np.column_stack([u, v, h]), face]) + rng.normal(0, noise_m, (len(u) + 1200, 3))
    return turned(uvh, heading_deg)


def turned(uvh, heading_deg):
    """Points of a street in the world: on a 3 % grade, u towards `heading_deg`."""
    a = np.radians(heading_deg)
    east = uvh[:, 0] * np.cos(a) - uvh[:, 1] * np.sin(a)
    north = uvh[:, 0] * np.sin(a) + uvh[:, 1] * np.cos(a)
    return np.column_stack([east, north, uvh[:, 2] + 0.03 * uvh[:, 0]]) + CORNER


def boxes_of(xyz, intensity=None) -> BoxSet:
    points = Points(xyz, intensity=intensity)
    surface = find_ground(points, None, RoadConfig())
    return find_boundary_boxes(
        TileData("t", points.bounds, points, surface=surface, origin=ORIGIN), surface, BoundaryConfig()
    )


def across(boxes, heading_deg):
    """Distance of the centres from the kerb's foot, and of the u-axes from its direction [rad]."""
    a = np.radians(heading_deg)
    d = boxes.centre + np.array(ORIGIN) - CORNER
    return d[:, 1] * np.cos(a) - d[:, 0] * np.sin(a), boxes.u @ np.array([-np.sin(a), np.cos(a)])


@pytest.mark.parametrize("step_m", [0.03, 0.12, 0.25])
@pytest.mark.parametrize("heading_deg", [0.0, 30.0, 200.0])
def test_kerb_foot_is_found_where_it_is(step_m, heading_deg):
    boxes = boxes_of(street(np.random.default_rng(1), step_m, heading_deg=heading_deg))
    kerb = boxes.take(boxes.form == BoxForm.KERB)
    v, turn = across(kerb, heading_deg)
    inside = np.abs(v) < 0.1
    assert np.count_nonzero(inside) >= (30 if step_m < 0.05 else 38)  # one in every cell of 20 m
    # Of a step of 3 cm no face is seen in 6 mm of noise
    assert np.sqrt(np.mean(v[inside] ** 2)) < (0.02 if step_m < 0.05 else 0.010)
    assert np.percentile(np.abs(np.arcsin(turn[inside])), 95) < np.radians(4)
    assert (kerb.u[inside] @ [np.cos(np.radians(heading_deg)), np.sin(np.radians(heading_deg))] > 0.9).all()
    assert np.median(kerb.height_m[inside]) == pytest.approx(step_m, abs=0.006)
    if step_m > 0.05:
        assert np.median(kerb.top_v_m[inside]) == pytest.approx(-0.02, abs=0.01)


@pytest.mark.parametrize("width_m", [0.20, 0.35])
def test_the_foot_of_a_sloping_face_is_where_it_begins(width_m):
    # Faces that lean by 2 to 3.5: between two lines with a break they are steep tops, or a kerb in their middle
    boxes = boxes_of(street(np.random.default_rng(7), 0.10, lean_m=width_m))
    kerb = boxes.take(boxes.form == BoxForm.KERB)
    v, turn = across(kerb, 30.0)
    inside = np.abs(v) < 0.1
    assert np.count_nonzero(inside) >= 34 and np.count_nonzero(~inside) <= 2
    assert np.sqrt(np.mean(v[inside] ** 2)) < 0.02
    assert np.percentile(np.abs(np.arcsin(turn[inside])), 95) < np.radians(5)
    assert np.median(kerb.height_m[inside]) == pytest.approx(0.10, abs=0.01)
    assert np.median(kerb.top_v_m[inside]) == pytest.approx(-width_m, abs=0.03)


def test_a_bank_that_goes_on_rising_is_no_kerb():
    rng = np.random.default_rng(8)
    u, v = rng.uniform(0, 20, 35_000), rng.uniform(-1.0, 6.0, 35_000)
    h = 0.3 * np.clip(-v, 0.0, None) + rng.normal(0, 0.006, len(v))
    boxes = boxes_of(turned(np.column_stack([u, v, h]), 30.0))
    assert not (boxes.form == BoxForm.KERB).any()


def test_few_points_show_a_kerb_over_a_longer_stretch():
    rng = np.random.default_rng(5)
    # 12 points a square metre, of which hardly any on the face: 20 in a metre of road and footway
    xyz = street(rng, 0.05, noise_m=0.010, per_m2=12)
    boxes = boxes_of(np.delete(xyz, np.s_[-1160:], axis=0))
    kerb = boxes.take(boxes.form == BoxForm.KERB)
    v, turn = across(kerb, 30.0)
    inside = np.abs(v) < 0.15
    assert np.count_nonzero(inside) >= 30
    assert np.abs(np.median(v[inside])) < 0.03
    assert np.percentile(np.abs(np.arcsin(turn[inside])), 90) < np.radians(6)
    assert np.median(kerb.height_m[inside]) == pytest.approx(0.05, abs=0.01)


def test_a_long_window_tries_no_direction_twice():
    work = np.zeros((400, 5))
    work[:, :2] = np.random.default_rng(7).uniform(-1.0, 1.0, (400, 2))
    sums, out, tried = np.zeros((73, 9)), np.zeros(CLEAREST_COLUMNS), np.zeros((MOST_TRIED, 2))
    numbers = []
    for turn in np.deg2rad([0.0, 2.0, 180.0]):
        frame = (float(np.cos(turn)), float(np.sin(turn)))
        # Half of the window is four times the usual: 13 directions 6 degrees apart
        assert not best_step(work, 400, frame, 1.0, 2.0, sums, tried, out)
        numbers.append(np.count_nonzero(tried.any(axis=1)))
    assert numbers == [13, 13, 26]


def test_every_box_lies_in_its_own_cell_and_in_order():
    boxes = boxes_of(street(np.random.default_rng(2)))
    cells = np.floor(boxes.centre[:, :2] / 0.5).astype(np.int64)
    keys = list(map(tuple, cells[:, ::-1].tolist()))
    assert len(keys) == len(set(keys)) and keys == sorted(keys)


def test_a_plain_road_has_no_boundary():
    rng = np.random.default_rng(3)
    uv = rng.uniform(0, 12, (30_000, 2))
    xyz = turned(np.column_stack([uv, rng.normal(0, 0.01, len(uv))]), 10.0)
    v = boxes_of(xyz)
    assert len(v) == 0


def test_no_points_no_boxes():
    some = Points(turned(np.zeros((1, 3)), 0.0))
    surface = find_ground(some, None, RoadConfig())
    none = some.take(slice(0, 0))
    assert (
        len(find_boundary_boxes(TileData("t", some.bounds, none, surface=surface), surface, BoundaryConfig()))
        == 0
    )


def test_the_edge_of_the_pavement_at_a_rough_and_bright_verge():
    rng = np.random.default_rng(6)
    u, v = rng.uniform(0, 20, 42_000), rng.uniform(-3, 5, 42_000)
    grass = v < 0
    h = rng.normal(0, 0.006, len(u)) + np.where(grass, 0.03 * np.abs(rng.normal(size=len(u))), 0.0)
    strength = np.where(grass, 60.0, 30.0) * rng.uniform(0.8, 1.2, len(u))
    boxes = boxes_of(turned(np.column_stack([u, v, h]), 70.0), strength.astype(np.float32))
    edge = boxes.take(boxes.form == BoxForm.EDGE)
    off, _ = across(edge, 70.0)
    inside = np.abs(off) < 0.15
    assert np.count_nonzero(inside) >= 38 and np.count_nonzero(~inside) <= 4
    assert np.sqrt(np.mean(off[inside] ** 2)) < 0.03
    assert (edge.u[inside] @ [np.cos(np.radians(70.0)), np.sin(np.radians(70.0))] > 0.9).all()


def flush(rng, *, outside=45.0, stripe=None, step_m=0.0, per_m2=250.0, form=BoxForm.CHANGE):
    """A carriageway and a footway of another brightness beside it; a stripe of paint between two v [m]."""
    n = int(20 * 8 * per_m2)
    u, v = rng.uniform(0, 20, n), rng.uniform(-3, 5, n)
    level = np.where(v < 0, outside, 30.0)
    if stripe:
        level = np.where((v > stripe[0]) & (v < stripe[1]), 90.0, level)
    xyz = turned(np.column_stack([u, v, np.where(v < 0, step_m, 0.0) + rng.normal(0, 0.004, n)]), 20.0)
    boxes = boxes_of(xyz, (level * rng.normal(1.0, 0.1, n)).astype(np.float32))
    change = boxes.take(boxes.form == form)
    off, _ = across(change, 20.0)
    # Away from the ends of the data
    along = (change.centre + np.array(ORIGIN) - CORNER)[:, :2] @ [
        np.cos(np.radians(20.0)),
        np.sin(np.radians(20.0)),
    ]
    middle = (along > 1.0) & (along < 19.0) & (off > -2.0) & (off < 4.0)
    return change.take(middle), off[middle]


@pytest.mark.parametrize(("per_m2", "form"), [(250.0, BoxForm.CHANGE), (30.0, BoxForm.EDGE)])
def test_a_change_of_brightness_alone_is_found_where_it_is(per_m2, form):
    change, off = flush(np.random.default_rng(11), per_m2=per_m2, form=form)
    inside = np.abs(off) < 0.15
    assert np.count_nonzero(inside) >= 25 and np.count_nonzero(~inside) <= 2
    assert np.sqrt(np.mean(off[inside] ** 2)) < 0.05
    if form == BoxForm.CHANGE:
        assert np.median(change.contrast[inside]) == pytest.approx(1.5, abs=0.1)
    # The carriageway is the darker side
    assert (change.u[inside] @ [np.cos(np.radians(20.0)), np.sin(np.radians(20.0))] > 0.9).all()


def test_a_step_lower_than_a_kerb_is_a_change_of_height():
    change, off = flush(np.random.default_rng(12), outside=30.0, step_m=0.012)
    inside = np.abs(off) < 0.10
    assert np.count_nonzero(inside) >= 12 and np.count_nonzero(~inside) <= 2
    assert np.median(change.height_m[inside]) == pytest.approx(0.012, abs=0.002)
    assert np.isnan(change.contrast[inside]).all()


def test_neither_paint_nor_even_asphalt_is_a_change_of_the_ground():
    painted, _ = flush(np.random.default_rng(13), outside=30.0, stripe=(0.5, 0.65))
    plain, _ = flush(np.random.default_rng(14), outside=30.0)
    assert len(painted) <= 1 and len(plain) <= 1


def wall(rng, low_m, high_m, depth_m=0.01):
    """An upright face over v = 0, from `low_m` to `high_m`; (n, 3) along u, v, h."""
    n = 8_000
    return np.column_stack([rng.uniform(0, 20, n), rng.normal(0, depth_m, n), rng.uniform(low_m, high_m, n)])


def road_before(rng):
    u, v = rng.uniform(0, 20, 25_000), rng.uniform(0, 5, 25_000)
    return np.column_stack([u, v, rng.normal(0, 0.006, len(u))])


def test_the_foot_of_a_barrier_on_the_edge():
    rng = np.random.default_rng(8)
    boxes = boxes_of(turned(np.concatenate([road_before(rng), wall(rng, 0.0, 0.8)]), 110.0))
    barrier = boxes.take(boxes.form == BoxForm.BARRIER)
    off, _ = across(barrier, 110.0)
    assert len(barrier) >= 35 and np.sqrt(np.mean(off**2)) < 0.01
    assert (barrier.u @ [np.cos(np.radians(110.0)), np.sin(np.radians(110.0))] > 0.99).all()


@pytest.mark.parametrize(("low_m", "depth_m"), [(0.22, 0.01), (0.0, 0.15)])
def test_neither_a_cars_side_nor_a_hedge_is_a_barrier(low_m, depth_m):
    rng = np.random.default_rng(9)
    boxes = boxes_of(turned(np.concatenate([road_before(rng), wall(rng, low_m, 0.8, depth_m)]), 110.0))
    assert np.count_nonzero(boxes.form == BoxForm.BARRIER) == 0
    assert np.count_nonzero(boxes.form == BoxForm.KERB) == 0


def test_a_level_reference_refuses_a_road_on_a_grade():
    rng = np.random.default_rng(11)
    xyz = street(rng, heading_deg=0.0)
    xyz[:, 2] += 0.11 * (xyz[:, 0] - CORNER[0])  # 14 % in all
    points = Points(xyz)
    surface = find_ground(points, None, RoadConfig())
    tile = TileData("t", points.bounds, points, surface=surface, origin=ORIGIN)
    level = find_boundary_boxes(tile, surface, BoundaryConfig(level_reference=True))
    assert np.count_nonzero(level.form == BoxForm.KERB) == 0
    assert np.count_nonzero(find_boundary_boxes(tile, surface, BoundaryConfig()).form == BoxForm.KERB) >= 38


@pytest.mark.parametrize(("behind_m", "form"), [(0.006, "kerb"), (0.015, "edge")])
def test_a_step_with_rough_ground_behind_it_is_no_kerb(behind_m, form):
    rng = np.random.default_rng(4)
    xyz = street(rng, step_m=0.10, heading_deg=0.0)
    is_behind = xyz[:, 1] - CORNER[1] < -0.02
    more_m = np.sqrt(behind_m**2 - 0.006**2)
    xyz[is_behind, 2] += rng.normal(0.0, 1.0, np.count_nonzero(is_behind)) * more_m
    boxes = boxes_of(xyz)
    kerb = boxes.take((boxes.form == BoxForm.KERB) & (np.abs(across(boxes, 0.0)[0]) < 0.1))
    lines = smooth_boundaries(
        kerb, track_lines(kerb, TrackConfig(), width_m=0.15), lambda xy: np.ones(len(xy), dtype=bool)
    )
    assert [form_by_ground(line).form for line in lines] == [form]
    assert [line.form for line in lines] == ["kerb"]


def channels(rng, height_m):
    """Distances across of the channels on a paved street whose heights are a function of v; 300 points/m2, 4 mm noise."""
    n = 20 * 8 * 300
    u, v = rng.uniform(0, 20, n), rng.uniform(-3, 5, n)
    boxes = boxes_of(turned(np.column_stack([u, v, height_m(v) + rng.normal(0, 0.004, n)]), 20.0))
    found = boxes.take(boxes.form == BoxForm.CHANNEL)
    off, turn = across(found, 20.0)
    middle = (off > -2.0) & (off < 4.0)
    return off[middle], turn[middle]


def test_carriageway_and_footway_that_fall_to_their_common_edge_meet_in_a_channel():
    off, turn = channels(np.random.default_rng(31), lambda v: np.where(v < 0, -0.02, 0.025) * v)
    assert len(off) >= 25 and np.abs(off).max() < 0.15
    assert np.sqrt(np.mean(off**2)) < 0.03 and np.abs(turn).max() < 0.1


@pytest.mark.parametrize(
    "height_m",
    [
        lambda v: 0.02 * v,
        # A crown; a bow as deep as a channel; a kerb of 2 cm between the same slopes
        lambda v: -0.025 * np.abs(v),
        lambda v: 0.02 * v**2,
        lambda v: np.where(v < 0, -0.02 * v + 0.02, 0.025 * v),
    ],
)
def test_slopes_crowns_bows_and_low_kerbs_are_no_channels(height_m):
    off, _ = channels(np.random.default_rng(32), height_m)
    assert len(off) <= 2


@pytest.mark.parametrize(("fall", "bumps_m"), [(0.4, 0.03), (0.6, 0.02), (0.6, 0.03)])
def test_a_pavement_above_a_steep_verge_has_its_edge(fall, bumps_m):
    # The mean slope there is that of neither side: a facet across the edge has more of it than the road's
    rng = np.random.default_rng(11)
    u, v = rng.uniform(0, 20, 60_000), rng.uniform(-3, 5, 60_000)
    bumps = np.clip(-v / 0.1, 0, 1) * bumps_m * np.abs(np.sin(31 * u + 17 * v) * np.sin(29 * v - 13 * u))
    h = np.where(v < 0, fall * v + bumps, 0.025 * v) + rng.normal(0, 0.002, len(u))
    boxes = boxes_of(turned(np.column_stack([u, v, h]), 30.0))
    edges = boxes.take((boxes.form == BoxForm.EDGE) | (boxes.form == BoxForm.KERB))
    off, _ = across(edges, 30.0)
    assert np.count_nonzero(np.abs(off) < 0.10) >= 30  # about two in every metre
