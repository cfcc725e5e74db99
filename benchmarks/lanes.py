"""How right the lanes are that follow from extracted lines: what was found, what was invented, how wide.

``python -m benchmarks.lanes`` simulates a road of every kind, extracts its lines, finds the lanes between them and compares
them with the lanes that the simulator states. A lane's station is right where both its bounds are within 0.6 m of those of a
true lane; a lane is invented where less than half of its stations are. Asked for are true lanes that were observed on both
sides, in the limits of widths of `linework.lines.lane_evidence.SINGLE_LANE_M`. ``--exact`` finds the lanes between the exact lines.
"""

import argparse
import warnings

import numpy as np
from scipy.spatial import cKDTree

from benchmarks._simulated_worlds import simulated, with_stages
from linework.errors import LineworkWarning
from linework.lines.lane_evidence import SINGLE_LANE_M
from linework.lines.lanes import find_lanes
from linework.model.lines import KINDS
from linework.simulation.roads.draw import ROADS
from linework.simulation.roads.true_lanes import LANE_STEP_M, true_lanes

#: Seeds that nothing was tuned on.
SEEDS = (941, 942, 943)
#: Whose lanes end in mouths and turns.
WITH_JUNCTIONS = ("junction", "roundabout", "mixed")
#: Largest distance of a bound from the true one, and of a place from the nearest station. [m]
SAME_M, NEAR_M = 0.6, 0.8


def main(arguments=()):
    parser = argparse.ArgumentParser(prog="python -m benchmarks.lanes")
    parser.add_argument("--length-m", type=float, default=200.0)
    parser.add_argument("--points-per-m", type=float, default=4000.0)
    parser.add_argument("--seeds", type=int, nargs="+", default=SEEDS)
    parser.add_argument("--roads", nargs="+", default=ROADS)
    parser.add_argument("--exact", action="store_true", help="lanes between the exact lines")
    options = parser.parse_args(arguments)
    warnings.simplefilter("ignore", LineworkWarning)
    print(
        f"{'road':11}{'seed':>5}{'asked m':>9}{'share':>7}{'lanes':>6}{'written m':>10}{'invented':>9}{'width cm':>9}{'sigma cm':>9}"
    )
    rows = []
    for road in options.roads:
        for seed in options.seeds:
            survey = simulated(road, seed, options.length_m, points_per_m=options.points_per_m)
            lines = survey.truth if options.exact else with_stages(survey, KINDS)[0]
            rows.append((road, compared(survey, find_lanes(lines))))
            print(f"{road:11}{seed:5}{shown(rows[-1][1])}", flush=True)
    print(
        f"{'without junctions':16}{shown(summed([row for road, row in rows if road not in WITH_JUNCTIONS]))}"
    )
    print(f"{'all':16}{shown(summed([row for _, row in rows]))}")


def compared(survey, lanes):
    """Return metres asked for and found, lanes, their metres, how many were invented, errors of widths, their sigmas."""
    true = true_lanes(survey.scenario, most_m=SINGLE_LANE_M[1])
    width = np.hypot(*(true.left_xyz - true.right_xyz)[:, :2].T)
    asked = observed(survey.truth, true) & (width >= SINGLE_LANE_M[0])
    written = lanes.centre.length_m.sum()
    n = len(lanes.centre.xyz)
    is_right, found, error = np.zeros(n, dtype=bool), np.zeros(len(true), dtype=bool), np.zeros(0)
    sigma = np.repeat(lanes.sigma_width_m, np.diff(lanes.centre.offsets))
    if len(true) and n:
        middle = 0.5 * (true.left_xyz + true.right_xyz)
        _, i = cKDTree(middle[:, :2]).query(lanes.centre.xyz[:, :2])
        sides = (true.left_xyz[i], true.right_xyz[i])
        # A lane has no direction: left and right may be exchanged
        away = [
            np.maximum(apart(lanes.left_xyz, a), apart(lanes.right_xyz, b)) for a, b in (sides, sides[::-1])
        ]
        is_right = np.minimum(*away) <= SAME_M
        error = (apart(lanes.left_xyz, lanes.right_xyz) - width[i])[is_right]
        distance, k = cKDTree(lanes.centre.xyz[:, :2]).query(middle[:, :2])
        found = (distance <= NEAR_M) & is_right[k]
    owner = lanes.centre.line_of_vertex
    n_invented = sum(is_right[owner == k].mean() < 0.5 for k in range(len(lanes)))
    metres = LANE_STEP_M * np.count_nonzero(asked), LANE_STEP_M * np.count_nonzero(asked & found)
    return *metres, len(lanes), written, n_invented, error, sigma[is_right]


def apart(a, b):
    """Return the distances (n,) of places in plan. [m]"""
    return np.hypot(*(a - b)[:, :2].T)


def observed(truth, lanes):
    """Return which places of lanes (n,) are observed on both sides."""
    bounds = truth.take(np.isin(truth.kind, ("lane_marking", "road_boundary")))
    if not len(bounds.xyz) or not len(lanes):
        return np.zeros(len(lanes), dtype=bool)
    tree = cKDTree(bounds.xyz[:, :2])
    sides = [bounds.observed[tree.query(xyz[:, :2])[1]] for xyz in (lanes.right_xyz, lanes.left_xyz)]
    return sides[0] & sides[1]


def summed(rows):
    """Return the rows of several roads as one."""
    if not rows:
        return 0.0, 0.0, 0, 0.0, 0, np.zeros(0), np.zeros(0)
    columns = list(zip(*rows, strict=True))
    return *(sum(column) for column in columns[:5]), *(np.concatenate(column) for column in columns[5:])


def shown(row):
    """Return a row as text; widths as root mean squares."""
    asked, found, n_lanes, written, n_invented, error, sigma = row
    share = f"{100 * found / asked:5.1f} %" if asked else "      -"
    rms = [
        f"{100 * np.sqrt(np.mean(values**2)):9.1f}" if len(values) else f"{'-':>9}"
        for values in (error, sigma)
    ]
    return f"{asked:9.0f}{share}{n_lanes:6}{written:10.0f}{n_invented:9}{''.join(rms)}"


if __name__ == "__main__":
    import sys

    main(sys.argv[1:])
