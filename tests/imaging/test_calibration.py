"""Calibrations are adjusted where corners support it, and only there: on corners of exact truth."""

import numpy as np
import pytest
from tests.scenes.corner_scenes import corner_windows, given_rig, van_path

from linework.imaging.calibration.bundle import misfit_px
from linework.imaging.calibration.parameters import NAMES, PARAMETERS, adjusted_rig
from linework.imaging.calibration.support import CornerCalibration, Finding, calibrated_by_corners
from linework.runs.cameras.calibrate import calibrated_values

USUAL = {
    "focal_length": 0.005,
    "boresight_yaw": 0.5,
    "boresight_pitch": -0.5,
    "relative_yaw": 0.05,
    "time_offset": 0.02,
}
#: As large as a knock or a change of temperature makes them.
RARE = (
    {"boresight_roll": 1.0, "relative_roll": 0.05, "focal_length_right": 0.002, "k1_left": 0.01},
    {"relative_pitch": -0.05, "base_up": 10.0, "k2_right": -0.02},
)


def findings(errors, path, seed, **options):
    found = calibrated_by_corners(given_rig(), corner_windows(errors, path, seed, **options))
    return found, {f.parameter.name: f for f in found.findings}


def assert_found(by_name, errors):
    assert {name for name, f in by_name.items() if f.is_supported} == set(errors)
    for name, error in errors.items():
        assert abs(by_name[name].correction - error) < 3.0 * by_name[name].sigma, by_name[name]


def test_usual_errors_are_found_together_and_no_other():
    found, by_name = findings(USUAL, van_path(), seed=11)
    assert_found(by_name, USUAL)
    assert found.after_px < 0.6 * found.before_px
    assert found.time_offset_s == by_name["time_offset"].correction
    # The errors of the poses are estimated as large as they are: 1 cm and 0.02 degrees
    assert np.abs(found.sigma_moves[:3] / 0.01 - 1.0).max() < 0.3
    assert np.abs(found.sigma_moves[3:] / np.radians(0.02) - 1.0).max() < 0.3
    assert found.sigma_px == pytest.approx(0.1, rel=0.15)


@pytest.mark.parametrize("errors", RARE, ids=lambda errors: next(iter(errors)))
def test_rare_errors_are_found_among_good_poses(errors):
    _, by_name = findings(errors, van_path(), seed=12, sigma_m=0.001, sigma_deg=0.002)
    assert_found(by_name, errors)


@pytest.mark.parametrize("seed", [13, 14])
def test_a_right_calibration_stays_to_the_last_bit(seed):
    found, by_name = findings({}, van_path(), seed=seed)
    assert_found(by_name, {})
    given = given_rig()
    for own, other in ((found.rig.left, given.left), (found.rig.right, given.right)):
        assert (own.fx, own.cx, own.distortion) == (other.fx, other.cx, other.distortion)
        assert np.allclose(own.R_vehicle_camera, other.R_vehicle_camera, atol=1e-12)
    assert found.time_offset_s == 0.0
    assert found.before_px == found.after_px


def test_a_straight_drive_says_what_it_cannot_tell():
    errors = {name: USUAL[name] for name in USUAL if name != "time_offset"}
    _, by_name = findings(USUAL, van_path(is_straight=True), seed=15)
    assert_found(by_name, errors)
    for name, needs in (("time_offset", "changes of speed"), ("boresight_roll", "turns")):
        assert by_name[name].reason.startswith("not determined: needs " + needs)
        assert by_name[name].sigma > 0.33 * by_name[name].parameter.prior


