"""How right the classes of points are, and what they cost beside reading and writing the same files.

``python -m benchmarks.classify`` takes a simulated road of every kind, classifies its points by the exact lines and by
those that `extract` finds, and compares each point with what its beam met: recall / precision, in percent. The
carriageway is road and marking together. Strays are of the class other. ``--cost MILLIONS`` classifies files of so many points instead, and gives the wall time and the
processor time as ratios to reading and writing the same files with the same library, without looking at the points.
"""

import argparse
import os
import sys
import tempfile
import time
import warnings
from pathlib import Path

import laspy
import numpy as np

import linework
from linework.library.classify import classify_files, classify_points
from linework.methods.classes.point_class import PointClass
from linework.simulation.folder import write_survey_folder
from linework.simulation.roads.draw import ROADS
from linework.simulation.simulate import simulate_survey

#: Seeds that nothing was tuned on.
SEEDS = (911, 912)
#: Land without a road: what the vehicle drives on there is called road, as it is on a track.
WITHOUT_ROAD = ("forest", "field", "roofs")
NAMES = [kind.name.lower() for kind in PointClass]


def main(arguments=()):
    parser = argparse.ArgumentParser(prog="python -m benchmarks.classify")
    parser.add_argument("--length-m", type=float, default=150.0)
    parser.add_argument("--seeds", type=int, nargs="+", default=SEEDS)
    parser.add_argument("--roads", nargs="+", default=ROADS)
    parser.add_argument("--conditions", default="usual", choices=("usual", "hard"))
    parser.add_argument("--cost", type=float, default=0.0, metavar="MILLIONS", help="points of the files")
    options = parser.parse_args(arguments)
    warnings.simplefilter("ignore", linework.errors.LineworkWarning)
    if options.cost:
        cost(options.cost * 1e6)
        return
    print(f"{'road':11}{'seed':>4} {'lines':6}" + "".join(f"{name:>14}" for name in ["carriageway", *NAMES]))
    for by in ("exact", "found"):
        total = np.zeros((len(NAMES), len(NAMES)), dtype=np.int64)
        for road in options.roads:
            for seed in options.seeds:
                counts = counted(road, seed, options.length_m, by, options.conditions)
                print_row(f"{road:11}{seed:4} {by:6}", counts)
                total += counts if road not in WITHOUT_ROAD else 0
        print_row(f"{'all roads':15} {by:6}", total)


def counted(road, seed, length_m, by, conditions):
    """Return the number of points by true class (rows) and by class (columns)."""
    survey = simulate_survey(road, seed, length_m, conditions=conditions)
    points = survey.points
    if by == "exact":
        lines = survey.truth
    else:
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name) / "survey"
            write_survey_folder(survey, folder)
            lines = linework.extract(folder, work=Path(name) / "work", on_problem="warn")
    found = classify_points(points, lines, survey.trajectory)
    counts = np.zeros((len(NAMES), len(NAMES)), dtype=np.int64)
    np.add.at(counts, (survey.point_class, found.classes), 1)
    return counts


def print_row(what, counts):
    """Print recall and precision of each class that there is."""
    cells = []
    for kinds in ([PointClass.ROAD, PointClass.MARKING], *([kind] for kind in PointClass)):
        right, there, found = counts[np.ix_(kinds, kinds)].sum(), counts[kinds].sum(), counts[:, kinds].sum()
        cells.append(f"{100 * right / there:.1f} /{100 * right / max(found, 1):6.1f}" if there else "-")
    print(what + "".join(f"{cell:>14}" for cell in cells), flush=True)


def cost(n_points):
    """Print how long it takes to classify files, and to read and write them."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        survey = simulate_survey("urban", SEEDS[0], 400.0)
        write_survey_folder(survey, folder / "survey")
        files = repeated(folder, n_points)
        n = sum(laspy.open(path).header.point_count for path in files)
        size = sum(path.stat().st_size for path in files)
        print(f"{n / 1e6:.1f} million points in {len(files)} files of {size / n:.1f} bytes a point")
        lines = moved(survey.truth, len(files))
        path = moved_path(survey.trajectory, len(files))
        plain = timed("read and write", lambda: [copy(file, folder / "copy.laz") for file in files], n)
        for what in ("first", "again"):
            # The first builds the store of the survey and its surface, as extract has done for its lines
            timed(
                f"classify, {what}",
                lambda: classify_files(
                    files, lines, folder / "classified", trajectory=path, work=folder / "work", overwrite=True
                ),
                n, plain,
            )  # fmt: skip


def timed(what, call, n, plain=(0.0, 0.0)):
    """Print wall and processor time of a call, as ratios to those of reading and writing; return both."""
    start = time.perf_counter(), used()
    result = call()
    taken = time.perf_counter() - start[0], used() - start[1]
    ratio = f"{taken[0] / plain[0]:7.2f} and {taken[1] / plain[1]:.2f} times" if plain[0] else ""
    steps = result["timings_s"] if isinstance(result, dict) else ""
    print(f"{what:16} {taken[0]:7.1f} s, {taken[1]:7.1f} s of processors, {1e9 * taken[1] / n:6.0f} ns a point {ratio}"
          f" {steps}", flush=True)  # fmt: skip
    return taken


def used():
    """Return the processor time of this process and of those that it has waited for [s]."""
    return sum(os.times()[:4])


#: Copies of the road lie this far from one another. [m]
_APART_M = 2000.0


def repeated(folder, n_points):
    """Return LAZ files of a survey that lies beside itself as often as it takes to have so many points."""
    originals = sorted((folder / "survey" / "points").glob("*.laz"))
    read = [laspy.read(path) for path in originals]
    n_times = max(round(n_points / sum(len(las.points) for las in read)), 1)
    files = []
    (folder / "points").mkdir()
    for k in range(n_times):
        for i, las in enumerate(read):
            file = folder / "points" / f"{k:03}_{i}.laz"
            las.header.offsets = las.header.offsets + np.array([_APART_M if k else 0.0, 0.0, 0.0])
            las.points.offsets[:] = las.header.offsets
            las.write(file)
            files.append(file)
    return files


def moved(lines, n_files):
    """Return the lines of all copies."""
    passes = 2 if n_files % 2 == 0 else 1
    step = np.array([_APART_M, 0.0, 0.0])
    return linework.LineSet.concatenate(
        [lines.with_columns(xyz=lines.xyz + k * step) for k in range(max(n_files // passes, 1))]
    )


def moved_path(path, n_files):
    """Return the path through all copies; the time between them is an hour."""
    passes = 2 if n_files % 2 == 0 else 1
    n = max(n_files // passes, 1)
    step = np.array([_APART_M, 0.0, 0.0])
    return linework.Trajectory(
        np.concatenate([path.time_s + 3600.0 * k for k in range(n)]),
        np.concatenate([path.xyz + k * step for k in range(n)]),
    )


def copy(path, target):
    """Read a file and write it again, in batches and on all cores, as fast as the library can."""
    with (
        laspy.open(path, laz_backend=laspy.LazBackend.LazrsParallel) as reader,
        laspy.open(
            target, mode="w", header=reader.header, laz_backend=laspy.LazBackend.LazrsParallel
        ) as writer,
    ):
        for batch in reader.chunk_iterator(500_000):
            writer.write_points(batch)


if __name__ == "__main__":
    main(sys.argv[1:])
