"""Disks that fail: every k-th call of a run, and disks of many sizes. Is a run that ends well always right?

    python -m benchmarks.faults FAULTIO.so [EVERY]

FAULTIO.so fails the k-th call of a kind in each process (LD_PRELOAD; FAULT_OP, FAULT_N, FAULT_ERRNO,
FAULT_STICKY, FAULT_SHORT, FAULT_COUNT). Full disks are made with mount (tmpfs), where that is allowed. After
each fault the run is resumed without it, and must come to the right output.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Mapping
from pathlib import Path

from benchmarks.kills import command, make_survey, run, sha256

#: Takes long: not among those that are run without being named.
ON_REQUEST = True
ERRORS = {"ENOSPC": "28", "EIO": "5"}
MODES: dict[str, tuple[dict[str, str], ...]] = {
    "write": ({}, {"FAULT_STICKY": "1"}, {"FAULT_SHORT": "1"}),
    "fsync": ({}, {"FAULT_STICKY": "1"}),
    "rename": ({}, {"FAULT_STICKY": "1"}),
}
N_SIZES = 20


def main(library: str, every: str = "1") -> int:
    """Try all faults; print what came of them and return how many runs were wrong."""
    library = str(Path(library).resolve())
    with tempfile.TemporaryDirectory(prefix="linework-faults-") as name:
        folder = Path(name)
        survey = make_survey(folder / "survey")
        run(survey, folder / "first")
        run(survey, folder / "undisturbed")
        expected = sha256(folder / "undisturbed" / "lines.gpkg")
        n_wrong = 0
        for operation, modes in MODES.items():
            highest = n_calls(survey, folder / "count", library, operation)
            print(f"{operation}: at most {highest} calls in a process")
            for mode in modes:
                for error, number in ERRORS.items():
                    settings = {"LD_PRELOAD": library, "FAULT_OP": operation, "FAULT_ERRNO": number} | mode
                    found = Counter[str]()
                    for k in range(1, highest + 1, int(every)):
                        found += one_fault(survey, folder / "out", expected, settings | {"FAULT_N": str(k)})
                    n_wrong += report(f"{operation} {error} {' '.join(mode)}", found)
        n_wrong += report(f"{N_SIZES} sizes of a full disk", full_disks(survey, folder, expected))
    return n_wrong


def n_calls(survey: Path, out: Path, library: str, operation: str) -> int:
    """Return how often the busiest process of a run makes a call."""
    count = out.with_suffix(".txt")
    disturbed(survey, out, {"LD_PRELOAD": library, "FAULT_OP": operation, "FAULT_COUNT": str(count)})
    return max(int(line.split()[1]) for line in count.read_text(encoding="utf-8").splitlines())


def disturbed(survey: Path, out: Path, settings: Mapping[str, str]) -> int:
    """Run with a fault and return the exit code."""
    environment = os.environ | settings
    arguments = command(survey, out)
    done = subprocess.run(arguments, env=environment, capture_output=True, check=False, timeout=120)
    return done.returncode


def one_fault(survey: Path, out: Path, expected: str, settings: Mapping[str, str]) -> Counter[str]:
    """Run with a fault, then resume without it; count what came of both."""
    shutil.rmtree(out, ignore_errors=True)
    code = disturbed(survey, out, settings)
    return judged(out, code, expected) + after(survey, out, expected)


def judged(out: Path, code: int, expected: str) -> Counter[str]:
    """Count how a run ended, and whether what is there is right."""
    lines = sha256(out / "lines.gpkg")
    found = Counter({f"exit {code}": 1})
    found["WRONG: success without the right lines"] += code == 0 and lines != expected
    found["WRONG: something else at the output's name"] += lines not in ("", expected)
    return found


def after(survey: Path, out: Path, expected: str) -> Counter[str]:
    """Resume without a fault and count whether that comes to the right lines."""
    code = run(survey, out, "--resume")
    return Counter({"WRONG: not mended by resuming": code != 0 or sha256(out / "lines.gpkg") != expected})


def full_disks(survey: Path, folder: Path, expected: str) -> Counter[str]:
    """Run on disks of many sizes, from a tenth of what is needed to a little more than that."""
    undisturbed = folder / "undisturbed"
    parts = [p for p in (*(undisturbed / "work").rglob("*"), undisturbed / "lines.gpkg") if p.is_file()]
    needed, found = 1.3 * sum(p.stat().st_size for p in parts), Counter[str]()
    disk = folder / "disk"
    disk.mkdir()
    for i in range(N_SIZES):
        size = int(needed * (0.1 + i / (N_SIZES - 1)))
        mounted = subprocess.run(
            ["mount", "-t", "tmpfs", "-o", f"size={size}", "none", str(disk)], check=False
        )
        if mounted.returncode != 0:
            return Counter({"disks that could not be made": N_SIZES})
        try:
            code = run(survey, disk / "out")
            found += judged(disk / "out", -1 if code is None else code, expected)
            subprocess.run(["mount", "-o", f"remount,size={4 * int(needed)}", str(disk)], check=True)
            found += after(survey, disk / "out", expected)
        finally:
            subprocess.run(["umount", str(disk)], check=True)
    return found


def report(what: str, found: Counter[str]) -> int:
    """Print what came of a kind of fault; return how many runs were wrong."""
    n_wrong = sum(n for name, n in found.items() if name.startswith("WRONG"))
    print(f"{what}: " + ", ".join(f"{name}: {n}" for name, n in sorted(found.items()) if n), flush=True)
    return n_wrong


if __name__ == "__main__":
    sys.exit(1 if main(*sys.argv[1:]) else 0)
