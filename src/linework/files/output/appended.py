"""A file that only grows: what was appended is on the disk when the call returns, or was not appended at all.

For records that must survive a cut of the power. What a run can write at once goes through `publish` or `replace`.
"""

from __future__ import annotations

import os
from pathlib import Path

from linework.files.output.publish import machine_errors, sync


class AppendedFile:
    """A text file to whose end whole lines are appended.

    Parameters
    ----------
    path
        Created with the first lines if it is missing. Half a line at its end, which a cut of the power may leave, is
        removed when the next lines are appended.

    Raises
    ------
    MachineError
        The file cannot be read.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        with machine_errors(path):
            self._size = _end_of_lines(path) if path.exists() else 0

    def lines(self) -> list[str]:
        """Return the whole lines of the file.

        Raises
        ------
        MachineError
            It cannot be read.
        """
        if not self._size:
            return []
        with machine_errors(self.path), self.path.open("rb") as file:
            data = file.read(self._size)
        return data.decode("utf-8", errors="replace").split("\n")[:-1]

    def append(self, text: str) -> None:
        """Append whole lines; the disk holds them when this returns.

        Raises
        ------
        MachineError
            The disk is full, or failed: then nothing was appended, and the call can be repeated.
        """
        data = text.encode("utf-8", errors="backslashreplace")
        assert data.endswith(b"\n"), "whole lines"
        is_new = not self._size
        with machine_errors(self.path):
            with self.path.open("ab") as file:
                # What an append that failed, or a cut of the power, left half written
                file.truncate(self._size)
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
            if is_new:
                sync(self.path.parent)
        self._size += len(data)


def _end_of_lines(path: Path) -> int:
    """Return the size of a file without the half line at its end. [bytes]."""
    with path.open("rb") as file:
        end = file.seek(0, os.SEEK_END)
        while end > 0:
            start = max(end - (1 << 16), 0)
            file.seek(start)
            found = file.read(end - start).rfind(b"\n")
            if found >= 0:
                return start + found + 1
            end = start
    return 0
