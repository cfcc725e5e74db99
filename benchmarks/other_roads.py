"""How good the lines are on roads of another generator than ours: `python -m benchmarks.other_roads`.

Six scenes (`--scenes street,country,...`), seeds (`--seeds 1-3`), scanners by noise, points and intensities
(`--noise-cm 2 --bits 8 --offset 20 --lines-per-m 25 --heads 1`). Markings and boundaries as `linework.extract` gives
them, within 10 cm of what was seen of the truth. See `benchmarks._profile_roads` for what differs.
"""

import argparse
import time
import warnings

import numpy as np

import linework
from benchmarks._profile_roads import SCENES, Scanner, recorded, truth_of
from benchmarks._real_worlds import false_m
from benchmarks.accuracy import seeds_of
from linework.errors import LineworkWarning
from linework.evaluation.measures import match_lines, score
from linework.evaluation.report.tables import centimetres, number, percent

#: Run where it is asked for.
ON_REQUEST = True
TOLERANCE_M = 0.10
KINDS = ("lane_marking", "lane_marking_dash", "road_boundary")


def main(arguments=()):
    options = parsed(arguments)
    scanner = Scanner(
        noise_m=options.noise_cm / 100.0,
        bits=options.bits,
        offset=options.offset,
        lines_per_m=options.lines_per_m,
        points_per_line=options.points_per_line,
        tilt_deg=(45.0, -45.0)[: options.heads],
    )
    warnings.simplefilter("ignore", LineworkWarning)
    parts = {}
    for name in options.scenes.split(","):
        for seed in seeds_of(options.seeds):
            survey = made(name, seed, options.length_m, scanner)
            start = time.perf_counter()
            found = linework.extract(survey[0], trajectory=survey[1], kinds=KINDS)
            seconds = time.perf_counter() - start
            matches = match_lines(found, survey[2], kinds=KINDS)
            told = [shown(one) for one in matches]
            print(
                f"{name} {seed}: {len(survey[0]) / 1e6:.2f} M points, {seconds:.0f} s; {'; '.join(filter(None, told))}",
                flush=True,
            )
            for one in matches:
                parts.setdefault((name, one.kind), []).append(one)
    print()
    for (name, _), matches in parts.items():
        print(f"{name:12}", shown(*matches))


def parsed(arguments):
    parser = argparse.ArgumentParser(prog="python -m benchmarks.other_roads")
    parser.add_argument("--scenes", default=",".join(SCENES))
    parser.add_argument("--seeds", default="1-3", help="first-last, or a list")
    parser.add_argument("--length-m", type=float, default=100.0)
    parser.add_argument("--noise-cm", type=float, default=0.5, help="of a range")
    parser.add_argument("--bits", type=int, default=16, help="of the intensities")
    parser.add_argument("--offset", type=float, default=0.0, help="of the intensities: what black reads")
    parser.add_argument("--lines-per-m", type=float, default=25.0, help="scan lines, all heads")
    parser.add_argument("--points-per-line", type=int, default=1500, help="in a whole turn")
    parser.add_argument("--heads", type=int, default=2, choices=(1, 2))
    options = parser.parse_args(list(arguments))
    if options.offset >= 2**options.bits:
        parser.error(f"--offset {options.offset:g} leaves nothing of {options.bits} bits")
    return options


def made(name, seed, length_m, scanner):
    """Return points, trajectory and truth of a scene."""
    rng = np.random.default_rng([seed, list(SCENES).index(name)])
    road = SCENES[name](length_m, rng)
    points, trajectory = recorded(road, rng, scanner)
    return points, trajectory, truth_of(road, points)


def shown(*matches):
    """Return completeness, correctness, lateral error and false metres of a kind."""
    one = score(list(matches), matches[0].kind, TOLERANCE_M)
    if not one.observed_m and not one.extracted_m:
        return ""
    lateral = centimetres(one.at.lateral.rmse_m)
    return (
        f"{one.kind} {percent(one.at.completeness)} of {number(one.observed_m, 0)} m / "
        f"{percent(one.at.correctness)}, {lateral} cm, false {number(false_m(one), 0)} m"
    )


if __name__ == "__main__":
    import sys

    main(sys.argv[1:])
