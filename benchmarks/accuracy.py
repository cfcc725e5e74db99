"""How good the lines are on simulated surveys: all roads, several seeds, pooled.

``python -m benchmarks accuracy`` takes the seeds below; ``python -m benchmarks.accuracy --seeds 200-219
--roads bends,urban --length-m 200`` takes others. Nothing may be tuned on the seeds that are reported.
"""

import argparse
import time

from linework.cli.score_tables import print_tables
from linework.evaluation.measures import match_lines, score
from linework.evaluation.scores import Scores
from linework.evaluation.tables import score_tables
from linework.methods.choose import ALL_KINDS, RunSettings, choose_methods
from linework.model.lines import LineSet
from linework.model.tile import TileData
from linework.simulation.draw import ROADS
from linework.simulation.simulate import simulate_survey

SEEDS = "100-109"
TOLERANCE_M = 0.10


def main(arguments=()):
    options = parsed(arguments)
    pooled = {}
    for road in options.roads.split(","):
        parts = []
        for seed in seeds_of(options.seeds):
            parts += survey_parts(road, seed, options.length_m, options.points_per_m)
        print(f"\n=== {road}, seeds {options.seeds}, {options.length_m:g} m each")
        print_tables(list(score_tables(scores_of(parts)))[:2])
        pooled[road] = parts
    print(f"\n=== all roads: {', '.join(pooled)}")
    print_tables(score_tables(scores_of([part for parts in pooled.values() for part in parts])))


def parsed(arguments):
    parser = argparse.ArgumentParser(prog="python -m benchmarks.accuracy")
    parser.add_argument("--seeds", default=SEEDS, help="first-last, or a list")
    parser.add_argument("--roads", default=",".join(ROADS))
    parser.add_argument("--length-m", type=float, default=200.0)
    parser.add_argument("--points-per-m", type=float, default=None)
    return parser.parse_args(list(arguments))


def seeds_of(text):
    """Seeds of "3-5" or "3,4,5"."""
    if "-" in text:
        first, last = map(int, text.split("-"))
        return range(first, last + 1)
    return [int(seed) for seed in text.split(",")]


def survey_parts(road, seed, length_m, points_per_m):
    """Simulate, extract and match one survey; say in one line how it came out."""
    survey = simulate_survey(road, seed, length_m, points_per_m=points_per_m)
    start = time.perf_counter()
    tile = TileData("benchmark", survey.points.bounds.grown(1.0), survey.points, survey.trajectory)
    methods = choose_methods("auto", ALL_KINDS, RunSettings())
    found = LineSet.concatenate([method.extract(tile) for method in methods])
    seconds = time.perf_counter() - start
    parts = match_lines(found.with_columns(crs=survey.crs), survey.truth, kinds=ALL_KINDS)
    print(f"{road} {seed}: {len(survey.points) / 1e6:.2f} M points, {seconds:.1f} s", end="")
    for part in parts:
        at = score([part], part.kind, TOLERANCE_M, ()).at
        print(f"; {part.kind}", end="")
        for name in ("completeness", "correctness"):
            value = getattr(at, name)
            print(f" {name[:4]} {'-' if value is None else format(value, '.3f')}", end="")
    print(flush=True)
    return list(parts)


def scores_of(parts):
    """Score the parts of many surveys as if they were one."""
    by_kind = [[part for part in parts if part.kind == kind] for kind in ALL_KINDS]
    kinds = tuple(score(own, own[0].kind, TOLERANCE_M) for own in by_kind)
    return Scores(tolerance_m=TOLERANCE_M, kinds=kinds, overall=score(parts, "overall", TOLERANCE_M))


if __name__ == "__main__":
    import sys

    main(sys.argv[1:])
