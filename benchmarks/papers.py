"""The three papers as published, beside linework's own methods: accuracy, time and what each paper argues for.

    python -m benchmarks.papers [radon] [peaks] [obb] [search] [boxes] [stereo]

Surveys are simulated after each paper (`simulate --like`), seeds 31 to 35 (peaks: 1 to 20; boxes: 31). Completeness and
correctness within 10 cm, in stereo 15 cm within 20 m. Times are processor time of one call after a first one that
compiles. Tables are printed as Markdown: docs/papers.md holds them.
"""

import contextlib
import sys
import tempfile
import time
from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np

import linework
from linework.errors import LineworkError
from linework.imaging.raster import grid_for, in_height_band, rasterise
from linework.library.opened import opened_source
from linework.library.trace import traced_line
from linework.methods.protocol import tile_of, whole_tile
from linework.methods.radon.figures import FigureConfig, find_candidate_lines, line_ends
from linework.methods.stereo.method import Stereo
from linework.model.lines import LineSet
from linework.model.points import Points
from linework.published import obb_2023, radon_2002
from linework.published.bounding_volumes import (
    AABB,
    KDOP,
    OBB,
    collide_by_slabs,
    collide_in_space,
    dop_directions,
)
from linework.published.methods import Stereo1992, discs_of
from linework.runs.opened.recordings import opened_recordings
from linework.runs.settings import RunSettings
from linework.runs.steps import RunSteps
from linework.surface.road import height_above_road

SEEDS = (31, 32, 33, 34, 35)
LENGTH_M = 100.0


def table(head, rows):
    print("| " + " | ".join(head) + " |\n|" + "---|" * len(head))
    for row in rows:
        print("| " + " | ".join(str(cell) for cell in row) + " |")
    print(flush=True)


def timed(work):
    start = time.process_time()
    return work(), time.process_time() - start


def survey_like(paper, seed, folder, *, images=False, length_m=LENGTH_M):
    path = Path(folder) / f"{paper}-{seed}"
    if not path.exists():
        linework.simulate(path, like=paper, seed=seed, length_m=length_m, images=images)
    return path


def percent(value):
    return "-" if value is None or not np.isfinite(value) else f"{100 * value:.1f} %"


def centimetres(value):
    return "-" if value is None or not np.isfinite(value) else f"{100 * value:.1f}"


# Radon


def radon(folder):
    """Guardrails of whole surveys."""
    rows = []
    for seed in SEEDS:
        path = survey_like("radon-2002", seed, folder)
        truth = linework.read_lines(path / "truth.gpkg")
        for name, asked in (("as published", {"methods": "radon-2002"}), ("ours", {"kinds": "guardrail"})):
            linework.extract(path, workers=1, **asked)
            lines, seconds = timed(partial(linework.extract, path, workers=1, **asked))
            score = linework.evaluate(lines, truth, kinds=["guardrail"])["guardrail"]
            rows.append([seed, name, len(lines), percent(score.at.completeness), percent(score.at.correctness),
                         centimetres(score.at.lateral.rmse_m), f"{seconds:.1f}"])  # fmt: skip
    table(["seed", "guardrails", "lines", "complete", "correct", "across [cm]", "time [s]"], rows)


def peaks(folder):
    """Share of the rails within 0.3 m of one of the best candidate lines, as many as there are rails, twice that, 20."""
    shares = {"as published": [], "ours": []}
    for seed in range(1, 21):
        path = survey_like("radon-2002", seed, folder, length_m=60.0)
        points, way = linework.read_points(path), linework.read_trajectory(path)
        truth = linework.read_lines(path / "truth.gpkg")["guardrail"]
        if not len(truth):
            continue
        tile = whole_tile(tile_of(points, way))
        xyz = tile.points.xyz
        height, grid = height_above_road(tile.surface, xyz), grid_for(tile.points, 0.2)
        highest = rasterise(Points(xyz), grid, height_m=height).maximum.values
        ends = {
            "as published": published_candidates(radon_2002.binary_image(highest, 0.2, 1.2), grid),
            "ours": our_candidates(in_height_band(xyz, height, grid, 0.2, 1.2)),
        }
        for name, own in ends.items():
            shares[name].append([near(truth.xyz[:, :2], own[:n]) for n in (len(truth), 2 * len(truth), 20)])
    rows = [[name, len(found), *map(percent, np.mean(found, axis=0))] for name, found in shares.items()]
    table(["peaks", "surveys", "as many as rails", "twice as many", "20"], rows)


