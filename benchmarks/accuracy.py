"""How good the lines are on simulated surveys: all roads, several seeds, pooled.

``python -m benchmarks accuracy`` takes the seeds below; ``python -m benchmarks.accuracy --seeds 200-219
--roads bends,urban --length-m 200`` takes others. ``--degrade half,quarter,noise3cm,no-trajectory,8bit`` scores
the same surveys once more in each of these variants, and the confidence over all of them. Nothing may be tuned
on the seeds that are reported.
"""

import argparse
import time

from benchmarks._degrade import AS_DRAWN, VARIANTS, degraded
from benchmarks._summary import confidence_table, summary_table
from linework.cli.commands.of_lines.evaluate import print_tables
from linework.evaluation.measures import match_lines, score
from linework.evaluation.report.tables import score_tables
from linework.evaluation.tolerance import DASH_END_M
from linework.evaluation.values import Scores
from linework.methods.choose import choose_methods
from linework.methods.kinds import ALL_KINDS, parse_kinds
from linework.methods.protocol import extract_tile
from linework.methods.radon.method import RadonConfig
from linework.model.lines import LineSet
from linework.model.tile import TileData, local_origin
from linework.simulation.roads.draw import USUAL_ROADS
from linework.simulation.simulate import simulate_survey
from linework.surface.road import RoadConfig, find_ground

SEEDS = "100-109"
TOLERANCE_M = 0.10


def main(arguments=()):
    options = parsed(arguments)
    variants = [AS_DRAWN, *filter(None, options.degrade.split(","))]
    kinds = parse_kinds(options.kinds)
    roads = options.roads.split(",")
    pooled = {(variant, road): [] for variant in variants for road in roads}
    for road in roads:
        for seed in seeds_of(options.seeds):
            survey = simulate_survey(road, seed, options.length_m, points_per_m=options.points_per_m)
            for variant in variants:
                pooled[variant, road] += survey_parts(*degraded(survey, variant), variant, kinds)
        print(f"\n=== {road}, seeds {options.seeds}, {options.length_m:g} m each")
        print_tables(list(score_tables(scores_of(pooled[AS_DRAWN, road])))[:2])
    scores = {v: scores_of([part for road in roads for part in pooled[v, road]]) for v in variants}
    for variant in variants:
        print(f"\n=== all roads, {variant}: {', '.join(roads)}")
        print_tables(score_tables(scores[variant]))
    print(f"\n=== all roads, seeds {options.seeds}, {options.length_m:g} m each: in short")
    print_tables([summary_table(scores)])
    worse = [part for (variant, _), parts in pooled.items() if variant != AS_DRAWN for part in parts]
    if worse:
        print(f"\n=== confidence over {', '.join(variants[1:])}")
        print_tables([confidence_table(worse, TOLERANCE_M)])


def parsed(arguments):
    parser = argparse.ArgumentParser(prog="python -m benchmarks.accuracy")
    parser.add_argument("--seeds", default=SEEDS, help="first-last, or a list")
    parser.add_argument("--roads", default=",".join(USUAL_ROADS))
    parser.add_argument("--kinds", default=",".join(ALL_KINDS))
    parser.add_argument("--length-m", type=float, default=200.0)
    parser.add_argument("--points-per-m", type=float, default=None)
    parser.add_argument("--degrade", default="", help="of " + ",".join(VARIANTS.keys() - {AS_DRAWN}))
    options = parser.parse_args(list(arguments))
    unknown = set(filter(None, options.degrade.split(","))) - set(VARIANTS)
    if unknown:
        parser.error(f"no variant {', '.join(sorted(unknown))}")
    return options


def seeds_of(text):
    """Seeds of "3-5" or "3,4,5"."""
    if "-" in text:
        first, last = map(int, text.split("-"))
        return range(first, last + 1)
    return [int(seed) for seed in text.split(",")]


def survey_parts(survey, trajectory, variant, kinds):
    """Extract and match one survey; say in one line how it came out."""
    start = time.perf_counter()
    found = extracted(survey, trajectory, kinds)
    seconds = time.perf_counter() - start
    # No end of a dash is known better than the scan lines of one pass are apart
    spacing_m = survey.scenario.passes[0].speed_mps / survey.scenario.scanners[0].turns_per_s
    parts = match_lines(
        found.with_columns(crs=survey.crs), survey.truth, kinds=kinds, dash_end_m=max(DASH_END_M, spacing_m)
    )
    scenario = survey.scenario
    size = f"{len(survey.points) / 1e6:.2f} M points, {seconds:.1f} s"
    tell(f"{scenario.kind} {scenario.seed} {variant}: {size}", parts, TOLERANCE_M)
    return list(parts)


def tell(what, parts, tolerance_m):
    """Say in one line how complete and correct each kind came out."""
    print(what, end="")
    for part in parts:
        at = score([part], part.kind, tolerance_m, ()).at
        print(f"; {part.kind}", end="")
        for name in ("completeness", "correctness"):
            value = getattr(at, name)
            print(f" {name[:4]} {'-' if value is None else format(value, '.3f')}", end="")
    print(flush=True)


def extracted(survey, trajectory, kinds):
    """Lines of a survey as one tile."""
    points = survey.points
    bounds = points.bounds
    tile = TileData(
        "benchmark", bounds.grown(1.0), points, trajectory,
        surface=find_ground(points, trajectory, RoadConfig()),
        origin=local_origin(bounds.west, bounds.south, float(points.xyz[:, 2].min())),
    )  # fmt: skip
    methods = choose_methods("auto", kinds, radon=RadonConfig())
    of_points = [method for method in methods if method.recording == "points"]
    return LineSet.concatenate([extract_tile(method, tile) for method in of_points])


def scores_of(parts, tolerance_m=TOLERANCE_M):
    """Score the parts of many surveys as if they were one."""
    by_kind = [[part for part in parts if part.kind == kind] for kind in dict.fromkeys(p.kind for p in parts)]
    kinds = tuple(score(own, own[0].kind, tolerance_m) for own in by_kind)
    return Scores(tolerance_m=tolerance_m, kinds=kinds, overall=score(parts, "overall", tolerance_m))


if __name__ == "__main__":
    import sys

    main(sys.argv[1:])
