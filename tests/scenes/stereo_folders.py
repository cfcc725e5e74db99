"""A made-up survey folder of stereo pairs: grey images of noise, cameras side by side, a van that drives east."""

import numpy as np
from PIL import Image

SIZE = (64, 48)
TOML = """\
name = "made up"
crs = "EPSG:25832"
[trajectory]
file = "trajectory.csv"
[cameras.left]
images = "left.csv"
{camera}
position_m = [1.0, 0.25, 1.6]
[cameras.right]
images = "right.csv"
{camera}
position_m = [1.0, -0.25, 1.6]
"""
CAMERA = """\
model = "pinhole"
width = 64
height = 48
fx = 60.0
fy = 60.0
cx = 31.5
cy = 23.5
distortion = [0, 0, 0, 0, 0]
rotation_wxyz = [0.5, -0.5, 0.5, -0.5]"""


def make_stereo_folder(folder, *, n_pairs=6, times=None, pose_times=None, with_attitude=True, toml=None):
    """Write the folder; pair k is taken at second k, where the van is 10 k metres along."""
    rng = np.random.default_rng(0)
    times = np.arange(n_pairs, dtype=float) if times is None else np.asarray(times, dtype=float)
    for side in ("left", "right"):
        (folder / side).mkdir(parents=True)
        rows = ["file,time_s"]
        for k, time_s in enumerate(times):
            image = rng.integers(60, 120, SIZE[::-1], dtype=np.uint8)
            Image.fromarray(image).save(folder / side / f"{k:06d}.png")
            rows.append(f"{side}/{k:06d}.png,{time_s:.3f}")
        (folder / f"{side}.csv").write_text("\n".join(rows) + "\n")
    pose_times = np.arange(-1.0, n_pairs + 1.0, 0.5) if pose_times is None else np.asarray(pose_times)
    head = "time_s,easting_m,northing_m,height_m" + (
        ",roll_deg,pitch_deg,heading_deg" if with_attitude else ""
    )
    tail = ",0,0,90" if with_attitude else ""
    poses = [f"{t:.3f},{500000 + 10 * t:.3f},5400000,100{tail}" for t in pose_times]
    (folder / "trajectory.csv").write_text("\n".join([head, *poses]) + "\n")
    (folder / "survey.toml").write_text((toml or TOML).format(camera=CAMERA))
    return folder
