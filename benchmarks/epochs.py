"""Worn and renewed paint between two surveys of one road: what is found, and what is called a change and is none.

``python -m benchmarks.epochs`` simulates each road twice, from another lane and at another speed each time, with a
scanner whose gain differs. In the second survey a share of the paint of one marking is gone from its middle on. Lines
of both are extracted, and compared with the points of both. ``--roads``, ``--seeds`` and ``--length-m`` choose the
roads, ``--wear`` how much paint more is gone. *False* are stretches with other paint on lines that were left alone.
"""

import argparse
import sys
import tempfile
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np

import linework
from benchmarks.accuracy import seeds_of
from linework.cli.commands.of_lines.evaluate import print_tables
from linework.evaluation.chainage.paint_along import paint_left
from linework.evaluation.chainage.paint_points import paint_pieces
from linework.evaluation.changes.epochs import compare_epochs
from linework.evaluation.report.tables import ReportTable
from linework.model.points import Points
from linework.simulation.roads.draw import draw_scenario
from linework.simulation.simulate import survey_of

#: Seeds that nothing was tuned on.
SEEDS, ROADS, WEAR = "2541-2543", "straight,urban,motorway,rural", "0.15,0.3,0.5"
#: Gain of the second scanner. [1]
GAIN = 0.7
#: A change lies on the marking that was worn, this near. [m]
ON_LINE_M = 0.3


def main(arguments=()):
    parser = argparse.ArgumentParser(prog="python -m benchmarks.epochs")
    parser.add_argument("--seeds", default=SEEDS, help="first-last, or a list")
    parser.add_argument("--roads", default=ROADS)
    parser.add_argument("--wear", default=WEAR, help="shares of paint that are gone in the second survey")
    parser.add_argument("--length-m", type=float, default=200.0)
    options = parser.parse_args(list(arguments))
    warnings.simplefilter("ignore", linework.errors.LineworkWarning)
    rows = []
    for wear in map(float, options.wear.split(",")):
        cases = [
            case
            for road in options.roads.split(",")
            for seed in seeds_of(options.seeds)
            for case in measured(road, seed, options.length_m, wear)
        ]
        worn, found, false_m, km, error = (np.array(v, dtype=float) for v in zip(*cases, strict=True))
        big = worn > 0
        rows.append((
            f"{100 * wear:.0f}", f"{big.sum()}", f"{worn.sum():.0f}", f"{100 * found.sum() / max(worn.sum(), 1):.0f}",
            f"{np.nanmean(error):+.0f}" if np.isfinite(error).any() else "", f"{false_m.sum():.0f}",
            f"{km.sum():.1f}",
        ))  # fmt: skip
    columns = (
        "more gone %", "surveys", "worn, both measured m", "found %", "error of the loss %", "false m", "road km"
    )  # fmt: skip
    print_tables([ReportTable("Worn paint between two surveys", columns, tuple(rows), "")])


def measured(road, seed, length_m, wear):
    """Yield worn metres that both surveys measured, those found, false metres, kilometres, error of the loss [%]."""
    scenario = draw_scenario(road, seed, length_m)
    # Paint in good order at first: of what is mostly gone, little can be lost
    markings = tuple(replace(m, wear=0.3 * m.wear) for m in scenario.layout.markings)
    scenario, passes = replace(scenario, layout=replace(scenario.layout, markings=markings)), scenario.passes
    old = looked_at(scenario, gain=1.0)
    # The marking of which most is known: paint that is not found at all is for other benchmarks
    long = [m for m in markings if m.end_m - m.start_m > 0.6 * length_m]
    if not long:
        return
    shown = np.isfinite(paint_left(old[1])[0])
    chosen = max(long, key=lambda m: place_on(scenario, m, old[1].xy)[1][shown].sum())
    k, middle = markings.index(chosen), 0.5 * length_m
    gone = chosen.wear + wear * (1.0 - chosen.wear)
    parts = replace(chosen, end_m=middle), replace(chosen, start_m=middle, wear=gone)
    layout = replace(scenario.layout, markings=(*markings[:k], parts[0], *markings[k + 1 :], parts[1]))
    second = replace(passes[0], q_m=passes[0].q_m + 0.5, speed_mps=0.9 * passes[0].speed_mps)
    new = looked_at(replace(scenario, layout=layout, passes=(second, *passes[1:])), gain=GAIN)
    lines, paint = zip(old, new, strict=True)
    changes, _ = compare_epochs(*lines, paint)
    worn_m, false_m, losses = np.zeros(int(length_m)), 0.0, []
    for change in changes:
        if not change.what.startswith("remaining paint"):
            continue
        s, on_line = place_on(scenario, chosen, change.line.xyz)
        if on_line.mean() < 0.5:
            false_m += change.length_m
            continue
        false_m += max(middle - s.min() - 2.0, 0.0)
        worn_m[max(int(s.min()), 0) : int(s.max())] = 1.0
        before, after = (float(v) for v in change.what.split()[2:5:2])
        losses.append(before - after)
    known = []
    for pieces in paint:
        s, on_line = place_on(scenario, chosen, pieces.xy)
        here = on_line & np.isfinite(paint_left(pieces)[0]) & (s > middle)
        known.append(np.isin(np.arange(int(length_m)) // 10, s[here].astype(int) // 10))
    both = known[0] & known[1]
    error = np.mean(losses) - 100.0 * (gone - chosen.wear) if losses else np.nan
    yield both.sum(), worn_m[both].sum(), false_m, length_m / 1000.0, error


def looked_at(scenario, gain):
    """Return the lines of a survey and what its points show on them, with intensities of another gain."""
    survey = survey_of(scenario)
    points = survey.points
    with tempfile.TemporaryDirectory() as folder:
        lines = linework.extract(
            points, kinds=("lane_marking", "lane_marking_dash", "road_boundary"), trajectory=survey.trajectory, work=Path(folder),
            on_problem="warn",
        )  # fmt: skip
    brightness = (gain * points.intensity).astype(np.float32)
    return lines, paint_pieces(lines, within(Points(points.xyz, intensity=brightness, time_s=points.time_s)))


def place_on(scenario, marking, xyz):
    """Return distance along the road (n,) and whether each place is on a marking."""
    s, q = scenario.layout.road.alignment.locate(xyz[:, :2] - np.asarray(scenario.origin_m)[:2])
    shift = [float(marking.shift_m(one)) if marking.shift_m else 0.0 for one in s.tolist()]
    return s, np.abs(q - marking.q_m - np.array(shift)) < ON_LINE_M


def within(cloud):
    """Return points within bounds, as the store gives them."""
    x, y = cloud.xyz[:, 0], cloud.xyz[:, 1]
    return lambda b: cloud.take((x >= b.west) & (x < b.east) & (y >= b.south) & (y < b.north))


if __name__ == "__main__":
    main(sys.argv[1:])
