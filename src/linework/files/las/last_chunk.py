"""Whether the last chunk of a compressed file holds more points than its header says.

Separate from `chunks`, which reads what the file states about its chunks: for point formats 0 to 5 it states no number
of points in the last one, so that chunk is decoded once more.

References
----------
I. H. Witten, R. M. Neal, J. G. Cleary, Arithmetic coding for data compression, Commun. ACM 30(6), 1987: the decoder
runs ahead of the encoder by the width of its window, and LASzip's encoder ends a chunk with as many bytes.
"""

from __future__ import annotations

import io
import struct
from pathlib import Path
from typing import Any

import lazrs
import numpy as np

from linework.files.las.header import LasHeader

#: Records decoded at a time. [bytes]
_BUFFER_BYTES = 8 << 20


def last_chunk_warnings(path: Path, header: LasHeader) -> tuple[str, ...]:
    """Return a warning if the last chunk of a file of point format 0 to 5 holds points beyond those promised.

    The chunk of the last promised point is decoded without its last byte. All bytes of a chunk are needed for all of
    its points, and no fewer: where one can be spared, another point follows.

    Notes
    -----
    Runs where damage to the file may end the process, after all promised points were decoded.
    """
    laz = header.laz
    if laz is None or laz.last_chunk is None:
        return ()
    n_before, start, end = laz.last_chunk
    n_left = header.n_points - n_before
    # Points for whole chunks are missing: that has been said
    if n_left <= 0 or end - start < header.record_bytes:
        return ()
    with path.open("rb") as file:
        file.seek(start)
        data = file.read(end - start - 1)
    if not _can_decode(data, laz.vlr, header.record_bytes, n_left):
        return ()
    return (
        f"more points in the file than the {header.n_points:,} that its header says: the others are not read",
    )


def _can_decode(chunk: bytes, vlr: bytes, record_bytes: int, n_points: int) -> bool:
    """Return whether that many points can be decoded from the bytes of a chunk."""
    step = max(_BUFFER_BYTES // record_bytes, 1)
    buffer = np.empty(min(step, n_points) * record_bytes, np.uint8)
    try:
        decoder = lazrs.LasZipDecompressor(_OneChunk(chunk), vlr)
        for first in range(0, n_points, step):
            decoder.decompress_many(buffer[: min(step, n_points - first) * record_bytes])
    except (KeyboardInterrupt, SystemExit, MemoryError):
        raise
    except BaseException:  # lazrs panics are not Exceptions
        return False
    return True


class _OneChunk(io.RawIOBase):
    """A file of one chunk, after which there is nothing to read; its empty chunk table is far behind that."""

    _TABLE, _TABLE_BYTES = 1 << 40, 8

    def __init__(self, chunk: bytes) -> None:
        self._data, self._at = struct.pack("<q", self._TABLE) + chunk, 0

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def seek(self, offset: int, whence: int = 0, /) -> int:
        self._at = offset + (0, self._at, self._TABLE + self._TABLE_BYTES)[whence]
        return self._at

    def readinto(self, buffer: Any, /) -> int:
        view = memoryview(buffer).cast("B")
        if self._at < self._TABLE:
            part = self._data[self._at : self._at + len(view)]
        else:
            part = bytes(min(len(view), self._TABLE + self._TABLE_BYTES - self._at))
        view[: len(part)] = part
        self._at += len(part)
        return len(part)
