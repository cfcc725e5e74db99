"""Several drives over one road: how well they agree before and after they are adjusted, and what that does to lines.

``python -m benchmarks.drives --seeds 900-902 --roads bends,urban`` simulates two passes over each road, each with slow
position errors of its own of 2 to 10 cm, and extracts each pass alone, both as they are (``--no-adjust``) and both
adjusted. ``--sigmas no`` keeps from linework how good each pass is. Nothing may be tuned on the seeds that are reported.
"""

import argparse
import time
from dataclasses import replace

import numpy as np

import linework
from benchmarks.accuracy import seeds_of
from linework.arrays import distance_along
from linework.cli.commands.of_lines.evaluate import print_tables
from linework.evaluation.report.tables import ReportTable, centimetres, number
from linework.lines.crosscuts import axis_along, cross_cuts
from linework.model.points import Points
from linework.model.trajectory import Trajectory
from linework.runs.drives.adjusted import adjusted_drives
from linework.runs.drives.separate import separate_drives
from linework.runs.drives.ties import TIE_KINDS
from linework.simulation.roads.draw import draw_scenario
from linework.simulation.roads.scenario import Pass
from linework.simulation.simulate import survey_of

SEEDS, ROADS = "900-902", "bends,urban,motorway,rural"
#: Amplitudes of the slow errors of a pass, along each axis. [m]
ERRORS_M = (0.02, 0.10)
#: Shares and periods of the two waves of an error: satellites change, corrections come late. [s]
SHARES, PERIODS_S = (0.7, 0.3), (8.0, 120.0)
#: Reach within which a line is the same, also before it is adjusted; the lines of double ones are farther apart. [m]
SAME_M = 0.25
#: Length over which differences are averaged, so that what is left is not the noise of a station. [m]
PIECE_M = 10.0
#: Kinds whose place does not depend on the side that it is looked at from.
KINDS = ("lane_marking", "road_boundary", "kerb_top")
RATIO_CAP = 5.0


def main(arguments=()):
    options = parsed(arguments)
    errors, between = {}, {"before": [], "after": []}
    seconds = {"as they are": 0.0, "adjusted": 0.0}
    for road in options.roads.split(","):
        for seed in seeds_of(options.seeds):
            points, path, truth = two_passes(road, seed, options.length_m, stated=options.sigmas == "yes")
            found = {}
            for name, adjust in (("as they are", False), ("adjusted", True)):
                start = time.perf_counter()
                found[name] = extracted(points, path, adjust=adjust)
                seconds[name] += time.perf_counter() - start
            drives = separate_drives(path)
            assert len(drives) == 2, drives
            alone = [extracted(*part(points, path, drive)) for drive in drives]
            for i, lines in enumerate(alone):
                found[f"pass {i + 1}"] = lines
            said = [f"{road} {seed}"]
            adjusted = adjusted_drives(drives, path, alone)
            if adjusted is not None:
                fixed = [part(*moved(points, path, adjusted.correction), drive) for drive in drives]
                between["before"].append(differences(*alone))
                between["after"].append(differences(*(extracted(*one) for one in fixed)))
                middle = [[np.median(np.abs(d)) for d in parts[-1]] for parts in between.values()]
                said += [
                    f"{name} {in_cm(*two)}"
                    for name, two in zip(between, np.array(middle)[..., None], strict=True)
                ]
            for name, lines in found.items():
                errors.setdefault(name, []).append(of_truth(lines, truth))
                across, up, across_ratio, up_ratio = errors[name][-1]
                said.append(f"{name} {in_cm(across, up)} r {rms(across_ratio):.2f}/{rms(up_ratio):.2f}")
            print("; ".join(said), flush=True)
    print_tables([errors_table(errors, seconds), between_table(between)])


def parsed(arguments):
    parser = argparse.ArgumentParser(prog="python -m benchmarks.drives")
    parser.add_argument("--seeds", default=SEEDS, help="first-last, or a list")
    parser.add_argument("--roads", default=ROADS)
    parser.add_argument("--length-m", type=float, default=200.0)
    parser.add_argument("--sigmas", choices=("yes", "no"), default="yes")
    return parser.parse_args(list(arguments))


def two_passes(road, seed, length_m, *, stated):
    """Points and path of two passes with errors of their own, and the truth; with the sigmas of the path if `stated`."""
    scenario = draw_scenario(road, seed, length_m, points_per_m=3000.0)
    first = replace(scenario.passes[0], pose_error_m=(0.0, 0.0, 0.0))
    lanes = scenario.layout.lanes
    offset, direction = ([lane for lane in lanes if lane[1] != first.direction] or list(lanes))[-1]
    second = Pass(
        q_m=offset, direction=direction, speed_mps=first.speed_mps, wander_m=first.wander_m,
        pose_error_m=(0.0, 0.0, 0.0), start_time_s=first.start_time_s + 400.0,
    )  # fmt: skip
    survey = survey_of(replace(scenario, passes=(first, second)))
    points, path = survey.points, survey.trajectory
    rng = np.random.default_rng([seed, 53])
    off, off_path, sigma = np.zeros((len(points), 3)), np.zeros((len(path), 3)), np.zeros((len(path), 3))
    for drive in separate_drives(path):
        size = float(np.exp(rng.uniform(*np.log(ERRORS_M))))
        period = np.exp(rng.uniform(*np.log(PERIODS_S), (2, 3)))
        phase = rng.uniform(0.0, 2.0 * np.pi, (2, 3))

        def slow(time_s, size=size, period=period, phase=phase):
            waves = (
                s * np.sin(2.0 * np.pi * time_s[:, None] / p + f)
                for s, p, f in zip(SHARES, period, phase, strict=True)
            )
            return size * sum(waves)

        own, own_path = drive.holds(points.time_s), drive.holds(path.time_s)
        off[own], off_path[own_path] = slow(points.time_s[own]), slow(path.time_s[own_path])
        sigma[own_path] = size * np.sqrt(0.5 * sum(s * s for s in SHARES))
    path = Trajectory(path.time_s, path.xyz + off_path, path.attitude_deg, sigma if stated else None)
    return with_xyz(points, points.xyz + off, survey.crs), path, survey.truth


