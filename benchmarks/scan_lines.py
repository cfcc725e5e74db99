"""Scan lines: what recovering them costs, against reading the same points, how right they are, and crossings by them.

CPU time of this process, best of three. Reading is that of the points with the fields of their scanner from the survey's
laser files, as `linework.read_points` does, tile store included. ``--later N`` takes the same roads of seeds N later.
"""

import argparse
import tempfile
import time
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from linework.files.store.in_memory import read_survey_points
from linework.files.survey.open import open_survey
from linework.scanlines.crossings import support_of
from linework.scanlines.recover import recover_scan_lines
from linework.scanlines.timing import scanner_timing
from linework.simulation.folder import write_survey_folder
from linework.simulation.sensors.crossings import count_crossings
from linework.simulation.simulate import simulate_survey

FIELDS = ("point_source_id", "scanner_channel", "scan_angle", "scan_direction_flag", "edge_of_flight_line")
#: Kind of road, seed, scanner, points per metre.
SURVEYS = (
    ("urban", 11, "default", 6000.0),
    ("bends", 12, "one", 6000.0),
    ("urban", 13, "tilted", 6000.0),
    ("urban", 14, "spinning16", 8000.0),
    ("bends", 15, "spinning64", 16_000.0),
    ("urban", 16, "airborne", None),
)


def best(work):
    seconds = []
    for _ in range(4):  # the first compiles
        start = time.process_time()
        result = work()
        seconds.append(time.process_time() - start)
    return min(seconds[1:]), result


def share_right(survey, lines):
    """Return the share of neighbouring points that are rightly of one line or of two, on the ground and above it."""
    points = survey.points
    sample = np.arange(0, len(points), max(len(points) // 40_000, 1))
    _, near = cKDTree(points.xyz).query(points.xyz[sample], 7)
    near = near[:, 1:]
    found = lines.line[sample][:, None] == lines.line[near]
    return np.mean(found == (survey.sweep[sample][:, None] == survey.sweep[near]))


def crossings(survey, lines):
    """Return found over true scan lines at stations of the true lines, and the share of stations within 10 % of truth."""
    within = 0.6 if lines.kind == "airborne" else 0.3
    stations = survey.truth.xyz[:: max(len(survey.truth.xyz) // 500, 1)]
    true = count_crossings(survey, stations, within).n_sweeps
    near = cKDTree(survey.points.xyz).query_ball_point(stations, within)
    found = np.array([support_of(lines, np.array(index, dtype=np.int64)).n_lines for index in near])
    many = true >= 2
    return found[many].sum() / true[many].sum(), np.mean(np.abs(found - true)[many] <= 0.1 * true[many])


def main(arguments=()):
    parser = argparse.ArgumentParser(prog="python -m benchmarks.scan_lines")
    parser.add_argument(
        "--later", type=int, default=0, help="added to every seed: roads that nobody has looked at"
    )
    later = parser.parse_args(list(arguments)).later
    print(
        f"{'survey':<24}{'points':>10}{'timing':>8}{'lines':>7}{'read':>7}  ns a point {'ratio':>9}{'right':>9}{'crossings':>11}{'within 10 %':>13}"
    )
    for road, seed, scanner, density in SURVEYS:
        survey = simulate_survey(road, seed + later, 80.0, points_per_m=density, scanner=scanner)
        n = len(survey.points)
        carried = tuple(name for name in (*FIELDS, "ring") if name in survey.points.columns)
        with tempfile.TemporaryDirectory() as folder:
            write_survey_folder(survey, Path(folder) / "s")
            opened = open_survey([Path(folder) / "s"], carry=carried)
            read, _ = best(lambda opened=opened: read_survey_points(opened))
        for_timing, timing = best(lambda survey=survey: scanner_timing(survey.points))
        for_lines, lines = best(
            lambda survey=survey, timing=timing: recover_scan_lines(survey.points, timing)
        )
        ratio, within = crossings(survey, lines)
        print(
            f"{f'{road} {scanner} {seed + later}':<24}{n:>10,}{for_timing / n * 1e9:8.0f}{for_lines / n * 1e9:7.0f}{read / n * 1e9:7.0f}"
            f"{'':13}{(for_timing + for_lines) / read:9.2f}{100 * share_right(survey, lines):8.2f}%{ratio:11.3f}{100 * within:12.1f}%"
        )


if __name__ == "__main__":
    import sys

    main(sys.argv[1:])
