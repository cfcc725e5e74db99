"""What two cameras see of a road of noise with a wall at its end: images whose rows can be checked."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image
from scipy.ndimage import gaussian_filter, map_coordinates
from tests.scenes.image_folders import camera_toml

from linework.arrays import AnyArray

SIZE, FOCAL_PX, BASE_M, HEIGHT_M = (320, 240), 250.0, 0.5, 1.6
TRAJECTORY = "time_s,easting_m,northing_m,height_m,roll_deg,pitch_deg,heading_deg\n"


def road_view(
    x_m: float, ahead_m: float, *, row_offset: float = 0.0, grain_m: tuple[float, float] = (0.05, 0.2)
) -> AnyArray:
    """Return what a camera `x_m` to the right sees of a road of noise and a wall 40 m ahead, having driven on.

    The grain is that of the road and of the wall.
    """
    texture = gaussian_filter(np.random.default_rng(5).normal(size=(800, 800)), 1.0)
    col, row = np.meshgrid(np.arange(SIZE[0]) - SIZE[0] / 2 + 0.5, np.arange(SIZE[1]) - 60.0 + row_offset)
    with np.errstate(divide="ignore"):
        road = np.where(row > 0.0, FOCAL_PX * HEIGHT_M / np.maximum(row, 1e-9), np.inf)
    wall = 40.0 - ahead_m
    depth = np.minimum(road, wall)
    x, y = x_m + col * depth / FOCAL_PX, row * depth / FOCAL_PX
    is_wall = road >= wall
    on_road, on_wall = grain_m
    u = np.where(is_wall, x / on_wall, x / on_road)
    v = np.where(is_wall, y / on_wall + 400, (depth + ahead_m) / on_road)
    values = map_coordinates(texture, [v % 799, u % 799], order=1)
    return np.clip(128 + 120 * values, 0, 255).astype(np.uint8)


def views_folder(folder: Path, n: int = 8, *, grain_m: tuple[float, float] = (0.05, 0.2)) -> Path:
    """Write a survey folder of n pairs, a metre and a tenth of a second apart, and return it."""
    for side, x in (("left", 0.0), ("right", BASE_M)):
        (folder / side).mkdir(parents=True)
        rows = ["file,time_s"]
        for i in range(n):
            Image.fromarray(road_view(x, float(i), grain_m=grain_m)).save(folder / side / f"{i:06d}.png")
            rows.append(f"{side}/{i:06d}.png,{0.1 * i:.1f}")
        (folder / f"{side}.csv").write_text("\n".join(rows) + "\n")
    tables = [
        camera_toml(
            side, width=SIZE[0], height=SIZE[1], fx=FOCAL_PX, fy=FOCAL_PX, cx=SIZE[0] / 2 - 0.5, cy=60.0,
            position_m=[1.0, y, HEIGHT_M],
        )
        for side, y in (("left", 0.0), ("right", -BASE_M))
    ]  # fmt: skip
    poses = [f"{0.1 * i:.1f},{500_000 + i},5400000,100,0,0,90\n" for i in range(-1, n + 1)]
    (folder / "trajectory.csv").write_text(TRAJECTORY + "".join(poses))
    head = 'name = "views"\ncrs = "EPSG:25832"\n[trajectory]\nfile = "trajectory.csv"\n'
    (folder / "survey.toml").write_text(head + "".join(tables))
    return folder
