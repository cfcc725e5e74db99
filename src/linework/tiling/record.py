"""run.json: what a run was given, what it did and how long it took, beside its output."""

from __future__ import annotations

import contextlib
import json
import os
import platform
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path

import linework

#: What can change the result: named in every record.
PACKAGES = ("numpy", "scipy", "numba", "laspy", "lazrs", "pyproj", "pyogrio", "shapely")


def versions() -> dict[str, str]:
    """Return the versions of linework, of Python and of the packages that can change a result."""
    found = {"linework": linework.__version__, "python": platform.python_version()}
    for package in PACKAGES:
        with contextlib.suppress(metadata.PackageNotFoundError):
            found[package] = metadata.version(package)
    return found


def record_path(output: Path) -> Path:
    """Return where the record of `output` belongs: run.json beside it.

    Where run.json there belongs to another output that still exists, or is no record at all, it is
    ``<stem>.run.json``.
    """
    plain = output.with_name("run.json")
    owner = _output_of(plain)
    ours = not plain.exists() or owner == output.name
    deserted = owner and not output.with_name(owner).exists()
    if plain.name != output.name and (ours or deserted):
        return plain
    return output.with_name(f"{output.stem}.run.json")


@contextlib.contextmanager
def set_aside(path: Path) -> Iterator[None]:
    """Take an old record away while its output is replaced; it comes back if that fails.

    The order is: old record away, new output in place, new record in place. Whenever the run is killed,
    no output stands beside the record of another.
    """
    aside = path.with_name(f".{path.name}.{os.getpid()}.old")
    had_one = path.exists()
    if had_one:
        path.replace(aside)
    try:
        yield
    except BaseException:
        if had_one:
            aside.replace(path)
        raise
    aside.unlink(missing_ok=True)


def _output_of(record: Path) -> str:
    """Return the name of the output a record belongs to, "" where there is none that can be read."""
    try:
        return Path(json.loads(record.read_text(encoding="utf-8"))["output"]["file"]).name
    except (OSError, ValueError, KeyError, TypeError):
        return ""
