"""Small survey folders with stereo images, made up: for tests of what reads them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image

WIDTH, HEIGHT = 64, 48
#: A level camera that looks straight ahead.
AHEAD = (0.5, -0.5, 0.5, -0.5)


def camera_toml(side: str, **changed: object) -> str:
    """Return the table of a camera; keys given as None are left out."""
    values: dict[str, object] = {
        "images": f"{side}.csv", "width": WIDTH, "height": HEIGHT, "fx": 50.0, "fy": 50.0, "cx": 31.5,
        "cy": 23.5, "position_m": [1.0, 0.25 if side == "left" else -0.25, 2.0], "rotation_wxyz": list(AHEAD),
    }  # fmt: skip
    values |= changed
    lines = [f"{k} = {repr(v).replace(chr(39), chr(34))}" for k, v in values.items() if v is not None]
    return f"[cameras.{side}]\n" + "\n".join(lines) + "\n"


def picture(seed: int, size: tuple[int, int] = (WIDTH, HEIGHT)) -> Image.Image:
    """Return a grey image of noise, as cameras have it everywhere."""
    noise = np.random.default_rng(seed).integers(40, 200, size=(size[1], size[0]))
    return Image.fromarray(noise.astype(np.uint8))


def write_images(folder: Path, side: str, times: Sequence[float], suffix: str = ".png") -> None:
    """Write the images of one camera and their list."""
    (folder / side).mkdir(parents=True, exist_ok=True)
    rows = ["file,time_s"]
    for i, time_s in enumerate(times):
        name = f"{side}/{i:06d}{suffix}"
        picture(i).save(folder / name)
        rows.append(f"{name},{time_s!r}")
    (folder / f"{side}.csv").write_text("\n".join(rows) + "\n")


def stereo_folder(
    folder: Path, left_s: Sequence[float], right_s: Sequence[float] | None = None, more: str = ""
) -> Path:
    """Write a survey folder with images of two cameras, and return it."""
    for side, times in (("left", left_s), ("right", left_s if right_s is None else right_s)):
        write_images(folder, side, times)
    (folder / "survey.toml").write_text(
        'name = "stereo"\ncrs = "local"\n' + more + camera_toml("left") + camera_toml("right")
    )
    return folder
