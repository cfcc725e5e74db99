"""Changes of a road between two surveys, sort by sort: how many of their metres are found, and what is called one and is none.

``python -m benchmarks.changes`` simulates each road, and twice more from another lane and at another speed: once with one
marking painted anew beside its place, one that is gone and one that is new; once with another edge of the carriageway,
a new rail, and other cars at other places. Each change begins or ends in the middle of the road. ``--roads``, ``--seeds``
and ``--length-m`` choose the roads, ``--move-m`` how far lines have moved. A metre counts where both surveys could see it: the
old line was found there, or the new one. Both surveys' points say where the ground was seen, unless ``--no-points``.
*False* are stretches of changes, unsure ones left out, that none of these explain. Wear of paint is in `benchmarks.epochs`.
"""

import argparse
import sys
import tempfile
import warnings
from collections import defaultdict
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

import linework
from benchmarks.accuracy import seeds_of
from benchmarks.epochs import within
from linework.cli.commands.of_lines.evaluate import print_tables
from linework.evaluation.changes.epochs import compare_epochs
from linework.evaluation.changes.ground_seen import look_at_ground
from linework.evaluation.report.tables import ReportTable
from linework.simulation.roads.alignment import PiecewiseLinear
from linework.simulation.roads.draw import draw_scenario
from linework.simulation.roads.scenario import Car, Marking, Rail
from linework.simulation.simulate import survey_of

#: Seeds that nothing was tuned on.
SEEDS, ROADS = "2561-2562", "straight,urban,motorway"
KINDS = ("lane_marking", "lane_marking_dash", "road_boundary", "guardrail", "barrier")
#: A change is reported on its line where it lies this near to it, and from end to end to this. [m]
NEAR_M, END_M = 0.5, 6.0
#: Distance of a new line from all others. [m]
APART_M = 1.7


def main(arguments=()):
    parser = argparse.ArgumentParser(prog="python -m benchmarks.changes")
    parser.add_argument("--seeds", default=SEEDS, help="first-last, or a list")
    parser.add_argument("--roads", default=ROADS)
    parser.add_argument("--length-m", type=float, default=200.0)
    parser.add_argument("--move-m", default="0.12,0.28", help="how far lines have moved, by turns")
    parser.add_argument("--show", action="store_true", help="each false stretch")
    parser.add_argument("--no-points", action="store_true", help="compare lines only")
    options = parser.parse_args(list(arguments))
    warnings.simplefilter("ignore", linework.errors.LineworkWarning)
    moves = [float(text) for text in options.move_m.split(",")]
    found, false, km, turn = defaultdict(list), [], 0.0, 0
    for road in options.roads.split(","):
        for seed in seeds_of(options.seeds):
            scenario = draw_scenario(road, seed, options.length_m)
            old, old_look, _ = seen(scenario)
            for altered in (with_other_paint, with_other_edges):
                changed, sorts = altered(scenario, moves[turn % len(moves)])
                new, new_look, truth = seen(driven_anew(changed))
                looks = None if options.no_points else (old_look, new_look)
                changes = compare_epochs(old, new, looks=looks)[0]
                for sort, metres in scored(scenario, sorts, old, new, changes, truth).items():
                    found[sort].append(metres)
                wrong = unexplained(scenario, sorts, changes)
                false += wrong
                km += options.length_m / 1000.0
                print(f"{road} {seed} {altered.__name__}: {len(wrong)} false", flush=True)
                for one in wrong if options.show else ():
                    print("   ", one.status, one.line.kind[0], f"{one.from_m:.0f}-{one.to_m:.0f} m", one.what,
                          f"{one.across_m:.3f} {one.up_m:.3f}", one.line.xyz[0].round(1).tolist())  # fmt: skip
            turn += 1
    rows = []
    for sort, metres in found.items():
        there, hit = np.array(metres).T
        whole = (hit > 0.5 * there)[there >= 10.0]
        rows.append((sort, f"{there.sum():.0f}", f"{100 * hit.sum() / max(there.sum(), 1e-9):.0f}",
                     f"{whole.sum()} of {len(whole)}"))  # fmt: skip
    print_tables(
        [ReportTable("Changes", ("sort", "m", "found %", "changes of which half is found"), tuple(rows), "")]
    )
    by_sort = {s: sum(one.status == s for one in false) for s in sorted({one.status for one in false})}
    print(f"false: {len(false)} stretches in {km:.1f} km {by_sort}")


