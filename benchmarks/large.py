"""A large drive: `linework extract` against merely decoding it, and the memory of all its processes.

    python -m benchmarks.large [MILLIONS ...]      (5 15 50 if none are given)

The drive is simulated in three pieces, and repeated beside itself until there are enough points: about 3,300 a
metre of road, in files of 5 million. Fewer points than a piece has are those of a shorter piece.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

#: Takes long: not among those that are run without being named.
ON_REQUEST = True
PIECE_M, POINTS_PER_M, FILE_POINTS = 1500.0, 5700.0, 5_000_000
#: So many of them at least are returned.
LEAST_PER_M = 3000.0
#: Copies of the drive lie so far apart.
APART_M = 4000.0
DECODE = """
import sys
import laspy
for name in sys.argv[1:]:
    with laspy.open(name, laz_backend=laspy.LazBackend.LazrsParallel) as file:
        file.read().xyz
"""


def main(*millions: str) -> None:
    """Make the drives and measure each."""
    with tempfile.TemporaryDirectory(prefix="linework-large-") as name:
        folder = Path(name)
        for n in [int(text) for text in millions] or [5, 15, 50]:
            survey = make_survey(folder / f"drive{n}", n * 1_000_000)
            if n == (int(millions[0]) if millions else 5):
                measured(
                    [*extraction(survey, folder / "first.gpkg")]
                )  # compiles the kernels, once per machine
                subprocess.run([sys.executable, "-m", "linework", "clean", str(survey)], check=True)
            files = sorted(str(path) for path in survey.glob("*.laz"))
            decode_s, decode_cpu_s, _ = measured([sys.executable, "-c", DECODE, *files])
            wall_s, cpu_s, memory = measured([*extraction(survey, folder / f"lines{n}.gpkg")])
            print(
                f"{n} million points: decoding {decode_s:.1f} s ({decode_cpu_s:.1f} s of processor time), extract"
                f" {wall_s:.1f} s ({cpu_s:.1f} s): {wall_s / decode_s:.2f} times the wall time,"
                f" {cpu_s / decode_cpu_s:.2f} times the processor time; memory of all processes at most"
                f" {memory / 1e9:.2f} GB; {os.cpu_count()} cores",
                flush=True,
            )


def extraction(survey: Path, output: Path, *more: str, workers: int = 2) -> Iterator[str]:
    """Return the command line."""
    yield from (sys.executable, "-m", "linework", "extract", str(survey), "-o", str(output))
    yield from ("--workers", str(workers), "--quiet", "--overwrite", *more)


def make_survey(folder: Path, n_points: int) -> Path:
    """Write a drive of at least so many points, with its trajectory."""
    from linework.files.las.write import write_las
    from linework.files.trajectories.read import write_trajectory
    from linework.model.points import Points
    from linework.model.trajectory import Trajectory
    from linework.simulation.simulate import simulate_survey

    n, k = 0, 0
    times, places, start_s = [], [], 3.0e8
    piece_m = min(PIECE_M, n_points / LEAST_PER_M)
    while n < n_points:
        seed, row = 700 + k % 3, k // 3
        survey = simulate_survey("bends", seed, piece_m, points_per_m=POINTS_PER_M)
        shift = np.array([APART_M * (k % 3), APART_M * row, 0.0])
        shift[:2] -= np.round(survey.points.xyz[0, :2] - [500_000.0, 5_800_000.0])
        path, late = survey.trajectory, start_s - float(survey.trajectory.time_s[0])
        times.append(path.time_s + late)
        places.append(path.xyz + shift)
        start_s = float(times[-1][-1]) + 60.0
        points = survey.points.take(slice(0, n_points - n))
        assert points.time_s is not None
        points = Points(points.xyz + shift, intensity=points.intensity, time_s=points.time_s + late)
        for i in range(0, len(points), FILE_POINTS):
            part = points.take(slice(i, i + FILE_POINTS))
            write_las(part, folder / f"drive{k:02d}_{i // FILE_POINTS}.laz", crs=survey.crs)
        n, k = n + len(points), k + 1
    write_trajectory(Trajectory(np.concatenate(times), np.concatenate(places)), folder / "trajectory.csv")
    (folder / "survey.toml").write_text(
        '[points]\nfiles = ["*.laz"]\n[trajectory]\nfile = "trajectory.csv"\n', encoding="utf-8"
    )
    return folder


def measured(command: list[str]) -> tuple[float, float, int]:
    """Run a command; return wall time, processor time and the most memory of it and its children at a time.

    The processor time is at least this: the larger of what the processes took that were waited for, and of what was seen of all,
    up to a tenth of a second before their ends.
    """
    # Modules' bytecode is kept, as it is for users: without it every process compiles 300 files, 1 to 2 s
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    before, start = os.times(), time.perf_counter()
    most, seen_s = 0, dict[int, float]()
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, env=kept) as process:
        done = threading.Event()

        def watch() -> None:
            nonlocal most
            while not done.wait(0.1):
                most = max(most, memory_of(process.pid))
                seen_s.update(processor_time_of(process.pid))

        watcher = threading.Thread(target=watch)
        watcher.start()
        code = process.wait()
        done.set()
        watcher.join()
    if code != 0:
        raise subprocess.CalledProcessError(code, command)
    wall_s, after = time.perf_counter() - start, os.times()
    used = after.children_user + after.children_system - before.children_user - before.children_system
    return wall_s, max(used, sum(seen_s.values())), most


def memory_of(pid: int) -> int:
    """Return the resident bytes of a process and all that it has started."""
    page = os.sysconf("SC_PAGE_SIZE")
    return sum(int(text.split()[1]) * page for _, text in _of_tree(pid, "statm"))


def processor_time_of(pid: int) -> dict[int, float]:
    """Return the processor time so far of a process and of each that it has started, by number [s]."""
    tick = os.sysconf("SC_CLK_TCK")
    # Behind the name of the program, which may hold blanks; user and system time are the fields 14 and 15
    fields = ((one, text.rpartition(")")[2].split()) for one, text in _of_tree(pid, "stat"))
    return {one: (int(field[11]) + int(field[12])) / tick for one, field in fields}


def _of_tree(pid: int, name: str) -> Iterator[tuple[int, str]]:
    """Yield a file under /proc of a process and of all that it has started."""
    waiting = [pid]
    while waiting:
        one = waiting.pop()
        try:
            text = Path(f"/proc/{one}/{name}").read_text()
            for task in Path(f"/proc/{one}/task").iterdir():
                waiting += [int(child) for child in (task / "children").read_text().split()]
        except OSError:
            continue
        yield one, text


if __name__ == "__main__":
    main(*sys.argv[1:])
