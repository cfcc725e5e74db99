"""The journal of a drive that is followed: what was done with each pair, so that a restart continues there."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from linework.errors import MachineError
from linework.files.output.appended import AppendedFile

#: Most records that wait for a disk that is full: an hour at five pairs a second. Older ones are dropped then: what
#: they say can be found again from the images.
_MOST_WAITING = 18_000


class LiveJournal:
    """Records, one line of JSON each; `save` puts those noted since the last call on the disk.

    Parameters
    ----------
    path
        Created if it is missing; of an earlier start, its records are kept.

    Raises
    ------
    MachineError
        It cannot be read.
    """

    def __init__(self, path: Path) -> None:
        self._file = AppendedFile(path)
        self._waiting: list[str] = []
        #: Number of records on the disk.
        self.n_saved = 0

    def records(self) -> Iterator[dict[str, Any]]:
        """Yield the records on the disk; a damaged line is left out."""
        for line in self._file.lines():
            try:
                record = json.loads(line)
            except ValueError:
                continue
            if isinstance(record, dict):
                yield record

    def note(self, record: Mapping[str, Any]) -> None:
        """Note a record, to be saved."""
        self._waiting.append(json.dumps(record, allow_nan=False, separators=(",", ":")) + "\n")
        if len(self._waiting) > _MOST_WAITING:
            del self._waiting[0]

    def save(self) -> int:
        """Append what was noted; the disk holds it when this returns. Return how many records that was.

        Raises
        ------
        MachineError
            The disk is full: the records wait for the next call.
        """
        if not self._waiting:
            return 0
        n = len(self._waiting)
        self._file.append("".join(self._waiting))
        self._waiting.clear()
        self.n_saved += n
        return n

    def try_to_save(self) -> MachineError | None:
        """Save, and return the error where the disk refuses."""
        try:
            self.save()
        except MachineError as error:
            return error
        return None
