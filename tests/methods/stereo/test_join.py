"""Lines of a drawn road out of its stereo pairs: what each is, and where."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.scenes.road_images import RIG, STRIPES, road_pair, straight_poses

from linework.methods.protocol import SurveyContext
from linework.methods.stereo.method import Stereo, StereoConfig
from linework.model.camera import LOOKING_AHEAD
from linework.model.images import RectifiedPair
from linework.model.lines import LineSet
from linework.model.settings import settings_from, settings_toml
from linework.model.sightings import Sightings


@pytest.fixture(scope="module")
def lines() -> LineSet:
    poses, method = straight_poses(5), Stereo()
    seen = Sightings.concatenate([method.look(road_pair(i, poses)) for i in range(5)])
    return method.join(seen, SurveyContext(poses=poses, rig=RIG))


def test_every_line_is_there_once(lines: LineSet) -> None:
    found = lines["lane_marking"]
    assert len(found) == 3
    offsets = sorted(float(np.median(found[i].xyz[:, 1])) for i in range(3))
    np.testing.assert_allclose(offsets, sorted(s[0] for s in STRIPES), atol=0.01)
    assert (found.length_m > 20.0).all() and (found.method == "stereo").all()


def test_places_are_on_the_paint(lines: LineSet) -> None:
    found = lines["lane_marking"]
    for i in range(len(found)):
        xyz = found[i].xyz
        true = min((s[0] for s in STRIPES), key=lambda o: abs(o - float(np.median(xyz[:, 1]))))
        near = xyz[:, 0] < 25.0
        assert np.sqrt(np.mean((xyz[near, 1] - true) ** 2)) < 0.01
        assert np.sqrt(np.mean(xyz[near, 2] ** 2)) < 0.02


def test_widths_patterns_and_times(lines: LineSet) -> None:
    found = lines["lane_marking"]
    for offset, width, period, _ in STRIPES:
        i = int(np.argmin([abs(float(np.median(found[k].xyz[:, 1])) - offset) for k in range(3)]))
        assert found.width_m[i] == pytest.approx(width, abs=0.02)
        assert found.pattern[i] == ("dashed" if period else "solid")
        assert found.role[i] == ("edge" if not period else found.role[i])
        assert 0.0 <= found.time_start_s[i] <= found.time_end_s[i] <= 0.8
        assert found.confidence[i] > 0.9


def test_dashes_begin_and_end_where_they_do(lines: LineSet) -> None:
    dashes = lines["lane_marking_dash"]
    assert len(dashes) >= 2
    for i in range(len(dashes)):
        ends = np.sort(dashes[i].xyz[[0, -1], 0])
        if ends[1] < 22.0:
            start = np.round(ends[0] / 9.0) * 9.0
            np.testing.assert_allclose(ends, [start, start + 3.0], atol=0.25)


@pytest.mark.parametrize(("pitch_deg", "roll_deg", "base_m"), [(12.0, 3.0, 0.6), (0.0, -4.0, 1.2)])
def test_cameras_may_look_down_be_rolled_and_stand_apart(
    pitch_deg: float, roll_deg: float, base_m: float
) -> None:
    turned = Rotation.from_euler("ZYX", [0.0, pitch_deg, roll_deg], degrees=True).as_matrix() @ LOOKING_AHEAD
    rig = replace(RIG, R_vehicle_camera=turned, base_m=base_m, cy=95.0)
    poses, method = straight_poses(3), Stereo()
    seen = Sightings.concatenate([method.look(road_pair(i, poses, rig=rig)) for i in range(3)])
    found = method.join(seen, SurveyContext(poses=poses, rig=rig))["lane_marking"]
    offsets = sorted(float(np.median(found[i].xyz[:, 1])) for i in range(len(found)))
    for true in (3.5, -3.5):
        assert min(abs(o - true) for o in offsets) < 0.02
    assert np.abs(found.xyz[:, 2]).max() < 0.05


@pytest.mark.parametrize(("width", "height"), [(1, 1), (10, 10), (3, 200), (600, 3), (64, 48)])
def test_images_of_nothing_show_no_line(width: int, height: int) -> None:
    rig = replace(RIG, width=width, height=height, cx=0.5 * (width - 1), cy=height / 3)
    noise = np.random.default_rng(0).integers(0, 255, (height, width)).astype(np.uint8)
    for image in (np.zeros_like(noise), np.full_like(noise, 255), noise):
        assert len(Stereo().look(RectifiedPair(image, np.roll(image, -3, axis=1), rig))) == 0


def test_nothing_seen_is_no_line() -> None:
    assert len(Stereo().join(Sightings.empty(), SurveyContext(poses=straight_poses(2), rig=RIG))) == 0


def test_settings_are_read_and_written() -> None:
    import tomllib

    config = settings_from(StereoConfig, tomllib.loads(settings_toml(StereoConfig())))
    assert config == StereoConfig()
