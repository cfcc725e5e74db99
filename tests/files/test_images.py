"""Stereo images as grey values: what is not whole, or of another size, is refused in one line."""

from __future__ import annotations

import io
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from tests.scenes.image_folders import HEIGHT, WIDTH, picture

from linework.errors import InputError
from linework.files.images.read import read_image
from linework.model.camera import Camera

CAMERA = Camera(width=WIDTH, height=HEIGHT, fx=50.0, fy=50.0, cx=31.5, cy=23.5)


def _refused(path: Path, camera: Camera = CAMERA) -> str:
    with pytest.raises(InputError) as caught:
        read_image(path, camera)
    text = str(caught.value)
    assert text.startswith(str(path)) and "\n" not in text and len(text) <= 300 + len(str(path))
    return text


@pytest.mark.parametrize("suffix", [".png", ".tif", ".bmp", ".pgm"])
def test_grey_values_come_back_exactly(tmp_path: Path, suffix: str) -> None:
    picture(1).save(tmp_path / f"a{suffix}")
    values = read_image(tmp_path / f"a{suffix}", CAMERA)
    assert values.dtype == np.uint8 and values.shape == (HEIGHT, WIDTH)
    np.testing.assert_array_equal(values, np.asarray(picture(1)))


def test_colour_becomes_grey_as_the_standard_weighs_it(tmp_path: Path) -> None:
    colour = np.random.default_rng(0).integers(0, 256, size=(HEIGHT, WIDTH, 3)).astype(np.uint8)
    Image.fromarray(colour).save(tmp_path / "a.png")
    expected = colour @ np.array([0.299, 0.587, 0.114])
    np.testing.assert_allclose(read_image(tmp_path / "a.png", CAMERA), expected, atol=1.0)