def test_corners_that_move_or_are_mistaken_do_not_matter():
    windows = corner_windows(USUAL, van_path(), seed=16)
    rng = np.random.default_rng(16)
    for window in windows:
        pixel = window.tracks.pixel.copy()
        wrong = rng.random(len(pixel)) < 0.05
        pixel[wrong] += rng.normal(0.0, 8.0, (int(wrong.sum()), 2))
        object.__setattr__(window.tracks, "pixel", pixel)
    found = calibrated_by_corners(given_rig(), windows)
    by_name = {f.parameter.name: f for f in found.findings}
    for name, error in USUAL.items():
        assert by_name[name].is_supported
        assert abs(by_name[name].correction - error) < 3.0 * by_name[name].sigma


def test_the_order_of_corners_does_not_matter():
    windows = corner_windows(USUAL, van_path(), seed=17, n_windows=4)
    x = np.array([USUAL.get(name, 0.0) for name in NAMES])
    shuffled = []
    for window in windows:
        order = np.random.default_rng(0).permutation(len(window.tracks))
        shuffled.append(type(window)(window.tracks.take(order), window.poses_at))
    assert np.array_equal(
        np.sort(misfit_px(given_rig(), windows, x)), np.sort(misfit_px(given_rig(), shuffled, x))
    )


def test_too_few_corners_are_refused_with_their_number():
    windows = corner_windows({}, van_path(), seed=18, n_windows=3, n_corners=20)
    with pytest.raises(ValueError, match=r"\d+ corners followed in 3 windows of pairs"):
        calibrated_by_corners(given_rig(), windows)


def test_corrections_turn_the_whole_rig_about_its_left_camera():
    rig = given_rig()
    turned, _ = adjusted_rig(rig, {"boresight_yaw": 90.0})
    assert np.allclose(turned.left.position_m, rig.left.position_m)
    # Looking to the right, the right camera is behind the left one
    assert np.allclose(turned.left.R_vehicle_camera[:, 2], [0.0, -1.0, 0.0], atol=1e-12)
    assert np.allclose(turned.right.position_m - turned.left.position_m, [-0.54, 0.0, 0.0], atol=1e-12)
    up, _ = adjusted_rig(rig, {"boresight_pitch": 10.0})
    assert up.left.R_vehicle_camera[2, 2] > 0.17
    assert len({p.name for p in PARAMETERS}) == len(PARAMETERS)


def test_values_are_those_of_the_rig_that_is_written():
    """A turn of a rig that looks down changes its roll, and a focal length is that of both cameras."""
    down, _ = adjusted_rig(given_rig(), {"boresight_pitch": -20.0})
    made = {"boresight_yaw": 2.0, "focal_length": 0.01}
    rig, _ = adjusted_rig(down, made)
    findings = tuple(
        Finding(p, made.get(p.name, 0.5 * p.prior), 0.1 * p.prior, is_supported=p.name in made, reason="")
        for p in PARAMETERS
    )
    adjusted = CornerCalibration(rig, 0.0, findings, 4, 24, 100, 2400, 0.1, np.zeros(6), 1.0, 0.5)
    values = {v.name: v for v in calibrated_values(down, {"left": {"time_offset_s": 0.5}}, adjusted)}
    assert values["focal_length"].after == rig.left.fx == pytest.approx(1.01 * 718.0)
    ratio = values["focal_length_right"]
    assert (ratio.before, ratio.after) == pytest.approx((1.0, rig.right.fx / rig.left.fx))
    assert ratio.estimate == pytest.approx(1.0025)
    assert abs(values["boresight_roll"].after - values["boresight_roll"].before) > 0.1
    assert not values["boresight_roll"].is_supported
    for name in made:
        assert values[name].estimate == values[name].after
    assert values["time_offset"].after == values["time_offset"].before == 0.5


def test_what_is_corrected_passes_the_test_and_is_rounded():
    found, by_name = findings(USUAL, van_path(), seed=19)
    for f in by_name.values():
        if f.is_supported:
            # Student's distribution with 7 degrees of freedom, 2 % over 17 parameters
            assert abs(f.correction) > 5.3 * f.sigma
            assert f.correction == float(f"{f.correction:.10g}")
    assert found.after_px <= found.before_px