def published_candidates(binary, grid):
    """Return the ends (n, 2, 2) of the candidate lines of an image, by the paper's own steps."""
    config = radon_2002.Radon2002Config()
    # Row 0 is the southernmost in the paper's images
    values, theta, x = radon_2002.radon_image(binary[::-1], config.cell_m, config.step_deg)
    found = radon_2002.radon_peaks(values, theta, x, config)
    middle = grid.to_world(np.array(0.5 * grid.n_rows), np.array(0.5 * grid.n_cols))
    reach = float(np.abs(x).max())
    both = zip(found.theta_rad, found.rho_m, strict=True)
    ends = [np.stack(radon_2002.ends_of(angle, rho, -reach, reach, 0.0)) + middle for angle, rho in both]
    return np.array(ends).reshape(-1, 2, 2)


def our_candidates(binary):
    """Return the ends (n, 2, 2) of linework's candidate lines of an image."""
    found = find_candidate_lines(binary, FigureConfig())
    return line_ends(found.peaks, found.radon)


def near(places, ends, within_m=0.3):
    """Return the share of places (n, 2) near one of straight lines with ends (m, 2, 2)."""
    is_near = np.zeros(len(places), dtype=bool)
    for start, end in ends:
        way = (end - start) / np.hypot(*(end - start))
        is_near |= np.abs((places - start) @ [-way[1], way[0]]) <= within_m
    return is_near.mean()


# Boxes


def obb(folder):
    """Lines followed from one pick in the middle of each true line."""
    rows = []
    for seed in SEEDS:
        path = survey_like("obb-2023", seed, folder)
        truth = linework.read_lines(path / "truth.gpkg")
        with tempfile.TemporaryDirectory() as work, contextlib.ExitStack() as held:
            kinds = ("lane_marking", "road_boundary")
            recordings = held.enter_context(opened_source(path, Path(work), images=False, kinds=kinds))
            rows += [
                [seed, kind, name, *followed(recordings, truth[kind], kind, method, seed)]
                for kind in kinds
                for name, method in (("as published", "obb-2023"), ("ours", "auto"))
            ]
    table(
        [
            "seed",
            "kind",
            "",
            "picks",
            "refused",
            "followed",
            "across [cm]",
            "against drawn [cm]",
            "time a pick [s]",
        ],
        rows,
    )


def followed(recordings, truth, kind, method, seed):
    shares, offsets, by_drawing, seconds, refused = [], [], [], [], 0
    rng = np.random.default_rng([seed, len(kind)])
    for i in range(len(truth)):
        one = truth.take([i])
        visible = np.flatnonzero(one.observed)
        if len(visible) < 10:
            continue
        at = tuple(one.xyz[visible[len(visible) // 2], :2].tolist())
        start = time.process_time()
        try:
            found = traced_line(recordings, at, kind=kind, toward=None, settings=RunSettings(), steps=RunSteps(),
                                method=method)  # fmt: skip
        except LineworkError:
            refused += 1
            shares.append(0.0)
            continue
        finally:
            seconds.append(time.process_time() - start)
        score = linework.evaluate(found.lines.take([0]), one, kinds=[kind])[kind]
        shares.append(score.at.completeness or 0.0)
        drawn = linework.evaluate(found.lines.take([0]), digitised(one, rng), kinds=[kind])[
            kind
        ].at.lateral.rmse_m
        by_drawing.append(np.nan if drawn is None else drawn)
        offsets.append(np.nan if score.at.lateral.rmse_m is None else score.at.lateral.rmse_m)
    middle = [float(np.nanmedian(own)) if np.isfinite(own).any() else np.nan for own in (offsets, by_drawing)]
    return [
        len(shares),
        refused,
        percent(np.mean(shares)),
        *map(centimetres, middle),
        f"{np.median(seconds):.2f}",
    ]


def digitised(line, rng, every_m=5.0, sigma_m=0.03):
    """Return a line as a person draws it: a vertex every few metres, each picked among points 2 cm apart."""
    xyz = line.xyz
    t = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(xyz[:, :2], axis=0).T))])
    at = np.linspace(0.0, t[-1], max(int(t[-1] / every_m), 1) + 1)
    drawn = np.column_stack([np.interp(at, t, column) for column in xyz.T])
    drawn[:, :2] += rng.normal(0.0, sigma_m, (len(at), 2))
    return LineSet.from_lines([drawn], kind=line.kind.tolist(), crs=line.crs)


