"""Files by their handles: opened, and read at a place without a pointer.

The only file that uses preadv(2) and the flags of open(2) that not every system has. Handles are not inherited by
children (PEP 446).
"""

from __future__ import annotations

import io
import os
import threading
from collections.abc import Sequence
from pathlib import Path

#: Windows translates ends of lines unless it is told not to.
_BINARY: int = getattr(os, "O_BINARY", 0)
#: Opening a pipe would wait for a writer; where there is no such flag, pipes are no files either.
NOT_WAITING: int = getattr(os, "O_NONBLOCK", 0) | _BINARY
#: One at a time moves the pointer of a handle and reads, where the two cannot be one call.
_SEEKING = threading.Lock()


def open_for_reading(path: Path | str) -> int:
    """Return the handle of an existing file, open for reading bytes.

    Raises
    ------
    OSError
        It does not exist, or cannot be read.
    """
    return os.open(path, os.O_RDONLY | _BINARY)


def create_for_writing(path: Path) -> int:
    """Return the handle of a new file, open for writing bytes.

    Raises
    ------
    OSError
        It exists, or cannot be created.
    """
    return os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | _BINARY, 0o644)


def read_at(handle: int, views: Sequence[memoryview], offset: int) -> int:
    """Fill buffers one after the other from a place in a file, and return the number of bytes read.

    Parameters
    ----------
    handle
        Open for reading; several threads may read from it.
    views
        What to fill; contiguous, of any type.
    offset
        Where the first of them begins in the file. [bytes]

    Returns
    -------
    n
        Less than they hold at the end of the file, and where a file system returns less than requested; 0 at the end.

    Raises
    ------
    OSError
        The disk has failed.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     path, first, second = Path(folder) / "a", bytearray(2), bytearray(9)
    ...     _ = path.write_bytes(b"abcdef")
    ...     handle = open_for_reading(path)
    ...     n = read_at(handle, [memoryview(first), memoryview(second)], 1)
    ...     os.close(handle)
    >>> n, first, second[:3]
    (5, bytearray(b'bc'), bytearray(b'def'))
    """
    if hasattr(os, "preadv"):
        return os.preadv(handle, views, offset)
    got = 0
    with _SEEKING, io.FileIO(handle, "rb", closefd=False) as file:
        file.seek(offset)
        for view in views:
            n = file.readinto(view)
            got += n
            if n < view.nbytes:
                break
    return got


def bytes_at(handle: int, n: int, offset: int) -> bytes:
    """Return up to `n` bytes at a place in a file (see `read_at`)."""
    data = bytearray(n)
    return bytes(data[: read_at(handle, [memoryview(data)], offset)])