def test_the_upper_byte_of_16_bits_counts(tmp_path: Path) -> None:
    values = np.random.default_rng(0).integers(0, 1 << 16, size=(HEIGHT, WIDTH)).astype(np.uint16)
    Image.fromarray(values).save(tmp_path / "a.png")
    np.testing.assert_array_equal(read_image(tmp_path / "a.png", CAMERA), values // 256)


def test_12_bits_in_16_are_refused(tmp_path: Path) -> None:
    values = np.random.default_rng(0).integers(0, 1 << 12, size=(HEIGHT, WIDTH)).astype(np.uint16)
    Image.fromarray(values).save(tmp_path / "a.tif")
    assert "12 bits or fewer" in _refused(tmp_path / "a.tif")


def test_another_size_than_the_calibration_is_refused(tmp_path: Path) -> None:
    picture(1, (WIDTH // 2, HEIGHT)).save(tmp_path / "a.png")
    assert f"{WIDTH // 2} x {HEIGHT} pixels, the calibration says {WIDTH} x {HEIGHT}" in _refused(
        tmp_path / "a.png"
    )


@pytest.mark.parametrize("size", [(WIDTH, HEIGHT), (HEIGHT, WIDTH)])
def test_an_image_to_be_turned_is_refused(tmp_path: Path, size: tuple[int, int]) -> None:
    exif = Image.Exif()
    exif[0x0112] = 6
    picture(1, size).save(tmp_path / "a.jpg", exif=exif)
    assert "turned" in _refused(tmp_path / "a.jpg") and "6" in _refused(tmp_path / "a.jpg")


@pytest.mark.parametrize("exif", [b"Exif\0\0II*\0\xff\xff\xff\xff", b"Exif\0\0garbage", b"Exif\0\0"])
def test_damaged_exif_is_ignored(tmp_path: Path, exif: bytes) -> None:
    picture(1).save(tmp_path / "a.jpg", exif=exif, quality=95)
    assert read_image(tmp_path / "a.jpg", CAMERA).shape == (HEIGHT, WIDTH)


@pytest.mark.parametrize("year", ["1970", "2080", "0000", "9999"])
@pytest.mark.parametrize("latitude", [(0, 0), (1, 0), (4_294_967_295, 1)], ids=["NaN", "infinite", "huge"])
def test_places_and_dates_in_exif_are_not_read(tmp_path: Path, year: str, latitude: tuple[int, int]) -> None:
    """Times and places come from the lists and the trajectory: what Exif says of them cannot mislead."""
    # Big-endian: one directory with the date and a pointer to that of the place, which holds a latitude
    date = f"{year}:01:01 00:00:00\0".encode()
    head = struct.pack(">2sHI HHHII HHII I", b"MM", 42, 8, 2, 0x0132, 2, 20, 38, 0x8825, 4, 1, 58, 0)
    place = struct.pack(">H HHII I 6I", 1, 2, 5, 3, 76, 0, *latitude, 0, 1, 0, 1)
    exif = b"Exif\0\0" + head + date + place
    read_back = Image.Exif()
    read_back.load(exif)
    assert read_back[0x0132].startswith(year) and len(read_back.get_ifd(0x8825)[2]) == 3
    picture(1).save(tmp_path / "plain.png")
    picture(1).save(tmp_path / "a.png", exif=exif)
    assert np.array_equal(read_image(tmp_path / "a.png", CAMERA), read_image(tmp_path / "plain.png", CAMERA))


@pytest.mark.parametrize("share", [0.02, 0.3, 0.5, 0.9, 0.98])
@pytest.mark.parametrize("suffix", [".png", ".jpg", ".tif", ".bmp", ".pgm"])
def test_an_image_cut_off_is_refused(tmp_path: Path, suffix: str, share: float) -> None:
    picture(1).save(tmp_path / f"a{suffix}")
    data = (tmp_path / f"a{suffix}").read_bytes()
    (tmp_path / f"a{suffix}").write_bytes(data[: int(len(data) * share)])
    _refused(tmp_path / f"a{suffix}")


@pytest.mark.parametrize("end", [b"\xff\xd9", b"\0" * 500 + b"\xff\xd9"])
def test_a_grey_tail_behind_a_made_up_end_is_refused(tmp_path: Path, end: bytes) -> None:
    picture(1, (WIDTH, 96)).save(tmp_path / "a.jpg", quality=90)
    data = (tmp_path / "a.jpg").read_bytes()
    (tmp_path / "a.jpg").write_bytes(data[: len(data) // 2] + end)
    told = _refused(tmp_path / "a.jpg", Camera(width=WIDTH, height=96, fx=50.0, fy=50.0, cx=31.5, cy=47.5))
    assert "one grey" in told or "damaged" in told


def test_a_grey_tail_saved_as_png_is_refused(tmp_path: Path) -> None:
    values = np.array(picture(1))
    values[HEIGHT // 2 :] = 128
    Image.fromarray(values).save(tmp_path / "a.png")
    assert f"rows {HEIGHT // 2} to {HEIGHT - 1} are one grey (128)" in _refused(tmp_path / "a.png")
    values[HEIGHT // 2 :] = 0
    Image.fromarray(values).save(tmp_path / "b.png")
    assert read_image(tmp_path / "b.png", CAMERA)[-1].max() == 0


def test_a_thumbnails_end_is_not_the_images(tmp_path: Path) -> None:
    small = io.BytesIO()
    picture(2, (16, 16)).save(small, format="JPEG")
    picture(1).save(tmp_path / "a.jpg", exif=b"Exif\0\0" + small.getvalue())
    data = (tmp_path / "a.jpg").read_bytes()
    (tmp_path / "a.jpg").write_bytes(data[:-20])
    assert "no end" in _refused(tmp_path / "a.jpg")


def test_a_flipped_byte_in_a_png_is_refused(tmp_path: Path) -> None:
    picture(1).save(tmp_path / "a.png")
    data = bytearray((tmp_path / "a.png").read_bytes())
    data[len(data) // 2] ^= 4
    (tmp_path / "a.png").write_bytes(bytes(data))
    assert "checksum" in _refused(tmp_path / "a.png")


def _png_of_zeros(width: int, height: int) -> bytes:
    def chunk(name: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    head = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    data = zlib.compress(b"\0" * 1000)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", data) + chunk(b"IEND", b"")


@pytest.mark.parametrize("size", [(5000, 5000), (30_000, 30_000), (2**31 - 1, 2**31 - 1)])
def test_a_bomb_is_refused_by_its_header(tmp_path: Path, size: tuple[int, int]) -> None:
    (tmp_path / "a.png").write_bytes(_png_of_zeros(*size))
    assert f"the calibration says {WIDTH} x {HEIGHT}" in _refused(tmp_path / "a.png")


def test_a_tiff_that_claims_65535_pixels_is_refused(tmp_path: Path) -> None:
    entries = [(256, 65_535), (257, 65_535), (258, 8), (259, 1), (262, 1), (273, 8), (277, 1), (278, 65_535)]
    body = b"".join(struct.pack("<HHII", tag, 4, 1, value) for tag, value in entries)
    head = b"II*\0" + struct.pack("<IH", 8, len(entries))
    (tmp_path / "a.tif").write_bytes(head + body + b"\0\0\0\0")
    assert "the calibration says" in _refused(tmp_path / "a.tif")


@pytest.mark.parametrize(
    "content", [b"", b"<html>404</html>", b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff\xe0", b"II*\0\xff\xff\xff\xff"]
)
def test_what_is_no_image_is_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "a.png").write_bytes(content)
    _refused(tmp_path / "a.png")


def test_a_missing_image_a_folder_and_a_huge_file_are_refused(tmp_path: Path) -> None:
    assert "cannot be opened" in _refused(tmp_path / "a.png")
    assert "not a regular file" in _refused(tmp_path)
    with (tmp_path / "big.png").open("wb") as file:
        file.truncate(1 << 30)
    assert "1,073,741,824 bytes" in _refused(tmp_path / "big.png")


def test_random_damage_is_one_line_or_an_image(tmp_path: Path) -> None:
    random = np.random.default_rng(7)
    path = tmp_path / "a.img"
    for kind in ("PNG", "JPEG", "TIFF", "BMP"):
        kept = io.BytesIO()
        picture(3).save(kept, format=kind)
        for _ in range(60):
            data = bytearray(kept.getvalue())
            for place in random.integers(0, len(data), size=3):
                data[place] = random.integers(0, 256)
            path.write_bytes(bytes(data))
            try:
                assert read_image(path, CAMERA).shape == (HEIGHT, WIDTH)
            except InputError as error:
                assert "\n" not in str(error)
