"""Bounding volumes hold their points tightly; separating axes agree with slow, obvious twins."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog
from scipy.spatial import ConvexHull
from shapely import MultiPoint
from tests.scenes.effort import examples

from linework.published.bounding_volumes import (
    AABB,
    KDOP,
    OBB,
    collide_by_slabs,
    collide_in_plan,
    collide_in_space,
    dop_directions,
)

EPS_M = 1e-3
SIZES = st.one_of(st.just(0.0), st.floats(0.01, 3.0))
ANGLES = st.one_of(st.sampled_from([0.0, np.pi / 2, 1e-9, 1e-5]), st.floats(-np.pi, np.pi))
PLACES = st.one_of(st.just(0.0), st.floats(-3.0, 3.0))


def cloud(seed: int, n: int = 60) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return rng.normal(size=(n, 3)) @ rng.normal(size=(3, 3)) + (500_000.0, 5_400_000.0, 100.0)


@st.composite
def upright_boxes(draw: st.DrawFn) -> OBB:
    angle = draw(ANGLES)
    u = np.array([np.cos(angle), np.sin(angle), 0.0])
    axes = np.stack([u, [-u[1], u[0], 0.0], [0.0, 0.0, 1.0]])
    return OBB(np.array([draw(PLACES), draw(PLACES), 0.0]), axes, np.array([draw(SIZES), draw(SIZES), 0.1]))


@st.composite
def turned_boxes(draw: st.DrawFn) -> OBB:
    axes = np.eye(3)
    for i, j in ((0, 1), (1, 2), (0, 2)):
        turn = np.eye(3)
        angle = draw(ANGLES)
        turn[i, i] = turn[j, j] = np.cos(angle)
        turn[i, j], turn[j, i] = np.sin(angle), -np.sin(angle)
        axes = turn @ axes
    half = np.array([draw(SIZES), draw(SIZES), draw(SIZES)])
    return OBB(np.array([draw(PLACES), draw(PLACES), draw(PLACES)]), axes, half)


UNIT = OBB(np.zeros(3), np.eye(3), np.ones(3))


@given(upright_boxes(), upright_boxes())
@settings(max_examples=examples(150), deadline=None)
@example(UNIT, UNIT)
@example(UNIT, UNIT.moved(2.0))
@example(UNIT, OBB(np.zeros(3), np.eye(3), np.zeros(3)))
@example(OBB(np.zeros(3), np.eye(3), np.zeros(3)), OBB(np.zeros(3), np.eye(3), np.zeros(3)))
def test_four_axes_agree_with_polygons(a: OBB, b: OBB) -> None:
    outline = [MultiPoint(box.corners[:, :2]).convex_hull for box in (a, b)]
    distance = outline[0].distance(outline[1])
    assume(not 0.0 < distance < 1e-7)
    if distance > 0.0:
        assert not collide_in_plan(a, b)
    else:  # touching outlines may be parted by rounding, not by more
        assert collide_in_plan(a.grown(1e-9), b)
    assert collide_in_plan(a, b) == collide_in_plan(b, a)


@given(turned_boxes(), turned_boxes())
@settings(max_examples=examples(100), deadline=None)
@example(UNIT, UNIT)
@example(UNIT, OBB(np.array([0.0, 0.0, 2.5]), np.eye(3), np.zeros(3)))
def test_fifteen_axes_agree_with_a_linear_programme(a: OBB, b: OBB) -> None:
    grow = growth_to_meet(a, b)
    assume(abs(grow - EPS_M) > 1e-6)
    assert collide_in_space(a.grown(EPS_M), b.grown(EPS_M)) == (grow < EPS_M)
    assert collide_in_space(a, b) == collide_in_space(b, a)


def growth_to_meet(a: OBB, b: OBB) -> float:
    """By how much both boxes must grow at least to share a place: min t, |axes (p - centre)| <= half + t."""
    rows, right = [], []
    for box in (a, b):
        for sign in (1.0, -1.0):
            rows.append(np.column_stack([sign * box.axes, -np.ones(3)]))
            right.append(box.half_m + sign * box.axes @ box.centre)
    answer = linprog([0, 0, 0, 1], np.concatenate(rows), np.concatenate(right), bounds=(None, None))
    assert answer.success
    return float(answer.fun)


def test_edges_against_edges_need_the_cross_products() -> None:
    # Two long bars crossing one above the other, both turned onto an edge: no face parts them
    s = np.sqrt(0.5)
    a = OBB(np.zeros(3), np.array([[1.0, 0, 0], [0, s, s], [0, -s, s]]), np.array([3.0, 1.0, 1.0]))
    b = OBB(np.array([0, 0, 2.9]), np.array([[0, 1.0, 0], [-s, 0, s], [s, 0, s]]), np.array([3.0, 1.0, 1.0]))
    assert not collide_in_space(a, b)
    assert collide_in_space(a, OBB(np.array([0, 0, 2.8]), b.axes, b.half_m))


def test_touching_boxes_collide() -> None:
    assert collide_in_plan(UNIT, UNIT.moved(2.0))
    assert collide_in_space(UNIT, UNIT.moved(2.0))
    assert not collide_in_space(UNIT, UNIT.moved(2.0 + 1e-9))


def test_boxes_far_from_the_origin_lose_nothing() -> None:
    far = OBB(np.array([699_999.3, 5_900_000.7, 100.0]), UNIT.axes, UNIT.half_m)
    assert collide_in_plan(far, far.moved(1.999999))
    assert not collide_in_plan(far, far.moved(2.000001))


@pytest.mark.parametrize("k", [6, 14, 18, 26])
def test_polytopes_hold_their_points_and_their_corners_span_them(k: int) -> None:
    xyz = cloud(k) - (500_000.0, 5_400_000.0, 100.0)
    dop = KDOP.of(xyz, dop_directions(k))
    assert dop.contains(xyz).all()
    again = KDOP.of(dop.corners, dop_directions(k))
    np.testing.assert_allclose(again.low, dop.low, atol=1e-5)
    np.testing.assert_allclose(again.high, dop.high, atol=1e-5)


def test_more_directions_hug_the_points_more() -> None:
    xyz = cloud(1) - (500_000.0, 5_400_000.0, 100.0)
    volumes = [ConvexHull(KDOP.of(xyz, dop_directions(k)).corners).volume for k in (6, 14, 26)]
    assert volumes[0] > volumes[1] > volumes[2] > ConvexHull(xyz).volume


@given(st.integers(0, 1000), st.floats(0.0, 8.0))
@settings(max_examples=examples(40), deadline=None)
def test_disjoint_slabs_prove_disjoint_points(seed: int, apart_m: float) -> None:
    a = cloud(seed) - (500_000.0, 5_400_000.0, 100.0)
    b = a + np.array([apart_m, 0.0, 0.0])
    directions = dop_directions(14)
    hulls = [ConvexHull(xyz).equations for xyz in (a, b)]
    rows = np.concatenate(hulls)
    shared = linprog([0, 0, 0], rows[:, :3], -rows[:, 3], bounds=(None, None)).success
    if not collide_by_slabs(KDOP.of(a, directions), KDOP.of(b, directions)):
        assert not shared


def test_polytopes_of_different_directions_are_refused() -> None:
    xyz = cloud(3)
    with pytest.raises(ValueError, match="different directions"):
        collide_by_slabs(KDOP.of(xyz, dop_directions(6)), KDOP.of(xyz, dop_directions(14)))


@pytest.mark.parametrize("n", [1, 2, 3, 60])
def test_boxes_hold_their_points_tightly(n: int) -> None:
    xyz = cloud(n, n)
    for box in (
        OBB.along(xyz, np.array([2.0, 1.0])),
        OBB.along(xyz, np.array([2.0, 1.0, 0.3])),
        AABB.of(xyz),
    ):
        assert box.contains(xyz).all()
        assert box.contains(box.corners).all()
        assert not box.contains(box.centre + 1.1 * (box.corners - box.centre) + 1e-3).any()
    box = OBB.along(xyz, np.array([2.0, 1.0, 0.3]))
    np.testing.assert_allclose(box.axes @ box.axes.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(box.axes) == pytest.approx(1.0)
    assert box.v[2] == 0.0 and box.height_m == pytest.approx(2 * box.half_m[2])


@given(st.integers(0, 1000), st.integers(3, 30))
@settings(max_examples=examples(40), deadline=None)
def test_the_smallest_rectangle_is_the_polygons_own(seed: int, n: int) -> None:
    xyz = cloud(seed, n)
    box = OBB.smallest_in_plan(xyz)
    area = 4.0 * box.half_m[0] * box.half_m[1]
    twin = MultiPoint(xyz[:, :2] - xyz[0, :2]).minimum_rotated_rectangle.area
    assert area == pytest.approx(twin, rel=1e-6, abs=1e-9)
    assert box.half_m[0] >= box.half_m[1]
    assert box.contains(xyz).all()


@pytest.mark.parametrize(
    "xy", [[[1.0, 2.0]], [[0.0, 0.0], [3.0, 1.0]], [[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]], [[1.0, 1.0]] * 3]
)
def test_the_smallest_rectangle_of_points_in_a_row_is_flat(xy: list[list[float]]) -> None:
    xyz = np.column_stack([np.array(xy), np.zeros(len(xy))])
    box = OBB.smallest_in_plan(xyz)
    assert box.half_m[1] == pytest.approx(0.0, abs=1e-12)
    assert 2.0 * box.half_m[0] == pytest.approx(np.hypot(*(xyz[-1] - xyz[0])[:2]))


def test_what_cannot_be_a_box_is_refused() -> None:
    with pytest.raises(ValueError, match="no points"):
        AABB.of(np.zeros((0, 3)))
    with pytest.raises(ValueError, match="no direction in plan"):
        OBB.along(np.zeros((1, 3)), np.array([0.0, 0.0, 1.0]))
    with pytest.raises(ValueError, match="6, 14, 18 or 26"):
        dop_directions(8)