def search(_folder):
    """Share of a marking and of a kerb 60 m long that is followed, over search length and width: bends and straights."""
    rng = np.random.default_rng(2023)
    lengths, widths = (0.5, 1.0, 2.0, 3.0), (0.1, 0.3, 0.5, 1.0)
    for kind in ("lane_marking", "road_boundary"):
        rows = []
        for radius_m in (18.0, 30.0, 60.0, 200.0, np.inf):
            xyz, intensity = bend(rng, radius_m, kind)
            points_about = discs_of(xyz, intensity.astype(np.float32), 0.5)
            for width in widths:
                cells = []
                for length in lengths:
                    config = obb_2023.Obb2023Config(search_length_m=length, search_width_m=width)
                    place = on_bend(30.0, 0.0, radius_m)
                    if kind == "lane_marking":
                        config = obb_2023.with_range(points_about, place, config)
                    first = obb_2023.box_at(points_about, place, kind, config)
                    found = obb_2023.follow(points_about, first, kind, config)
                    along, aside = from_bend(found.xyz, radius_m)
                    # Chords leave a bend by L^2 / 8 R: between the centres too
                    middle = 0.5 * (found.xyz[1:] + found.xyz[:-1])
                    off = np.concatenate([aside, from_bend(middle, radius_m)[1]]) if len(middle) else aside
                    # Not the ends of the data, where there is no road beyond
                    places = np.concatenate([along, 0.5 * (along[1:] + along[:-1])])
                    off = off[np.abs(places - 30.0) < 29.0]
                    cells.append(f"{np.ptp(along) / 60.0:.0%}, {100 * np.sqrt(np.mean(off**2)):.1f} cm")
                rows.append(
                    ["straight" if np.isinf(radius_m) else f"{radius_m:.0f} m", f"{width:g} m", *cells]
                )
        print(f"{kind}\n")
        table(["radius", "width", *(f"length {length:g} m" for length in lengths)], rows)


def on_bend(along, aside, radius_m):
    """Return places (n, 2) beside a bend [m], from the distance along it and to its left."""
    along, aside = np.broadcast_arrays(np.asarray(along, dtype=float), np.asarray(aside, dtype=float))
    if np.isinf(radius_m):
        return np.stack([along, aside], axis=-1)
    angle, r = along / radius_m, radius_m - aside
    return np.stack([r * np.sin(angle), radius_m - r * np.cos(angle)], axis=-1)


def from_bend(xyz, radius_m):
    """Return distances along a bend and to its left. [m]"""
    if np.isinf(radius_m):
        return xyz[:, 0], xyz[:, 1]
    x, y = xyz[:, 0], radius_m - xyz[:, 1]
    # The bend turns by more than half a circle; it begins at 0
    angle = (np.arctan2(x, y) + 0.5) % (2.0 * np.pi) - 0.5
    return radius_m * angle, radius_m - np.hypot(x, y)


