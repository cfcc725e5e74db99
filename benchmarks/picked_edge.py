"""How far picked edges are followed, on simulated stereo drives with true poses.

``python -m benchmarks.picked_edge --seeds 950-953 --roads bends,urban --worst`` takes others than the default and
lists what went wrong. Images are drawn once and kept (``--folder``). Nothing may be tuned on the seeds that are
reported.

A pick is a random place of a truth line, 5 to 15 m from the cameras, inside both images, with nothing before it,
shifted by up to 2 pixels. On lane markings paint is to be seen there: 10 grey levels over the road beside it. On road
boundaries the grey values of both sides (3 to 15 cm off, 1.2 m long) differ by 10 levels or more, or there is a step
of 5 cm or more. Its visible stretch is what is connected with it, within 25 m
of the left camera, and inside both images with nothing before it (less than 1 m of it hidden), 3 m or longer. It is followed to
the end of visibility when the followed line is within 15 cm of it in plan, to within 1 m of both of its ends (on a
dashed line: of its first and last paint) and along 95 % of it. "pair": the line as the picked pair alone shows it;
"line": the line of all pairs. "far": as "line", its far end alone.
"""

import argparse
import time
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from benchmarks._stereo_sets import FOLDER, stereo_set
from benchmarks.accuracy import seeds_of
from linework.errors import InputError
from linework.imaging.rectify import rectifier_of
from linework.methods.picked_edge.method import PosedPairs, follow_picked
from linework.model.images import RectifiedPair
from linework.simulation.roads.draw import ROADS
from linework.simulation.sensors.view import PassScene

ON_REQUEST = True
VISIBLE_M, WITHIN_M, END_M, SHARE = 25.0, 0.15, 1.0, 0.95
PICK_M, SHIFT_PX = (5.0, 15.0), 2.0
LEAST_GREY, LEAST_STEP_M, LEAST_LENGTH_M = 10.0, 0.05, 3.0
#: Truth is looked at every so often; posts hide less of it than this. [m]
EVERY_M, HIDDEN_M = 0.1, 1.0


@dataclass
class Case:
    """One pick: where, and the stretch of truth that can be followed."""

    name: str
    kind: str
    number: int
    pixel: np.ndarray
    stretch: np.ndarray
    grey: float
    step_m: float
    radius_m: float


class World:
    """A drive with its rectified pairs and truth."""

    def __init__(self, drawn, road, seed):
        self.name, self.truth = f"{road} {seed}", drawn.truth
        self.poses, self.drawn = drawn.drive.poses, drawn
        self.rectifier = rectifier_of(drawn.drive.rig)
        self.rig = self.rectifier.rig
        self.scene, self.origin = PassScene(drawn.drive.scenario), np.asarray(drawn.drive.scenario.origin_m)
        self.pairs = {}
        self.drive = PosedPairs(self.pair, list(range(len(drawn.left))), self.poses)
        dashes = drawn.truth["lane_marking_dash"]
        places = [resampled(dashes[i].xyz, 0.05) for i in range(len(dashes))]
        self.paint = cKDTree(np.concatenate(places)[:, :2]) if places else None

    def pair(self, i):
        if i not in self.pairs:
            images = self.rectifier.rectified(self.drawn.left[i], self.drawn.right[i])
            self.pairs[i] = RectifiedPair(
                *images, self.rig, number=i, time_s=float(self.drawn.drive.time_s[i])
            )
        return self.pairs[i]

    def visible(self, i, xyz):
        """Which places a pair shows in both images, near enough."""
        col, row, disparity = self.rig.project(self.poses.to_vehicle(i, xyz))
        eyes = self.poses.to_world(i, np.array([self.rig.position_m, self.right_m]))
        away = np.linalg.norm(xyz - eyes[0], axis=1)
        with np.errstate(invalid="ignore"):
            seen = (
                (col - disparity >= 3)
                & (col <= self.rig.width - 4)
                & (row >= 3)
                & (row <= self.rig.height - 4)
            )
        seen &= (away <= VISIBLE_M) & np.isfinite(col)
        for eye in eyes:
            near = np.flatnonzero(seen)
            seen[near] &= ~self.scene.is_hidden(eye - self.origin, xyz[near] - self.origin + [0.0, 0.0, 0.02])
        return seen, np.column_stack([col, row]), away

    @property
    def right_m(self):
        return self.rig.position_m + self.rig.base_m * self.rig.R_vehicle_camera[:, 0]

    def grey_beside(self, i, xyz, left, off_m):
        """Mean grey value of the left image in places off a stretch of line, to its left."""
        places = (xyz[:, None] + off_m[:, None] * np.array([*left, 0.0])).reshape(-1, 3)
        col, row, _ = self.rig.project(self.poses.to_vehicle(i, places))
        inside = (
            np.isfinite(col)
            & (col >= 0)
            & (col < self.rig.width - 0.5)
            & (row >= 0)
            & (row < self.rig.height - 0.5)
        )
        c, r = np.round(col[inside]).astype(int), np.round(row[inside]).astype(int)
        return float(self.pair(i).left[r, c].mean()) if len(c) else 0.0

    def contrast(self, i, xyz, left, is_paint):
        """Paint over both sides of it, or the left side over the right one. [grey values]"""
        beside = np.linspace(0.03, 0.15, 5)
        if is_paint:
            sides = [self.grey_beside(i, xyz, left, s * (beside + 0.12)) for s in (1.0, -1.0)]
            return self.grey_beside(i, xyz, left, np.array([-0.03, 0.0, 0.03])) - max(sides)
        return self.grey_beside(i, xyz, left, beside) - self.grey_beside(i, xyz, left, -beside)


