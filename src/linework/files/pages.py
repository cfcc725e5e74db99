"""Publish what was made in memory: pictures and pages."""

from __future__ import annotations

from pathlib import Path

from linework.files.publish import publish


def write_bytes(content: bytes, path: Path, *, overwrite: bool = False) -> None:
    """Publish a file of the given bytes: whole, verified, or not at all.

    Raises
    ------
    OutputExistsError, MachineError
        As for `publish`.
    """

    def write(part: Path) -> None:
        part.write_bytes(content)

    def verify(part: Path) -> None:
        if part.read_bytes() != content:
            raise OSError("the file reads back differently")

    publish(path, write, verify, overwrite=overwrite)


def write_page(html: str, path: Path, *, overwrite: bool = False) -> None:
    """Publish a page as UTF-8 (see `write_bytes`)."""
    write_bytes(html.encode("utf-8", errors="backslashreplace"), path, overwrite=overwrite)
