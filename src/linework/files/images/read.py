"""Read stereo images: only of the size that the calibration states, and only complete ones."""

from __future__ import annotations

import contextlib
import io
import warnings
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from linework.arrays import AnyArray
from linework.errors import InputError, needed
from linework.files.input import filled_file_bytes
from linework.model.camera import Camera, StereoRig
from linework.model.images import ImagePair

if TYPE_CHECKING:
    import PIL.Image

#: Formats that cameras write; Pillow's fifty other decoders are not needed.
_FORMATS = ("PNG", "JPEG", "TIFF", "BMP", "PPM")
#: Largest file: 16 bits of red, green, blue and alpha per pixel, uncompressed, and 16 MB of metadata.
_MAX_BYTES_PER_PIXEL, _MAX_NOTES_BYTES = 8, 1 << 24
_ORIENTATION = 0x0112


def read_pair(pair: ImagePair, rig: StereoRig) -> tuple[AnyArray, AnyArray]:
    """Read both images of a pair as grey values.

    Returns
    -------
    left, right
        (height, width) uint8, of the sizes of the calibration.

    Raises
    ------
    InputError
        As for `read_image`.
    """
    return read_image(pair.left, rig.left), read_image(pair.right, rig.right)


def read_image(path: Path, camera: Camera) -> AnyArray:
    """Read an image of a camera as grey values, (height, width) uint8.

    Raises
    ------
    InputError
        Missing, not an image, of another size than the calibration's, rotated by its Exif, cut off, damaged.

    Notes
    -----
    Grey = 0.299 red + 0.587 green + 0.114 blue (ITU-R BT.601). Of 16 bits the upper 8 are used, in every
    image alike; images of 10 or 12 bits that were not scaled up to 16 are refused. Sizes are compared before a pixel
    is decoded. Exif that is damaged is ignored.
    """
    _check_bytes(filled_file_bytes(path, DAMAGED), path, camera)
    return decoded_image(path.read_bytes(), path, camera)


def decoded_image(data: bytes, path: Path, camera: Camera, *, in_colour: bool = False) -> AnyArray:
    """Decode an image of a camera that has been read from `path`.

    Parameters
    ----------
    in_colour
        Keep the colours of an image that has any.

    Returns
    -------
    image
        (height, width) uint8, or in colour (height, width, 3).

    Raises
    ------
    InputError
        As for `read_image`.
    """
    _check_bytes(len(data), path, camera)
    with image_errors(path, f", the calibration says {_size(camera)}"):
        return _decoded(data, path, camera, in_colour=in_colour)


def image_size(path: Path) -> tuple[int, int]:
    """Return width and height of an image by its header.

    Raises
    ------
    InputError
        Missing, not an image, absurdly large.
    """
    filled_file_bytes(path, DAMAGED)
    with image_errors(path), path.open("rb") as file, open_image(file, path) as image:
        return int(image.width), int(image.height)


def _check_bytes(n_bytes: int, path: Path, camera: Camera) -> None:
    if n_bytes == 0:
        raise InputError("empty file (0 bytes)", where=path, advice=DAMAGED)
    if n_bytes > most_bytes(camera):
        raise InputError(
            f"{n_bytes:,} bytes, too many for an image of {camera.width} x {camera.height} pixels", where=path,
            advice="check what this file is",
        )  # fmt: skip


def most_bytes(camera: Camera) -> int:
    """Return the largest size of a file of a camera's image, in bytes."""
    return camera.width * camera.height * _MAX_BYTES_PER_PIXEL + _MAX_NOTES_BYTES


def _pillow() -> Any:
    """Return Pillow's module of images, which opens all of them."""
    return needed("PIL.Image", "stereo", where="images")


@contextlib.contextmanager
def image_errors(path: Path, expected: str = "") -> Iterator[None]:
    """Turn the errors that Pillow raises for a damaged file into one line that names it."""
    pillow = _pillow()
    with warnings.catch_warnings():
        # One of Pillow's warnings is about decompression bombs, the others about damaged Exif
        warnings.simplefilter("ignore")
        warnings.simplefilter("error", pillow.DecompressionBombWarning)
        try:
            yield
        except InputError:
            raise
        except (pillow.DecompressionBombWarning, pillow.DecompressionBombError) as error:
            raise InputError(f"image of more than {pillow.MAX_IMAGE_PIXELS:,} pixels{expected}", where=path,
                             advice="check what this file is") from error  # fmt: skip
        # Decoders raise many types: SyntaxError, struct.error, KeyError, MemoryError ...
        except Exception as error:
            reason = str(error).strip("'\".").split("\n")[0][:80] or type(error).__name__
            raise InputError(f"damaged image ({reason})", where=path, advice=DAMAGED) from error


def open_image(file: BinaryIO, path: Path) -> PIL.Image.Image:
    """Return an image with its header read."""
    pillow = _pillow()
    try:
        image: PIL.Image.Image = pillow.open(file, formats=_FORMATS)
    except pillow.UnidentifiedImageError as error:
        raise InputError("not an image (PNG, JPEG, TIFF, BMP, PGM), or its header is damaged", where=path,
                         advice="check what this file is") from error  # fmt: skip
    return image


