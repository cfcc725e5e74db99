"""How good stereo lines are on simulated drives, and how many pairs a second are worked.

``python -m benchmarks.stereo --seeds 950-952 --roads straight,bends --sizes 1240x376`` takes others than the
default. Poses are the true ones, or with ``--poses located`` what `locate_drive` makes of a 2 cm receiver, the best gyro
and wheel counters. Images are drawn once and kept (``--folder``). Completeness is over what at least 3 pairs saw within 20 m.
Nothing may be tuned on the seeds that are reported.
"""

import argparse
import time
from pathlib import Path

import numpy as np

from benchmarks._stereo_sets import FOLDER, stereo_set
from benchmarks.accuracy import scores_of, seeds_of, tell
from linework.cli.commands.of_lines.evaluate import print_tables
from linework.evaluation.measures import match_lines
from linework.evaluation.report.tables import score_tables
from linework.imaging.rectify import rectifier_of
from linework.methods.protocol import SurveyContext
from linework.methods.stereo.method import Stereo
from linework.model.images import RectifiedPair
from linework.model.sightings import Sightings
from linework.navigation.locate import locate_drive
from linework.navigation.poses import poses_at
from linework.simulation.roads.draw import USUAL_ROADS
from linework.simulation.sensors.logs import GNSS_2_CM, GYROS, SensorGrades, simulate_logs
from linework.simulation.sensors.view import SIZES
from linework.simulation.simulate import drives_of

SEEDS = "950-959"
TOLERANCE_M = 0.15
KINDS = ("lane_marking", "lane_marking_dash")
#: Drawing its pictures takes hours.
ON_REQUEST = True


def main(arguments=()):
    options = parsed(arguments)
    for size in options.sizes.split(","):
        pooled = []
        for road in options.roads.split(","):
            own = []
            for seed in seeds_of(options.seeds):
                drawn = stereo_set(
                    road,
                    seed,
                    size,
                    length_m=options.length_m,
                    every_m=options.every_m,
                    rays_per_pixel=options.rays,
                    folder=options.folder,
                )
                own += set_parts(drawn, POSES[options.poses](drawn.drive))
            print(f"\n=== {size} {road}, seeds {options.seeds}, {options.length_m:g} m each")
            print_tables(list(score_tables(scores_of(own, TOLERANCE_M)))[:2])
            pooled += own
        print(f"\n=== {size}, all roads: {options.roads}, seeds {options.seeds}, tolerance {TOLERANCE_M:g} m")
        print_tables(score_tables(scores_of(pooled, TOLERANCE_M)))


def parsed(arguments):
    parser = argparse.ArgumentParser(prog="python -m benchmarks.stereo")
    parser.add_argument("--seeds", default=SEEDS, help="first-last, or a list")
    parser.add_argument("--roads", default=",".join(USUAL_ROADS))
    parser.add_argument("--sizes", default=",".join(SIZES))
    parser.add_argument("--length-m", type=float, default=100.0)
    parser.add_argument("--every-m", type=float, default=3.0)
    parser.add_argument("--poses", choices=POSES, default="true")
    parser.add_argument("--rays", type=int, default=4, help="rays per pixel: how finely images are drawn")
    parser.add_argument("--folder", type=Path, default=FOLDER, help="where images are kept")
    return parser.parse_args(list(arguments))


def true_poses(drive):
    """Poses as they were."""
    return drive.poses


def located_poses(drive):
    """Poses as the van's own logs say."""
    scenario = drive.scenario
    grades = SensorGrades(gnss=GNSS_2_CM, gyro=GYROS[0])
    rng = np.random.default_rng([scenario.seed, 51])
    logs = simulate_logs(drives_of(scenario)[0], grades, rng, origin_m=scenario.origin_m)
    return poses_at(locate_drive(logs).trajectory, drive.time_s)


POSES = {"true": true_poses, "located": located_poses}


def set_parts(drawn, poses):
    """Find the lines of one drive and match them; say in one line how it came out."""
    start = time.perf_counter()
    found = found_lines(drawn, poses)
    seconds = time.perf_counter() - start
    truth = drawn.truth.take([k in KINDS for k in drawn.truth.kind])
    parts = match_lines(found.with_columns(crs=truth.crs), truth, kinds=KINDS)
    scenario, n = drawn.drive.scenario, len(drawn.left)
    tell(f"{scenario.kind} {scenario.seed}: {n} pairs, {n / seconds:.1f} a second", parts, TOLERANCE_M)
    return list(parts)


def found_lines(drawn, poses):
    """Lines of all pairs, joined at these poses."""
    method, rectifier = Stereo(), rectifier_of(drawn.drive.rig)
    seen = []
    for i, (left, right) in enumerate(zip(drawn.left, drawn.right, strict=True)):
        time_s = float(drawn.drive.time_s[i])
        pair = RectifiedPair(*rectifier.rectified(left, right), rectifier.rig, number=i, time_s=time_s)
        seen.append(method.look(pair))
    return method.join(Sightings.concatenate(seen), SurveyContext(poses=poses, rig=rectifier.rig))


if __name__ == "__main__":
    import sys

    main(sys.argv[1:])
