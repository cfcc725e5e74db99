"""Stereo drives with their images, kept on disk: drawing them takes longer than working on them."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from linework.arrays import AnyArray
from linework.model.lines import LineSet
from linework.simulation.roads.draw import draw_scenario
from linework.simulation.sensors.cameras import StereoDrive, images_of, stereo_survey, stereo_truth

#: To be counted up when the pictures change.
VERSION = 1
FOLDER = Path(tempfile.gettempdir()) / "linework-stereo-sets"


@dataclass(frozen=True)
class StereoSet:
    """A drive, its truth (`observed`: in images), and its images, (n, height, width) uint8 each."""

    drive: StereoDrive
    truth: LineSet
    left: AnyArray
    right: AnyArray


def stereo_set(
    road: str,
    seed: int,
    size: str = "1240x376",
    *,
    length_m: float = 100.0,
    every_m: float = 3.0,
    rays_per_pixel: int = 4,
    folder: Path = FOLDER,
) -> StereoSet:
    """Return one drive with all its images, from `folder` where it is there already."""
    drive = stereo_survey(
        draw_scenario(road, seed, length_m), size=size, every_m=every_m, rays_per_pixel=rays_per_pixel
    )
    path = folder / f"{road}-{seed}-{size}-{length_m:g}m-{every_m:g}m-{rays_per_pixel}-v{VERSION}.npz"
    if not path.exists():
        folder.mkdir(parents=True, exist_ok=True)
        pairs = list(images_of(drive))
        part = path.with_suffix(".part.npz")
        np.savez_compressed(part, left=[p.left for p in pairs], right=[p.right for p in pairs])
        part.replace(path)
    with np.load(path) as held:
        return StereoSet(drive, stereo_truth(drive), held["left"], held["right"])
