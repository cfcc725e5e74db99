"""What may be wrong with a calibration: its parameters by name, what they could be, and the rig that they give."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from linework.arrays import FloatArray
from linework.model.camera import Camera, StereoRig


@dataclass(frozen=True, slots=True)
class CalibrationParameter:
    """A parameter of a calibration, as a correction of the given value.

    Parameters
    ----------
    name
        As it is reported.
    unit
        Of its value; "" for ratios.
    prior
        Standard deviation of the correction before anything is measured. [unit]
    scale
        What one unit is in the internal one (radians, metres, seconds, pixels, ratios).
    needs
        What a survey must have to determine it.
    """

    name: str
    unit: str
    prior: float
    scale: float
    needs: str


_DEG = float(np.radians(1.0))
_ANY = "corners at many distances"
_TURNS = "turns, and corners far and near"
#: Corrections that are looked for, what happens more often first. Priors are what goes wrong in practice, with ample room: a mount that was knocked
#: (degrees between rig and van, tenths of it between both cameras on one bar, millimetres along the bar), a lens that
#: was touched or has warmed up (per cents of its focal length, ten pixels of its principal point), a clock that lags
#: behind by an exposure, a transfer and a buffer of images (a tenth of a second).
PARAMETERS: tuple[CalibrationParameter, ...] = (
    CalibrationParameter("boresight_roll", "deg", 2.0, _DEG, _TURNS),
    CalibrationParameter("boresight_pitch", "deg", 2.0, _DEG, "movement, and corners near the van"),
    CalibrationParameter("boresight_yaw", "deg", 2.0, _DEG, "movement, and corners near the van"),
    CalibrationParameter("relative_roll", "deg", 0.5, _DEG, "corners at both sides of the images"),
    CalibrationParameter("relative_pitch", "deg", 0.5, _DEG, _ANY),
    CalibrationParameter("relative_yaw", "deg", 0.5, _DEG, _ANY),
    CalibrationParameter("time_offset", "s", 0.1, 1.0, "changes of speed, or of the rate of turn"),
    CalibrationParameter("focal_length", "ratio", 0.02, 1.0, "movement, or turns"),
    CalibrationParameter("base_up", "mm", 10.0, 1e-3, "corners near the van"),
    CalibrationParameter("base_ahead", "mm", 10.0, 1e-3, "corners near the van at both sides of the images"),
    CalibrationParameter("focal_length_right", "ratio", 0.005, 1.0, "corners at both sides of the images"),
    CalibrationParameter("principal_point_col", "px", 10.0, 1.0, _TURNS),
    CalibrationParameter("principal_point_row", "px", 10.0, 1.0, _TURNS),
    CalibrationParameter("k1_left", "", 0.05, 1.0, "corners near the edges of the images"),
    CalibrationParameter("k2_left", "", 0.05, 1.0, "corners near the edges of the images"),
    CalibrationParameter("k1_right", "", 0.05, 1.0, "corners near the edges of the images"),
    CalibrationParameter("k2_right", "", 0.05, 1.0, "corners near the edges of the images"),
)
#: What is taken as given although it is not exact: it widens the sigmas of the others. A base is known to some tenths of
#: a millimetre, the place of the cameras in the van to centimetres.
CONSIDERED: tuple[CalibrationParameter, ...] = (
    CalibrationParameter("base_length", "mm", 0.3, 1e-3, ""),
    CalibrationParameter("position_forward", "mm", 20.0, 1e-3, ""),
    CalibrationParameter("position_left", "mm", 20.0, 1e-3, ""),
    CalibrationParameter("position_up", "mm", 20.0, 1e-3, ""),
)
ALL_PARAMETERS = (*PARAMETERS, *CONSIDERED)
NAMES = tuple(p.name for p in ALL_PARAMETERS)
_SCALE = np.array([p.scale for p in ALL_PARAMETERS])


def turned(rotvec: FloatArray) -> FloatArray:
    """Return the rotations (..., 3, 3) of rotation vectors (..., 3) [rad]."""
    from scipy.spatial.transform import Rotation

    flat = np.asarray(rotvec, dtype=np.float64).reshape(-1, 3)
    return np.asarray(Rotation.from_rotvec(flat).as_matrix()).reshape(*np.shape(rotvec)[:-1], 3, 3)


def adjusted_rig(rig: StereoRig, correction: FloatArray | Mapping[str, float]) -> tuple[StereoRig, float]:
    """Return the rig with its calibration corrected, and the seconds to add to the times of its images.

    Parameters
    ----------
    correction
        (n,) in the order of `ALL_PARAMETERS`, or by name; what is not named is 0. In the units of the parameters.

    Notes
    -----
    Boresight angles turn the whole rig about the left camera, by roll, pitch (nose up) and yaw (to the right) of its
    own axes; relative angles turn the right camera about itself, after that.

    >>> left = Camera(width=640, height=480, fx=500.0, fy=500.0, cx=320.0, cy=240.0)
    >>> rig = StereoRig(left, replace(left, position_m=np.array([0.0, -0.5, 0.0])))
    >>> moved, offset_s = adjusted_rig(rig, {"focal_length": 0.01, "time_offset": 0.02})
    >>> moved.left.fx, offset_s
    (505.0, 0.02)
    """
    if isinstance(correction, Mapping):
        correction = np.array([correction.get(name, 0.0) for name in NAMES])
    value = dict(zip(NAMES, (np.asarray(correction) * _SCALE).tolist(), strict=True))
    left, right = rig.left, rig.right
    # Camera axes: right, down, forward. Roll is about forward, pitch about right, yaw about down
    axes = left.R_vehicle_camera
    boresight, relative = (
        turned(np.array([value[f"{of}_{angle}"] for angle in ("pitch", "yaw", "roll")]))
        for of in ("boresight", "relative")
    )
    whole = axes @ boresight @ axes.T
    base = axes.T @ (right.position_m - left.position_m)
    base = base * (1.0 + value["base_length"] / np.linalg.norm(base))
    base = base + np.array([0.0, -value["base_up"], value["base_ahead"]])
    place = left.position_m + np.array([value[f"position_{way}"] for way in ("forward", "left", "up")])
    return StereoRig(
        _with_lens(
            replace(left, position_m=place, R_vehicle_camera=whole @ axes), value, "left", 1.0
        ),
        _with_lens(
            replace(
                right,
                position_m=place + whole @ axes @ base,
                R_vehicle_camera=whole @ right.R_vehicle_camera @ relative,
            ),
            value, "right", 1.0 + value["focal_length_right"],
        ),
    ), value["time_offset"]  # fmt: skip


def _with_lens(camera: Camera, value: Mapping[str, float], side: str, ratio: float) -> Camera:
    factor = (1.0 + value["focal_length"]) * ratio
    k1, k2, p1, p2, k3 = camera.distortion
    return replace(
        camera,
        fx=camera.fx * factor, fy=camera.fy * factor,
        cx=camera.cx + value["principal_point_col"], cy=camera.cy + value["principal_point_row"],
        distortion=(k1 + value[f"k1_{side}"], k2 + value[f"k2_{side}"], p1, p2, k3),
    )  # fmt: skip


def prior_of(names: Sequence[str] = NAMES) -> FloatArray:
    """Return the standard deviations of corrections before anything is measured, (n,) in the units of the parameters."""
    known = {p.name: p.prior for p in ALL_PARAMETERS}
    return np.array([known[name] for name in names])
