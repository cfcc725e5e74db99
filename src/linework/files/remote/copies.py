"""Copies of remote files for the decoder: on disk, fetched in parts by several requests at once.

Separate from `reader`, which reads a few blocks: this fetches all of a file. The decoder walks through the chunks of a
file before it trusts them, decodes it twice where its times are of no use, and once more where that killed it: from a
copy all that costs no further request, and is the same code as for a local file.
"""

from __future__ import annotations

import shutil
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path

from linework.errors import MachineError, argument
from linework.files.output.publish import machine_errors
from linework.files.remote.address import is_remote
from linework.files.remote.reader import remote_state
from linework.files.remote.requests import RemoteState, remote_part

#: Bytes of a part, and parts fetched at once: 32 MiB of memory, and enough to fill a line with a long way.
_PART_BYTES, _AT_ONCE = 4 << 20, 8


class RemoteCopies:
    """Copies of remote files in a folder, fetched when they are first wanted.

    Parameters
    ----------
    folder
        An existing folder; `drop` removes a copy from it.
    fetched
        Called with the file, and with the share of it that has been fetched so far, from 0 to 1.
    """

    def __init__(self, folder: Path, fetched: Callable[[Path, float], None]) -> None:
        self._folder, self._fetched = folder, fetched
        self._copies: dict[Path, Path] = {}

    def local(self, path: Path) -> Path:
        """Return a file of this machine with the bytes of `path`: itself, or its copy.

        Raises
        ------
        InputError
            The remote file cannot be read, or has changed.
        MachineError
            The server cannot be reached, or the disk is full.
        """
        if not is_remote(path):
            return path
        if path not in self._copies:
            target = self._folder / f"fetched-{len(self._copies)}{path.suffix}"
            try:
                with machine_errors(target):
                    _fetch(path, remote_state(path), target, self._fetched)
            except BaseException:
                target.unlink(missing_ok=True)
                raise
            self._copies[path] = target
        return self._copies[path]

    def drop(self, path: Path) -> None:
        """Remove the copy of a file, if there is one."""
        copy = self._copies.pop(path, None)
        if copy is not None:
            copy.unlink(missing_ok=True)


def _fetch(path: Path, state: RemoteState, target: Path, fetched: Callable[[Path, float], None]) -> None:
    """Write a remote file to a new file; nothing is written beside the parts in flight."""
    usage = shutil.disk_usage(target.parent)
    # Some network disks report no size at all
    if usage.total and state.n_bytes > usage.free:
        raise MachineError(
            f"its copy needs {state.n_bytes / 1e9:.3g} GB of disk, {usage.free / 1e9:.3g} GB are free", where=path,
            advice=f"free some space, or name a folder on another disk with {argument('work', 'DIR')}",
        )  # fmt: skip
    with target.open("xb") as file, ThreadPoolExecutor(_AT_ONCE, thread_name_prefix="fetch") as pool:
        writing = threading.Lock()

        def fetch(start: int) -> None:
            end = min(start + _PART_BYTES, state.n_bytes)
            data = remote_part(path, state, start, end)
            with writing:
                file.seek(start)
                file.write(data)

        parts = [pool.submit(fetch, start) for start in range(0, state.n_bytes, _PART_BYTES)]
        try:
            for n_done, part in enumerate(as_completed(parts), 1):
                part.result()
                fetched(path, n_done / len(parts))
        finally:
            pool.shutdown(wait=True, cancel_futures=True)
