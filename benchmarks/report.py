"""How right the quantities of a report by chainage are, and how honest their standard deviations.

``python -m benchmarks.report`` simulates roads, extracts their lines, and compares what is measured at every place along
the road with the same quantity of the exact lines there; of remaining paint and contrast, with the paint that was
simulated. ``--roads``, ``--seeds`` and ``--length-m`` choose the roads. *sigma* is rms(error / standard deviation): 1 is
honest. *hidden* is the share of places of the exact lines, seen by the scanner, for which no number is given.
"""

import argparse
import math
import sys
import tempfile
import warnings
from collections import defaultdict
from pathlib import Path

import numpy as np
import shapely
from scipy.spatial import cKDTree

import linework
from benchmarks.accuracy import seeds_of
from linework.cli.commands.of_lines.evaluate import print_tables
from linework.evaluation.chainage.bends import with_bends
from linework.evaluation.chainage.crossings import crossings_at
from linework.evaluation.chainage.dash_ends import ends_of_dashes
from linework.evaluation.chainage.dashes_along import dash_samples
from linework.evaluation.chainage.paint_along import least_paint_ratios, paint_samples
from linework.evaluation.chainage.paint_points import CORE_SHARE, paint_pieces
from linework.evaluation.chainage.routes import own_routes
from linework.evaluation.chainage.samples import clearance_samples, station_samples
from linework.evaluation.report.tables import ReportTable
from linework.lines.crosscuts import cross_cuts
from linework.simulation.folder import write_survey_folder
from linework.simulation.scene.paint import paint_cover, smooth_noise, stain_shade
from linework.simulation.simulate import simulate_survey

#: Seeds that nothing was tuned on.
SEEDS = "2501-2503"
ROADS = ("straight", "bends", "urban", "motorway", "rural", "village")
#: Quantities of paint are summed up over intervals, too. [m]
EVERY_M = 10.0
#: The road beside paint is that about this far from its edge. [m]
BESIDE_M = 0.11
#: Lines of which several are near to each other, and places along them, to tell which one each is. [m]
RAILS = ("guardrail", "barrier")
WHICH, PLACES_M = (("cable",), RAILS), 0.25
#: Samples of the same place are this near to each other. [m]
SAME_M = 0.6


def main(arguments=()):
    parser = argparse.ArgumentParser(prog="python -m benchmarks.report")
    parser.add_argument("--roads", default=",".join(ROADS))
    parser.add_argument("--seeds", default=SEEDS, help="first-last, or a list")
    parser.add_argument("--length-m", type=float, default=200.0)
    options = parser.parse_args(arguments)
    warnings.simplefilter("ignore", linework.errors.LineworkWarning)
    errors = defaultdict(list)
    for road in options.roads.split(","):
        for seed in seeds_of(options.seeds):
            print(f"{road} {seed}", flush=True)
            measure(simulate_survey(road, seed, options.length_m), errors)
    rows = []
    for (topic, quantity), found in sorted(errors.items()):
        error, sigma = np.array(found, dtype=np.float64).reshape(-1, 2).T
        known = np.isfinite(error)
        both = known & np.isfinite(sigma) & (sigma > 0.0)
        if known.any():
            rows.append(
                (
                    topic, quantity, f"{known.sum():,}", f"{100 * (1 - known.mean()):.1f} %", f"{error[known].mean():.3f}",
                    f"{np.median(np.abs(error[known])):.3f}", f"{np.percentile(np.abs(error[known]), 95):.3f}",
                    f"{math.sqrt(np.mean(error[known] ** 2)):.3f}",
                    f"{math.sqrt(np.mean((error[both] / sigma[both]) ** 2)):.2f}" if both.any() else "-",
                )
            )  # fmt: skip
    heads = ("topic", "quantity", "n", "hidden", "bias", "median", "95 %", "rms", "sigma")
    print_tables([ReportTable("errors, each place", heads, rows)])


