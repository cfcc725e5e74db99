"""Images of a survey for the browser: decoded and re-encoded, so that no file is sent to a page as it is."""

from __future__ import annotations

import io
import os
import stat
from pathlib import Path
from typing import BinaryIO

import numpy as np

from linework.errors import InputError, extra_needed
from linework.files.handles import NOT_WAITING
from linework.files.images.read import DAMAGED, decoded_image, image_errors, most_bytes, open_image
from linework.files.input import filled_file_bytes
from linework.model.camera import Camera

with extra_needed("stereo"):
    import PIL.Image

#: JPEG quality at which edges of paint look sharp, with an eighth of the bytes of a PNG.
_JPEG_QUALITY = 90


def screen_image(path: Path, camera: Camera, root: Path) -> bytes:
    """Return an image of a camera, unrectified, as JPEG; in colour where it has colour.

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
    """Return a thumbnail of an image of a camera (see `screen_image`, `image_thumbnail`)."""
    return thumbnail_of(io.BytesIO(read_inside(path, root, most_bytes(camera))), path)


def read_inside(path: Path, root: Path, most: int) -> bytes:
    """Read a file of the survey's folder, or of a folder outside that the survey names; links out are refused.

    Parameters
    ----------
    path
        Path as the survey names it.
    most
        Larger files are refused. [bytes]

    Raises
    ------
    InputError
        Missing, not a regular file, too large, or a link out of the folder.

    Notes
    -----
    The opened file itself is checked, so that changing a link meanwhile has no effect.
    """
    try:
        data = _read(path, root, most)
    except OSError as error:
        # One message for refused and missing files, so that nothing is revealed
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
    # Non-blocking: opening a pipe would wait for a writer
    with open(path, "rb", opener=lambda name, flags: os.open(name, flags | NOT_WAITING)) as file:
        status = os.fstat(file.fileno())
        if not stat.S_ISREG(status.st_mode) or not _is_inside(path, root, status):
            raise PermissionError(path)
        return file.read(most + 1)


def _is_inside(path: Path, root: Path, opened: os.stat_result) -> bool:
    """Return whether the opened file lies in the root, or in the folder outside that its name gives."""
    # Not resolved: whether the name itself, links aside, points into the folder
    named, plain_root = (Path(os.path.normpath(p.absolute())) for p in (path, root))
    real_root, real = root.resolve(), path.resolve()
    is_named_inside = named.is_relative_to(plain_root) or named.is_relative_to(real_root)
    allowed = real_root if is_named_inside else named.parent.resolve()
    return real.is_relative_to(allowed) and os.path.samestat(opened, real.lstat())


#: Longer side of a thumbnail [pixels]; 3 to 6 kB each.
THUMBNAIL_PX = 160
_THUMBNAILS_JPEG_QUALITY = 70


def image_thumbnail(path: Path) -> bytes:
    """Return a thumbnail of an image, as JPEG; in colour where it has colour.

    Raises
    ------
    InputError
        Missing, not an image, cut off, absurdly large.
    """
    filled_file_bytes(path, DAMAGED)
    with image_errors(path), path.open("rb") as file:
        return thumbnail_of(file, path)


def thumbnail_of(file: BinaryIO, path: Path) -> bytes:
    """Return a thumbnail of an opened image (see `image_thumbnail`)."""
    with image_errors(path), open_image(file, path) as image:
        # Decodes a JPEG at the smallest sufficient scale, from an eighth
        image.draft("RGB", (2 * THUMBNAIL_PX, 2 * THUMBNAIL_PX))
        image.load()
        small = _eight_bits(image)
        small.thumbnail((THUMBNAIL_PX, THUMBNAIL_PX), reducing_gap=3.0)
        kept = io.BytesIO()
        small.save(kept, format="JPEG", quality=_THUMBNAILS_JPEG_QUALITY)
        return kept.getvalue()


def _eight_bits(image: PIL.Image.Image) -> PIL.Image.Image:
    """Return the image as 8 bits grey or RGB; of 16 bits the upper 8, as in `read_image`."""
    if image.mode.startswith("I"):
        values = np.clip(np.asarray(image), 0, 0xFFFF)
        return PIL.Image.fromarray((values >> 8).astype(np.uint8))
    return image.copy() if image.mode in ("L", "RGB") else image.convert("RGB")