def main(arguments=()):
    options = parsed(arguments)
    results = defaultdict(list)
    for road in options.roads.split(","):
        for seed in seeds_of(options.seeds):
            drawn = stereo_set(
                road, seed, length_m=options.length_m, every_m=options.every_m, rays_per_pixel=options.rays,
                folder=options.folder,
            )  # fmt: skip
            world = World(drawn, road, seed)
            rng = np.random.default_rng([seed, sum(map(ord, road))])
            for kind in options.kinds.split(","):
                for case in cases_in(world, kind, options.picks, rng):
                    results[kind].append(judged(world, case, options))
    for kind, rows in results.items():
        told(kind, rows)


def parsed(arguments):
    parser = argparse.ArgumentParser(prog="python -m benchmarks.picked_edge")
    parser.add_argument("--seeds", default="950-955", help="first-last, or a list")
    parser.add_argument("--roads", default=",".join(ROADS))
    parser.add_argument("--kinds", default="lane_marking,road_boundary")
    parser.add_argument("--picks", type=int, default=9, help="of each kind, per drive")
    parser.add_argument("--length-m", type=float, default=60.0)
    parser.add_argument("--every-m", type=float, default=3.0)
    parser.add_argument("--rays", type=int, default=2, help="per pixel")
    parser.add_argument("--worst", action="store_true", help="list what went wrong")
    parser.add_argument("--folder", type=Path, default=FOLDER, help="where images are kept")
    return parser.parse_args(list(arguments))


def cases_in(world, kind, n, rng):
    """Random picks on lines of one kind."""
    lines, found, tries = world.truth[kind], [], 0
    while len(found) < n and tries < 40 * n and len(lines):
        tries += 1
        case = drawn_case(world, lines, rng)
        if case is not None:
            found.append(case)
    return found


def drawn_case(world, lines, rng):
    chance = lines.length_m / lines.length_m.sum()
    i, number = rng.choice(len(lines), p=chance), int(rng.integers(len(world.drive.numbers)))
    xyz = resampled(lines[i].xyz, EVERY_M)
    seen, pixels, away = world.visible(number, xyz)
    paint = np.ones(len(xyz), dtype=bool)
    if lines.kind[i] == "lane_marking" and lines.pattern[i] == "dashed" and world.paint is not None:
        paint = world.paint.query(xyz[:, :2])[0] < 0.08
    can = np.flatnonzero(seen & paint & (away >= PICK_M[0]) & (away <= PICK_M[1]))
    if len(can) == 0:
        return None
    k = int(rng.choice(can))
    first, last = connected(seen, k)
    ends = np.flatnonzero(paint[first : last + 1]) + first
    way = xyz[min(k + 5, len(xyz) - 1), :2] - xyz[max(k - 5, 0), :2]
    left = np.array([-way[1], way[0]]) / np.hypot(*way)
    is_edge = lines.kind[i] == "road_boundary"
    n = 6 if is_edge else 1
    grey = world.contrast(number, xyz[max(k - n, 0) : k + n + 1], left, not is_edge)
    step = float(lines.height_m[i]) if np.isfinite(lines.height_m[i]) else 0.0
    if (not is_edge and grey < LEAST_GREY) or (abs(grey) < LEAST_GREY and abs(step) < LEAST_STEP_M):
        return None
    pixel = pixels[k] + rng.uniform(-SHIFT_PX, SHIFT_PX, 2)
    stretch = xyz[ends[0] : ends[-1] + 1]
    if len(stretch) * EVERY_M < LEAST_LENGTH_M:
        return None
    if away[ends[0]] > away[ends[-1]]:
        stretch = stretch[::-1]
    return Case(world.name, str(lines.kind[i]), number, pixel, stretch, grey, step, radius_m(stretch))


def connected(seen, k):
    """First and last place of what is seen around one, small gaps included."""
    at, gap = np.flatnonzero(seen), HIDDEN_M / EVERY_M
    cuts = np.flatnonzero(np.diff(at) > gap)
    starts, stops = at[np.concatenate([[0], cuts + 1])], at[np.concatenate([cuts, [len(at) - 1]])]
    i = int(np.flatnonzero((starts <= k) & (k <= stops))[0])
    return int(starts[i]), int(stops[i])


