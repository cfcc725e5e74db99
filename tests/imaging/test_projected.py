"""Lines projected into images as they were taken."""

import numpy as np
import pytest

from linework.imaging.projected import MARGIN_PX, PROJECTED_DEPTH_M, projected
from linework.imaging.rectify import directions, original_pixels, rectifier_of
from linework.model.camera import LOOKING_AHEAD, Camera, StereoRig
from linework.model.images import Poses
from linework.model.lines import LineSet
from linework.navigation.poses import rotations_of

LENS = (-0.3, 0.1, 0.001, -0.001, 0.0)
ORIGIN = np.array([5e5, 5.4e6, 100.0])


def camera(lens=LENS, **more):
    given = {"width": 640, "height": 400, "fx": 400.0, "fy": 405.0, "cx": 318.0, "cy": 199.0}
    position = np.array([1.0, 0.2, 1.8])
    return Camera(**given, distortion=lens, position_m=position, R_vehicle_camera=LOOKING_AHEAD, **more)


def poses(attitude_deg=(2.0, -3.0, 40.0)):
    nan = np.full((1, 3), np.nan)
    return Poses(np.zeros(1), ORIGIN[None], rotations_of(np.array([attitude_deg])), nan, nan)


def line(*xyz_vehicle, at=None, **columns):
    world = (at or poses()).to_world(0, np.array(xyz_vehicle, dtype=np.float64))
    return LineSet.from_lines([world], kind=["lane_marking"], id=["a"], **columns)


def slowly(lines, cam, at):
    """Return where 20,000 places along the first line are seen, one after the other through the lens."""
    ends = lines[0].xyz
    share = np.linspace(0.0, 1.0, 20_000)[:, None]
    place = at.to_vehicle(0, ends[0] * (1.0 - share) + ends[1] * share)
    xyz = (place - cam.position_m) @ cam.R_vehicle_camera
    ahead = (xyz[:, 2] > PROJECTED_DEPTH_M[0]) & (xyz[:, 2] < PROJECTED_DEPTH_M[1])
    x, y = (xyz[ahead, :2] / xyz[ahead, 2:]).T
    k1, k2, p1, p2, k3 = cam.distortion
    r2 = x * x + y * y
    inner = r2 < 1.5
    x, y, r2 = x[inner], y[inner], r2[inner]
    radial = 1.0 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    col = cam.fx * (x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x)) + cam.cx
    row = cam.fy * (y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y) + cam.cy
    seen = (col >= 0) & (col < cam.width) & (row >= 0) & (row < cam.height)
    return np.stack([col[seen], row[seen]], axis=1)


def distance_to(pixels, polyline):
    """Return how far each pixel is from a polyline."""
    a, b = polyline[:-1], polyline[1:]
    step = b - a
    best = np.full(len(pixels), np.inf)
    for p, d in zip(a, step, strict=True):
        t = np.clip((pixels - p) @ d / max(d @ d, 1e-12), 0.0, 1.0)
        best = np.minimum(best, np.linalg.norm(pixels - p - t[:, None] * d, axis=1))
    return best


@pytest.mark.parametrize("ends", [
    [(-20.0, 2.0, 0.0), (200.0, 2.0, 0.0)],   # along the road, from behind the van to far ahead
    [(8.0, -30.0, 0.0), (8.0, 30.0, 0.0)],    # across
    [(5.0, -3.0, 6.0), (60.0, 4.0, 0.0)],     # from the sky to the road
])  # fmt: skip
def test_a_long_segment_is_bent_as_the_lens_bends_it(ends):
    lines, cam, at = line(*ends), camera(), poses()
    seen = projected(lines, cam, at, 0)
    assert len(seen) == 1
    expected = slowly(lines, cam, at)
    assert len(expected) > 100
    assert distance_to(expected, seen.pixels).max() < 0.2


