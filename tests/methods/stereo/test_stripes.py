"""Stripes of paint in images: the road's surface, rows, links, partners."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from tests.scenes.road_images import RIG, STRIPES, road_pair, straight_poses

from linework.kernels.images.fuse import fuse, looked_at
from linework.kernels.images.link_stripes import fit_at, link
from linework.kernels.images.row_stripes import COL, ROW, STRIPE_CONTRAST, WIDTH, stripes_of_rows
from linework.methods.stereo.method import Stereo
from linework.methods.stereo.road_plane import RoadPlane, fit_pair_road
from linework.methods.stereo.stripes import StripeConfig, find_stripe_lines
from linework.model.images import RectifiedPair


@pytest.fixture(scope="module")
def pair() -> RectifiedPair:
    return road_pair(0, straight_poses(1))


def test_the_road_is_where_it_is(pair: RectifiedPair) -> None:
    road = fit_pair_road(pair)
    assert road is not None
    assert road.plane.camera_height_m(RIG) == pytest.approx(1.6, abs=0.02)
    assert math.degrees(math.acos(float(-road.plane.up(RIG)[1]))) < 0.5
    # A place 10 m ahead on the road
    row = np.array([RIG.cy + RIG.focal_px * 1.6 / 10.0])
    assert road.disparity(RIG, np.array([RIG.cx]), row)[0] == pytest.approx(RIG.focal_px * 0.06, rel=0.01)


def test_a_wall_is_no_road() -> None:
    # One distance everywhere: upright
    grain = np.random.default_rng(0).integers(0, 255, (RIG.height, RIG.width + 30)).astype(np.uint8)
    wall = RectifiedPair(grain[:, :-30], grain[:, 30:], RIG)
    assert fit_pair_road(wall) is None
    assert len(Stereo().look(wall)) == 0


def test_no_texture_shows_no_road() -> None:
    grey = np.full((RIG.height, RIG.width), 90, dtype=np.uint8)
    assert fit_pair_road(RectifiedPair(grey, grey, RIG)) is None


def test_the_right_image_has_the_same_road() -> None:
    plane = RoadPlane(0.4, 0.02, 0.37)
    col, row = np.array([300.0]), np.array([150.0])
    d = plane.disparity(RIG, col, row)
    assert plane.in_right().disparity(RIG, col - d, row)[0] == pytest.approx(d[0], rel=1e-12)


@pytest.mark.parametrize("middle", [40.0, 40.3, 40.5, 40.8])
@pytest.mark.parametrize("width", [2.0, 3.4, 8.0])
def test_middles_of_stripes_are_sub_pixel(middle: float, width: float) -> None:
    # Each pixel is the share of it that is paint, blurred a little
    edge = np.arange(121) - 0.5
    inside = np.clip(
        np.minimum(edge[1:], middle + width / 2) - np.maximum(edge[:-1], middle - width / 2), 0, 1
    )
    grey = 60.0 + 100.0 * np.convolve(inside, [0.2, 0.6, 0.2], mode="same")
    image = np.tile(np.round(grey), (3, 1)).astype(np.uint8)
    # 20 pixels per metre
    table, _ = stripes_of_rows(image, np.array([20.0, 0.0, 0.0]), 1.0, (2, -1), (0.07, 0.6), (4.0, 0.06))
    assert table[:, ROW].tolist() == [2.0, 1.0, 0.0]
    assert np.abs(table[:, COL] - middle).max() < 0.1
    assert np.abs(table[:, WIDTH] - width).max() < 0.6
    assert (table[:, STRIPE_CONTRAST] > 50.0).all()


def test_what_is_wider_than_paint_or_a_single_edge_is_no_stripe() -> None:
    image = np.full((1, 200), 60, dtype=np.uint8)
    image[0, 20:60] = 160  # 2 m at 20 pixels per metre
    image[0, 150:] = 160
    table, _ = stripes_of_rows(image, np.array([20.0, 0.0, 0.0]), 1.0, (0, -1), (0.07, 0.6), (4.0, 0.06))
    assert len(table) == 0


def test_a_strip_of_light_between_two_shadows_is_no_stripe() -> None:
    image = np.full((1, 200), 120, dtype=np.uint8)
    image[0, 90:94] = image[0, 104:108] = 30
    table, _ = stripes_of_rows(image, np.array([20.0, 0.0, 0.0]), 1.0, (0, -1), (0.07, 0.6), (4.0, 0.06))
    assert len(table) == 0


def test_links_go_through_where_lines_come_near() -> None:
    # Two lines that converge to 0.3 m, row by row
    ahead = np.arange(5.0, 15.0, 0.2)
    a, b = -1.0 + 0.05 * ahead, 1.5 - 0.12 * ahead + 0.3
    places = np.column_stack([
        np.column_stack([a, b]).ravel(), np.repeat(ahead, 2), np.full(2 * len(ahead), 0.12),
        np.full(2 * len(ahead), 0.01),
    ])  # fmt: skip
    first = np.arange(0, 2 * len(ahead) + 1, 2)
    line = link(places, first, len(ahead), 2.0, (0.6, 2))
    assert set(line[::2].tolist()) == {0} and set(line[1::2].tolist()) == {1}


def test_links_end_at_gaps() -> None:
    ahead = np.concatenate([np.arange(5.0, 8.0, 0.1), np.arange(9.0, 12.0, 0.1)])
    places = np.column_stack(
        [np.zeros(len(ahead)), ahead, np.full(len(ahead), 0.1), np.full(len(ahead), 0.01)]
    )
    rows = np.searchsorted(ahead, np.arange(5.0, 12.05, 0.1) - 0.05)
    line = link(places, rows, len(rows) - 1, 2.0, (0.6, 2))
    assert len(set(line.tolist())) == 2


def test_local_lines_are_exact_on_a_line_and_bend_little_to_what_is_off() -> None:
    x = np.arange(20.0)
    y = 3.0 + 0.5 * x
    value, _ = fit_at(x, y, np.full(20, 0.1), np.array([0.0, 9.5, 19.0]), np.full(3, 5.0))
    np.testing.assert_allclose(value, [3.0, 7.75, 12.5], atol=1e-9)
    y[10] += 5.0
    value, sigma = fit_at(x, y, np.full(20, 0.1), np.array([9.5]), np.full(1, 5.0))
    assert abs(value[0] - 7.75) < 0.3 and sigma[0] > 0.1


def test_local_lines_know_how_well() -> None:
    rng = np.random.default_rng(1)
    x = np.arange(30.0)
    off = []
    for _ in range(300):
        value, sigma = fit_at(
            x, 0.3 * x + rng.normal(0, 0.2, 30), np.full(30, 0.2), np.array([15.0]), np.full(1, 8.0)
        )
        off.append((value[0] - 4.5) / sigma[0])
    # Neighbouring rows are taken to err together, so by itself white noise is over-estimated
    assert 0.5 < np.std(off) < 1.1


def test_stripes_are_matched_along_the_rows(pair: RectifiedPair) -> None:
    road = fit_pair_road(pair)
    assert road is not None
    lines = find_stripe_lines(pair, road, StripeConfig())
    on_line = lines.line >= 0
    n = np.bincount(lines.line[on_line])
    for number in np.flatnonzero(n > 40).tolist():
        at = np.flatnonzero(lines.line == number)
        xyz = RIG.intersect(lines.table[at, COL], lines.table[at, ROW], lines.disparity[at])
        good = np.isfinite(xyz[:, 1])
        assert good.mean() > 0.9
        offset = xyz[good, 1] + 0.4
        true = min((s[0] for s in STRIPES), key=lambda o: abs(o - float(np.median(offset))))
        assert abs(float(np.median(offset)) - true) < 0.02
    assert (n > 40).sum() >= 2


def test_fused_places_weigh_by_variance() -> None:
    table = np.array([[0.0, 0.00, 0.0, 1.0, 0.0, 0.01, 0.01], [0.05, 0.09, 0.3, -1.0, 0.0, 0.02, 0.02]])
    codes = np.zeros(2, dtype=np.int64)
    seeds, place, fused = fuse(table, np.array([0, 1]), codes, (0.0, 0.0, 1.0, 10), 0.3, (0.06, 0.2))
    assert seeds.tolist() == [0] and place.tolist() == [0, 0]
    assert fused[0, 0] == pytest.approx(0.03) and fused[0, 3] == pytest.approx(0.1)
    assert fused[0, 4] == pytest.approx(1.0 / 150.0)


def test_places_are_looked_at_from_where_they_are_in_view() -> None:
    station = np.array([[0.0, 0.0, 1.0, 0.0]])
    places = np.array([[10.0, 0.0], [2.0, 0.0], [30.0, 0.0], [10.0, 9.0], [-10.0, 0.0]])
    lattice = (-60.0, -60.0, 30.0, 6)
    code = np.array([2 * 6 + 2])
    assert looked_at(places, station, code, lattice, (4.0, 20.0, 0.8, 0.8)).tolist() == [1, 0, 0, 0, 0]


def test_paint_brighter_in_one_image_is_matched(pair: RectifiedPair) -> None:
    darker = replace(pair, right=(0.8 * pair.right).astype(np.uint8))
    method = Stereo()
    assert len(method.look(darker)) > 0.8 * len(method.look(pair))