def bend(rng, radius_m, kind):
    """Return points of a road 60 m long [m], 2000 a square metre, 1 cm noise, with a marking or a kerb, and intensities."""
    n = 60 * 4 * 2000
    along, aside = rng.uniform(0.0, 60.0, n), rng.uniform(-2.0, 2.0, n)
    is_kerb = kind == "road_boundary"
    up = np.where(aside > 0.0, 0.12, 0.0) if is_kerb else np.zeros(n)
    paint = np.abs(aside) < 0.075
    intensity = np.where(paint & (not is_kerb), 180.0, 40.0) + rng.normal(0.0, 8.0, n)
    xyz = np.column_stack([on_bend(along, aside, radius_m), up]) + rng.normal(0.0, 0.01, (n, 3))
    return xyz, intensity


def boxes(folder):
    """Figure 1: axis-aligned, oriented and k-DOP volumes about the markings of search areas."""
    path = survey_like("obb-2023", SEEDS[0], folder)
    points, truth = linework.read_points(path), linework.read_lines(path / "truth.gpkg")["lane_marking"]
    points_about = discs_of(points.xyz, points.intensity, 0.5)
    directions = dop_directions(14)
    clouds, volumes = [], {"AABB": [], "OBB": [], "14-DOP": []}
    for place in truth.xyz[truth.observed][::2, :2]:
        xyz, intensity = points_about(place)
        try:
            box = obb_2023.marking_box(xyz - np.append(place, 0.0), intensity, obb_2023.Obb2023Config())
        except obb_2023.NoBoxError:
            continue
        low, high = obb_2023.intensity_range(intensity, obb_2023.Obb2023Config())
        paint = xyz[(intensity >= low) & (intensity <= high)]
        clouds.append(paint)
        volumes["AABB"].append(AABB.of(paint))
        volumes["OBB"].append(OBB.along(paint, box.u))
        volumes["14-DOP"].append(KDOP.of(paint, directions))
    tests = {"AABB": lambda a, b: bool(np.all((a.low <= b.high) & (b.low <= a.high))),
             "OBB": collide_in_space, "14-DOP": collide_by_slabs}  # fmt: skip
    n_bytes = {"AABB": 6 * 8, "OBB": (3 + 9 + 3) * 8, "14-DOP": 14 * 8}
    rng = np.random.default_rng(1)
    pairs = rng.integers(len(clouds), size=(20_000, 2))
    centres = np.array([cloud.mean(axis=0) for cloud in clouds])
    pairs = pairs[np.hypot(*(centres[pairs[:, 0]] - centres[pairs[:, 1]])[:, :2].T) < 1.5][:1000]
    touching = np.array([apart_m(clouds[i], clouds[j]) < 0.02 for i, j in pairs])
    rows = []
    for name, own in volumes.items():
        start = time.process_time()
        collides = np.array([tests[name](own[i], own[j]) for i, j in pairs])
        each = (time.process_time() - start) / max(len(pairs), 1)
        rows.append([name, f"{np.mean([plan_area(volume) for volume in own]):.3f}", n_bytes[name], f"{1e6 * each:.1f}",
                     percent(np.mean(collides & ~touching))])  # fmt: skip
    print(f"{len(clouds)} volumes, {len(pairs)} pairs within 1.5 m, {touching.sum()} of them touch\n")
    table(["volume", "area in plan [m2]", "bytes", "test [us]", "false collisions"], rows)


def plan_area(volume):
    corners = volume.corners[:, :2]
    corners = corners[np.unique(corners.round(6), axis=0, return_index=True)[1]]
    if len(corners) < 3:
        return 0.0
    from scipy.spatial import ConvexHull

    return float(ConvexHull(corners).volume)


def apart_m(a, b):
    from scipy.spatial import cKDTree

    return float(cKDTree(a).query(b)[0].min())


# Stereo


