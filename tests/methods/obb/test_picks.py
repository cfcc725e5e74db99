"""Picked places on a made-up street: what works, why the others do not, and which place is proposed instead."""

from __future__ import annotations

import numpy as np
import pytest

from linework.methods.obb.picks import PickSurroundings, nearest_trackable_place, refusal_reason
from linework.methods.obb.search_area import NoLineReason, SearchArea, lowest_plane
from linework.model.boxes import BoxForm, BoxSet

#: A street along x: kerb of 12 cm on both sides at y = -4 and y = 4, a line at y = 0, footways of 3 m, walls.
KERB_Y, WALL_Y = 4.0, 7.0


def street(spacing_m: float = 0.05) -> np.ndarray:
    x, y = np.meshgrid(np.arange(-15, 15, spacing_m), np.arange(-WALL_Y, WALL_Y, spacing_m))
    x, y = x.ravel(), y.ravel()
    z = 0.02 * x + 0.03 * y + 0.12 * (np.abs(y) > KERB_Y)
    return np.column_stack([x, y, z + np.random.default_rng(1).normal(0, 0.004, len(x))])


def row_of_boxes(y: float, form: BoxForm, way: float = 1.0, x: np.ndarray | None = None) -> BoxSet:
    x = np.arange(-14.75, 15, 0.5) if x is None else x
    n = len(x)
    return BoxSet(
        centre=np.column_stack([x, np.full(n, y), np.zeros(n)]),
        u=np.tile([way, 0.0], (n, 1)),
        half_u_m=np.full(n, 0.4),
        half_v_m=np.full(n, 0.1),
        sigma_v_m=np.full(n, 0.01),
        sigma_z_m=np.full(n, 0.01),
        sigma_u_rad=np.full(n, 0.02),
        form=np.full(n, form, dtype=np.int8),
    )


BOXES = BoxSet.concatenate([
    row_of_boxes(0.0, BoxForm.STRIPE),
    row_of_boxes(-KERB_Y, BoxForm.KERB),
    row_of_boxes(KERB_Y, BoxForm.KERB, way=-1.0),
    row_of_boxes(WALL_Y, BoxForm.BARRIER, way=-1.0),
])  # fmt: skip
WAY = np.column_stack([np.linspace(-30, 30, 61), np.full(61, -2.0)])
FOUND = PickSurroundings.of(BOXES, WAY)
XYZ = street()


@pytest.mark.parametrize(
    ("place", "wanted", "expected"),
    [
        ((0.2, 0.1), "", None),
        ((0.2, 0.1), "lane_marking", None),
        ((3.0, -3.8), "road_boundary", None),
        ((3.0, 4.3), "", None),
        ((0.2, 0.1), "road_boundary", NoLineReason.ALL_ROAD),
        ((3.0, -4.0), "lane_marking", NoLineReason.NO_MARKING),
        ((0.0, 2.0), "", NoLineReason.ALL_ROAD),
        ((0.0, 2.0), "lane_marking", NoLineReason.NO_MARKING),
        ((0.0, 5.5), "", NoLineReason.NO_ROAD),
        ((0.0, -6.0), "lane_marking", NoLineReason.NO_ROAD),
        ((40.0, 0.0), "", NoLineReason.OFF_THE_EDGE),
        ((15.5, 1.5), "", NoLineReason.OFF_THE_EDGE),
    ],
)
def test_reasons(place: tuple[float, float], wanted: str, expected: NoLineReason | None) -> None:
    for way in (WAY, None):  # without the van's way the nearest boundary tells the carriageway
        found = FOUND if way is not None else PickSurroundings.of(BOXES)
        assert refusal_reason(XYZ, np.array(place), found, wanted=wanted) is expected


def test_a_wall_at_the_back_of_a_footway_bounds_no_road() -> None:
    assert refusal_reason(XYZ, np.array([0.0, WALL_Y]), FOUND) is NoLineReason.NO_ROAD
    assert FOUND.bounds_road(np.array([0.0, KERB_Y])) and not FOUND.bounds_road(np.array([0.0, WALL_Y]))
    alone = BoxSet.concatenate([row_of_boxes(WALL_Y, BoxForm.BARRIER, way=-1.0)])
    assert refusal_reason(XYZ, np.array([0.0, WALL_Y]), PickSurroundings.of(alone, WAY)) is None


