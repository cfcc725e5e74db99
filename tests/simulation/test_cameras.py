"""Stereo images of simulated drives: every line is where the exact pose and the calibration say."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from linework.errors import UsageError
from linework.files.images.read import read_pair
from linework.files.images.series import open_stereo
from linework.files.survey.open import open_survey
from linework.files.vectors.read_write import read_lines
from linework.imaging.rectify import distorted, rectifier_of
from linework.kernels.images.grain import grain
from linework.navigation.poses import poses_at
from linework.simulation.folder import write_survey_folder
from linework.simulation.roads.draw import draw_scenario
from linework.simulation.roads.scenario import Car, Marking
from linework.simulation.scene.paint import paint_cover
from linework.simulation.sensors.cameras import (
    camera_pixels,
    images_of,
    observed_in_images,
    stereo_survey,
    stereo_truth,
)
from linework.simulation.sensors.view import SIZES, draw_rig, pixel_offsets, pixel_rays
from linework.simulation.simulate import survey_of


def whole(scenario):
    """Return the scenario with nothing worn."""
    markings = tuple(replace(m, wear=0.0) for m in scenario.layout.markings)
    return replace(scenario, layout=replace(scenario.layout, markings=markings))


def clear(drive):
    """Return the drive without shadows and noise, paint well above the road."""
    light = replace(drive.light, sun=0.0, noise_grey=0.01, contrast=4.0, asphalt_grey=60.0, vignetting=0.0)
    return replace(drive, light=light)


@pytest.mark.parametrize("size", SIZES)
def test_rays_of_pixels_come_back_to_them_through_the_lens(size):
    rig = draw_rig(size, np.random.default_rng(5))
    for camera in (rig.left, rig.right):
        offset = np.array([0.25, -0.125, 0.0])
        rays = pixel_rays(camera, offset) @ camera.R_vehicle_camera
        row, col = np.mgrid[: camera.height, : camera.width]
        back = distorted(camera, rays[..., :2] / rays[..., 2:])
        assert np.abs(back[..., 0] - col - offset[0]).max() < 1e-4
        assert np.abs(back[..., 1] - row - offset[1]).max() < 1e-4
        assert any(camera.distortion)


@pytest.mark.parametrize("n", [1, 2, 4, 9])
def test_rays_of_a_pixel_displace_nothing(n):
    offsets = pixel_offsets(n)
    assert offsets.shape == (n, 3)
    assert np.abs(offsets.mean(axis=0)).max() < 1e-12
    assert np.abs(offsets).max() < 0.75
    # Evenly spaced across a stripe along the road
    assert np.allclose(np.diff(offsets[:, 0]), 1.0 / n)


@pytest.mark.parametrize("size", SIZES)
def test_places_seen_by_both_cameras_are_on_one_row_when_rectified(size):
    drive = stereo_survey(draw_scenario("bends", 3, 60.0), size=size)
    truth = stereo_truth(drive, kinds=("lane_marking",))
    rectifier = rectifier_of(drive.rig)
    col, row, disparity = rectifier.rig.project(drive.poses.to_vehicle(4, truth.xyz))
    inside = (col > 150) & (col < rectifier.rig.width - 5) & (row > 5) & (row < rectifier.rig.height - 5)
    inside &= disparity < 140
    assert inside.sum() > 10
    assert disparity[inside].min() > 3.0
    for camera, source, at in (
        (drive.rig.left, rectifier.left_map, col),
        (drive.rig.right, rectifier.right_map, col - disparity),
    ):
        i, j = row[inside].astype(int), at[inside].astype(int)
        u, v = (row[inside] - i)[:, None], (at[inside] - j)[:, None]
        seen = (1 - u) * ((1 - v) * source[i, j] + v * source[i, j + 1])
        seen = seen + u * ((1 - v) * source[i + 1, j] + v * source[i + 1, j + 1])
        assert np.abs(seen - camera_pixels(camera, drive.poses, 4, truth.xyz[inside])).max() < 0.02


def stripe_errors(image, camera, drive, number, markings):
    """Return how far the middle of stripes in the image is off that of their projected edges, by rows [pixels]."""
    scenario, errors = drive.scenario, []
    road, origin = scenario.layout.road, np.asarray(scenario.origin_m)
    eye = drive.poses.to_world(number, camera.position_m[None])[0]
    for m in markings:
        s = np.arange(0.0, scenario.length_m, 0.05)
        middle = road.on_ground(s, m.q_m) + origin
        ahead = drive.poses.to_vehicle(number, middle)[:, 0] > 2.0
        s = s[ahead & (np.linalg.norm(middle - eye, axis=1) < 25.0)]
        edges = []
        for q in (m.q_m + 0.5 * m.width_m, m.q_m - 0.5 * m.width_m):
            edge = camera_pixels(camera, drive.poses, number, road.on_ground(s, q) + origin)
            edges.append(edge[np.argsort(edge[:, 1])])
        first = max(int(np.ceil(max(e[0, 1] for e in edges))), 0)
        last = min(int(min(e[-1, 1] for e in edges)), camera.height - 1)
        for row in range(first, last + 1):
            a, b = (float(np.interp(row, e[:, 1], e[:, 0])) for e in edges)
            x = np.arange(int(min(a, b)) - 5, int(max(a, b)) + 7)
            if x[0] < 0 or x[-1] >= camera.width:
                continue
            grey = image[row, x].astype(float)
            beside = np.concatenate([grey[:3], grey[-3:]])
            paint = grey - beside.mean()
            if paint.max() > 15.0 and beside.std() < 5.0:
                errors.append(float((x * paint).sum() / paint.sum() - 0.5 * (a + b)))
    return errors


@pytest.mark.parametrize(("kind", "seed", "size"), [("straight", 1, "1240x376"), ("bends", 9, "732x484")])
def test_stripes_are_where_pose_and_calibration_say(kind, seed, size):
    drive = clear(stereo_survey(whole(draw_scenario(kind, seed, 60.0)), size=size, rays_per_pixel=2))
    pair = next(images_of(drive, [6]))
    solid = [m for m in drive.scenario.layout.markings if m.pattern == "solid"]
    for image, camera in ((pair.left, drive.rig.left), (pair.right, drive.rig.right)):
        errors = np.array(stripe_errors(image, camera, drive, 6, solid))
        assert len(errors) > 100
        assert abs(errors.mean()) < 0.05
        assert np.sqrt(np.mean(errors**2)) < 0.15


def test_a_pair_is_the_same_alone_or_among_others():
    drive = stereo_survey(draw_scenario("urban", 2, 40.0), size="732x484", rays_per_pixel=1)
    among = {p.number: p for p in images_of(drive, [1, 3])}
    alone = next(images_of(drive, [3]))
    assert alone.time_s == among[3].time_s == drive.time_s[3]
    assert np.array_equal(alone.left, among[3].left)
    assert np.array_equal(alone.right, among[3].right)
    assert not np.array_equal(among[1].left, among[3].left)
    assert alone.left.std() > 20.0


def test_poses_are_those_of_the_trajectory_but_for_its_error():
    survey = survey_of(draw_scenario("bends", 3, 40.0, points_per_m=200.0))
    drive = stereo_survey(survey.scenario)
    reported = poses_at(survey.trajectory, drive.time_s)
    assert np.abs(reported.xyz - drive.poses.xyz).max() < 0.004
    assert np.abs(reported.R_world_vehicle - drive.poses.R_world_vehicle).max() < 1e-5


def test_truth_is_seen_the_less_the_more_is_asked():
    drive = stereo_survey(draw_scenario("straight", 3, 60.0))
    truth = stereo_truth(drive)
    near = observed_in_images(truth, drive, max_range_m=14.0)
    often = observed_in_images(truth, drive, least_pairs=5)
    assert truth.observed.sum() > near.sum() > 50
    assert truth.observed.sum() > often.sum() > 0
    assert not np.any(near & ~truth.observed)
    assert not np.any(often & ~truth.observed)
    # What the first pair leaves behind, nobody has seen
    behind = drive.poses.to_vehicle(0, truth.xyz)[:, 0] < 2.0
    assert behind.any()
    assert not truth.observed[behind].any()


def test_what_stands_in_front_hides_lines():
    scenario = draw_scenario("straight", 3, 60.0)
    edge = min(scenario.layout.markings, key=lambda m: m.q_m)
    lorry = Car(s_m=30.0, q_m=edge.q_m + 0.6, length_m=10.0, width_m=2.5, height_m=3.5, is_lorry=True)
    seen = []
    for cars in ((), (lorry,)):
        layout = replace(scenario.layout, cars=cars, plants=(), hedges=())
        seen.append(stereo_truth(stereo_survey(replace(scenario, layout=layout)), kinds=("lane_marking",)))
    free, hidden = seen
    lost = free.observed & ~hidden.observed
    assert 5 < lost.sum() < 150
    road = scenario.layout.road
    beside = road.on_ground(30.0, edge.q_m) + np.asarray(scenario.origin_m)
    assert np.linalg.norm(free.xyz[lost] - beside, axis=1).max() < 25.0
    assert not np.any(hidden.observed & ~free.observed)


def test_grain_leaves_out_what_a_pixel_is_too_wide_for():
    rng = np.random.default_rng(1)
    x, y = rng.uniform(0.0, 50.0, (2, 4000))
    finest, growth = np.full(4000, 0.01), np.full(4000, 0.6)

    def strength(wide_x, wide_y):
        wide = np.full(4000, wide_x), np.full(4000, wide_y)
        return grain(x, y, *wide, finest, growth, 8, 3).std()

    sharp = strength(0.005, 0.005)
    assert sharp > strength(0.02, 0.02) > strength(0.08, 0.08) > 0.0
    # A pixel that is long in one direction shows less, but not as little as one that is wide in both
    assert sharp > strength(0.08, 0.005) > strength(0.08, 0.08)
    assert strength(5.0, 5.0) == 0.0


@pytest.mark.parametrize("wide", [0.005, 0.05, 0.4])
def test_paint_keeps_its_amount_however_wide_a_pixel_is(wide):
    marking = Marking(q_m=1.0, start_m=0.0, end_m=50.0, width_m=0.12, role="edge")
    q = np.arange(0.0, 2.0, 0.001)
    place = np.stack([np.full(len(q), 20.0), q], axis=1)
    cover = paint_cover(place, [marking], 1, edge_m=np.full((len(q), 2), wide))
    assert cover.sum() * 0.001 == pytest.approx(0.12, rel=0.01)
    assert np.average(q, weights=cover) == pytest.approx(1.0, abs=0.001)


def test_the_folder_holds_what_the_cameras_took(tmp_path):
    survey = survey_of(draw_scenario("straight", 2, 40.0, points_per_m=200.0))
    drive = stereo_survey(survey.scenario, size="732x484", every_m=20.0, rays_per_pixel=1)
    told = []
    write_survey_folder(
        survey, tmp_path / "s", cameras=drive, advance=lambda done, total: told.append((done, total))
    )
    assert told == [(i + 1, len(drive)) for i in range(len(drive))]
    series = open_stereo(open_survey([tmp_path / "s"]))
    assert series is not None
    assert not series.warnings
    assert [p.time_s for p in series.pairs] == pytest.approx(drive.time_s.tolist(), abs=1e-6)
    for read, drawn in ((series.rig.left, drive.rig.left), (series.rig.right, drive.rig.right)):
        assert read.matrix == pytest.approx(drawn.matrix)
        assert read.distortion == drawn.distortion
        assert read.position_m == pytest.approx(drawn.position_m)
        assert read.R_vehicle_camera == pytest.approx(drawn.R_vehicle_camera, abs=1e-12)
    for pair, drawn_pair in zip(series.pairs, images_of(drive), strict=True):
        left, right = read_pair(pair, series.rig)
        assert np.array_equal(left, drawn_pair.left)
        assert np.array_equal(right, drawn_pair.right)
    scanned, seen = (read_lines(tmp_path / "s" / f"{name}.gpkg") for name in ("truth", "truth_images"))
    assert np.array_equal(scanned.xyz, seen.xyz)
    assert scanned.observed.any()
    # Two pairs are less than the three that it takes
    assert not seen.observed.any()


def test_cameras_that_there_are_not_are_refused():
    scenario = draw_scenario("straight", 2, 40.0)
    with pytest.raises(UsageError, match="Choose one of 732x484, 1240x376"):
        stereo_survey(scenario, size="640x480")
    with pytest.raises(UsageError, match="a pair every 0 m"):
        stereo_survey(scenario, every_m=0.0)