def seen(scenario):
    """Return the lines of a survey, the look at its points, and its exact lines."""
    survey = survey_of(scenario)
    with tempfile.TemporaryDirectory() as folder:
        lines = linework.extract(
            survey.points, kinds=KINDS, trajectory=survey.trajectory, work=Path(folder), on_problem="warn"
        )
    return lines, partial(look_at_ground, points_in=within(survey.points)), survey.truth


def end_m(scenario, sort):
    """Return how far from its true end a change may be reported to end: of dashes also as far as their space."""
    own = [m for m in scenario.layout.markings if m.q_m == sort[2]]
    return END_M + max((m.gap_m for m in own), default=0.0)


def driven_anew(scenario):
    """Return the road from a pass half a metre beside the first one, a tenth slower."""
    first, *others = scenario.passes
    return replace(
        scenario, passes=(replace(first, q_m=first.q_m + 0.5, speed_mps=0.9 * first.speed_mps), *others)
    )


def with_other_paint(scenario, move_m):
    """Return the road with a marking moved and another gone from the middle on, and a new one up to the middle."""
    layout, length, middle = scenario.layout, scenario.length_m, 0.5 * scenario.length_m
    long = [
        m
        for m in layout.markings
        if m.end_m - m.start_m > 0.8 * length and not m.generation and m.shift_m is None
    ]
    # The best kept ones: what is not found at all is for other benchmarks
    long = sorted(long, key=lambda m: (m.wear, m.q_m))
    markings, sorts = list(layout.markings), {}
    for sort, chosen in zip((f"moved {100 * move_m:.0f} cm", "gone"), long, strict=False):
        k = markings.index(chosen)
        markings[k] = replace(chosen, end_m=middle)
        sorts[sort] = (
            "moved" if sort != "gone" else "gone",
            "lane_marking",
            chosen.q_m,
            (middle, chosen.end_m),
        )
        if sort != "gone":
            # Dashes go on in their rhythm
            period = chosen.dash_m + chosen.gap_m
            start = chosen.start_m + (
                np.ceil((middle - chosen.start_m) / period) * period if period else middle - chosen.start_m
            )
            markings.append(replace(chosen, start_m=float(start), q_m=chosen.q_m + move_m))
    place = free_place([m.q_m for m in layout.markings], layout)
    if place is not None:
        markings.append(Marking(q_m=place, start_m=10.0, end_m=middle, width_m=0.15, role="edge"))
        sorts["new"] = ("new", "lane_marking", place, (10.0, middle))
    return replace(scenario, layout=replace(layout, markings=tuple(markings))), sorts


def free_place(taken, layout):
    """Return an offset on the carriageway that is far from all paint and from its edges, None without one."""
    low, high = -layout.road.right.width_m + 1.0, layout.road.left.width_m - 1.0
    offsets = np.linspace(low, high, 60)
    away = np.abs(offsets[:, None] - np.array([*taken, low - 9.0])).min(axis=1)
    k = int(np.argmax(away))
    return float(offsets[k]) if away[k] >= APART_M else None


def with_other_edges(scenario, move_m):
    """Return the road with its left edge further out from the middle on, a rail on the right up to it, and other cars."""
    layout, length, middle = scenario.layout, scenario.length_m, 0.5 * scenario.length_m
    sorts, road = {}, layout.road
    at = np.array([-100.0, middle, middle + 4.0, length + 100.0])
    extra = PiecewiseLinear(at, road.left.extra_m(at) + np.array([0.0, 0.0, move_m, move_m]))
    plain = np.ptp(road.left.extra_m(np.linspace(0.0, length, 50))) == 0.0
    if plain:
        road = replace(road, left=replace(road.left, extra_m=extra))
        sorts[f"edge moved {100 * move_m:.0f} cm"] = (
            "moved",
            "road_boundary",
            road.left.width_m,
            (middle + 4.0, length),
        )
    rails = layout.rails
    if not any(rail.q_m < 0.0 for rail in rails) and road.right.form == "edge":
        q = -road.right.width_m - 0.8
        rails = (*rails, Rail(q_m=q, faces=1, start_m=10.0, end_m=middle, top_m=0.75))
        sorts["new rail"] = ("new", "guardrail", q, (10.0, middle))
    cars = tuple(replace(car, s_m=car.s_m + 9.0) for car in layout.cars if isinstance(car, Car))
    return replace(scenario, layout=replace(layout, road=road, rails=rails, cars=cars)), sorts


