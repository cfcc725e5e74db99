"""The automatic path as published, step by step."""

import numpy as np
import pytest
from scipy.ndimage import binary_dilation, label
from skimage.morphology import skeletonize

from linework.model.camera import LOOKING_AHEAD, RectifiedRig
from linework.model.images import RectifiedPair
from linework.published.stereo_1992 import (
    analytical_functions,
    bright_pixels,
    centres_of_runs,
    chain_code,
    codes_of,
    grouped,
    images_of_steps,
    lines_in,
    straight_lines_of_pair,
    thinned,
    vanishing_point,
)

RIG = RectifiedRig(
    focal_px=700.0, cx=400.0, cy=100.0, width=800, height=360, base_m=0.6,
    position_m=np.array([0.0, 0.3, 2.0]), R_vehicle_camera=LOOKING_AHEAD,
)  # fmt: skip


def road_image(lines, right=False, seed=0):
    """Draw stripes (offset, width, dash, gap) on a level road, as the left or the right camera sees it."""
    row, col = np.mgrid[: RIG.height, : RIG.width].astype(float)
    ahead = np.where(row > RIG.cy, 2.0 * RIG.focal_px / np.maximum(row - RIG.cy, 0.5), 1e6)
    camera = 0.3 - RIG.base_m * right
    offset = camera - (col - RIG.cx) / RIG.focal_px * ahead
    image = np.random.default_rng(seed).normal(90.0, 4.0, row.shape)
    image[row <= RIG.cy] = 60.0
    for at, width, dash, gap in lines:
        painted = np.abs(offset - at) < width / 2
        if gap:
            painted &= ahead % (dash + gap) < dash
        image[painted & (ahead < 60.0)] = 200.0
    return np.clip(image, 0, 255).astype(np.uint8)


LINES = ((3.5, 0.15, 0, 0), (0.0, 0.12, 3, 3), (-3.5, 0.15, 0, 0))


def test_bright_pixels_are_above_the_mean_of_their_scan_line():
    image = np.full((3, 100), 80, dtype=np.uint8)
    image[1, 40:50] = 200
    image[2, 10] = 255  # a single pixel is what the median takes away
    found = bright_pixels(image)
    assert np.flatnonzero(found[1]).tolist() == list(range(40, 50))
    assert not found[[0, 2]].any()


def test_nothing_outside_the_window_counts():
    image = np.full((2, 100), 80, dtype=np.uint8)
    image[:, 50:80] = 250  # the sky beside a bridge hides what is less bright
    image[:, 5:10] = 150
    window = np.zeros(image.shape, dtype=bool)
    window[:, :40] = True
    assert not bright_pixels(image)[0, 5:10].any()
    assert np.flatnonzero(bright_pixels(image, window)[0]).tolist() == [5, 6, 7, 8, 9]


def test_runs_are_stood_for_by_their_middle():
    bright = np.array([[1, 1, 0, 1, 1, 1, 1], [0, 0, 0, 0, 0, 0, 1]], dtype=bool)
    assert np.nan_to_num(centres_of_runs(bright), nan=-1).tolist() == [
        [0.5, 0.5, -1, 4.5, 4.5, 4.5, 4.5], [-1, -1, -1, -1, -1, -1, 6],
    ]  # fmt: skip


def test_thinning_is_that_of_others():
    white = bright_pixels(road_image(LINES))
    ours = thinned(white)
    assert ours.sum() > 300
    theirs = skeletonize(white, method="zhang")
    # The same lines, but for the ends of spurs; none is lost, none falls apart
    assert np.count_nonzero(theirs & ~binary_dilation(ours, iterations=2)) < 0.02 * theirs.sum()
    assert np.count_nonzero(ours & ~binary_dilation(theirs, iterations=2)) < 0.02 * ours.sum()
    every = np.ones((3, 3))
    assert label(ours, every)[1] == label(white, every)[1]
    assert not (ours[1:, 1:] & ours[:-1, 1:] & ours[1:, :-1] & ours[:-1, :-1]).any()


def test_chains_are_followed_whole_and_short_ones_dropped():
    thin = np.zeros((40, 40), dtype=bool)
    for i in range(30):
        thin[35 - i, 5 + i // 2] = True
    thin[3, 30:38] = True  # 8 pixels
    chains = chain_code(thin)
    assert len(chains) == 1
    assert chains.line(0)[0].tolist() == [35, 5]
    assert chains.line(0)[-1].tolist() == [6, 19]
    straight = np.zeros((40, 40), dtype=bool)
    straight[5:35, 10] = True
    assert chain_code(straight).is_corner.sum() == 2


def test_functions_gate_and_groups():
    image = road_image(LINES)
    bright = bright_pixels(image)
    found = analytical_functions(chain_code(thinned(bright)), centres_of_runs(bright))
    row, col = vanishing_point(found)
    assert row == pytest.approx(RIG.cy, abs=2.0)
    assert col == pytest.approx(RIG.cx, abs=3.0)
    lines = grouped(lines_in(image))
    solid = lines.take(lines.is_solid & (lines.bottom_row - lines.top_row > 100))
    assert sorted((solid.k * 2.0).round(1).tolist()) == pytest.approx([-3.2, 3.8], abs=0.1)
    assert (~lines.is_solid).any()  # the dashed one


def test_lines_are_intersected_where_they_are():
    pair = RectifiedPair(road_image(LINES), road_image(LINES, right=True, seed=1), RIG, number=7)
    seen = straight_lines_of_pair(pair)
    assert set(seen.pair.tolist()) == {7}
    near = seen.take(seen.xyz[:, 0] < 15.0)
    offsets = sorted(float(np.median(near.xyz[near.line == i, 1])) for i in np.unique(near.line))
    assert offsets == pytest.approx([-3.5, 0.0, 3.5], abs=0.06)
    assert np.abs(near.xyz[:, 2]).max() < 0.1


def test_an_empty_road_shows_nothing():
    pair = RectifiedPair(road_image(()), road_image((), right=True), RIG)
    assert len(straight_lines_of_pair(pair)) == 0


def test_chain_codes_lead_from_pixel_to_pixel():
    around = np.array([[0, 0], [0, 1], [-1, 2], [-2, 2], [-3, 1], [-3, 0], [-2, -1], [-1, -1], [0, 0]])
    assert codes_of(around) == "01234567"[:3] + "34567"
    assert codes_of(around[:1]) == ""


def test_the_images_of_the_steps_show_ever_less():
    images = images_of_steps(road_image(LINES))
    assert list(images) == ["grey", "median_minus_mean", "binary", "thinned", "chains"]
    white = {name: np.count_nonzero(image == 255) for name, image in images.items() if name != "grey"}
    assert white["binary"] > 2 * white["thinned"] >= 2 * white["chains"] > 400
    # Grey values are shown about their mean
    assert abs(float(np.median(images["median_minus_mean"])) - 128.0) < 30.0
    assert all(image.dtype == np.uint8 for image in images.values())
