"""Find the stereo pairs of a survey: check the cameras, find the images and pair them by time; none is opened."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from linework.arrays import FloatArray, IntArray
from linework.errors import ConfigError, InputError
from linework.files.images.lists import ImageList, read_image_list
from linework.imaging.pairing import PairedTimes, pair_by_time
from linework.model.camera import Camera, StereoRig
from linework.model.images import ImagePair, StereoSeries
from linework.model.survey import Survey

_SIDES = ("left", "right")
_REQUIRED = ("images", "width", "height", "fx", "fy", "cx", "cy", "position_m", "rotation_wxyz")
#: Time stamps of cameras triggered together agree within this [s]; at 80 km/h a van drives 2 cm.
_TOGETHER_S = 0.001
#: Ratio to the usual interval from which a pause is reported: the camera was off, or its clock jumped.
_PAUSE = 10.0
#: Images named in a warning; the others are counted.
_MAX_NAMED = 3


def open_stereo(survey: Survey) -> StereoSeries | None:
    """Find the stereo pairs of a survey, or return None where it has no cameras that make pairs.

    Returns
    -------
    StereoSeries
        Pairs in time order, at the time of their left image. Images in no pair are counted in its warnings.

    Raises
    ------
    ConfigError
        A key of [cameras] is missing, or the calibration is impossible; with the key.
    InputError
        A camera without images, or no two images taken at the same time.

    Notes
    -----
    Two images are a pair where each is the other's nearest in time and they are less than half the median interval
    apart (`pair_by_time`). Times need not be equal: each camera has its own time stamps.
    """
    cameras = survey.settings.get("cameras")
    if not cameras or not survey.has_pairs:
        return None
    where = survey.settings_file or survey.root
    from linework.files.survey.toml import check_cameras

    check_cameras(cameras, where)
    rig = rig_of(cameras, where)
    only_inside = None if survey.allow_outside else survey.settings_file
    left, right = (
        read_image_list(cameras[side], survey.root, f"cameras.{side}", only_inside=only_inside)
        for side in _SIDES
    )
    for side, images in zip(_SIDES, (left, right), strict=True):
        _check_some_exist(images.files, f"cameras.{side}", where)
    if left.files[0] == right.files[0]:
        raise ConfigError(f"cameras.left and cameras.right have the same images ({left.files[0].name})",
                          where=where, advice="name each camera's own images")  # fmt: skip
    paired = pair_by_time(left.time_s, right.time_s)
    if not len(paired.left):
        raise InputError(
            f"no two images taken at the same time: cameras.left {_span(left.time_s)}, cameras.right "
            f"{_span(right.time_s)}, at most {paired.tolerance_s:.3f} s apart", where=where,
            advice="check the times of the images",
        )  # fmt: skip
    pairs = tuple(
        ImagePair(number, float(left.time_s[i]), left.files[i], right.files[j])
        for number, (i, j) in enumerate(zip(paired.left, paired.right, strict=True))
    )
    warnings = (*left.warnings, *right.warnings, *_about(left, right, paired))
    alone = _alone(left, paired.left) + _alone(right, paired.right)
    uncertain = (*left.left_out, *right.left_out)
    return StereoSeries(
        rig, pairs, warnings, unpaired=alone,
        left_out=tuple((path, "its time occurs twice") for path in uncertain),
    )  # fmt: skip


def rig_of(cameras: Mapping[str, Any], where: object) -> StereoRig:
    """Return the stereo rig of the table [cameras].

    Raises
    ------
    ConfigError
        As for `open_stereo`.
    """
    for side in _SIDES:
        if side not in cameras:
            raise ConfigError(f"cameras.{side} is missing, a stereo pair needs both cameras", where=where,
                              advice=f"add a table [cameras.{side}]")  # fmt: skip
    left, right = (_camera_of(cameras[side], f"cameras.{side}", where) for side in _SIDES)
    try:
        return StereoRig(left, right)
    except ValueError as error:
        raise ConfigError(f"cameras: {error}", where=where,
                          advice="check position_m and rotation_wxyz of both") from error  # fmt: skip


def _camera_of(table: Mapping[str, Any], name: str, where: object) -> Camera:
    from scipy.spatial.transform import Rotation

    missing = [key for key in _REQUIRED if key not in table]
    if missing:
        raise ConfigError(f"{name}.{missing[0]} is missing" + _and_more(missing), where=where,
                          advice="see the manual for the keys of a camera")  # fmt: skip
    w, x, y, z = table["rotation_wxyz"]
    try:
        return Camera(
            width=table["width"], height=table["height"], fx=float(table["fx"]), fy=float(table["fy"]),
            cx=float(table["cx"]), cy=float(table["cy"]),
            distortion=tuple(map(float, table.get("distortion", (0.0,) * 5))),  # type: ignore[arg-type]
            position_m=np.array(table["position_m"], dtype=np.float64),
            R_vehicle_camera=Rotation.from_quat([x, y, z, w]).as_matrix(),
        )  # fmt: skip
    except ValueError as error:
        raise ConfigError(f"{name}: {error}", where=where, advice="correct the calibration") from error


def _check_some_exist(files: Sequence[Path], name: str, where: object) -> None:
    """Refuse a camera without any image; single missing ones are reported by name when they are read."""
    if not any(file.is_file() for file in files):
        problem = f"none of its {len(files)} files exists, first {files[0]}" if files else "none has a time"
        raise InputError(f"{name} has no image: {problem}", where=where,
                         advice="check the folder and the names in the list")  # fmt: skip


def _about(left: ImageList, right: ImageList, paired: PairedTimes) -> list[str]:
    """Return warnings about images without a partner, time differences within pairs, and pauses."""
    warnings = []
    for name, images, chosen in (("left", left, paired.left), ("right", right, paired.right)):
        alone = _alone(images, chosen)
        if alone:
            warnings.append(
                f"cameras.{name}: {len(alone)} of {len(images.files)} images are in no pair (none of the other "
                f"camera within {paired.tolerance_s:.3f} s): {_named(alone)}"
            )
    apart = np.abs(left.time_s[paired.left] - right.time_s[paired.right])
    if apart.max() > _TOGETHER_S:
        warnings.append(
            f"left and right images of a pair are up to {1e3 * apart.max():.1f} ms apart "
            f"(median {1e3 * np.median(apart):.1f} ms); both are used at the time of the left one"
        )
    steps = np.diff(left.time_s[paired.left])
    if len(steps) > 1 and steps.max() > _PAUSE * np.median(steps):
        i = int(steps.argmax())
        n = int(np.count_nonzero(steps > _PAUSE * np.median(steps)))
        warnings.append(f"no pair in {n} pauses, the longest of {steps[i]:.3f} s after "
                        f"{left.time_s[paired.left[i]]:.3f} s")  # fmt: skip
    return warnings


def _alone(images: ImageList, chosen: IntArray) -> tuple[Path, ...]:
    in_pair = np.zeros(len(images.files), dtype=bool)
    in_pair[chosen] = True
    return tuple(images.files[i] for i in np.flatnonzero(~in_pair))


def _named(files: Sequence[Path]) -> str:
    return ", ".join(file.name for file in files[:_MAX_NAMED]) + _and_more(files[_MAX_NAMED - 1 :])


def _and_more(items: Sequence[object]) -> str:
    return f" and {len(items) - 1} more" if len(items) > 1 else ""


def _span(time_s: FloatArray) -> str:
    return f"{time_s[0]:.3f} to {time_s[-1]:.3f} s"