def located(scenario, xyz):
    return scenario.layout.road.alignment.locate(xyz[:, :2] - np.asarray(scenario.origin_m)[:2])


def stretch_on(scenario, sort, change):
    """Return the chainages of a change on the line of a sort, None where it lies elsewhere."""
    s, q = located(scenario, change.line.xyz)
    on = np.abs(q - sort[2]) < NEAR_M
    return (float(s.min()), float(s.max())) if on.mean() > 0.5 else None


def is_of(sort, change):
    """Return whether a change is reported as one of this sort: paint that is moved further is gone and new."""
    kind = str(change.line.kind[0]).removesuffix("_dash")
    named = {
        "moved": ("moved", "new", "gone", "changed"),
        "gone": ("gone", "changed"),
        "new": ("new", "changed"),
    }
    return kind == sort[1] and change.status in named[sort[0]]


def scored(scenario, sorts, old, new, changes, truth):
    """Return the metres of each sort that could be seen, and those that are reported; what has moved where both could see it."""
    scored_m = {}
    for name, sort in sorts.items():
        known = np.zeros(int(scenario.length_m) + 1, dtype=bool)
        for lines in (new,) if sort[0] == "new" else (old,):
            for i in np.flatnonzero(lines.kind == sort[1]).tolist():
                s, q = located(scenario, lines[i].xyz)
                on = (np.abs(q - sort[2]) < NEAR_M) & ~lines[i].bridged
                for a, b in zip(s[:-1][on[:-1] & on[1:]], s[1:][on[:-1] & on[1:]], strict=True):
                    known[max(int(min(a, b)), 0) : int(max(a, b)) + 1] = True
        metre = np.arange(len(known))
        known &= (metre > sort[3][0] + 1) & (metre < sort[3][1] - 1)
        if sort[0] == "moved":
            known &= shown_in(scenario, sort, truth)
        hit = np.zeros(len(known), dtype=bool)
        for change in changes:
            stretch = stretch_on(scenario, sort, change) if is_of(sort, change) else None
            if stretch is not None:
                hit[max(int(stretch[0]), 0) : int(stretch[1]) + 1] = True
        scored_m[name] = (int(known.sum()), int((known & hit).sum()))
    return scored_m


def shown_in(scenario, sort, truth):
    """Return at which metres the new survey's scanner saw the line that has moved, dashes and what is between them."""
    shown = np.zeros(int(scenario.length_m) + 1, dtype=bool)
    for i in np.flatnonzero(np.isin(truth.kind, (sort[1], f"{sort[1]}_dash"))).tolist():
        s, q = located(scenario, truth[i].xyz)
        for at in s[(np.abs(q - sort[2]) < NEAR_M) & truth[i].observed].tolist():
            shown[max(int(at) - 1, 0) : max(int(at) + 2, 0)] = True
    return shown


def unexplained(scenario, sorts, changes):
    """Return the changes, other than of what is hidden, that no sort explains.

    What lies beyond an edge that was moved, such as the other carriageway, was moved with it.
    """
    wrong, edges = [], [sort for name, sort in sorts.items() if name.startswith("edge")]
    for change in changes:
        if change.status in ("not visible", "unsure") or any(
            is_beyond(scenario, sort, change) for sort in edges
        ):
            continue
        stretches = [(sort, stretch_on(scenario, sort, change)) for sort in sorts.values()]
        if not any(
            stretch is not None
            and stretch[0] > sort[3][0] - end_m(scenario, sort)
            and stretch[1] < sort[3][1] + end_m(scenario, sort)
            for sort, stretch in stretches
        ):
            wrong.append(change)
    return wrong


def is_beyond(scenario, sort, change):
    """Return whether a change lies farther out than an edge that was moved, beside what has moved of it."""
    s, q = located(scenario, change.line.xyz)
    middle = 0.5 * (s.min() + s.max())
    return bool(np.median(q) > sort[2] + NEAR_M and sort[3][0] - END_M < middle < sort[3][1] + END_M)


if __name__ == "__main__":
    main(sys.argv[1:])
