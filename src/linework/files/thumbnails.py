"""Small pictures of images, for pages."""

from __future__ import annotations

import io
from pathlib import Path
from typing import BinaryIO

import numpy as np
import PIL.Image

from linework.files.images import image_errors, open_image
from linework.files.las_header import regular_file_bytes

#: Longer side of a thumbnail: 3 to 6 kB each. [pixels]
THUMBNAIL_PX = 160
_JPEG_QUALITY = 70


def thumbnail(path: Path) -> bytes:
    """Return an image made small, as JPEG; in colour where it is.

    Raises
    ------
    InputError
        Missing, no image, cut off, absurdly large.
    """
    regular_file_bytes(path)
    with image_errors(path), path.open("rb") as file:
        return thumbnail_of(file, path)


def thumbnail_of(file: BinaryIO, path: Path) -> bytes:
    """Return an opened image made small (see `thumbnail`)."""
    with image_errors(path), open_image(file, path) as image:
        # Decodes a JPEG at an eighth to the full size, whichever is enough
        image.draft("RGB", (2 * THUMBNAIL_PX, 2 * THUMBNAIL_PX))
        image.load()
        small = _eight_bits(image)
        small.thumbnail((THUMBNAIL_PX, THUMBNAIL_PX), reducing_gap=3.0)
        kept = io.BytesIO()
        small.save(kept, format="JPEG", quality=_JPEG_QUALITY)
        return kept.getvalue()


def _eight_bits(image: PIL.Image.Image) -> PIL.Image.Image:
    """Return the image in grey or red, green, blue of 8 bits; of 16 bits the upper 8, as `read_image` has them."""
    if image.mode.startswith("I"):
        values = np.clip(np.asarray(image), 0, 0xFFFF)
        return PIL.Image.fromarray((values >> 8).astype(np.uint8))
    return image.copy() if image.mode in ("L", "RGB") else image.convert("RGB")
