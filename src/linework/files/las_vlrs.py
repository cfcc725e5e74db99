"""The variable length records of a LAS file, those before the points and the extended ones behind them.

References
----------
ASPRS, LAS Specification 1.4 - R15, sections 2.5 and 2.7.
"""

from __future__ import annotations

import struct
from pathlib import Path
from typing import BinaryIO

from linework.errors import InputError

#: (user id, record id, data)
Record = tuple[bytes, int, bytes]

#: Bytes before the data of a record, and of an extended one.
HEAD_BYTES, EXTENDED_HEAD_BYTES = 54, 60
#: A WKT is some kB; what calls itself one and is larger is not read.
_MAX_EXTENDED_BYTES = 1 << 20
_DAMAGED = "copy the file again, or leave it out"


def read_records(path: Path, file: BinaryIO, start: int, n_records: int, end: int) -> list[Record]:
    """Return the records between the header and the points; their number was bounded by the bytes there.

    Parameters
    ----------
    end
        Byte where the points start.

    Raises
    ------
    InputError
        They do not fit there.
    """
    file.seek(start)
    block = file.read(end - start)
    found, at = [], 0
    for i in range(n_records):
        if at + HEAD_BYTES > len(block):
            raise _error(path, f"only {i:,} of {n_records:,} variable length records fit before the points")
        user, record, length = struct.unpack_from("<16sHH", block, at + 2)
        over = at + HEAD_BYTES + length - len(block)
        if over > 0:
            raise _error(
                path, f"variable length record {i + 1:,} of {n_records:,} runs {over:,} bytes into the points"
            )
        found.append((user.split(b"\0")[0], record, block[at + HEAD_BYTES : at + HEAD_BYTES + length]))
        at += HEAD_BYTES + length
    return found


def read_extended_records(
    path: Path, file: BinaryIO, start: int, n_records: int, n_bytes: int
) -> list[Record]:
    """Return the CRS records among the extended ones; others (waveforms, COPC hierarchy) are passed over.

    Parameters
    ----------
    n_bytes
        Size of the file.

    Raises
    ------
    InputError
        They are not in the file.
    """
    if n_records == 0:
        return []
    if start < 375 or start + EXTENDED_HEAD_BYTES * n_records > n_bytes:
        raise _error(
            path,
            f"header promises {n_records:,} extended records from byte {start:,}, the file ends at {n_bytes:,}",
        )
    found, at = [], start
    for i in range(n_records):
        file.seek(at)
        head = file.read(EXTENDED_HEAD_BYTES)
        if len(head) < EXTENDED_HEAD_BYTES:
            raise _error(path, f"only {i:,} of {n_records:,} extended records are in the file")
        user, record, length = struct.unpack_from("<16sHQ", head, 2)
        if at + EXTENDED_HEAD_BYTES + length > n_bytes:
            raise _error(path, f"extended record {i + 1:,} of {n_records:,} runs past the end of the file")
        name = user.split(b"\0")[0]
        if name == b"LASF_Projection" and length <= _MAX_EXTENDED_BYTES:
            found.append((name, record, file.read(length)))
        at += EXTENDED_HEAD_BYTES + length
    return found


def _error(path: Path, problem: str) -> InputError:
    return InputError(problem, where=path, advice=_DAMAGED)
