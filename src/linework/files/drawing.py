"""The lines of a workbench on disk: a GeoPackage that every change is saved to at once, with its history."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from linework.model.changes import Change, Edit
from linework.model.lines import LineSet


class DrawingFile:
    """Lines that are edited. Made by `DrawingFile.opened`."""

    path: Path

    @classmethod
    @contextmanager
    def opened(cls, path: Path, *, crs: str) -> Iterator[DrawingFile]:
        """Open the lines of a file for editing, begin a new file where there is none; hold it until the end."""
        raise NotImplementedError

    @property
    def lines(self) -> LineSet:
        """All lines, also rejected ones (``review == "rejected"``)."""
        raise NotImplementedError

    @property
    def revision(self) -> int:
        """Number of the last edit."""
        raise NotImplementedError

    def commit(self, change: Change, *, who: str, based_on: int | None = None) -> Edit:
        """Save a change; when this returns it is on the disk."""
        raise NotImplementedError
