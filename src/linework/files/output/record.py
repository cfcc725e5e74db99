"""JSON documents beside an output (run.json), and hashes of files."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from linework.errors import MachineError
from linework.files.input import regular_file_bytes
from linework.files.output.publish import publish


def write_json(document: Mapping[str, Any], path: Path, *, overwrite: bool = False) -> None:
    """Write a document as indented JSON; keys keep their order, NaN and infinity are refused.

    Raises
    ------
    OutputExistsError, MachineError
        As for `publish`.
    """
    text = json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False) + "\n"

    def write(part: Path) -> None:
        part.write_text(text, encoding="utf-8", newline="\n")

    def verify(part: Path) -> None:
        if part.read_text(encoding="utf-8") != text:
            raise MachineError(
                "written file does not read back the same", where=path, advice="check the disk"
            )

    publish(path, write, verify, overwrite=overwrite)


def hash_file(path: Path) -> str:
    """Return the SHA-256 of a file's bytes as hexadecimal text.

    Raises
    ------
    InputError
        Not a regular file.
    """
    regular_file_bytes(path)
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
