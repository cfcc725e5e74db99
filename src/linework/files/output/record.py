"""JSON documents beside an output (run.json), and hashes of files."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from linework.files.input import regular_file_bytes
from linework.files.output.publish import write_bytes


def write_json(document: Mapping[str, Any], path: Path, *, overwrite: bool = False) -> None:
    """Write a document as indented JSON; keys keep their order, NaN and infinity are refused.

    Raises
    ------
    OutputExistsError, MachineError
        As for `publish`.
    """
    write_bytes(json_bytes(document), path, overwrite=overwrite)


def json_bytes(document: Mapping[str, Any]) -> bytes:
    """Return a document as `write_json` writes it."""
    text = json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
    # Names that are not UTF-8 come as lone surrogates, which JSON writes as \\udcff
    return text.encode("utf-8", errors="backslashreplace")


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
