"""The figures of docs/performance.md: decoding alone, extraction, memory, stages, and the same on a Dask cluster.

    python -m benchmarks.performance [MILLIONS ...]      (1 5 15 if none are given; writes docs/performance.md)

Everything is measured as a user runs it, as commands, each drive by each way in turn.
"""

from __future__ import annotations

import datetime
import hashlib
import json
import os
import platform
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

from benchmarks.large import DECODE, extraction, make_survey, measured

#: Takes long: not among those that are run without being named.
ON_REQUEST = True
PAGE = Path(__file__).parents[1] / "docs" / "performance.md"


@dataclass(frozen=True)
class Measured:
    """Processor time [s], wall time [s] and the most memory of all processes [bytes] of a command."""

    wall_s: float
    cpu_s: float
    memory: int


@dataclass(frozen=True)
class Row:
    """What was measured on a drive."""

    millions: float
    decoding: Measured
    one: Measured
    two: Measured
    cluster: Measured
    stages: dict[str, float]
    store_bytes: int
    is_same: bool


def main(*millions: str) -> None:
    """Measure the drives, and write the page."""
    sizes = [float(text) for text in millions] or [1.0, 5.0, 15.0]
    with tempfile.TemporaryDirectory(prefix="linework-performance-") as name:
        rows = [measure(Path(name), size, is_first=i == 0) for i, size in enumerate(sizes)]
    PAGE.write_text(page(rows, sizes), encoding="utf-8")
    print(f"{PAGE} written")


def measure(folder: Path, millions: float, *, is_first: bool) -> Row:
    """Measure one drive; the first also compiles the kernels, once more before anything is measured."""
    survey = make_survey(folder / f"drive{millions:g}", round(millions * 1e6))
    files = sorted(str(path) for path in survey.glob("*.laz"))
    lines = folder / "lines.gpkg"
    if is_first:
        measured([*extraction(survey, lines, workers=1)])
    decoding = Measured(*measured([sys.executable, "-c", DECODE, *files]))
    found, ways, stages, store = set(), [], {}, 0
    for way in ({"workers": 1}, {"workers": 2}, {"workers": 2, "scheduler": "local"}):
        subprocess.run(
            [sys.executable, "-m", "linework", "clean", str(survey)], check=True, capture_output=True
        )
        more = ("--scheduler", way["scheduler"]) if "scheduler" in way else ()
        ways.append(Measured(*measured([*extraction(survey, lines, *more, workers=way["workers"])])))
        found.add(hashlib.sha256(lines.read_bytes()).hexdigest())
        if len(ways) == 1:
            stages = json.loads((folder / "run.json").read_text(encoding="utf-8"))["timings_s"]
            stores = (survey / ".linework" / "stores").rglob("*")
            store = sum(path.stat().st_size for path in stores if path.is_file())
    row = Row(millions, decoding, *ways, stages, store, len(found) == 1)
    print(row, flush=True)
    return row


def page(rows: list[Row], sizes: list[float]) -> str:
    """Return the page as Markdown."""
    load = os.getloadavg()[2] if hasattr(os, "getloadavg") else float("nan")
    command = f"python -m benchmarks.performance {' '.join(f'{size:g}' for size in sizes)}"
    table = [
        "| points | decoding | 1 worker | 2 workers | cluster, 2 workers | 1 worker / decoding | cluster / 2 workers |",
        "|---|---|---|---|---|---|---|",
        *(
            f"| {r.millions:g} million | {r.decoding.cpu_s:.1f} s | {r.one.cpu_s:.1f} s | {r.two.cpu_s:.1f} s"
            f" | {r.cluster.cpu_s:.1f} s | {r.one.cpu_s / r.decoding.cpu_s:.1f} | {r.cluster.cpu_s / r.two.cpu_s:.2f} |"
            for r in rows
        ),
    ]
    memory = [
        "| points | 1 worker | 2 workers | cluster, 2 workers | store and surface on disk |",
        "|---|---|---|---|---|",
        *(
            f"| {r.millions:g} million | {r.one.memory / 1e9:.2f} GB | {r.two.memory / 1e9:.2f} GB"
            f" | {r.cluster.memory / 1e9:.2f} GB | {r.store_bytes / r.millions / 1e6:.0f} bytes a point |"
            for r in rows
        ),
    ]
    names = list(dict.fromkeys(name for r in rows for name in r.stages))
    stages = [
        f"| stage | {' | '.join(f'{r.millions:g} million' for r in rows)} |",
        "|---|" + "---|" * len(rows),
        *(f"| {name} | {' | '.join(share(r, name) for r in rows)} |" for name in names),
    ]
    same = "the same bytes by all three ways" if all(r.is_same for r in rows) else "NOT the same by all ways"
    return f"""# Performance

What `linework extract` costs, measured by `{command}`, which writes this page. {machine()}, Python {platform.python_version()}, {datetime.date.today():%d %B %Y}; other programs ran at the same time (load average {load:.0f}), so processor time is what can be compared. The drive is simulated (`benchmarks.large`): a bending road between guardrails, poles and wires, some 3,300 points a metre; all kinds of line, kernels compiled, nothing in the work folder. The lines were {same}.

## Processor time of all processes

Decoding is laspy's parallel decoder on the same files. *Cluster* is `--scheduler local`: it includes starting the scheduler and the workers of Dask. The goal is 4 times decoding at 5 million points, 3.2 at 15 and 2.5 at 50.

{chr(10).join(table)}

## Most memory of all processes at a time

{chr(10).join(memory)}

## Stages

Share of the time that passed, with one worker; the rest is starting: loading Python's modules and the kernels, in the command and in the worker.

{chr(10).join(stages)}

Further benchmarks are modules of `benchmarks`, one for each subject: `make bench` runs those that take minutes.
"""


def share(row: Row, stage: str) -> str:
    """Return the share of a stage in the time that a run with one worker took."""
    return f"{row.stages[stage] / row.one.wall_s:.0%}" if stage in row.stages else ""


def machine() -> str:
    """Return the processor and the number of cores, as the system names them."""
    name = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.exists():
        models = [line for line in info.read_text().splitlines() if line.startswith("model name")]
        name = models[0].partition(":")[2].strip() if models else name
    return f"{name}, {os.cpu_count()} cores"


if __name__ == "__main__":
    main(*sys.argv[1:])
