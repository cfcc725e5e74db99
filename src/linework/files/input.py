"""Input files: checked before they are opened, so that a pipe cannot block and an empty file is named as such.

GDAL is restricted here, too: opening a file with it can reach other files and the network. Two copies of GDAL live in
this process (pyogrio's and rasterio's); both read the variable, so import this before either of them.
"""

from __future__ import annotations

import contextlib
import os
import re
import stat
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from linework.errors import InputError
from linework.files.remote.address import is_remote
from linework.files.remote.reader import open_remote

# A value set by the user stays
os.environ.setdefault("CPL_VSIL_CURL_ALLOWED_EXTENSIONS", ".invalid")


def is_address(path: Path) -> bool:
    """Return whether a path is an address, the description of a connection, or one of GDAL's virtual paths.

    >>> [is_address(Path(name)) for name in ("http://host/a.laz", "PG:host=h", "/vsizip/a.zip", "C:/a.laz", "a:b.laz")]
    [True, True, True, False, False]
    """
    text = str(path)
    # A drive of Windows has one letter
    is_scheme = re.match(r"[A-Za-z][A-Za-z0-9+.-]+:(?:[/\\\\]|.*=)", text) is not None
    return is_scheme or text.lower().startswith(("/vsi", "\\\\", "//"))


@contextlib.contextmanager
def plainly_named(path: Path) -> Iterator[Path]:
    """Yield a path that GDAL's readers take as it is: that of a link in a temporary folder, where a name is odd.

    They take what follows a ``;``, ``?`` or ``!`` for a part of an address, drop line ends and spaces at the ends, and
    need UTF-8. The files
    of the same name with other suffixes (.shx, .dbf) are linked too.
    """
    if _is_plain(str(path)):
        yield path
        return
    # The name of a Shapefile is that of its layer
    stem = "".join(c if _is_plain(c) else "_" for c in path.stem)
    with tempfile.TemporaryDirectory(prefix="linework-") as folder:
        for beside in sorted(path.absolute().parent.iterdir()):
            if beside.stem == path.stem and beside.suffix.isprintable() and beside.is_file():
                Path(folder, f"{stem}{beside.suffix}").symlink_to(beside)
        yield Path(folder, f"{stem}{path.suffix}")


def _is_plain(text: str) -> bool:
    is_utf8 = text.encode(errors="replace").decode() == text
    return is_utf8 and text.isprintable() and text == text.strip() and not set(";?!").intersection(text)


def matching_paths(base: Path, pattern: str) -> list[Path]:
    """Return what matches a pattern that starts from a folder, sorted; ``**`` is any number of folders, links not.

    Raises
    ------
    InputError
        It is not a pattern: two stars beside other characters, as in ``a**b``.
    """
    try:
        return sorted(base.glob(pattern))
    except (ValueError, NotImplementedError) as error:
        raise InputError(
            "is not a pattern: ** stands for folders, and stands alone between slashes", where=pattern,
            advice="write * for any characters",
        ) from error  # fmt: skip


def regular_file_bytes(path: Path) -> int:
    """Return the size of a regular file; a pipe, a device or a folder is refused unopened, so nothing can hang.

    Raises
    ------
    InputError
        Missing, unreadable, or not a regular file.
    """
    try:
        status = path.stat()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(f"cannot be opened: {reason}", where=path, advice="check the name") from error
    if not stat.S_ISREG(status.st_mode):
        raise InputError("is not a regular file", where=path, advice="name a file on a disk")
    if not os.access(path, os.R_OK):
        raise InputError("no permission to read it", where=path, advice="check its permissions")
    return status.st_size


def filled_file_bytes(path: Path, advice: str = "copy the file again") -> int:
    """Return the size of a regular file that is not empty.

    Raises
    ------
    InputError
        Missing, unreadable, not a regular file, or empty.
    """
    n_bytes = regular_file_bytes(path)
    if n_bytes == 0:
        raise InputError("empty file (0 bytes)", where=path, advice=advice)
    return n_bytes


def open_input(path: Path) -> BinaryIO:
    """Return a checked file, open for reading bytes; use it in a `with` statement.

    Raises
    ------
    InputError
        Missing, unreadable, not a regular file, or empty; at an address, also without ranges.
    MachineError
        The server of an address cannot be reached, or fails.
    """
    if is_remote(path):
        return open_remote(path)
    filled_file_bytes(path)
    return path.open("rb")


def read_input_text(path: Path, *, max_bytes: int, advice: str) -> str:
    """Return the text of a whole file: UTF-8, with or without a byte order mark.

    Parameters
    ----------
    max_bytes
        Larger files are refused before they are read.
    advice
        What to do about a larger file.

    Raises
    ------
    InputError
        Missing, unreadable, not a regular file, too large, or not UTF-8.
    """
    n_bytes = regular_file_bytes(path)
    if n_bytes > max_bytes:
        raise InputError(f"{n_bytes:,} bytes, expected at most {max_bytes:,}", where=path, advice=advice)
    try:
        return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(
            f"is not UTF-8 text (byte {error.start:,})", where=path, advice="save it as UTF-8"
        ) from error
