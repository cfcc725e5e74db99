"""Calibrate the cameras of a survey by corners that are followed over its pairs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from linework.errors import InputError, check_extra
from linework.files.images.series import open_stereo
from linework.files.survey.calibration import table_of_camera
from linework.files.trajectories.of_survey import read_van_path
from linework.imaging.calibration.parameters import adjusted_rig
from linework.imaging.calibration.support import CornerCalibration, calibrated_by_corners
from linework.model.camera import LOOKING_AHEAD, StereoRig
from linework.model.survey import Survey
from linework.runs.cameras.windows import followed
from linework.runs.opened.pairs import OpenedStereo, place_pairs
from linework.runs.opened.recordings import located_survey
from linework.runs.steps import RunSteps

#: Values differ by rounding alone up to this part of them.
_SAME = 1e-12
#: Decimals of corrected values [m, pixels, s, parts of a quaternion]: finer than any sigma, and coarser than the last bits,
#: in which machines differ.
_DECIMALS = 9


@dataclass(frozen=True, slots=True)
class CalibratedValue:
    """One parameter of a calibration, as given and as adjusted.

    Parameters
    ----------
    name, unit
        Of the parameter.
    before, after
        The given value, and that of the calibration to be used. Without a correction of its own it is the same, but
        where other corrections change it.
    estimate, sigma
        What the corners say, and its standard deviation.
    is_supported
        Whether it is corrected.
    reason
        Why, or why not.
    """

    name: str
    unit: str
    before: float
    after: float
    estimate: float
    sigma: float
    is_supported: bool
    reason: str


@dataclass(frozen=True, slots=True, repr=False)
class SurveyCalibration:
    """The cameras of a survey, calibrated by its own images and trajectory.

    Parameters
    ----------
    survey
        With the adjusted calibration: give it to `linework.extract`.
    cameras
        The tables [cameras.left] and [cameras.right] of its survey.toml.
    values
        Every parameter.
    n_windows, n_pairs, n_corners, n_pixels
        Windows of pairs, pairs, corners followed in them, and places where these were seen.
    sigma_px
        Standard deviation of a coordinate of a corner. [pixels]
    before_px, after_px
        Median residual of the corners, with the poses of the trajectory as they are. [pixels]
    warnings
        One line each.
    """

    survey: Survey
    cameras: Mapping[str, Mapping[str, Any]]
    values: tuple[CalibratedValue, ...]
    n_windows: int
    n_pairs: int
    n_corners: int
    n_pixels: int
    sigma_px: float
    before_px: float
    after_px: float
    warnings: tuple[str, ...] = ()

    def __repr__(self) -> str:
        used = ", ".join(v.name for v in self.values if v.is_supported) or "nothing"
        return f"SurveyCalibration({self.survey.name!r}: {used} corrected; residuals {self.before_px:.2f} -> {self.after_px:.2f} px)"

    @property
    def supported(self) -> tuple[CalibratedValue, ...]:
        """The parameters that are corrected."""
        return tuple(value for value in self.values if value.is_supported)

    def document(self) -> dict[str, Any]:
        """Return it for JSON."""
        return {
            "parameters": [
                {
                    "name": v.name, "unit": v.unit, "before": v.before, "after": v.after, "estimate": v.estimate,
                    "sigma": v.sigma, "supported": v.is_supported, "reason": v.reason,
                }
                for v in self.values
            ],
            "cameras": {side: dict(table) for side, table in self.cameras.items()},
            "n_windows": self.n_windows, "n_pairs": self.n_pairs, "n_corners": self.n_corners,
            "n_pixels": self.n_pixels, "sigma_px": self.sigma_px, "residual_before_px": self.before_px,
            "residual_after_px": self.after_px, "warnings": list(self.warnings),
        }  # fmt: skip

    def lines(self) -> list[str]:
        """Return it as lines of text: a summary, then a table of all parameters."""
        summary = (
            f"{self.n_corners:,} corners seen {self.n_pixels:,} times in {self.n_pairs} pairs ({self.n_windows} windows);"
            f" median residual {self.before_px:.2f} pixels, after the adjustment {self.after_px:.2f}"
        )
        head = (
            f"{'parameter':20} {'before':>10} {'after':>10} {'estimate':>10} {'sigma':>9} unit  used  reason"
        )
        return [summary, head, *(_row(value) for value in self.values)]


def _row(v: CalibratedValue) -> str:
    digits = int(np.clip(1 - np.floor(np.log10(v.sigma)), 0, 5)) if v.sigma > 0.0 else 5
    before, after, estimate, sigma = (f"{x:.{digits}f}" for x in (v.before, v.after, v.estimate, v.sigma))
    used = "yes" if v.is_supported else "no"
    return f"{v.name:20} {before:>10} {after:>10} {estimate:>10} {sigma:>9} {v.unit:5} {used:5} {v.reason}"


def calibrate_survey(survey: Survey, work: Path, steps: RunSteps) -> SurveyCalibration:
    """Return the calibration of a survey's cameras, corrected where its images and its trajectory support it.

    Parameters
    ----------
    work
        The work folder, for a trajectory that is made from logs.

    Raises
    ------
    InputError
        No pairs, no trajectory, no movement, too few corners, or images that cannot be read.
    ConfigError
        A mistake in [cameras].
    """
    check_extra("stereo", where="calibration of cameras")
    stereo, messages = _placed(survey, work, steps)
    with steps.step("follow corners", unit="windows") as advance:
        found = followed(stereo, advance)
    with steps.step("adjust the calibration", unit="rounds") as advance:
        try:
            adjusted = calibrated_by_corners(stereo.series.rig, found.windows, progress=advance)
        except ValueError as error:
            raise InputError(f"the cameras cannot be calibrated: {error}", where=survey.name,
                             advice="use a longer survey, with more texture in its images") from error  # fmt: skip
    cameras = _tables(stereo.series.rig, survey.settings["cameras"], adjusted)
    return SurveyCalibration(
        survey=survey.with_cameras(cameras),
        cameras=cameras,
        values=calibrated_values(stereo.series.rig, survey.settings["cameras"], adjusted),
        n_windows=adjusted.n_windows, n_pairs=adjusted.n_pairs, n_corners=adjusted.n_corners,
        n_pixels=adjusted.n_pixels, sigma_px=adjusted.sigma_px, before_px=adjusted.before_px,
        after_px=adjusted.after_px,
        warnings=(*messages, *stereo.warnings, *found.warnings),
    )  # fmt: skip


def _placed(survey: Survey, work: Path, steps: RunSteps) -> tuple[OpenedStereo, tuple[str, ...]]:
    """Return the pairs of a survey with their poses; whether they fit the given calibration is not asked."""
    if not survey.has_pairs:
        cameras = survey.single_cameras
        problem = f"one camera ([cameras.{cameras[0]}])" if cameras else "no images"
        raise InputError(f"{problem}: a calibration needs stereo pairs", where=survey.name,
                         advice="name both cameras, [cameras.left] and [cameras.right]")  # fmt: skip
    located, messages = located_survey(survey, work, steps)
    series = open_stereo(located)
    assert series is not None, "the survey has pairs"
    van = read_van_path(located, series)
    return place_pairs(located, van.series or series, van.trajectory), (*messages, *van.warnings)


def _tables(
    rig: StereoRig, cameras: Mapping[str, Any], adjusted: CornerCalibration
) -> dict[str, dict[str, Any]]:
    """Return the tables of both cameras with what was corrected; what was not stays as it was written."""
    found = {}
    for side in ("left", "right"):
        given, new = (table_of_camera(getattr(one, side)) for one in (rig, adjusted.rig))
        changed = {key: _rounded(new[key]) for key in new if not _is_same(new[key], given[key])}
        if adjusted.time_offset_s:
            offset = float(cameras[side].get("time_offset_s", 0.0)) + adjusted.time_offset_s
            changed["time_offset_s"] = _rounded(offset)
        found[side] = {**cameras[side], **changed}
    return found


def _is_same(new: Any, given: Any) -> bool:
    """Return whether values of a camera differ by no more than the rounding of a product of rotations."""
    if isinstance(new, str):
        return bool(new == given)
    size = np.abs(given).max()
    return bool(np.abs(np.subtract(new, given)).max() <= _SAME * size)


def _rounded(value: Any) -> Any:
    return (np.round(value, _DECIMALS) + 0.0).tolist()


def calibrated_values(
    rig: StereoRig, cameras: Mapping[str, Any], adjusted: CornerCalibration
) -> tuple[CalibratedValue, ...]:
    """Return all parameters with their values: angles against a level view ahead and against the left camera.

    All are read from rigs: a correction may change the values of other parameters, too, as a turn to the side changes
    the roll of cameras that look down. An estimate that is not used is that of the rig with it and with what is used.
    """
    offset = float(cameras["left"].get("time_offset_s", 0.0))

    def named(corrected: StereoRig, later_s: float) -> dict[str, float]:
        return _named(corrected) | {"time_offset": offset + later_s}

    given, after = named(rig, 0.0), named(adjusted.rig, adjusted.time_offset_s)
    used = {f.parameter.name: f.correction for f in adjusted.findings if f.is_supported}
    found = []
    for finding in adjusted.findings:
        name, unit = finding.parameter.name, finding.parameter.unit
        estimate = named(*adjusted_rig(rig, used | {name: finding.correction}))[name]
        # Corrections of focal lengths are ratios to the given ones
        factor = given[name] if unit == "ratio" else 1.0
        found.append(
            CalibratedValue(
                name, "px" if name == "focal_length" else unit, given[name], after[name], estimate,
                finding.sigma * factor, finding.is_supported, finding.reason,
            )
        )  # fmt: skip
    return tuple(found)


def _named(rig: StereoRig) -> dict[str, float]:
    """Return the values of a calibration by the names of its parameters."""
    left, right = rig.left, rig.right
    base = 1e3 * left.R_vehicle_camera.T @ (right.position_m - left.position_m)
    values = {
        "focal_length": left.fx, "focal_length_right": right.fx / left.fx, "principal_point_col": left.cx,
        "principal_point_row": left.cy, "base_up": -base[1], "base_ahead": base[2],
        "k1_left": left.distortion[0], "k2_left": left.distortion[1],
        "k1_right": right.distortion[0], "k2_right": right.distortion[1],
    }  # fmt: skip
    angles = {
        "boresight": LOOKING_AHEAD.T @ left.R_vehicle_camera,
        "relative": left.R_vehicle_camera.T @ right.R_vehicle_camera,
    }
    for name, turn in angles.items():
        values |= dict(zip((f"{name}_pitch", f"{name}_yaw", f"{name}_roll"), _angles_deg(turn), strict=True))
    return {name: float(value) for name, value in values.items()}


def _angles_deg(turn: Any) -> list[float]:
    """Return rotations about the camera's axes right, down and forward, as one rotation vector [deg]."""
    from scipy.spatial.transform import Rotation

    return [float(v) for v in np.degrees(Rotation.from_matrix(turn).as_rotvec())]
