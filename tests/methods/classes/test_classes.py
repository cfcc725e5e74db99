"""What points lie on: roads that end at boundaries, paint that is worn, and what stands beside the road."""

import numpy as np
import pytest

from linework.library.classify import classify_points
from linework.methods.classes.pieces import RoadPieces
from linework.methods.classes.point_class import PointClass
from linework.methods.classes.tile import tile_classes
from linework.model.grid import Bounds
from linework.model.lines import LineSet
from linework.model.points import Points
from linework.model.trajectory import Trajectory
from linework.simulation.simulate import simulate_survey
from linework.surface.cells import path_samples
from linework.surface.road import find_ground

LENGTH_M = 60.0
PATH = Trajectory(
    np.linspace(0.0, 6.0, 13), np.stack([np.linspace(0.0, LENGTH_M, 13), [2.0] * 13, [5.0] * 13], axis=1)
)


def ground_points(height, *, noise_m=0.004, width_m=(-6.0, 12.0)):
    """Return points every 0.1 m over a road along x, whose path is at y = 2: their height by x and y."""
    east, north = (
        v.ravel() for v in np.meshgrid(np.arange(0.05, LENGTH_M, 0.1), np.arange(*width_m, 0.1) + 0.03)
    )
    rng = np.random.default_rng(1)
    return np.stack([east, north, height(east, north) + noise_m * rng.normal(size=len(east))], axis=1)


def level(east, north):
    return np.full(np.broadcast_shapes(east.shape, north.shape), 5.0)


def along(y, z=5.0, start=0.0, end=LENGTH_M):
    return [[start, y, z], [end, y, z]]


def classes_of(xyz, lines, *, path=PATH, intensity=None):
    return classify_points(Points(xyz, intensity=intensity), lines, path)


def is_all(found, kind, where):
    return bool((found.classes[where] == kind).all())


def test_the_road_ends_at_the_boundary_even_where_the_ground_goes_on():
    xyz = ground_points(level)
    found = classes_of(xyz, LineSet.from_lines([along(6.0), along(-2.0)], kind=["road_boundary"] * 2))
    y = xyz[:, 1]
    assert is_all(found, PointClass.ROAD, (y > -2.0) & (y < 6.0))
    assert is_all(found, PointClass.VERGE, (y < -2.0) | (y > 6.0))
    # Without lines the surface alone says what is road
    assert is_all(classes_of(xyz, LineSet.empty()), PointClass.ROAD, y > -10.0)


def test_a_gap_in_a_boundary_is_closed_but_a_side_street_stays_open():
    xyz = ground_points(level)
    x, y = xyz[:, 0], xyz[:, 1]
    beyond = (x > 22.0) & (x < 38.0) & (y > 6.5)
    straight = LineSet.from_lines([along(6.0, end=20.0), along(6.0, start=40.0)], kind=["road_boundary"] * 2)
    assert is_all(classes_of(xyz, straight), PointClass.VERGE, beyond)
    turning = LineSet.from_lines(
        [[[0, 6, 5], [17, 6, 5], [20, 9, 5], [20, 12, 5]], [[60, 6, 5], [43, 6, 5], [40, 9, 5], [40, 12, 5]]],
        kind=["road_boundary"] * 2,
    )
    found = classes_of(xyz, turning)
    assert is_all(found, PointClass.ROAD, beyond)
    assert is_all(found, PointClass.VERGE, (x < 15.0) & (y > 6.0))


def test_kerb_and_footway_beyond_it_and_grass_beyond_that():
    rng = np.random.default_rng(2)

    def height(east, north):
        grass = 0.02 * np.abs(rng.normal(size=len(north))) * 1.5
        return 5.0 + 0.12 * (north > 6.0) + np.where(north > 8.5, grass, 0.0)

    xyz = ground_points(height)
    lines = LineSet.from_lines([along(6.0)], kind=["road_boundary"], form=["kerb"], id=["k"])
    found = classes_of(xyz, lines)
    y = xyz[:, 1]
    assert is_all(found, PointClass.ROAD, y < 5.9)
    assert is_all(found, PointClass.KERB, (y > 6.01) & (y < 6.15))
    assert set(found.line[(y > 6.01) & (y < 6.15)]) == {1}
    assert np.mean(found.classes[(y > 6.3) & (y < 8.0)] == PointClass.FOOTWAY) > 0.97
    assert np.mean(found.classes[y > 9.5] == PointClass.VERGE) > 0.97