def test_what_is_shown_is_before_the_camera_and_in_the_image_or_its_margin():
    rng = np.random.default_rng(7)
    lines = LineSet.concatenate([line(*rng.uniform(-100, 100, (2, 3))) for _ in range(300)])
    cam = camera()
    seen = projected(lines, cam, poses(), 0)
    assert 20 < len(seen) < 300
    # The image of a rectangle in space is as far beyond the image's corners as the lens bends its edges
    bend = 60.0
    assert (seen.pixels > -MARGIN_PX - bend).all()
    assert (seen.pixels < np.array([cam.width, cam.height]) + MARGIN_PX + bend).all()
    # and nothing is folded back into it: the lens undone leads where the line is
    inside = ((seen.pixels > 0) & (seen.pixels < [cam.width - 1, cam.height - 1])).all(axis=1)
    ideal = directions(cam, seen.pixels[inside])
    piece = np.repeat(np.arange(len(seen)), np.diff(seen.offsets))[inside]
    for k in np.unique(piece):
        ends = poses().to_vehicle(0, lines[seen.line[k]].xyz)
        a, b = (ends - cam.position_m) @ cam.R_vehicle_camera
        normal = np.cross(a, b) / np.linalg.norm(np.cross(a, b))
        ray = np.c_[ideal[piece == k], np.ones(np.count_nonzero(piece == k))]
        assert np.abs(ray @ normal / np.linalg.norm(ray, axis=1)).max() < 1e-6


def test_behind_the_camera_and_too_far_is_nothing():
    for ends in ([(-50, 0, 0), (-1, 0, 0)], [(100, 0, 0), (150, 0, 0)], [(10, 50, 0), (10, 90, 0)]):
        assert len(projected(line(*ends), camera(), poses(), 0)) == 0
    empty = projected(LineSet.empty(), camera(), poses(), 0)
    assert len(empty) == 0
    assert empty.offsets.tolist() == [0]


def test_bridged_stretches_are_pieces_of_their_own():
    vertices = [(5.0 + i, 0.0, 0.0) for i in range(6)]
    lines = line(*vertices, bridged=[False, False, True, True, False, False])
    seen = projected(lines, camera(), poses(), 0)
    assert seen.bridged.tolist() == [False, True, False]
    assert seen.line.tolist() == [0, 0, 0]
    for k in range(2):  # the pieces meet
        last, first = seen.pixels[seen.offsets[k + 1] - 1], seen.pixels[seen.offsets[k + 1]]
        assert np.allclose(last, first)


def test_a_line_that_leaves_the_image_and_returns_is_two_pieces():
    seen = projected(line((10, 0, 0), (10, 60, 0), (12, 60, 0), (12, 0, 0)), camera(), poses(), 0)
    assert len(seen) == 2
    assert seen.line.tolist() == [0, 0]


def test_lines_are_not_joined_to_one_another():
    one, other = line((10, 1, 0), (12, 1, 0)), line((12, 1, 0), (14, 1, 0))
    seen = projected(LineSet.concatenate([one, other]), camera(), poses(), 0)
    assert seen.line.tolist() == [0, 1]


def test_it_agrees_with_the_rectified_pair():
    """The way by which lines are found in images: rectified, and from there back into the original."""
    left = camera()
    right = Camera(
        width=640, height=400, fx=398.0, fy=404.0, cx=322.0, cy=203.0, distortion=(-0.28, 0.08, 0.0, 0.0, 0.0),
        position_m=np.array([1.02, -0.35, 1.79]), R_vehicle_camera=LOOKING_AHEAD,
    )  # fmt: skip
    rig, at = StereoRig(left, right), poses()
    common = rectifier_of(rig).rig
    places = np.array([[6.0, 1.0, 0.1], [15.0, -2.0, 0.0], [40.0, 3.0, 5.0]])
    col, row, disparity = common.project(places)
    for cam, shift in ((left, 0.0), (right, disparity)):
        expected = original_pixels(cam, common, np.stack([col - shift, row], axis=1))
        lines = LineSet.concatenate([line(p, p + np.array([0.01, 0.0, 0.0])) for p in places])
        seen = projected(lines, cam, at, 0)
        assert np.abs(seen.pixels[seen.offsets[:-1]] - expected).max() < 1e-3