def radius_m(xyz):
    """Radius of the circle through both ends and the middle."""
    a, b, c = xyz[0, :2], xyz[len(xyz) // 2, :2], xyz[-1, :2]
    u, v = b - a, c - a
    area = abs(u[0] * v[1] - u[1] * v[0])
    sides = np.hypot(*u) * np.hypot(*v) * np.hypot(*(c - b))
    return float(sides / (2.0 * area)) if area > 1e-6 else np.inf


def resampled(line, every_m):
    step = np.hypot(*np.diff(line[:, :2], axis=0).T)
    t = np.concatenate([[0.0], np.cumsum(step)])
    at = np.arange(0.0, t[-1] + 1e-9, every_m)
    return np.column_stack([np.interp(at, t, c) for c in line.T])


@dataclass
class Result:
    """What came of a pick."""

    case: Case
    said: str
    kind: str
    pair: bool
    line: bool
    far: bool
    seconds: float
    errors: np.ndarray
    ratios: np.ndarray
    n_pairs: int


def judged(world, case, options):
    start = time.process_time()
    steps, said, edge = [], "", None
    try:
        follow = follow_picked(world.drive, (case.number, *case.pixel))
        while True:
            steps.append(next(follow))
    except StopIteration as end:
        edge = end.value
    except InputError as error:
        said = str(error)
    seconds = time.process_time() - start
    if edge is None:
        result = Result(case, said, "", False, False, False, seconds, np.zeros(0), np.zeros(0), 0)
    else:
        by_pair, by_line = (reached(x, case.stretch) for x in (steps[0].xyz, edge.lines.xyz))
        errors, ratios = errors_of(edge.lines, case.stretch)
        said = " / ".join(edge.stops) + f"; covered {by_line[0]:.2f} near {by_line[1]} far {by_line[2]}"
        result = Result(
            case, said, edge.kind, is_whole(by_pair), is_whole(by_line), by_line[2], seconds, errors, ratios,
            len(steps),
        )  # fmt: skip
    if options.worst and not result.line:
        side = f"grey {case.grey:.0f} step {case.step_m:.2f} R {case.radius_m:.0f} m {len(case.stretch) * EVERY_M:.0f} m"
        print(
            f"{case.name} {case.kind} pair {case.number} at {case.pixel.round(1)} {side}: {said}", flush=True
        )
    return result


def is_whole(how):
    return how[0] >= SHARE and how[1] and how[2]


def reached(xyz, stretch):
    """Share of a stretch that a line is at, and whether it reaches to its near and its far end."""
    line = resampled(xyz, 0.02)
    is_at = cKDTree(line[:, :2]).query(stretch[:, :2])[0] <= WITHIN_M
    n = max(round(END_M / EVERY_M), 1)
    inner = is_at[n:-n] if len(is_at) > 2 * n else is_at
    return float(inner.mean()), bool(is_at[: n + 1].any()), bool(is_at[-n - 1 :].any())


def errors_of(lines, stretch):
    """Distances across of a line's vertices beside a stretch, and those over their sigma."""
    tree = cKDTree(stretch[1:-1, :2])
    away, at = tree.query(lines.xyz[:, :2])
    near = (away < 0.5) & (at > 0) & (at < len(stretch) - 3)
    along = stretch[2:, :2] - stretch[:-2, :2]
    along /= np.hypot(*along.T)[:, None]
    apart = lines.xyz[near, :2] - stretch[1:-1][at[near], :2]
    way = along[at[near]]
    across = way[:, 0] * apart[:, 1] - way[:, 1] * apart[:, 0]
    return across, across / lines.sigma_xy_m[near]


def told(kind, rows):
    """Print what share was followed."""
    groups = {"all": rows, "radius < 90 m": [r for r in rows if r.case.radius_m < 90.0]}
    if kind == "road_boundary":
        groups["grey >= 10"] = [r for r in rows if abs(r.case.grey) >= LEAST_GREY]
        groups["step, grey < 10"] = [r for r in rows if abs(r.case.grey) < LEAST_GREY]
    for name, some in groups.items():
        if not some:
            continue
        shares = {key: np.mean([getattr(r, key) for r in some]) for key in ("pair", "line", "far")}
        errors, ratios = (np.concatenate([getattr(r, key) for r in some]) for key in ("errors", "ratios"))
        right = np.mean([r.kind == kind for r in some])
        print(
            f"{kind}, {name}: {len(some)} picks; to both ends: pair {shares['pair']:.3f} line {shares['line']:.3f} "
            f"far {shares['far']:.3f}; refused {np.mean([not r.kind for r in some]):.3f}, kind right {right:.3f}; "
            f"rmse {rms(errors):.3f} m, within 15 cm {rms(errors[np.abs(errors) < WITHIN_M]):.3f} m, "
            f"error/sigma {rms(ratios):.2f} median {np.median(np.abs(ratios)) * 1.4826 if len(ratios) else 0:.2f}; "
            f"{np.mean([r.seconds for r in some]):.2f} s, {np.mean([r.seconds / max(r.n_pairs, 1) for r in some]):.3f} s a pair"
        )


def rms(values):
    return float(np.sqrt(np.mean(np.square(values)))) if len(values) else float("nan")


if __name__ == "__main__":
    import sys

    main(sys.argv[1:])