@pytest.mark.parametrize(("edge_y", "bounds"), [(3.2, True), (1.0, False)])
def test_a_gutter_hides_no_kerb_but_the_pavements_edge_hides_a_bank(edge_y: float, bounds: bool) -> None:
    rows = [row_of_boxes(edge_y, BoxForm.EDGE, way=-1.0), row_of_boxes(KERB_Y, BoxForm.KERB, way=-1.0)]
    assert PickSurroundings.of(BoxSet.concatenate(rows), WAY).bounds_road(np.array([0.0, KERB_Y])) is bounds


def test_the_surface_and_the_floor_tell_what_is_no_road() -> None:
    place = np.array([0.0, 2.0])
    assert refusal_reason(XYZ, place, FOUND, is_road=False) is NoLineReason.NO_ROAD
    bank = XYZ * (1.0, 1.0, 20.0)
    assert refusal_reason(bank, place, FOUND) is NoLineReason.NO_ROAD


def test_shadows_are_holes_and_few_points_are_few() -> None:
    place = np.array([0.0, 2.0])
    shadow = XYZ[np.hypot(XYZ[:, 0], XYZ[:, 1] - 2.0) > 0.8]
    assert refusal_reason(shadow, place, FOUND) is NoLineReason.HOLES
    rng = np.random.default_rng(2)
    assert refusal_reason(XYZ[rng.random(len(XYZ)) < 0.004], place, FOUND) is NoLineReason.TOO_FEW_POINTS


def test_the_nearest_place_that_works_is_proposed() -> None:
    place = nearest_trackable_place(np.array([1.1, 2.4]), FOUND)
    assert place is not None and place[1] == KERB_Y and abs(place[0] - 1.1) < 0.5
    place = nearest_trackable_place(np.array([1.1, 2.4]), FOUND, "lane_marking")
    assert place is not None and place[1] == 0.0
    assert nearest_trackable_place(np.array([25.0, 0.0]), FOUND) is None
    assert nearest_trackable_place(np.zeros(2), PickSurroundings.of(BoxSet.empty())) is None


def test_single_boxes_are_no_line() -> None:
    one = row_of_boxes(0.0, BoxForm.STRIPE, x=np.array([0.25]))
    assert refusal_reason(XYZ, np.zeros(2), PickSurroundings.of(one, WAY)) is NoLineReason.ALL_ROAD


def test_another_carriageway_is_road_though_a_boundary_lies_between() -> None:
    far = BoxSet.concatenate([row_of_boxes(-4.0, BoxForm.BARRIER), row_of_boxes(-11.0, BoxForm.STRIPE)])
    found = PickSurroundings.of(far, WAY)
    assert found.on_carriageway(np.array([0.0, -9.0]))
    assert not found.on_carriageway(np.array([0.0, -6.0]))


def test_the_floor_is_the_road_and_not_the_kerb() -> None:
    area = SearchArea.of(XYZ, np.array([2.0, 3.8]))
    np.testing.assert_allclose(area.floor, [0.02 * 2.0 + 0.03 * 3.8, 0.02, 0.03], atol=0.006)
    assert area.is_level() and area.lost_data() is None
    assert np.median(area.above_m()[area.xyz[:, 1] > KERB_Y + 0.03]) == pytest.approx(0.12, abs=0.006)


def test_strays_below_and_a_car_above_do_not_tilt_the_floor() -> None:
    near = XYZ[np.hypot(*XYZ[:, :2].T) < 0.5]
    side = np.column_stack([np.full(300, 0.3), np.linspace(-0.4, 0.4, 300), np.linspace(0.02, 1.4, 300)])
    strays = np.array([[0.4, 0.0, -0.4], [0.4, 0.1, -9.0]])
    plane = lowest_plane(np.concatenate([near, side, strays]), np.zeros(2))
    np.testing.assert_allclose(plane, [0.0, 0.02, 0.03], atol=0.015)


def test_the_floor_does_not_depend_on_where_the_origin_is() -> None:
    near = XYZ[np.hypot(*XYZ[:, :2].T) < 0.5]
    moved = lowest_plane(near + np.array([1000.0, 1000.0, 500.0]), np.array([1000.0, 1000.0]))
    np.testing.assert_allclose(moved - (500.0, 0.0, 0.0), lowest_plane(near, np.zeros(2)), atol=1e-9)
    assert np.isnan(lowest_plane(near[:2], np.zeros(2))).all()