def with_xyz(points, xyz, crs):
    return Points(xyz, intensity=points.intensity, time_s=points.time_s, crs=crs, columns=points.columns)


def part(points, path, drive):
    """The points and the path of one drive."""
    return points.take(drive.holds(points.time_s)), path.take(np.flatnonzero(drive.holds(path.time_s)))


def moved(points, path, correction):
    """Points and path, corrected."""
    return with_xyz(points, points.xyz + correction.at(points.time_s), points.crs), correction.moved(path)


def extracted(points, path, *, adjust=False):
    return linework.extract(points, kinds=TIE_KINDS, trajectory=path, adjust=adjust, on_problem="warn")


def differences(lines, others):
    """Differences across and up of the lines of two sets, averaged over pieces, (n,) and (n,). [m]"""
    across, up = [np.zeros(0)], [np.zeros(0)]
    for i in range(len(lines)):
        if str(lines.kind[i]) not in KINDS or lines.length_m[i] < PIECE_M:
            continue
        axis, cuts = nearest_cuts(lines, i, others)
        piece = axis.station_m[cuts.station] // PIECE_M
        for one in np.unique(piece):
            own = piece == one
            if own.sum() >= PIECE_M // 2:
                across.append(cuts.offset_m[own].mean(keepdims=True))
                up.append((cuts.up_m - axis.xyz[cuts.station, 2])[own].mean(keepdims=True))
    return np.concatenate(across), np.concatenate(up)


def of_truth(lines, truth):
    """Errors across and up of lines at stations, and their ratios to sigma."""
    truth = truth.with_columns(crs=lines.crs)
    parts = [np.zeros((4, 0))]
    for i in range(len(lines)):
        if str(lines.kind[i]) not in KINDS or lines.length_m[i] < 5.0:
            continue
        axis, cuts = nearest_cuts(lines, i, truth)
        along = axis.station_m[cuts.station]
        own = lines[i]
        vertex_m = distance_along(own.xyz)
        rows = slice(lines.offsets[i], lines.offsets[i + 1])
        sigma = [np.interp(along, vertex_m, s[rows]) for s in (lines.sigma_xy_m, lines.sigma_z_m)]
        up = cuts.up_m - axis.xyz[cuts.station, 2]
        parts.append(np.stack([cuts.offset_m, up, cuts.offset_m / sigma[0], up / sigma[1]]))
    return np.concatenate(parts, axis=1)


def nearest_cuts(lines, i, others):
    """The nearest line of the same kind at each station of a line."""
    axis = axis_along("", lines[i].xyz)
    cuts = cross_cuts(others.take(others.kind == lines.kind[i]), axis, reach_m=SAME_M)
    cuts = cuts.take(np.flatnonzero((np.abs(cuts.cosine) > 0.966) & ~cuts.bridged))
    order = np.lexsort((np.abs(cuts.offset_m), cuts.station))
    first = np.concatenate([[True], np.diff(cuts.station[order]) > 0])[: len(order)]
    cuts = cuts.take(order[first])
    return axis, cuts.take(np.flatnonzero(np.abs(cuts.up_m - axis.xyz[cuts.station, 2]) < SAME_M))


def rms(values):
    return float(np.sqrt(np.mean(values**2))) if len(values) else float("nan")


def in_cm(across, up):
    return f"{centimetres(rms(across))}/{centimetres(rms(up))}"


def errors_table(errors, seconds):
    rows = []
    for name, parts in errors.items():
        across, up, across_ratio, up_ratio = np.concatenate(parts, axis=1)
        # Lines of something else are none of this, and have no sigma for it
        ratios = (r[np.abs(r) < RATIO_CAP] for r in (across_ratio, up_ratio))
        rows.append(
            (
                name, number(across.size, 0), centimetres(rms(across)), centimetres(np.median(np.abs(across))),
                centimetres(rms(up)), *(number(rms(r), 2) for r in ratios), number(seconds.get(name, np.nan), 0),
            )
        )  # fmt: skip
    columns = (
        "lines of",
        "m",
        "across\nrms cm",
        "median\ncm",
        "up\nrms cm",
        "across /\nsigma",
        "up /\nsigma",
        "s",
    )
    return ReportTable(
        "Lines against the truth", columns, tuple(rows), "all seeds pooled, lines within 0.25 m"
    )


def between_table(between):
    rows = []
    for name, parts in between.items():
        across, up = (np.concatenate(column) for column in zip(*parts, strict=True))
        rows.append(
            (
                name,
                number(across.size, 0),
                *(
                    centimetres(v)
                    for d in (across, up)
                    for v in (np.median(np.abs(d)), np.quantile(np.abs(d), 0.9), rms(d))
                ),
            )
        )
    columns = (
        "",
        "pieces",
        "across\nmedian cm",
        "90 %\ncm",
        "rms\ncm",
        "up\nmedian cm",
        "90 %\ncm",
        "rms\ncm",
    )
    return ReportTable("Between the two passes, at lines", columns, tuple(rows), "means of 10 m")


if __name__ == "__main__":
    import sys

    main(sys.argv[1:])