def _decoded(data: bytes, path: Path, camera: Camera, *, in_colour: bool) -> AnyArray:
    """Return the values; the size is checked before decoding, the end of the data after it."""
    with open_image(io.BytesIO(data), path) as image:
        turned = _orientation(image)
        if image.size != (camera.width, camera.height):
            by_exif = f", to be rotated (Exif orientation {turned})" if turned != 1 else ""
            raise InputError(
                f"{image.width} x {image.height} pixels{by_exif}, the calibration says {_size(camera)}",
                where=path, advice="calibrate for this size, or leave the image out",
            )  # fmt: skip
        if turned != 1:
            raise InputError(
                f"Exif orientation {turned} asks for a rotation, but the calibration holds for the image as stored",
                where=path, advice="rotate the images, or remove the tag",
            )  # fmt: skip
        check_complete(data, str(image.format), path)
        image.load()
        has_colour = image.mode not in ("L", "LA", "1", "F") and not image.mode.startswith("I")
        keeps_colour = in_colour and has_colour
        values = np.array(image.convert("RGB"), dtype=np.uint8) if keeps_colour else _grey(image, path)
    check_last_rows(values.reshape(len(values), -1), path, is_jpeg=image.format in ("JPEG", "MPO"))
    return values


def _size(camera: Camera) -> str:
    return f"{camera.width} x {camera.height}"


def _orientation(image: PIL.Image.Image) -> int:
    """Return the Exif orientation, 1 to 8; 1 where it is missing or damaged."""
    if "exif" not in image.info:
        return 1
    try:
        value = image.getexif().get(_ORIENTATION, 1)
    except Exception:
        return 1
    return value if isinstance(value, int) and 1 <= value <= 8 else 1


def _grey(image: Any, path: Path) -> AnyArray:
    """Return the grey values of an image in memory."""
    if image.mode.startswith("I"):
        values = np.asarray(image)
        if values.min() < 0 or values.max() > 0xFFFF:
            raise InputError(f"grey values from {values.min()} to {values.max()}, expected 8 or 16 bits",
                             where=path, advice="write them as 16 bits")  # fmt: skip
        if values.max() < 1 << 12:
            raise InputError(
                f"16 bits per pixel, but no value above {int(values.max())}: 12 bits or fewer in use", where=path,
                advice="scale the images to 16 bits, all alike",
            )  # fmt: skip
        return np.asarray(values >> 8, dtype=np.uint8)
    if image.mode == "F":
        raise InputError("grey values are not whole numbers", where=path, advice="write them as 16 bits")
    plain = image if image.mode == "L" else image.convert("RGB").convert("L")
    return np.array(plain, dtype=np.uint8)


#: Rows that a JPEG decoder fills at once where the data end early (one or two rows of 8 x 8 blocks).
_BLOCK_ROWS = 16
#: Grey value of blocks without data: the middle of the scale.
_MADE_UP_GREY = 128
#: Advice for damaged images.
DAMAGED = "copy the file again, or leave it out"


def check_complete(data: bytes, kind: str, path: Path) -> None:
    """Refuse a JPEG without its end and a PNG with wrong checksums, where decoders would silently fill in."""
    if kind in ("JPEG", "MPO") and data.rfind(b"\xff\xd9") < data.rfind(b"\xff\xda"):
        raise InputError(
            f"JPEG cut off after {len(data):,} bytes (it has no end)", where=path, advice=DAMAGED
        )
    if kind == "PNG":
        place, name = 8, b""
        while name != b"IEND":
            n = int.from_bytes(data[place : place + 4])
            name, end = data[place + 4 : place + 8], place + 8 + n
            if len(data) < end + 4:
                raise InputError(f"PNG cut off after {len(data):,} bytes", where=path, advice=DAMAGED)
            # Damaged metadata spoil no pixel; names of such chunks begin with a small letter
            is_needed = name[:1].isupper()
            if is_needed and zlib.crc32(data[place + 4 : end]) != int.from_bytes(data[end : end + 4]):
                raise InputError(f"damaged PNG (checksum at byte {place:,})", where=path, advice=DAMAGED)
            place = end + 4


def check_last_rows(values: AnyArray, path: Path, *, is_jpeg: bool) -> None:
    """Refuse an image whose last rows are one grey: a JPEG with its end marker whose data ended early.

    Lenses, noise and rounding leave no 16 whole rows of one value, except all black or white. Other formats may hold
    the decoded content of such a JPEG, whose rows are 128; drawn images may end in rows of another grey.
    """
    tail = values[-_BLOCK_ROWS:]
    value = int(tail[0, 0])
    is_made_up = value == _MADE_UP_GREY or (is_jpeg and 0 < value < 255)
    if is_made_up and bool(np.all(tail == value)):
        whole = np.flatnonzero(np.any(values != value, axis=1))
        first = int(whole[-1]) + 1 if len(whole) else 0
        raise InputError(
            f"rows {first} to {len(values) - 1} are one grey ({value}): the image data end early", where=path,
            advice=DAMAGED,
        )  # fmt: skip


def write_grey_png(image: AnyArray, path: Path) -> None:
    """Write a (height, width) uint8 image as PNG; the same image gives the same bytes."""
    # Level 6 of zlib: 9 saves 1 % on noisy images and takes three times as long
    _pillow().fromarray(image).save(path, format="PNG", compress_level=6)
