"""The stereo images of a simulated survey as part of its folder."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from scipy.spatial.transform import Rotation

from linework.files.image_write import write_grey_png
from linework.model.camera import Camera, StereoRig
from linework.simulation.cameras import StereoDrive, images_of


def write_images(drive: StereoDrive, folder: Path, advance: Callable[[int, int], None] | None = None) -> None:
    """Write left/000000.png and so on, the same for right, and the lists left.csv and right.csv.

    Parameters
    ----------
    advance
        Told how many pairs are written, and how many there are.
    """
    lists = {"left": ["file,time_s"], "right": ["file,time_s"]}
    for side in lists:
        (folder / side).mkdir()
    for pair in images_of(drive):
        for side, image in (("left", pair.left), ("right", pair.right)):
            name = f"{side}/{pair.number:06d}.png"
            write_grey_png(image, folder / name)
            lists[side].append(f"{name},{pair.time_s:.6f}")
        if advance:
            advance(pair.number + 1, len(drive))
    for side, lines in lists.items():
        (folder / f"{side}.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")


def cameras_toml(rig: StereoRig) -> str:
    """Return the tables [cameras.left] and [cameras.right] of a survey.toml."""
    return _camera_toml("left", rig.left) + _camera_toml("right", rig.right)


def _camera_toml(side: str, camera: Camera) -> str:
    x, y, z, w = Rotation.from_matrix(camera.R_vehicle_camera).as_quat()
    return f"""
[cameras.{side}]
images = "{side}.csv"
model = "pinhole"
width = {camera.width}
height = {camera.height}
fx = {camera.fx!r}
fy = {camera.fy!r}
cx = {camera.cx!r}
cy = {camera.cy!r}
distortion = {[float(k) for k in camera.distortion]}
position_m = {camera.position_m.tolist()}
rotation_wxyz = {[float(value) for value in (w, x, y, z)]}
"""
