"""A remote file as a file to read from: the blocks that are asked for, and no others."""

from __future__ import annotations

import io
from collections import OrderedDict
from pathlib import Path
from typing import Any, BinaryIO

from linework.errors import InputError
from linework.files.remote.requests import RemoteState, remote_part, remote_start

#: Bytes of a block: headers with their records have some kB, chunk tables two bytes a chunk.
BLOCK_BYTES = 16 << 10
#: Blocks kept of a file, 4 MiB; and files whose blocks are kept.
_MOST_BLOCKS, _MOST_FILES = 256, 16


class _Blocks:
    """Blocks of a remote file in one state, the latest used ones kept."""

    def __init__(self, path: Path, state: RemoteState, first: bytes) -> None:
        self.path, self.state = path, state
        self._kept: OrderedDict[int, bytes] = OrderedDict({0: first})

    def block(self, number: int) -> bytes:
        """Return a block, asked for where it is not kept."""
        if number not in self._kept:
            start = number * BLOCK_BYTES
            end = min(start + BLOCK_BYTES, self.state.n_bytes)
            self._kept[number] = remote_part(self.path, self.state, start, end)
            while len(self._kept) > _MOST_BLOCKS:
                self._kept.popitem(last=False)
        self._kept.move_to_end(number)
        return self._kept[number]


#: Blocks of the files that were read last: headers are read several times.
_KEPT: OrderedDict[Path, _Blocks] = OrderedDict()


def open_remote(path: Path) -> BinaryIO:
    """Return a remote file, open for reading bytes; use it in a `with` statement.

    Raises
    ------
    InputError
        No such file, no access to it, an empty one, or a server that sends no ranges.
    MachineError
        The server cannot be reached, is too slow, or fails.
    """
    return io.BufferedReader(_RemoteFile(_blocks_of(path)), BLOCK_BYTES)


def remote_state(path: Path) -> RemoteState:
    """Return the state that a remote file has now; raises what `open_remote` raises."""
    return _blocks_of(path).state


def _blocks_of(path: Path) -> _Blocks:
    """Return the blocks of a file: those kept, if it has not changed."""
    state, first = remote_start(path, BLOCK_BYTES)
    if state.n_bytes == 0:
        raise InputError("empty file (0 bytes)", where=path, advice="copy it there again")
    kept = _KEPT.get(path)
    if kept is None or kept.state != state or kept.block(0) != first:
        kept = _Blocks(path, state, first)
    _KEPT[path] = kept
    _KEPT.move_to_end(path)
    while len(_KEPT) > _MOST_FILES:
        _KEPT.popitem(last=False)
    return kept


class _RemoteFile(io.RawIOBase):
    """Reads blocks as one stream of bytes."""

    def __init__(self, blocks: _Blocks) -> None:
        self._blocks, self._at = blocks, 0

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def seek(self, offset: int, whence: int = 0, /) -> int:
        at = offset + (0, self._at, self._blocks.state.n_bytes)[whence]
        if at < 0:
            raise ValueError(f"negative position {at}")
        self._at = at
        return at

    def tell(self) -> int:
        return self._at

    def readinto(self, buffer: Any, /) -> int:
        view = memoryview(buffer).cast("B")
        if self._at >= self._blocks.state.n_bytes:
            return 0
        number, within = divmod(self._at, BLOCK_BYTES)
        part = self._blocks.block(number)[within : within + len(view)]
        view[: len(part)] = part
        self._at += len(part)
        return len(part)
