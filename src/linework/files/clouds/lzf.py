"""Unpack LZF, by which PCD files are compressed.

Separate from `rows`, which needs it for one of its formats: here is the format of Marc Lehmann's LibLZF alone. A byte
below 32 begins a run of up to 32 bytes as they are; another one a copy of up to 264 bytes from up to 8 kB before.
"""

from __future__ import annotations


def unpacked_lzf(data: bytes, n_bytes: int) -> bytes:
    """Return the `n_bytes` bytes that were compressed.

    >>> unpacked_lzf(bytes([2]) + b"abc" + bytes([0x80, 2]), 9)
    b'abcabcabc'

    Raises
    ------
    ValueError
        Damaged: it unpacks to another number of bytes, or copies from before its start.
    """
    out = bytearray()
    at, end = 0, len(data)
    while at < end and len(out) < n_bytes:
        control = data[at]
        at += 1
        if control < 32:
            out += data[at : at + control + 1]
            at += control + 1
            continue
        length = control >> 5
        if length == 7:
            if at >= end:
                break
            length += data[at]
            at += 1
        if at >= end:
            break
        start = len(out) - ((control & 31) << 8) - data[at] - 1
        at += 1
        length += 2
        if start < 0:
            raise ValueError("a copy from before the start")
        piece = out[start : start + length]
        # What is copied may overlap what it writes: then it repeats
        out += piece if len(piece) == length else (piece * (length // len(piece) + 1))[:length]
    if len(out) != n_bytes or at < end:
        raise ValueError(f"{len(out):,} bytes instead of {n_bytes:,}")
    return bytes(out)
