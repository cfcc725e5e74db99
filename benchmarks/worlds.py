"""How good the lines are on roads nobody tuned to: real surveys with hand-made references, and simulated scenes.

``python -m benchmarks.worlds`` does both. ``--data DIR`` is the folder of the real surveys (``shared/data`` beside
the repository, or what the variable LINEWORK_REAL_DATA names); each is extracted with default settings and scored
within the area of its reference (tests/references). ``--surveys av2,here-a22`` takes some of them, ``none`` none.
``--roads urban,motorway --seeds 900-904`` takes scenes of the simulator, by the names that it gives them, ``none``
none; ``--scanners`` and ``--conditions`` likewise, ``--holes`` leaves stretches without points. Scored is what
``linework.extract`` gives. ``--moved 3`` scores everything three times more, with points moved by a millimetre, and
says what depends on that. Nothing may be tuned on the seeds that are reported.
"""

import argparse
from dataclasses import replace

from benchmarks._edge_roles import roles_table
from benchmarks._moved import MovedRuns, moved
from benchmarks._real_worlds import checked_data, real_table, real_worlds
from benchmarks._simulated_worlds import (
    SceneResult,
    causes_table,
    scored_scene,
    scores_table,
    simulated,
    summed,
)
from benchmarks.accuracy import seeds_of
from linework.cli.commands.of_lines.evaluate import print_tables
from linework.errors import LineworkError
from linework.methods.kinds import ALL_KINDS, parse_kinds
from linework.simulation.roads.draw import ROADS

#: Minutes, and data that is not everywhere: run where it is asked for.
ON_REQUEST = True
SEEDS = "900-904"
NONE = "none"


def main(arguments=()):
    options, moved_runs = parsed(arguments), MovedRuns()
    if options.surveys != NONE:
        names = tuple(filter(None, options.surveys.split(",")))
        print_tables([real_table(real_worlds(checked_data(options.data), names, options.moved, moved_runs))])
    if options.roads != NONE:
        results = scenes_of(options, moved_runs)
        tables = [scores_table(results)]
        if options.causes:
            tables += [causes_table(results), causes_table([summed(results)])]
        every = [*results, summed(results)]
        for title, of in (("Roles of edges beside boundaries", "roles"), ("Forms of boundaries", "forms")):
            tables.append(roles_table(title, [(result.scene, getattr(result, of)) for result in every]))
        print_tables(tables)
    if options.moved:
        print_tables([moved_runs.pooled(), moved_runs.table()])


def parsed(arguments):
    parser = argparse.ArgumentParser(prog="python -m benchmarks.worlds")
    parser.add_argument("--data", default=None, help="folder of the real surveys")
    parser.add_argument("--surveys", default="", help="names of references, or none; default: all")
    parser.add_argument("--roads", default=",".join(ROADS), help="names of roads, or none")
    parser.add_argument("--scanners", default="", help="names of scanners; default: as the seed draws them")
    parser.add_argument("--conditions", default="", help="names of conditions; default: the usual ones")
    parser.add_argument("--holes", action="store_true", help="stretches of road without points")
    parser.add_argument("--seeds", default=SEEDS, help="first-last, or a list")
    parser.add_argument("--kinds", default=",".join(ALL_KINDS))
    parser.add_argument(
        "--no-causes", dest="causes", action="store_false", help="scores alone: half the time"
    )
    parser.add_argument("--length-m", type=float, default=150.0)
    parser.add_argument("--points-per-m", type=float, default=None)
    parser.add_argument("--moved", type=int, default=0, help="times that all is done again with moved points")
    return parser.parse_args(list(arguments))


def scenes_of(options, moved_runs):
    """Extract and score every scene; one that the simulator refuses is said."""
    kinds, results = parse_kinds(options.kinds), []
    for scanner in options.scanners.split(","):
        for conditions in options.conditions.split(","):
            for road in options.roads.split(","):
                result = SceneResult(" ".join(filter(None, (road, scanner, conditions))))
                for seed in seeds_of(options.seeds):
                    name = f"{result.scene} {seed}"
                    try:
                        survey = simulated(
                            road, seed, options.length_m, points_per_m=options.points_per_m,
                            scanner=scanner or None, conditions=conditions or None,
                            holes=options.holes or None,
                        )  # fmt: skip
                        for k in range(options.moved + 1):
                            again = replace(survey, points=moved(survey.points, k))
                            for one in scored_scene(again, kinds, result, name, causes=options.causes):
                                moved_runs.add(name, one)
                    except LineworkError as problem:
                        print(f"{name}: {problem}", flush=True)
                results.append(result)
    return results


if __name__ == "__main__":
    import sys

    main(sys.argv[1:])