def test_only_what_is_bright_of_a_marking_is_paint():
    xyz = ground_points(level)
    x, y = xyz[:, 0], xyz[:, 1]
    inside = np.abs(y - 4.0) <= 0.15
    worn = inside & (x > 30.0) & (x < 33.0)
    intensity = np.where(inside & ~worn, 90.0, 40.0).astype(np.float32)
    lines = LineSet.from_lines([along(4.0)], kind=["lane_marking"], width_m=[0.3])
    found = classes_of(xyz, lines, intensity=intensity)
    assert is_all(found, PointClass.MARKING, inside & ~worn)
    assert is_all(found, PointClass.ROAD, worn)
    # Nothing is known of the paint without intensities; and a line where no paint shows is none
    assert is_all(classes_of(xyz, lines), PointClass.MARKING, inside)
    plain = classes_of(xyz, lines, intensity=np.full(len(xyz), 40.0, dtype=np.float32))
    assert is_all(plain, PointClass.ROAD, inside)


@pytest.mark.parametrize("zero", [0.0, 30_000.0])
def test_paint_shows_by_the_noise_beside_it_whatever_the_zero_of_the_intensities(zero):
    xyz = ground_points(level)
    x, y = xyz[:, 0], xyz[:, 1]
    inside = np.abs(y - 4.0) <= 0.15
    paint = inside & (x < 30.0)
    noise = np.random.default_rng(3).normal(0.0, 5.0, len(xyz))
    intensity = (np.where(paint, 80.0, 40.0) + noise + zero).astype(np.float32)
    lines = LineSet.from_lines([along(4.0)], kind=["lane_marking"], width_m=[0.3])
    found = classes_of(xyz, lines, intensity=intensity).classes == PointClass.MARKING
    assert found[paint].mean() > 0.99
    assert not found[inside & (x > 30.0)].any()


@pytest.mark.parametrize(("step", "zero"), [(1.0, 40.0), (1.0, 30_000.0), (257.0, 0.0)])
def test_one_step_of_a_constant_8_bit_road_is_no_paint(step, zero):
    xyz = ground_points(level)
    x, y = xyz[:, 0], xyz[:, 1]
    inside = np.abs(y - 4.0) <= 0.15
    # Rounding alone makes one step; four are paint
    counts = 40.0 + np.where(inside, np.where(x < 30.0, 4.0, 1.0), 0.0)
    lines = LineSet.from_lines([along(4.0)], kind=["lane_marking"], width_m=[0.3])
    found = classes_of(xyz, lines, intensity=(step * counts + zero).astype(np.float32))
    assert is_all(found, PointClass.MARKING, inside & (x < 29.0))
    assert is_all(found, PointClass.ROAD, inside & (x > 31.0))


def test_of_a_dashed_marking_the_dashes_are_paint():
    xyz = ground_points(level)
    lines = LineSet.from_lines(
        [along(4.0), along(4.0, start=10.0, end=14.0)],
        kind=["lane_marking", "lane_marking_dash"], pattern=["dashed", "dashed"], width_m=[0.3, 0.3],
    )  # fmt: skip
    found = classes_of(xyz, lines)
    paint = found.classes == PointClass.MARKING
    assert 9.9 < xyz[paint, 0].min() < 10.2 and 13.8 < xyz[paint, 0].max() < 14.1
    assert set(found.line[paint]) == {2}


