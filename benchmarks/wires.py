"""How right wires are told apart and followed from pole to pole, and what stands where they end.

``python -m benchmarks.wires`` simulates roads as they are drawn, and the same roads with wires hung anew: a line of poles with
drop lines to the other side of the road, wires in pairs (twins) down to 0.2 m apart. For all of them it scores the geometry
of cables and poles at 5 cm, so that no line serves for both of a pair, and networks, circuits and spans: the share of the length of found wires that is in the group which the
best one-to-one assignment of found to true groups gives it; a wire that is on no true one is wrong. ``--forest`` counts what
is claimed in forests without wires.
"""

import argparse
import itertools
from dataclasses import replace

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial import cKDTree

from benchmarks.accuracy import extracted, scores_of, seeds_of
from linework.evaluation.measures import match_lines
from linework.model.lines import POLE
from linework.simulation.roads.draw import draw_scenario
from linework.simulation.roads.scenario import Cable, Pole
from linework.simulation.simulate import simulate_survey, survey_of

#: A vertex of a found wire is on the true one that is nearest, within this distance in space. [m]
ON_WIRE_M = 0.05
GROUPS = ("network", "circuit", "span")
#: Ways of hanging wires anew: distance of twins side by side [m]; 0: single wires.
HUNG = {"drops": 0.0, "twins 0.4 m": 0.4, "twins 0.3 m": 0.3, "twins 0.2 m": 0.2}


def main(arguments=()):
    parser = argparse.ArgumentParser(prog="python -m benchmarks.wires")
    parser.add_argument("--seeds", default="960-962", help="first-last, or a list")
    parser.add_argument("--roads", nargs="*", default=["straight", "bends", "urban"])
    parser.add_argument("--hung", nargs="*", default=list(HUNG), choices=list(HUNG))
    parser.add_argument("--length-m", type=float, default=150.0)
    parser.add_argument("--forest", action="store_true")
    options = parser.parse_args(arguments)
    seeds = list(seeds_of(options.seeds))
    if options.forest:
        for seed in seeds:
            found = found_in(bare(simulate_survey("forest", seed, options.length_m)))
            print(
                f"forest {seed}: cables {np.sum(found.kind == 'cable')}, poles {np.sum(found.kind == POLE)}",
                flush=True,
            )
        return
    for road in options.roads:
        pooled(road, (simulate_survey(road, seed, options.length_m) for seed in seeds))
    for way in options.hung:
        pooled(way, (survey_of(hung_anew(seed, options.length_m, HUNG[way])) for seed in seeds))


def pooled(name, surveys):
    """Print what came out of some surveys together."""
    parts, right, away, height = [], {group: [] for group in GROUPS}, [], []
    n_poles, n_true, n_wires = 0, 0, np.zeros(2, dtype=int)
    for survey in surveys:
        found = found_in(survey)
        parts += match_lines(found, survey.truth, kinds=("cable", POLE), tolerance_m=ON_WIRE_M)
        n_wires += np.array([np.sum(lines.kind == "cable") for lines in (found, survey.truth)])
        for group, rows in right.items():
            rows.append(right_share(found, survey.truth, group))
        feet, true = (lines.xyz[lines.offsets[:-1]][lines.kind == POLE] for lines in (found, survey.truth))
        n_poles, n_true = n_poles + len(feet), n_true + len(true)
        if len(feet) and len(true):
            distance, nearest = cKDTree(true[:, :2]).query(feet[:, :2])
            away += distance.tolist()
            heights = [lines.height_m[lines.kind == POLE] for lines in (found, survey.truth)]
            height += (heights[0] - heights[1][nearest])[distance < 1.0].tolist()
    shown = [f"{n_wires[0]} wires of {n_wires[1]}"]
    shown += [
        f"{one.kind} {percent(one.at.completeness)} / {percent(one.at.correctness)}"
        for one in scores_of(parts, ON_WIRE_M).kinds
    ]
    for group, rows in right.items():
        total = sum(length for length, _ in rows)
        shown.append(f"{group} {percent(sum(good for _, good in rows) / total if total else None)}")
    away = np.array(away)
    near = away[away < 1.0]
    shown.append(f"poles {n_poles} of {n_true} true, {np.sum(away >= 1.0)} false")
    if len(near):
        shown.append(f"off by {100 * np.median(near):.1f} cm (95 %: {100 * np.quantile(near, 0.95):.1f})")
        shown.append(f"height {100 * np.median(height):+.0f} cm")
    print(f"{name}: {'; '.join(shown)}", flush=True)


