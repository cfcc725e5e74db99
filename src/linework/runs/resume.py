"""Unfinished runs: their journal and the results of their tasks, in the work folder."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import linework
from linework.errors import UsageError, argument
from linework.files.output.journal import Journal, noted_output_in, open_journal
from linework.files.output.locks import hold_lock
from linework.files.output.publish import machine_errors
from linework.files.output.record import hash_file
from linework.files.output.replace import replace_file
from linework.runs.opened.made import RUNS, claim, remove_made
from linework.runs.opened.work_folder import folder_in_use_error
from linework.runs.record import versions

_DESCRIPTION, _JOURNAL, _RESULTS = "run.json", "journal.sqlite", "tiles"


@dataclass(frozen=True, slots=True)
class RunFolder:
    """Folder of an unfinished run.

    Parameters
    ----------
    results
        Folder for the results of tasks.
    is_resumed
        Whether an earlier process began the run.
    """

    path: Path
    results: Path
    journal: Journal
    is_resumed: bool


def describe_run(parameters: Mapping[str, Any], hashes: Mapping[Path, str]) -> dict[str, Any]:
    """Return all that the result of a run depends on: parameters, the bytes of its inputs, the program."""
    inputs = {os.fsencode(path).decode("utf-8", "backslashreplace"): text for path, text in hashes.items()}
    found = {"inputs": inputs, **parameters, "code": source_hash(), "versions": versions()}
    described: dict[str, Any] = json.loads(json.dumps(found, default=str))
    return described


def fingerprint_of(described: Mapping[str, Any]) -> str:
    """Return the SHA-256 of a description, for the record of the finished run."""
    return hashlib.sha256(json.dumps(described, sort_keys=True).encode()).hexdigest()


def is_result_of_run(work: Path, output: Path) -> bool:
    """Return whether an existing output was put in place by a run that was killed just after."""
    journal = _folder(work, output) / _JOURNAL
    if not journal.is_file():
        return False
    noted = noted_output_in(journal, output.name)
    return noted is not None and noted == hash_file(output)


def _folder(work: Path, output: Path) -> Path:
    return work / RUNS / hashlib.sha256(os.fsencode(output.absolute())).hexdigest()[:16]


@contextlib.contextmanager
def run_folder(
    work: Path, output: Path, described: Mapping[str, Any], *, resume: bool = False
) -> Iterator[RunFolder]:
    """Open the folder of a run: it is removed when the run succeeds, and stays for `resume` when it fails.

    Parameters
    ----------
    output
        File that the run writes: runs with the same output have the same folder.
    described
        All that the result depends on, see `describe_run`.
    resume
        Use the results that an earlier process has left; otherwise they are discarded.

    Raises
    ------
    UsageError
        The run to resume was begun with other parameters; the message names the first that differs.
    OutputExistsError
        Another process holds the folder.
    """
    folder = _folder(work, output)
    with hold_lock(work / f"run-{folder.name}.lock", folder_in_use_error(work)), machine_errors(folder):
        begun = _description(folder)
        if begun is not None and resume:
            _refuse_other(begun, described, output)
        is_resumed = begun is not None and resume
        claim(work, f"{RUNS}/{folder.name}")
        if not is_resumed:
            remove_made(work, f"{RUNS}/{folder.name}")
        (folder / _RESULTS).mkdir(parents=True, exist_ok=True)
        journal = open_journal(folder / _JOURNAL)
        if not is_resumed:
            _describe(folder, described)
        try:
            yield RunFolder(folder, folder / _RESULTS, journal, is_resumed)
        finally:
            journal.close()
        remove_made(work, f"{RUNS}/{folder.name}")


def _describe(folder: Path, described: Mapping[str, Any]) -> None:
    """Write what the run is, last of what makes its folder: a folder without it was never begun."""
    replace_file(folder / _DESCRIPTION, json.dumps(described).encode())


def _description(folder: Path) -> dict[str, Any] | None:
    try:
        found = json.loads((folder / _DESCRIPTION).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return found if isinstance(found, dict) else None


def _refuse_other(begun: Mapping[str, Any], now: Mapping[str, Any], output: Path) -> None:
    one, two = dict(_flat(begun)), dict(_flat(now))
    for name in sorted(one.keys() | two.keys()):
        if one.get(name) != two.get(name):
            was, is_ = (_short(values.get(name)) for values in (one, two))
            raise UsageError(
                f"the run to resume was begun with {name} = {was}, now it is {is_}",
                where=output,
                advice=f"give the same again, or run without {argument('resume', True)} to start over",
            )


def _flat(document: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    """Yield every leaf of a document with its dotted name.

    >>> dict(_flat({"a": {"b": 1}, "c": [2, 3]}))
    {'a.b': 1, 'c': [2, 3]}
    """
    if isinstance(document, Mapping):
        for key, value in document.items():
            yield from _flat(value, f"{name}.{key}" if name else str(key))
    else:
        yield name, document


def _short(value: Any) -> str:
    text = json.dumps(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


# A hash of linework's own source: results of two versions must not be mixed


@lru_cache(maxsize=8)
def source_hash(*rooms: str) -> str:
    """Return a hash of the source files of some packages, or of all if none is named.

    >>> len(source_hash("files")), source_hash("files") == source_hash("kernels")
    (16, False)
    """
    root = Path(linework.__file__).parent
    total = hashlib.sha256()
    assert all((root / room).is_dir() for room in rooms), rooms
    for path in sorted(path for room in rooms or (".",) for path in (root / room).rglob("*.py")):
        total.update(path.relative_to(root).as_posix().encode() + b"\0" + path.read_bytes())
    return total.hexdigest()[:16]
