"""How right the lanes are that follow from extracted lines: what was found, what was invented, how wide.

``python -m benchmarks.lanes`` simulates a road of every kind, extracts its lines, finds the lanes between them and compares
them with the lanes that the simulator states. A lane's station is right where both its bounds are within 0.6 m of those of a
true lane; a lane is invented where less than half of its stations are. Asked for are true lanes that were observed on both
sides, in the limits of widths of `linework.lines.lane_evidence.SINGLE_LANE_M`. ``--exact`` finds the lanes between the exact
lines, which judges the step from lines to lanes by itself. *In sight* is the share of those lanes whose paint stands out from
the road beside it within 10 m of the place: paint that is as dark as its road is in no picture of intensities.
"""

import argparse
import warnings

import numpy as np
from scipy.spatial import cKDTree

from benchmarks._failures import (
    BESIDE_STRIPE_M,
    FEWEST_COMPARED,
    LEAST_STRIPE_T,
    ON_STRIPE_M,
    WINDOW_M,
    places_of,
)
from benchmarks._simulated_worlds import extracted, simulated
from linework.errors import LineworkWarning
from linework.lines.lane_evidence import SINGLE_LANE_M
from linework.lines.lanes import find_lanes
from linework.methods.classes.point_class import PointClass
from linework.model.lines import KINDS
from linework.simulation.roads.draw import ROADS
from linework.simulation.roads.true_lanes import LANE_STEP_M, true_lanes

#: Seeds that nothing was tuned on.
SEEDS = (941, 942, 943)
#: Whose lanes end in mouths and turns.
WITH_JUNCTIONS = ("junction", "roundabout", "mixed")
#: Largest distance of a bound from the true one, and of a place from the nearest station. [m]
SAME_M, NEAR_M = 0.6, 0.8
#: Paint is in sight where some of it stands out this near along its line: the longest gap between dashes is 12 m (Austria's
#: 6/12 m). Bounds this near the line of a marking are paint. [m]
IN_SIGHT_M, ON_LINE_M = 10.0, 0.3


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
        f"{'road':11}{'seed':>5}{'asked m':>9}{'share':>8}{'in sight':>9}{'lanes':>6}{'written m':>10}{'invented':>9}{'width cm':>9}{'sigma cm':>9}"
    )
    rows = []
    for road in options.roads:
        for seed in options.seeds:
            survey = simulated(road, seed, options.length_m, points_per_m=options.points_per_m)
            lines = survey.truth if options.exact else extracted(survey, KINDS)
            rows.append((road, compared(survey, find_lanes(lines))))
            print(f"{road:11}{seed:5}{shown(rows[-1][1])}", flush=True)
    print(
        f"{'without junctions':16}{shown(summed([row for road, row in rows if road not in WITH_JUNCTIONS]))}"
    )
    print(f"{'all':16}{shown(summed([row for _, row in rows]))}")


def compared(survey, lanes):
    """Return metres asked for and found, both in sight, lanes, their metres, invented ones, errors of widths, their sigmas."""
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
    seen = asked & in_sight(survey, true)
    metres = (LANE_STEP_M * np.count_nonzero(here) for here in (asked, asked & found, seen, seen & found))
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


def in_sight(survey, lanes):
    """Return at which places of lanes (n,) the paint of both sides stands out from the road beside it."""
    truth, points = survey.truth, survey.points
    points = points.take(np.isin(survey.point_class, (PointClass.ROAD, PointClass.MARKING)))
    tree = cKDTree(points.xyz[:, :2])
    shown, stands_out = [np.zeros((0, 2))], [np.zeros(0, dtype=bool)]
    for i in np.flatnonzero(truth.kind == "lane_marking").tolist():
        places = places_of(truth.take([i]), LANE_STEP_M)
        is_bright = [
            t_of_paint(points, tree, *place) >= LEAST_STRIPE_T
            for place in zip(places.xyz, places.along, strict=True)
        ]
        reach = np.ones(2 * round(IN_SIGHT_M / LANE_STEP_M) + 1)
        shown.append(places.xyz[:, :2])
        stands_out.append(np.convolve(is_bright, reach)[len(reach) // 2 :][: len(places)] > 0.5)
    places, stands_out = np.concatenate(shown), np.concatenate(stands_out)
    if not len(places) or not len(lanes):
        return np.ones(len(lanes), dtype=bool)
    is_dark = np.zeros(len(lanes), dtype=bool)
    for side in (lanes.right_xyz, lanes.left_xyz):
        away, i = cKDTree(places).query(side[:, :2])
        is_dark |= (away <= ON_LINE_M) & ~stands_out[i]
    return ~is_dark


def t_of_paint(points, tree, place, along):
    """Return how many deviations paint is brighter than the road on its brighter side, where there is road."""
    near = tree.query_ball_point(place[:2], np.hypot(WINDOW_M, BESIDE_STRIPE_M[1]))
    away = points.xyz[near, :2] - place[:2]
    is_inside = np.abs(away @ along[:2]) <= WINDOW_M
    across = (away[:, 1] * along[0] - away[:, 0] * along[1])[is_inside]
    brightness = points.intensity[near][is_inside].astype(np.float64)
    low, high = BESIDE_STRIPE_M
    parts = [np.abs(across) <= ON_STRIPE_M, *((s * across >= low) & (s * across <= high) for s in (1, -1))]
    on, *sides = (brightness[part] for part in parts)
    sides = [side for side in sides if len(side) >= FEWEST_COMPARED]
    if len(on) < FEWEST_COMPARED or not sides:
        return -np.inf
    error = [np.sqrt(on.var() / len(on) + side.var() / len(side)) for side in sides]
    return min((on.mean() - side.mean()) / max(e, 1e-9) for side, e in zip(sides, error, strict=True))


def summed(rows):
    """Return the rows of several roads as one."""
    if not rows:
        return 0.0, 0.0, 0.0, 0.0, 0, 0.0, 0, np.zeros(0), np.zeros(0)
    columns = list(zip(*rows, strict=True))
    return *(sum(column) for column in columns[:7]), *(np.concatenate(column) for column in columns[7:])


def shown(row):
    """Return a row as text; widths as root mean squares."""
    asked, found, seen, seen_found, n_lanes, written, n_invented, error, sigma = row
    share, in_view = (
        f"{100 * a / b:6.1f} %" if b else "       -" for a, b in ((found, asked), (seen_found, seen))
    )
    rms = [
        f"{100 * np.sqrt(np.mean(values**2)):9.1f}" if len(values) else f"{'-':>9}"
        for values in (error, sigma)
    ]
    return f"{asked:9.0f}{share}{in_view:>9}{n_lanes:6}{written:10.0f}{n_invented:9}{''.join(rms)}"


if __name__ == "__main__":
    import sys

    main(sys.argv[1:])