def measure(survey, errors):
    """Add the errors of one survey: (error, standard deviation) of each place, NaN where it was hidden."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "survey"
        write_survey_folder(survey, folder)
        lines = linework.extract(folder, work=Path(name) / "work", on_problem="warn")
    truth = survey.truth.with_columns(bridged=~survey.truth.observed)
    axes = own_routes(truth)
    points_in = in_bounds(survey.points)
    pieces = paint_pieces(lines, points_in)
    dashes = ends_of_dashes(lines, least_paint_ratios(pieces), points_in)
    for axis in axes:
        exact = by_quantity(truth, axis, own_lines(truth, truth), is_lowest_only=True)
        found = by_quantity(lines, axis, own_lines(lines, truth), dashes=dashes)
        for key, places in exact.items():
            add_errors(places, found.get(key, []), errors[key[:2]])
    for axis in axes:
        samples = iter(paint_samples(lines, axis, pieces))
        stretches = defaultdict(list)
        for row in rows_in_order(pieces, axis):
            true = dict(
                zip(("remaining_paint", "contrast", "width"), painted(survey, pieces, row), strict=True)
            )
            for _ in true:
                one = next(samples)
                if true[one.quantity] is not None:
                    error = math.nan if one.value is None else one.value - true[one.quantity]
                    errors["marking", one.quantity].append((error, one.sigma))
                    stretches[one.quantity, one.line, one.station_m // EVERY_M].append((error, one.sigma))
        for (quantity, _, _), found in stretches.items():
            error, sigma = np.array(found).T
            known = np.isfinite(error)
            mean = math.nan, math.nan
            if known.any():
                share = 1.0 if quantity == "contrast" else known.sum()
                mean = error[known].mean(), math.sqrt(np.mean(sigma[known] ** 2) / share)
            errors["marking", f"{quantity}, {EVERY_M:.0f} m"].append(mean)


def rows_in_order(pieces, axis):
    """Return the numbers of the pieces in the order of their samples."""
    away = cKDTree(axis.xyz[:, :2]).query(pieces.xy)[0]
    order = np.argsort(pieces.line, kind="stable")
    return order[away[order] <= 30.0].tolist()


def painted(survey, pieces, row):
    """Return the share of paint that is left on a piece [%], its contrast and its width [m]; None where it is no line."""
    scenario = survey.scenario
    s, q = scenario.layout.road.alignment.locate(pieces.xy[row : row + 1] - np.asarray(scenario.origin_m)[:2])
    s, q = float(s[0]), float(q[0])
    near = [
        m
        for m in scenario.layout.markings
        if m.start_m - 0.5 <= s <= m.end_m + 0.5
        and abs(q - m.q_m - (float(m.shift_m(s)) if m.shift_m else 0.0)) < 0.5 * m.width_m
    ]
    if not near:
        return None, None, None
    half_s, half_q = 0.5 * pieces.length_m[row], 0.5 * CORE_SHARE * pieces.width_m[row]
    grid = np.stack(
        np.meshgrid(np.linspace(s - half_s, s + half_s, 41), np.linspace(q - half_q, q + half_q, 7)), axis=-1
    )
    place = grid.reshape(-1, 2)
    cover = paint_cover(place, scenario.layout.all_markings, scenario.seed)
    is_left = cover >= 0.5
    if is_left.mean() < 0.2:
        return 100 * float(is_left.mean()), None, near[0].width_m
    # Brightness in that of plain asphalt; where paint thins out the road shows through
    road = road_shade(scenario, place)
    paint = np.median((road + cover * (scenario.sensor.contrast - road))[is_left])
    edge = np.array([0.0, 0.5 * near[0].width_m + BESIDE_M])
    beside = [place - edge, place + edge]
    return (
        100 * float(is_left.mean()),
        paint / road_shade(scenario, np.concatenate(beside)).mean(),
        near[0].width_m,
    )


def road_shade(scenario, place):
    """Return how bright the asphalt is at (n, 2) places: stones, patches along the road, and stains, as the simulator has them."""
    fine, patch = (
        smooth_noise(place[:, 0] / along, place[:, 1] / across, scenario.seed + seed)
        for along, across, seed in ((0.3, 0.3, 101), (12.0, 2.5, 102))
    )
    shade = 1.0 + 0.2 * (fine - 0.5) + 0.3 * (patch - 0.5)
    return shade * stain_shade(place, scenario.layout.all_stains)


def in_bounds(points):
    def inside(bounds):
        x, y = points.xyz[:, 0], points.xyz[:, 1]
        return points.take((x >= bounds.west) & (x < bounds.east) & (y >= bounds.south) & (y < bounds.north))

    return inside


def own_lines(lines, truth):
    """Return the exact wire or rail that each one is, by its name: the one that is nearest to most of its places.

    Wires hang 0.3 m and more above each other, and beams of a median stand 0.35 m behind each other: where one is hidden,
    the other is no measure of it.
    """
    owners = {}
    for kinds in WHICH:
        exact = list(places_by_name(truth, kinds))
        tree = cKDTree(np.concatenate([places for _, places in exact])) if exact else None
        owner = np.repeat(np.arange(len(exact)), [len(places) for _, places in exact])
        for name, places in places_by_name(lines, kinds):
            nearest = np.bincount(owner[tree.query(places)[1]]).argmax() if exact else None
            owners[name] = exact[nearest][0] if exact else ""
    return owners


def places_by_name(lines, kinds):
    """Yield the name of each line of some kinds as samples have it, and places along it."""
    for i in np.flatnonzero(np.isin(lines.kind, kinds)).tolist():
        shape = shapely.segmentize(shapely.linestrings(lines[i].xyz), PLACES_M)
        yield str(lines.id[i]) or f"line {i + 1}", shapely.get_coordinates(shape, include_z=True)


def by_quantity(lines, axis, owners, *, is_lowest_only=False, dashes=None):
    """Return all samples by topic, quantity, and wire or rail: the least clearance of each wire at a place, or of the lowest one only."""
    crossings = crossings_at(lines, cross_cuts(lines, axis), len(axis.station_m))
    found = defaultdict(list)
    for samples in (with_bends(station_samples(axis, crossings)), dash_samples(lines, axis, dashes)):
        for sample in samples:
            own = owners.get(sample.line, "") if sample.topic in RAILS else ""
            found[sample.topic, sample.quantity, own].append(sample)
    lowest = {}
    for one in clearance_samples(lines, axis, crossings):
        wire = owners[one.line.split(" over ")[0]]
        key = one.station_m, round(one.offset_m, 1), "" if is_lowest_only else wire
        if one.value is not None and (key not in lowest or one.value < lowest[key][1].value):
            lowest[key] = wire, one
    for wire, one in lowest.values():
        found["clearance", "clearance", wire].append(one)
    return found


def add_errors(exact, found, into):
    """Compare each exact sample with the found one at the same place."""
    known = [one for one in found if one.value is not None]
    tree = cKDTree([(one.station_m, one.offset_m) for one in known]) if known else None
    for one in exact:
        if one.value is None:
            continue
        away, i = tree.query((one.station_m, one.offset_m)) if tree is not None else (math.inf, 0)
        if away > SAME_M:
            into.append((math.nan, math.nan))
        else:
            into.append((known[i].value - one.value, known[i].sigma))


if __name__ == "__main__":
    main(sys.argv[1:])
