"""Files of arrays: the one format for arrays of the work folder, with or without names.

Arrays follow one another as numpy writes them (.npy 1.0), each at a multiple of 64 bytes, so that rows of one can
be read without the rest; of named arrays the first holds the names. The tile store's points have their own packed
layout (`linework.files.store.layout`): they are read run by run into buffers of the caller, and an array header
for every run would double their number of reads.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import math
import os
from collections.abc import Iterator, Mapping
from functools import lru_cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any, BinaryIO

import numpy as np

from linework.arrays import AnyArray
from linework.errors import MachineError
from linework.files.handles import bytes_at, open_for_reading, read_at
from linework.files.output.replace import replace_file, replacing

ARRAY_SUFFIX = ".arrays"
#: Arrays begin at multiples of this: a cache line, and enough for any dtype. [bytes]
_ALIGNMENT = 64
#: Bytes of an .npy 1.0 header up to and with its length.
_PREFIX_BYTES = 10
#: Bytes of a header of few dimensions, which numpy fills up to that.
_USUAL_HEADER_BYTES = 128
ADVICE = "linework clean removes the work folder, the next run rebuilds it"


def write_arrays(path: Path, *arrays: AnyArray) -> None:
    """Write arrays, whole or not at all; not yet durable (see `make_durable`).

    Raises
    ------
    MachineError
        The folder is full, read-only or gone.
    """
    with replacing(path, durable=False) as file:
        _append(file, *arrays)


def write_named_arrays(path: Path, arrays: Mapping[str, AnyArray]) -> str:
    """Write arrays by name, durable, and return the SHA-256 of the file: the same arrays give the same bytes.

    Raises
    ------
    MachineError
        The folder is full, read-only or gone.
    """
    whole = io.BytesIO()
    _append(whole, np.array(list(arrays), dtype=np.str_), *arrays.values())
    data = whole.getvalue()
    replace_file(path, data)
    return hashlib.sha256(data).hexdigest()


def read_named_arrays(path: Path, sha256: str | None = None) -> dict[str, AnyArray]:
    """Return the arrays of a file by name.

    Parameters
    ----------
    sha256
        What `write_named_arrays` returned; None: the bytes are not compared.

    Raises
    ------
    FileNotFoundError
        The file does not exist.
    MachineError
        The file cannot be read, or is not what was written.
    """
    if sha256 is not None and not is_file_of(path, sha256):
        path.stat()
        raise MachineError("is not what was written (damaged)", where=path, advice=ADVICE)
    with opened_arrays(path) as file:
        names, *arrays = file.all()
    return dict(zip(names.tolist(), arrays, strict=True))


def is_file_of(path: Path, sha256: str) -> bool:
    """Return whether a file exists and its bytes have this hash."""
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest() == sha256
    except OSError:
        return False


class ArrayFile:
    """An open file of arrays: read, not mapped, because a mapped file that fails kills the process."""

    def __init__(self, handle: int) -> None:
        self._handle = handle
        self._layout = []
        size, begin = os.fstat(handle).st_size, 0
        while begin < size:
            # Nearly all headers fill 128 bytes: they are read at once
            head = bytes_at(handle, _USUAL_HEADER_BYTES, begin)
            length = _PREFIX_BYTES + int.from_bytes(head[8:_PREFIX_BYTES], "little")
            start = begin + length
            dtype, shape = _header(head[:length] if length <= len(head) else bytes_at(handle, length, begin))
            self._layout.append((dtype, shape, start))
            begin = start + math.prod(shape) * dtype.itemsize
            if begin > size:
                raise ValueError(f"{size} bytes, expected {begin}")
            begin += -begin % _ALIGNMENT

    def all(self) -> tuple[AnyArray, ...]:
        """Return all arrays."""
        return tuple(
            self.rows(i, 0, shape[0]) if shape else self.rows(i, 0, 1).reshape(())
            for i, (_, shape, _) in enumerate(self._layout)
        )

    @property
    def n_arrays(self) -> int:
        """Number of arrays."""
        return len(self._layout)

    def shape(self, which: int) -> tuple[int, ...]:
        """Return the shape of one of the arrays.

        Raises
        ------
        ValueError
            There are not so many.
        """
        if not 0 <= which < len(self._layout):
            raise ValueError(f"{len(self._layout)} arrays, expected {which + 1}")
        return self._layout[which][1]

    def rows(self, which: int, first: int, last: int) -> AnyArray:
        """Return rows `first` up to but not `last` of one of the arrays.

        Raises
        ------
        ValueError
            The file ends before them.
        """
        dtype, shape, start = self._layout[which]
        out = np.empty((last - first, *shape[1:]), dtype)
        row = math.prod(shape[1:]) * dtype.itemsize
        view, got = out.reshape(-1).view(np.uint8).data, 0
        while got < len(view):
            n = read_at(self._handle, [view[got:]], start + first * row + got)
            if n == 0:
                raise ValueError(f"ends before row {last}")
            got += n
        return out


@contextlib.contextmanager
def opened_arrays(path: Path | str) -> Iterator[ArrayFile]:
    """Open a file of arrays to read some of them.

    Raises
    ------
    FileNotFoundError
        The file does not exist.
    MachineError
        The file cannot be read, or is damaged.
    """
    handle = open_for_reading(path)
    try:
        yield ArrayFile(handle)
    except ValueError as error:
        raise MachineError(f"is damaged: {error}", where=path, advice=ADVICE) from error
    except OSError as error:
        raise MachineError(f"cannot be read: {error.strerror or error}", where=path, advice=ADVICE) from error
    finally:
        os.close(handle)


def _append(file: BinaryIO, *arrays: AnyArray) -> None:
    # To a file of the system numpy writes by itself, and does not tell a full disk from other failures
    writer: Any = SimpleNamespace(write=file.write)
    for values in arrays:
        np.lib.format.write_array(writer, values, (1, 0), allow_pickle=False)
        file.write(bytes(-file.tell() % _ALIGNMENT))


# A survey's surface has some hundred files, each with headers of its own, and is read a dozen times
@lru_cache(maxsize=8192)
def _header(data: bytes) -> tuple[np.dtype[Any], tuple[int, ...]]:
    """Return the dtype and the shape that the header of an array states."""
    file = io.BytesIO(data)
    if np.lib.format.read_magic(file) != (1, 0):
        raise ValueError("not an array of this program")
    shape, is_fortran, dtype = np.lib.format.read_array_header_1_0(file)
    if is_fortran or dtype.hasobject:
        raise ValueError("not an array of this program")
    return dtype, shape