def percent(value):
    return "-" if value is None else f"{100 * value:.1f} %"


def found_in(survey):
    return extracted(survey, survey.trajectory, ("cable",)).with_columns(crs=survey.crs)


def bare(survey):
    """Return a survey; one that has wires after all is refused, since what it shows would be none."""
    assert not np.any(survey.truth.kind == "cable"), "this forest has wires"
    return survey


def right_share(found, truth, group):
    """Return the length of found wires, and of those that are in the right group. [m]"""
    found, truth = (
        found["cable"] if "cable" in found.kinds else found.take([]),
        truth.take(truth.kind == "cable"),
    )
    length = found.length_m
    if not len(found) or not len(truth):
        return float(length.sum()), 0.0
    places = [along(line) for line in truth]
    owner = np.repeat(np.arange(len(truth)), [len(p) for p in places])
    tree = cKDTree(np.concatenate(places))
    true_of = np.full(len(found), -1)
    for i, line in enumerate(found):
        distance, nearest = tree.query(line.xyz)
        on = owner[nearest[distance <= ON_WIRE_M]]
        if 2 * len(on) > len(line.xyz):
            true_of[i] = np.bincount(on).argmax()
    ours, of_found = np.unique(getattr(found, group), return_inverse=True)
    theirs, of_true = np.unique(getattr(truth, group), return_inverse=True)
    shared = np.zeros((len(ours), len(theirs)))
    known = true_of >= 0
    np.add.at(shared, (of_found[known], of_true[true_of[known]]), length[known])
    return float(length.sum()), float(shared[linear_sum_assignment(-shared)].sum())


def along(line):
    """Return places every 5 cm along a line."""
    step = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(line.xyz, axis=0), axis=1))]
    at = np.linspace(0.0, step[-1], max(int(step[-1] / 0.05), 2))
    return np.column_stack([np.interp(at, step, axis) for axis in line.xyz.T])


def hung_anew(seed, length_m, twins_m):
    """Return a straight road whose wires are a line of poles, twins or not, with drop lines across the road."""
    scenario = draw_scenario("straight", seed, length_m)
    rng = np.random.default_rng([seed, 77])
    layout = scenario.layout
    side = float(rng.choice([-1.0, 1.0]))
    q = side * (layout.road.left.width_m + rng.uniform(4.0, 6.0))
    at = np.linspace(2.0, length_m - 2.0, round(length_m / rng.uniform(35.0, 50.0)) + 1)
    height, sag, apart = rng.uniform(8.0, 9.5), rng.uniform(0.010, 0.02), rng.uniform(0.45, 0.7)
    levels = [height - apart * i for i in range(int(rng.integers(2, 4)))]
    sides = [-twins_m / 2.0, twins_m / 2.0] if twins_m else [0.16]
    poles = [Pole(s_m=float(s), q_m=q, height_m=height + 0.3, radius_m=0.12, network="line") for s in at]
    cables = [
        Cable(start=(float(a), q + out, up), end=(float(b), q + out, up), sag_m=sag * float(b - a),
              network="line", circuit="line", span=f"line-{number}")
        for number, (a, b) in enumerate(itertools.pairwise(at)) for up in levels for out in sides
    ]  # fmt: skip
    low = levels[-1] - 0.5
    for number, s in enumerate(at[1:-1].tolist()):
        if rng.random() < 0.6:
            end = (s + rng.uniform(-8.0, 8.0), -q, rng.uniform(5.5, 6.0))
            name = f"drop-{number}"
            poles.append(Pole(s_m=end[0], q_m=end[1], height_m=end[2] + 0.3, radius_m=0.08, network="line"))
            span = float(np.hypot(end[0] - s, 2.0 * q))
            cables.append(
                Cable(start=(s, q, low), end=end, sag_m=0.02 * span, network="line", circuit=name, span=name)
            )
    return replace(scenario, layout=replace(layout, poles=tuple(poles), cables=tuple(cables), plants=()))


if __name__ == "__main__":
    import sys

    main(sys.argv[1:])
