"""Faults of images and their lists, put in on purpose: each one line, the rest of the survey done."""

from __future__ import annotations

import io
import json
import struct
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from tests.scenes.road_views import SIZE, views_folder


@pytest.fixture(scope="module")
def views(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """Return the files of a survey folder of six pairs, made once."""
    folder = views_folder(tmp_path_factory.mktemp("views") / "views", 6)
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


@pytest.fixture
def folder(views: dict[str, bytes], tmp_path: Path) -> Path:
    """Return a folder of these files, to be harmed."""
    for name, content in views.items():
        path = tmp_path / "drive" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    return tmp_path / "drive"


@pytest.fixture
def extracted(linework: Any, folder: Path, tmp_path: Path) -> Callable[[], tuple[Any, dict[str, Any]]]:
    """Return a function that extracts from the folder and gives the outcome and its record."""

    def run() -> tuple[Any, dict[str, Any]]:
        output = tmp_path / "lines.gpkg"
        found = linework("extract", folder, "-o", output, "--workers", 1, "--quiet")
        record = tmp_path / "run.json"
        return found, json.loads(record.read_text()) if record.is_file() else {}

    return run


def _as_jpeg(path: Path, **how: Any) -> bytes:
    kept = io.BytesIO()
    with Image.open(path) as image:
        image.save(kept, format="JPEG", quality=95, **how)
    return kept.getvalue()


def _turned_by_exif(path: Path) -> None:
    exif = Image.Exif()
    exif[0x0112] = 6
    path.write_bytes(_as_jpeg(path, exif=exif))


def _grey_tail(path: Path) -> None:
    data = _as_jpeg(path)
    path.write_bytes(data[: len(data) // 2] + b"\xff\xd9")


def _cut_jpeg(path: Path) -> None:
    data = _as_jpeg(path)
    path.write_bytes(data[: len(data) // 2])


def _cut_png(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-600])


def _half_size(path: Path) -> None:
    Image.new("L", (SIZE[0] // 2, SIZE[1] // 2), 90).save(path)


def _bomb(path: Path) -> None:
    def chunk(name: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    head = struct.pack(">IIBBBBB", 30_000, 30_000, 8, 0, 0, 0, 0)
    data = zlib.compress(b"\0" * 10_000_000)
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", data) + chunk(b"IEND", b""))


def _tiff_bomb(path: Path) -> None:
    entries = [(256, 65_535), (257, 65_535), (258, 8), (259, 1), (262, 1), (273, 8), (277, 1), (278, 65_535)]
    body = b"".join(struct.pack("<HHII", tag, 4, 1, value) for tag, value in entries)
    path.write_bytes(b"II*\0" + struct.pack("<IH", 8, len(entries)) + body + b"\0\0\0\0")


def _web_page(path: Path) -> None:
    path.write_text("<html>404</html>")


@pytest.mark.parametrize(
    ("harm", "told"),
    [
        (_half_size, "160 x 120 pixels, the calibration says 320 x 240"),
        (_turned_by_exif, "Exif orientation 6 asks for a rotation"),
        (_cut_jpeg, "JPEG cut off"),
        (_grey_tail, "are one grey"),
        (_cut_png, "PNG cut off"),
        (_bomb, "image of more than 89,478,485 pixels"),
        (_tiff_bomb, "the calibration says 320 x 240"),
        (_web_page, "not an image"),
    ],
)
def test_one_bad_image_costs_its_pair(
    extracted: Any, folder: Path, harm: Callable[[Path], None], told: str
) -> None:
    harm(folder / "left/000002.png")
    found, record = extracted()
    assert found.code == 4
    assert told in found.line and "000002.png" in found.line and "1 of 6 stereo pairs left out" in found.line
    assert record["counts"]["stereo_pairs_used"] == 5
    problem = record["failures"][0]["problem"]
    assert "\n" not in problem and len(problem) <= 300 + len(str(folder)) and problem.endswith(".")


@pytest.mark.parametrize(
    "exif", [b"Exif\0\0II*\0\xff\xff\xff\xff", b"Exif\0\0MM\0*\0\0\0\x08\0\x01\x01\x12garbage"]
)
def test_damaged_exif_is_ignored(extracted: Any, folder: Path, exif: bytes) -> None:
    path = folder / "left/000002.png"
    path.write_bytes(_as_jpeg(path, exif=exif))
    found, record = extracted()
    assert found.code == 0, found.stderr
    assert record["counts"]["stereo_pairs_used"] == 6


def _lists(folder: Path) -> list[str]:
    return (folder / "right.csv").read_text().splitlines()


def test_a_frame_missing_from_a_camera_shifts_no_pair(extracted: Any, folder: Path) -> None:
    rows = _lists(folder)
    (folder / "right.csv").write_text("\n".join(rows[:3] + rows[4:]) + "\n")
    found, record = extracted()
    assert found.code == 4 and "000002.png: in no pair" in found.line
    assert record["counts"]["stereo_pairs_used"] == 5


def test_an_order_off_by_one_is_refused(extracted: Any, folder: Path) -> None:
    head, *rows = _lists(folder)
    files, times = zip(*(row.split(",") for row in rows), strict=True)
    moved = [f"{file},{time}" for file, time in zip(files[1:], times, strict=False)]
    (folder / "right.csv").write_text("\n".join([head, *moved]) + "\n")
    found, record = extracted()
    assert found.code == 3 and record == {}
    assert "left and right images were not taken at the same time" in found.line
    assert "the previous right image fits better" in found.line


def test_swapped_images_are_refused(extracted: Any, folder: Path) -> None:
    text = (folder / "survey.toml").read_text()
    swapped = text.replace("left.csv", "x.csv").replace("right.csv", "left.csv").replace("x.csv", "right.csv")
    (folder / "survey.toml").write_text(swapped)
    found, _ = extracted()
    assert found.code == 3 and "the images of the two cameras are swapped" in found.line


@pytest.mark.parametrize(
    ("was", "is_now", "told"),
    [
        ("fx = 250.0\n", "", "cameras.left.fx is missing"),
        ("fx = 250.0", "fx = 0.0", "cameras.left.fx is 0.0"),
        ("fx = 250.0", "fx = nan", "cameras.left.fx is nan"),
        ("[0.5, -0.5, 0.5, -0.5]", "[0.5, -0.5, 0.5, 0.9]", "cameras.left.rotation_wxyz"),
        ("[cameras.right]", "[cameras.middle]", "cameras.middle"),
        ("position_m = [1.0, -0.5, 1.6]", "position_m = [1.0, 0.5, 1.6]", "swapped"),
        ("position_m = [1.0, -0.5, 1.6]", "position_m = [1.0, 0.0, 1.6]", "base of 0.0000 m"),
    ],
)
def test_an_impossible_calibration_names_its_key(
    extracted: Any, folder: Path, was: str, is_now: str, told: str
) -> None:
    text = (folder / "survey.toml").read_text()
    assert was in text
    (folder / "survey.toml").write_text(text.replace(was, is_now, 1))
    found, _ = extracted()
    assert found.code == 3 and "survey.toml" in found.line and told in found.line


def test_a_clock_set_back_leaves_its_doubled_times_out(extracted: Any, folder: Path) -> None:
    for side in ("left", "right"):
        text = (folder / f"{side}.csv").read_text()
        # The clock is set back by 0.15 s before the fifth image
        (folder / f"{side}.csv").write_text(text.replace(",0.4", ",0.25").replace(",0.5", ",0.35"))
    found, record = extracted()
    assert "time runs backwards 1 times, first from 0.300 to 0.250 s at 000004.png" in found.stderr
    assert record["counts"]["stereo_pairs_used"] == 4
    assert len(record["failures"]) == 4


def test_folders_in_circles_and_strange_names_end(extracted: Any, folder: Path) -> None:
    (folder / "left/again").symlink_to(folder / "left")
    (folder / "left/000009.PNG.part").write_bytes(b"x")
    (folder / "right/000003.png").rename(folder / "right/000003.PNG")
    text = (folder / "survey.toml").read_text()
    for side in ("left", "right"):
        text = text.replace(f'"{side}.csv"', f'"**/{side}/*.png"\nrate_hz = 10.0')
    (folder / "survey.toml").write_text(text)
    found, record = extracted()
    assert found.code == 0, found.stderr
    assert record["counts"]["stereo_pairs_used"] == 6


def test_a_camera_without_images_is_refused(extracted: Any, folder: Path) -> None:
    for path in (folder / "right").iterdir():
        path.unlink()
    found, _ = extracted()
    assert found.code == 3 and "cameras.right has no image" in found.line


def test_noise_for_images_is_no_fault(extracted: Any, folder: Path) -> None:
    random = np.random.default_rng(0)
    for path in (folder / "left").iterdir():
        Image.fromarray(random.integers(0, 256, SIZE[::-1]).astype(np.uint8)).save(path)
    found, record = extracted()
    assert found.code == 0, found.stderr
    assert record["counts"]["stereo_pairs_used"] == 6
