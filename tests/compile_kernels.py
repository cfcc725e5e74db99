"""Compile the kernels before the tests run, on two cores: no test waits for a compiler.

Numba keeps compiled kernels beside their sources and looks only at the file of the kernel itself: one that calls
a kernel of another file stays as it was when that file changes. So all are compiled anew after any change.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import linework

KERNELS = Path(linework.__file__).parent / "kernels"
#: What comes to all kernels of a kind of line, the longest first.
RUNS = (
    ("extract", "--features", "lane_marking,lane_marking_dash,road_boundary"),
    ("extract", "--features", "guardrail,barrier,cable"),
    ("extract", "--method", "stereo"),
    ("locate",),
)


def run(*arguments: object) -> None:
    """Run a command of linework; its output is shown only if it fails."""
    command = [sys.executable, "-m", "linework", *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"{' '.join(command)}: exit code {done.returncode}\n{done.stderr}")


def main() -> None:
    """Compile all kernels that the main commands come to."""
    start = time.monotonic()
    for cached in [*KERNELS.rglob("*.nbi"), *KERNELS.rglob("*.nbc")]:
        cached.unlink()
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        survey = folder / "survey"
        run("simulate", "-o", survey, "--road", "motorway", "--seed", 1, "--length-m", 40, "--points-per-m", 2000,
            "--image-size", "732x484", "--image-every-m", 8, "--quiet")  # fmt: skip

        def compile_for(i: int) -> None:
            command, *options = RUNS[i]
            output = folder / (f"trajectory{i}.csv" if command == "locate" else f"lines{i}.gpkg")
            work = () if command == "locate" else ("--work", folder / f"work{i}", "--workers", 1)
            run(command, survey, "-o", output, *options, *work, "--quiet")

        with ThreadPoolExecutor(2) as lanes:
            list(lanes.map(compile_for, range(len(RUNS))))
    print(f"compiled the kernels in {time.monotonic() - start:.0f} s")


if __name__ == "__main__":
    main()
