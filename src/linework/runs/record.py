"""run.json, beside the output: inputs and parameters of a run, its results, and the time it took."""

from __future__ import annotations

import contextlib
import platform
from collections.abc import Mapping
from importlib import metadata
from pathlib import Path
from typing import Any

import linework
from linework.files.documents import read_json

#: Packages whose version can change the result: listed in every record.
PACKAGES = ("numpy", "scipy", "numba", "laspy", "lazrs", "pyproj", "pyogrio", "shapely")
#: Failures that a summary lists; further ones are counted. run.json has all. [failures]
MAX_LISTED = 3


def versions() -> dict[str, str]:
    """Return the versions of linework, of Python and of the packages that can change a result."""
    found = {"linework": linework.__version__, "python": platform.python_version()}
    for package in PACKAGES:
        with contextlib.suppress(metadata.PackageNotFoundError):
            found[package] = metadata.version(package)
    return found


def record_path(output: Path) -> Path:
    """Return where the record of `output` belongs: run.json beside it.

    If that run.json belongs to another output that still exists, or is not a record, the record is named by
    the output: lines.gpkg.run.json. A record of that name stays in use.
    """
    plain, own = output.with_name("run.json"), output.with_name(f"{output.name}.run.json")
    if _output_of(own) == output.name:
        return own
    owner = _output_of(plain)
    ours = not plain.exists() or owner == output.name
    deserted = owner and not output.with_name(owner).exists()
    if plain.name != output.name and (ours or deserted):
        return plain
    return own


def facts_of_run(record: Mapping[str, Any]) -> dict[str, str]:
    """Return the main facts of a run for a reader, by name.

    >>> facts_of_run({
    ...     "counts": {"points_used": 5, "lines": {"cable": 1}}, "crs": {"name": "local"},
    ...     "timings_s": {"read points": 1.26}, "versions": {"linework": "1"},
    ... })["time"]
    'read points 1.3 s'
    """
    counts = record["counts"]
    return {
        "points": f"{counts['points_used']:,}",
        "CRS": record["crs"]["name"],
        "looked for": ", ".join(counts["lines"]),
        "time": ", ".join(f"{step} {seconds:.1f} s" for step, seconds in record["timings_s"].items()),
        "linework": record["versions"]["linework"],
    }


def missing_summary(record: Mapping[str, Any]) -> str:
    """Return a line on what a run has left out and why, "" if nothing.

    >>> failures = [{"file": "a.laz", "problem": "a.laz: empty file."}]
    >>> missing_summary({"failures": failures, "counts": {"files": 2, "tiles": 1, "stereo_pairs": 0}})
    '1 of 2 files left out: a.laz: empty file'
    """
    failures, counts = record["failures"], record["counts"]
    totals = {"file": counts["files"], "tile": counts["tiles"], "stereo pair": counts["stereo_pairs"]}
    left_out = {
        "file": sum("file" in failure for failure in failures),
        "tile": sum("tile" in failure for failure in failures),
        "stereo pair": sum("image" in failure for failure in failures),
    }
    parts = [f"{left_out[name]} of {of} {name}s" for name, of in totals.items() if left_out[name]]
    n_recordings = sum("recording" in failure for failure in failures)
    parts += [f"{n_recordings} recording{'s' * (n_recordings > 1)}"] * bool(n_recordings)
    listed = "; ".join(
        f"tile {failure['tile']}: {failure['problem'].rstrip('.')}"
        if "tile" in failure
        else failure["problem"].rstrip(".")
        for failure in failures[:MAX_LISTED]
    )
    more = f" and {len(failures) - MAX_LISTED} more" if len(failures) > MAX_LISTED else ""
    return f"{' and '.join(parts)} left out: {listed}{more}" if failures else ""


def _output_of(record: Path) -> str:
    """Return the name of the output that a record belongs to, "" if the record cannot be read."""
    try:
        return Path(read_json(record.read_text(encoding="utf-8"), record)["output"]["file"]).name
    except (OSError, ValueError, KeyError, TypeError):
        return ""