def stereo(folder):
    """Markings of each pair by itself, before lines of several pairs are joined; and joined, as extract does it."""
    rows, whole = [], []
    for seed in SEEDS:
        path = survey_like("stereo-1992", seed, folder, images=True, length_m=80.0)
        truth = linework.read_lines(path / "truth.gpkg")
        with tempfile.TemporaryDirectory() as work:
            survey = linework.open_survey(path)
            with opened_recordings(survey, Path(work), laser=False) as recordings:
                opened = recordings.stereo
                pairs = [(opened.pair(int(number)), k) for k, number in enumerate(opened.numbers)]
                for name, method in (("as published", Stereo1992()), ("ours, before joining", Stereo())):
                    method.look(pairs[0][0])
                    found, seconds = timed(partial(looks, method, [pair for pair, _ in pairs]))
                    shares = [share_of_pair(sightings, opened.poses, k, truth)
                              for sightings, (_, k) in zip(found, pairs, strict=True)]  # fmt: skip
                    n_lines = np.mean([len(np.unique(sightings.line)) for sightings in found])
                    rows.append([seed, name, f"{n_lines:.1f}", percent(np.nanmean([s for s, _ in shares])),
                                 percent(np.nanmean([c for _, c in shares])), f"{1000 * seconds / len(pairs):.0f}"])  # fmt: skip
        for name, method in (("as published", "stereo-1992"), ("ours", "stereo")):
            lines = linework.extract(path, methods=method, kinds="lane_marking")
            score = linework.evaluate(lines, truth, kinds=["lane_marking"], tolerance_m=0.15)["lane_marking"]
            whole.append(
                [seed, name, len(lines), percent(score.at.completeness), percent(score.at.correctness)]
            )
    table(["seed", "each pair", "lines a pair", "found", "right", "time a pair [ms]"], rows)
    table(["seed", "whole survey", "lines", "complete", "correct"], whole)


def looks(method, pairs):
    return [method.look(pair) for pair in pairs]


def share_of_pair(sightings, poses, k, truth, reach_m=20.0, within_m=0.15):
    """Return the share of the markings ahead of a pair that it shows, and of what it shows that is a marking."""
    marks = truth.take(np.isin(truth.kind, ["lane_marking"]))
    solid = densely(marks.xyz, marks.offsets)
    there = poses.to_vehicle(k, solid)
    ahead = there[(there[:, 0] > 6.0) & (there[:, 0] < reach_m) & (np.abs(there[:, 1]) < 5.0)]
    near_ones = sightings.take((sightings.xyz[:, 0] < reach_m) & (sightings.xyz[:, 0] > 6.0))
    if not len(ahead):
        return np.nan, np.nan
    if not len(near_ones):
        return 0.0, np.nan
    places = np.concatenate(
        [densely(near_ones.xyz[near_ones.line == line]) for line in np.unique(near_ones.line)]
    )
    from scipy.spatial import cKDTree

    found = cKDTree(places[:, :2]).query(ahead[:, :2])[0] <= within_m
    right = cKDTree(there[:, :2]).query(places[:, :2])[0] <= within_m
    return found.mean(), right.mean()


def densely(xyz, offsets=None, step_m=0.1):
    """Return places at most `step_m` apart on lines."""
    offsets = np.array([0, len(xyz)]) if offsets is None else offsets
    out = []
    for a, b in pairwise(offsets):
        line = xyz[a:b]
        t = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line[:, :2], axis=0).T))])
        at = np.arange(0.0, t[-1] + step_m, step_m)
        out.append(np.column_stack([np.interp(at, t, column) for column in line.T]))
    return np.concatenate(out)


PARTS = {part.__name__: part for part in (radon, peaks, obb, search, boxes, stereo)}


def main(arguments):
    chosen = arguments or list(PARTS)
    unknown = [name for name in chosen if name not in PARTS]
    if unknown:
        raise SystemExit(f"no part {unknown[0]}: choose from {', '.join(PARTS)}")
    with tempfile.TemporaryDirectory() as folder:
        for name in chosen:
            print(f"## {name}\n\n{PARTS[name].__doc__.strip()}\n")
            PARTS[name](folder)


if __name__ == "__main__":
    main(sys.argv[1:])