def test_what_stands_beside_the_road():
    rng = np.random.default_rng(3)
    n = 4000
    wall = np.stack([rng.uniform(5, 20, n), np.full(n, 10.0), rng.uniform(5, 8, n)], axis=1)
    hedge = np.stack([rng.uniform(25, 40, n), rng.uniform(9.4, 10.6, n), rng.uniform(5.2, 7.0, n)], axis=1)
    around = rng.uniform(0, 2 * np.pi, n)
    pole = np.stack([50 + 0.1 * np.cos(around), 10 + 0.1 * np.sin(around), rng.uniform(5, 11, n)], axis=1)
    wire = np.stack([rng.uniform(0, 60, 400), np.full(400, 3.0), np.full(400, 12.0)], axis=1)
    rail = np.stack([rng.uniform(0, 60, n), np.full(n, -3.0), rng.uniform(5.4, 5.75, n)], axis=1)
    parts = [wall, hedge, pole, wire, rail]
    floor = ground_points(level)
    xyz = np.concatenate([floor, *(part + 0.004 * rng.normal(size=part.shape) for part in parts)])
    lines = LineSet.from_lines([along(3.0, 12.0), along(-3.0, 5.75)], kind=["cable", "guardrail"])
    found = classes_of(xyz, lines)
    start = len(floor)
    expected = [PointClass.OTHER, PointClass.VEGETATION, PointClass.POLE, PointClass.WIRE, PointClass.RAIL]
    for part, kind in zip(parts, expected, strict=True):
        of_part = found.classes[start : start + len(part)]
        high = part[:, 2] > 5.5
        assert np.mean(of_part[high] == kind) > 0.95, kind
        start += len(part)
    assert set(found.line[found.classes == PointClass.WIRE]) == {1}


def test_without_a_path_the_road_is_where_it_is_wide_or_painted():
    xyz = ground_points(level)
    y = xyz[:, 1]
    # A strip of 1.5 m beyond the boundary is no lane
    found = classes_of(xyz[y < 7.5], LineSet.from_lines([along(6.0)], kind=["road_boundary"]), path=None)
    y = y[y < 7.5]
    assert is_all(found, PointClass.ROAD, y < 6.0)
    assert is_all(found, PointClass.VERGE, y > 6.0)


@pytest.mark.parametrize("road", ["urban", "bends", "junction"])
def test_road_of_simulated_streets_by_their_exact_lines(road):
    survey = simulate_survey(road, 921, 80.0, points_per_m=3000)
    found = classify_points(survey.points, survey.truth, survey.trajectory)
    truth = np.isin(survey.point_class, (PointClass.ROAD, PointClass.MARKING))
    there = np.isin(found.classes, (PointClass.ROAD, PointClass.MARKING))
    assert np.mean(there[truth]) > 0.97
    assert np.mean(truth[there]) > 0.97


def test_classes_do_not_depend_on_tiles():
    survey = simulate_survey("urban", 922, 80.0, points_per_m=2000)
    points, pieces = survey.points, RoadPieces.of(survey.truth)
    ground = find_ground(points, survey.trajectory)
    path = path_samples(survey.trajectory, 0.5)[:, :2].copy()
    box = points.bounds
    middle = np.floor(0.5 * (box.west + box.east)), np.floor(0.5 * (box.south + box.north))

    def classified(cores):
        out, line = np.zeros(len(points), np.uint8), np.zeros(len(points), np.uint32)
        for core in cores:
            inside = (points.xyz[:, 0] >= core.west) & (points.xyz[:, 0] < core.east)
            inside &= (points.xyz[:, 1] >= core.south) & (points.xyz[:, 1] < core.north)
            tile = tile_classes(core, ground, points, pieces, path, has_path=True)
            tile.classify(points.xyz, points.intensity, np.flatnonzero(inside), out, line)
        return out

    whole = classified([Bounds(box.west - 1, box.south - 1, box.east + 1, box.north + 1)])
    quarters = classified(
        Bounds(w, s, e, n)
        for w, e in ((box.west - 1, middle[0]), (middle[0], box.east + 1))
        for s, n in ((box.south - 1, middle[1]), (middle[1], box.north + 1))
    )
    # Brightness of paint and flatness are measured in each tile: some points at their limits differ
    assert np.mean(whole == quarters) > 0.998
