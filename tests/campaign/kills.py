"""Runs killed at random moments and resumed: is the output that of an undisturbed run, to the last byte?

    python -m benchmarks.kills [KILLS] [SEED]

The whole group of processes is killed (SIGKILL). A run begins anew when it has been resumed to its end.
"""

from __future__ import annotations

import hashlib
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

#: Takes long: not among those that are run without being named.
ON_REQUEST = True
SETTINGS = "[tiling]\ncore_m = 64.0\nhigh_core_m = 64.0\nmax_points = 10000\n"


def main(n_kills: int = 50, seed: int = 1) -> int:
    """Kill and resume until there were `n_kills`; print what came of it, return the number of faults."""
    chance, found = random.Random(seed), Counter[str]()
    with tempfile.TemporaryDirectory(prefix="linework-kills-") as name:
        folder = Path(name)
        survey = make_survey(folder / "survey")
        run(survey, folder / "first")  # compiles the kernels, once per machine
        start = time.monotonic()
        run(survey, folder / "undisturbed")
        seconds, expected = time.monotonic() - start, sha256(folder / "undisturbed" / "lines.gpkg")
        while found["kills"] < n_kills:
            out = folder / f"run{found['runs']}"
            found["runs"] += 1
            while (
                code := run(survey, out, "--resume", limit_s=chance.uniform(0.02, 0.95) * seconds)
            ) is None:
                found["kills"] += 1
                lines = out / "lines.gpkg"
                found["seen, not whole"] += lines.exists() and sha256(lines) != expected
            found["exit codes other than 0"] += code != 0
            found["outputs that differ"] += sha256(out / "lines.gpkg") != expected
            found["parts left"] += len(list(out.glob(".*.part*")))
            shutil.rmtree(out)
    print(f"undisturbed {seconds:.1f} s;", ", ".join(f"{what}: {n}" for what, n in found.items()))
    return found.total() - found["kills"] - found["runs"]


def make_survey(folder: Path) -> Path:
    """Write a small survey that is worked in many tiles."""
    from linework.simulation.folder import write_survey_folder
    from linework.simulation.simulate import simulate_survey

    write_survey_folder(simulate_survey("bends", 612, 150.0, points_per_m=800), folder)
    (folder / "run.toml").write_text(SETTINGS, encoding="utf-8")
    return folder


def command(survey: Path, out: Path, *more: str) -> list[str]:
    """Return the command line of a run whose work folder and output lie in `out`."""
    return [
        sys.executable, "-m", "linework", "extract", str(survey), "-o", str(out / "lines.gpkg"), "--quiet",
        "--config", str(survey / "run.toml"), "--work", str(out / "work"), *more,
    ]  # fmt: skip


def run(survey: Path, out: Path, *more: str, limit_s: float | None = None) -> int | None:
    """Run once; return the exit code, None where it took longer than `limit_s` and was killed."""
    with subprocess.Popen(
        command(survey, out, *more),
        start_new_session=True,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    ) as process:
        try:
            return process.wait(limit_s)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            return None


def sha256(path: Path) -> str:
    """Return the hash of a file, "" where there is none."""
    return hashlib.sha256(path.read_bytes()).hexdigest() if path.exists() else ""


if __name__ == "__main__":
    sys.exit(1 if main(*map(int, sys.argv[1:])) else 0)
