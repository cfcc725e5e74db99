"""Write the calibration of cameras as the tables of a survey.toml, and read them back."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from linework.errors import ConfigError, MachineError
from linework.files.documents import read_toml
from linework.files.images.series import rig_of
from linework.files.output.publish import publish
from linework.files.survey.toml import check_cameras
from linework.model.camera import Camera

#: Keys of a camera in the order in which they are written.
_ORDER = (
    "images", "times", "rate_hz", "time_offset_s", "model", "width", "height", "fx", "fy", "cx", "cy", "distortion",
    "position_m", "rotation_wxyz",
)  # fmt: skip


def table_of_camera(camera: Camera) -> dict[str, Any]:
    """Return a camera as the keys of a survey.toml that hold its calibration."""
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_matrix(camera.R_vehicle_camera).as_quat()
    return {
        "model": "pinhole",
        "width": camera.width,
        "height": camera.height,
        "fx": camera.fx,
        "fy": camera.fy,
        "cx": camera.cx,
        "cy": camera.cy,
        "distortion": [float(k) for k in camera.distortion],
        "position_m": camera.position_m.tolist(),
        "rotation_wxyz": [float(value) for value in (w, x, y, z)],
    }


def cameras_text(cameras: Mapping[str, Mapping[str, Any]]) -> str:
    """Return tables [cameras.left] and so on as TOML, numbers to their last digit.

    >>> print(cameras_text({"left": {"width": 640, "images": "left.csv"}}).strip())
    [cameras.left]
    images = "left.csv"
    width = 640
    """
    return "".join(
        f"\n[cameras.{name}]\n" + "".join(f"{key} = {_toml(table[key])}\n" for key in _ORDER if key in table)
        for name, table in cameras.items()
    )


def _toml(value: Any) -> str:
    """Return a text, a number or a list of them as TOML, which writes them as JSON does, but for one character."""
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


def write_calibration(
    cameras: Mapping[str, Mapping[str, Any]],
    path: Path,
    *,
    remarks: Sequence[str] = (),
    overwrite: bool = False,
) -> None:
    """Write the tables of cameras to a file, whole or not at all.

    Parameters
    ----------
    cameras
        Tables of a survey.toml by the name of the camera.
    remarks
        Lines that stand above them as comments.

    Raises
    ------
    OutputExistsError, MachineError
        As for `linework.files.output.publish.publish`.
    """
    text = "".join(f"# {line}".rstrip() + "\n" for line in remarks) + cameras_text(cameras)

    def write(part: Path) -> None:
        part.write_text(text, encoding="utf-8", newline="\n")

    def verify(part: Path) -> None:
        if read_cameras(part) != {name: dict(table) for name, table in cameras.items()}:
            raise MachineError("the calibration reads back differently", where=path, advice="check the disk")

    publish(path, write, verify, overwrite=overwrite)


def read_cameras(path: Path) -> dict[str, dict[str, Any]]:
    """Return the tables of cameras in a file that `write_calibration` wrote, checked.

    Raises
    ------
    ConfigError
        Not TOML, other tables than [cameras.left] and [cameras.right], or an impossible calibration.
    InputError
        The file cannot be read.
    """
    document = read_toml(path)
    cameras = document.get("cameras")
    if set(document) != {"cameras"} or not isinstance(cameras, dict) or set(cameras) != {"left", "right"}:
        raise ConfigError("is not a calibration: it needs the tables [cameras.left] and [cameras.right] alone",
                          where=path, advice="write one with linework calibrate")  # fmt: skip
    check_cameras(cameras, path)
    rig_of(cameras, path)
    return cameras
