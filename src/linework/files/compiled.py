"""What is compiled: a note beside numba's cache, so that a look at it takes milliseconds and nothing stale is used.

Numba looks only at the file of a kernel itself: a kernel that calls one of another file would stay as it was when that
file changes. The note holds the state of every source of the kernels; when one has changed, the compiled code of all
kernels that import it, directly or not, is removed.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import platform
import re
import sys
import tempfile
from collections.abc import Callable, Iterable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import linework.kernels
from linework.files.documents import read_json
from linework.files.output.replace import replace_file

_IMPORT = re.compile(
    r"^from linework\.kernels\.([\w.]+) import|^from linework\.kernels import (\w+)", re.MULTILINE
)


def is_compiled(groups: Iterable[str]) -> bool:
    """Return whether all kernels of some groups are compiled from the sources as they are now."""
    note = _read_note()
    done = note.get("compiled", {})
    return (
        note.get("made_by") == _made_by()
        and note.get("sources") == _sources()
        and all(group in done for group in groups)
        # The cache may have been emptied since
        and all(_has_code(folder) for group in groups for folder in done[group])
    )


def remove_stale(cache_folder_of: Callable[[str], Path]) -> list[str]:
    """Remove compiled code that the sources have outdated, and return the modules concerned.

    Parameters
    ----------
    cache_folder_of
        Gives the folder where numba caches the kernels of a module below `linework.kernels`.
    """
    note, sources = _read_note(), _sources()
    known = note.get("sources", {}) if note.get("made_by") == _made_by() else {}
    changed = {name for name in sources.keys() | known.keys() if sources.get(name) != known.get(name)}
    if not changed:
        return []
    stale = sorted(name for name, needed in _needed(sources).items() if changed & needed)
    for name in stale:
        with contextlib.suppress(OSError):
            folder, stem = cache_folder_of(name), name.rpartition(".")[2]
            for pattern in (f"{stem}.*.nbi", f"{stem}.*.nbc"):
                for path in folder.glob(pattern):
                    path.unlink(missing_ok=True)
    _write_note({"made_by": _made_by(), "sources": sources, "compiled": {}})
    return stale


def note_compiled(groups: Iterable[str], folders: Iterable[Path]) -> None:
    """Note that all kernels of some groups are compiled, with the folders of their code."""
    done = dict(_read_note().get("compiled", {}))
    done |= dict.fromkeys(groups, sorted({str(folder) for folder in folders}))
    _write_note({"made_by": _made_by(), "sources": _sources(), "compiled": done})


def _made_by() -> list[Any]:
    """Return what compiled code depends on besides its sources; an installed package by when it was installed."""
    specs = [find_spec(name) for name in ("numba", "numpy")]
    installed = [Path(spec.origin).stat().st_mtime_ns for spec in specs if spec is not None and spec.origin]
    return [*installed, sys.implementation.cache_tag, platform.machine()]


def _folder() -> Path:
    return Path(next(iter(linework.kernels.__path__)))


def _sources() -> dict[str, list[int]]:
    """Return modification time and size of each source of the kernels, which numba goes by too."""
    found: dict[str, list[int]] = {}
    pending = [("", str(_folder()))]
    while pending:
        prefix, folder = pending.pop()
        with os.scandir(folder) as entries:
            for entry in entries:
                if entry.is_dir() and not entry.name.startswith("_"):
                    pending.append((f"{prefix}{entry.name}.", entry.path))
                elif entry.name.endswith(".py") and entry.name != "__init__.py":
                    status = entry.stat()
                    found[prefix + entry.name[:-3]] = [status.st_mtime_ns, status.st_size]
    return found


def _needed(names: Iterable[str]) -> dict[str, set[str]]:
    """Return for each module of the kernels itself and all that it imports, directly or not."""
    imported = {
        name: {
            a or b
            for a, b in _IMPORT.findall(
                (_folder() / f"{name.replace('.', '/')}.py").read_text(encoding="utf-8")
            )
        }
        for name in names
    }
    needed = {}
    for name in imported:
        found, pending = {name}, [name]
        while pending:
            for other in imported.get(pending.pop(), ()):
                if other not in found:
                    found.add(other)
                    pending.append(other)
        needed[name] = found
    return needed


def _has_code(folder: str) -> bool:
    with contextlib.suppress(OSError), os.scandir(folder) as entries:
        return any(entry.name.endswith(".nbi") for entry in entries)
    return False


def _note_path() -> Path:
    """Return the path of the note: where numba caches, or in the user's cache where that cannot be written."""
    # By the folder of the sources: installations may share a cache
    name = f"linework-compiled-{hashlib.sha256(os.fsencode(_folder())).hexdigest()[:16]}.json"
    given = os.environ.get("NUMBA_CACHE_DIR", "")
    if given:
        return Path(given) / name
    beside = _folder() / "__pycache__"
    if os.access(beside if beside.is_dir() else _folder(), os.W_OK):
        return beside / name
    try:
        cache = Path(os.environ.get("XDG_CACHE_HOME", "") or Path.home() / ".cache")
    except RuntimeError:  # no home folder
        cache = Path(tempfile.gettempdir())
    return cache / "linework" / name


def _read_note() -> dict[str, Any]:
    try:
        note = read_json(_note_path().read_text(encoding="utf-8"), _note_path())
    except (OSError, ValueError):
        return {}
    return note if isinstance(note, dict) else {}


def _write_note(note: dict[str, Any]) -> None:
    """Write the note; without it kernels are looked at again the next time, and that must not fail."""
    path = _note_path()
    with contextlib.suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        replace_file(path, json.dumps(note).encode())
