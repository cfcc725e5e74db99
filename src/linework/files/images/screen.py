"""Images of a survey for the screen: decoded with care and written anew, so that no file goes to a page as it is."""

from __future__ import annotations

import io
import os
import stat
from pathlib import Path
from typing import BinaryIO

import numpy as np
import PIL.Image

from linework.errors import InputError
from linework.files.images.read import DAMAGED, decoded_image, image_errors, most_bytes, open_image
from linework.files.input import filled_file_bytes
from linework.model.camera import Camera

#: Edges of paint stay as sharp as the eye sees them, at an eighth of the bytes of a PNG.
_JPEG_QUALITY = 90


def screen_image(path: Path, camera: Camera, root: Path) -> bytes:
    """Return an image of a camera as it was taken, as JPEG, in colour where it is.

    Parameters
    ----------
    root
        Folder of the survey.

    Raises
    ------
    InputError
        As for `read_image` and `read_inside`.
    """
    values = decoded_image(read_inside(path, root, most_bytes(camera)), path, camera, in_colour=True)
    kept = io.BytesIO()
    PIL.Image.fromarray(values).save(kept, format="JPEG", quality=_JPEG_QUALITY)
    return kept.getvalue()


def screen_thumbnail(path: Path, camera: Camera, root: Path) -> bytes:
    """Return an image of a camera made small (see `screen_image`, `image_thumbnail`)."""
    return thumbnail_of(io.BytesIO(read_inside(path, root, most_bytes(camera))), path)


def read_inside(path: Path, root: Path, most: int) -> bytes:
    """Read a file that lies where its name says: in the survey's folder, or in the folder that the survey names.

    Parameters
    ----------
    path
        As the survey names it.
    most
        Larger files are refused. [bytes]

    Raises
    ------
    InputError
        Missing, not a regular file, too large, or a link leads from the survey's folder to another place.

    Notes
    -----
    What is looked at is the file that was opened, so that a link that is changed meanwhile gains nothing.
    """
    try:
        data = _read(path, root, most)
    except OSError as error:
        # Whether it is refused or missing is said in the same words
        raise InputError(
            "missing, or not a file in the survey's folder", where=path.name,
            advice="check it, or name the place where it lies in the survey.toml",
        ) from error  # fmt: skip
    if len(data) > most:
        raise InputError(f"more than {most:,} bytes, too many for an image of this camera", where=path.name,
                         advice="check what this file is")  # fmt: skip
    return data


def _read(path: Path, root: Path, most: int) -> bytes:
    """Return at most one byte more than `most` of a file that is inside."""
    # Not blocking: a pipe would wait for somebody to write into it
    with open(path, "rb", opener=lambda name, flags: os.open(name, flags | os.O_NONBLOCK)) as file:
        status = os.fstat(file.fileno())
        if not stat.S_ISREG(status.st_mode) or not _is_inside(path, root, status):
            raise PermissionError(path)
        return file.read(most + 1)


def _is_inside(path: Path, root: Path, opened: os.stat_result) -> bool:
    """Return whether the file that was opened lies in the root, or in the folder that is named outside of it."""
    # Not resolved: whether the name itself, without its links, points into the folder
    named, plain_root = (Path(os.path.normpath(p.absolute())) for p in (path, root))
    real_root, real = root.resolve(), path.resolve()
    is_named_inside = named.is_relative_to(plain_root) or named.is_relative_to(real_root)
    allowed = real_root if is_named_inside else named.parent.resolve()
    return real.is_relative_to(allowed) and os.path.samestat(opened, real.lstat())


# Small pictures of images, for pages

#: Longer side of a thumbnail: 3 to 6 kB each. [pixels]
THUMBNAIL_PX = 160
_THUMBNAILS_JPEG_QUALITY = 70


def image_thumbnail(path: Path) -> bytes:
    """Return an image made small, as JPEG; in colour where it is.

    Raises
    ------
    InputError
        Missing, no image, cut off, absurdly large.
    """
    filled_file_bytes(path, DAMAGED)
    with image_errors(path), path.open("rb") as file:
        return thumbnail_of(file, path)


def thumbnail_of(file: BinaryIO, path: Path) -> bytes:
    """Return an opened image made small (see `image_thumbnail`)."""
    with image_errors(path), open_image(file, path) as image:
        # Decodes a JPEG at an eighth to the full size, whichever is enough
        image.draft("RGB", (2 * THUMBNAIL_PX, 2 * THUMBNAIL_PX))
        image.load()
        small = _eight_bits(image)
        small.thumbnail((THUMBNAIL_PX, THUMBNAIL_PX), reducing_gap=3.0)
        kept = io.BytesIO()
        small.save(kept, format="JPEG", quality=_THUMBNAILS_JPEG_QUALITY)
        return kept.getvalue()


def _eight_bits(image: PIL.Image.Image) -> PIL.Image.Image:
    """Return the image in grey or red, green, blue of 8 bits; of 16 bits the upper 8, as `read_image` has them."""
    if image.mode.startswith("I"):
        values = np.clip(np.asarray(image), 0, 0xFFFF)
        return PIL.Image.fromarray((values >> 8).astype(np.uint8))
    return image.copy() if image.mode in ("L", "RGB") else image.convert("RGB")
