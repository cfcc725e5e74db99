"""The main job on 4 million points, against only decoding the same file with laspy's parallel backend."""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

N_POINTS = 4_000_000
N_REPEATS = 5
GOAL = 2.5

DECODE = """
import sys, time
import laspy
start = time.perf_counter()
with laspy.open(sys.argv[1], laz_backend=laspy.LazBackend.LazrsParallel) as file:
    las = file.read()
    xyz = las.xyz
print(time.perf_counter() - start, len(xyz))
"""


def main() -> None:
    """Make the survey, time both in turn, print the ratio and where the time goes."""
    with tempfile.TemporaryDirectory(prefix="linework-bench-") as folder:
        survey = Path(folder) / "survey"
        make_survey(survey)
        points = survey / "points.laz"
        print(f"survey: {N_POINTS:,} points, {points.stat().st_size / 1e6:.1f} MB; {os.cpu_count()} cores")
        extract_once(survey)  # compiles the kernels, once per machine
        runs = [measure(survey, points) for _ in range(N_REPEATS)]
    report(runs)


def make_survey(folder: Path) -> None:
    """Write a bending road of exactly `N_POINTS` points, one file, with its trajectory."""
    from linework.files.las.write import write_las
    from linework.files.trajectories.read import write_trajectory
    from linework.simulation.simulate import simulate_survey

    length_m = 400.0
    while True:
        survey = simulate_survey("bends", 3, length_m, points_per_m=1.3 * N_POINTS / length_m)
        if len(survey.points) >= N_POINTS:
            break
        length_m *= 1.25 * N_POINTS / len(survey.points)
    write_las(survey.points.take(slice(0, N_POINTS)), folder / "points.laz", crs=survey.crs)
    write_trajectory(survey.trajectory, folder / "trajectory.csv")
    (folder / "survey.toml").write_text(
        '[points]\nfiles = ["points.laz"]\n[trajectory]\nfile = "trajectory.csv"\n', encoding="utf-8"
    )


def measure(survey: Path, points: Path) -> dict[str, float]:
    """Time decoding and extraction once each, one after the other."""
    start, cpu_start = time.perf_counter(), children_cpu_s()
    said = subprocess.run([sys.executable, "-c", DECODE, points], capture_output=True, text=True, check=True)
    decode_s, decode_cpu_s = time.perf_counter() - start, children_cpu_s() - cpu_start
    inside_s, n_points = said.stdout.split()
    assert int(n_points) == N_POINTS
    extract_s, timings = extract_once(survey)
    extract_cpu_s = children_cpu_s() - cpu_start - decode_cpu_s
    steps = {f"  {step}": seconds for step, seconds in timings.items()}
    rest = {"  start-up, imports, trajectory, record": extract_s - sum(timings.values())}
    return {
        "decode, as a process": decode_s,
        "decode, inside it": float(inside_s),
        "extract, as a process": extract_s,
    } | steps | rest | {"decode, processor time": decode_cpu_s, "extract, processor time": extract_cpu_s}  # fmt: skip


def children_cpu_s() -> float:
    """Return the processor time of all processes started here, which other load on the machine changes less."""
    times = os.times()
    return times.children_user + times.children_system


def extract_once(survey: Path) -> tuple[float, dict[str, float]]:
    """Run the command as a user does and return its wall time and the times of its steps."""
    output = survey.parent / "lines.gpkg"
    command = [sys.executable, "-m", "linework", "extract", survey, "-o", output, "--overwrite", "--quiet"]
    start = time.perf_counter()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    seconds = time.perf_counter() - start
    return seconds, json.loads((survey.parent / "run.json").read_text(encoding="utf-8"))["timings_s"]


def report(runs: list[dict[str, float]]) -> None:
    """Print the median and the best of every time, and the ratios."""
    print(f"{'':42} median     best   [s], {len(runs)} runs in turn")
    for name in runs[0]:
        values = [run[name] for run in runs]
        print(f"{name:42} {statistics.median(values):6.2f}   {min(values):6.2f}")
    for base in ("decode, as a process", "decode, inside it"):
        ratios = [run["extract, as a process"] / run[base] for run in runs]
        best = min(run["extract, as a process"] for run in runs) / min(run[base] for run in runs)
        print(f"extract / ({base}): median {statistics.median(ratios):.2f}, best to best {best:.2f}")
    ratios = [run["extract, processor time"] / run["decode, processor time"] for run in runs]
    print(f"processor time, extract / decode: median {statistics.median(ratios):.2f}")
    print(f"goal: extract as a process <= {GOAL} x decode as a process")


if __name__ == "__main__":
    main()
