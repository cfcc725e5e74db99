"""Roads of a generator that shares nothing with `linework simulate`: cross-sections on a grid, seen profile by profile.

A scan line is the road's height and brightness every centimetre along an oblique cut; a ray ends where the running
maximum of the elevation first passes its own, so kerbs, cars and barriers cast their shadows. What differs from the
simulator on purpose: asphalt in patches, wheel tracks, brightness that falls with range and incidence, paint worn
where wheels run, a beam that averages over its footprint, kerbs with rounded edges, grass in tussocks, two passes that
drift apart.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scipy.ndimage import gaussian_filter, gaussian_filter1d
from scipy.spatial import cKDTree

from linework.model.lines import LineSet
from linework.model.points import Points
from linework.model.trajectory import Trajectory

#: The grid of the road along and across. [m]
ALONG_M, ACROSS_M = 0.02, 0.01
#: What is built to each side of the axis. [m]
HALF_WIDTH_M = 16.0
#: Longest range. [m]
FARTHEST_M = 60.0
ORIGIN_M = (412_345.0, 5_654_321.0, 287.0)
#: A vertex of a truth line is observed where so many points lie this near: on paint, about an edge. [m]
SEEN_POINTS, SEEN_PAINT_M, SEEN_EDGE_M = 3, 0.08, 0.12


@dataclass
class Road:
    """Height and brightness by station and offset (left positive), and what a surveyor would draw on it."""

    length_m: float
    z: np.ndarray
    brightness: np.ndarray
    lines: list[tuple[str, np.ndarray, str]] = field(default_factory=list)
    driven_m: tuple[float, ...] = (-1.75,)
    bend_per_m: float = 0.0
    eye_m: float = 2.3

    @property
    def across(self) -> np.ndarray:
        return np.arange(-HALF_WIDTH_M, HALF_WIDTH_M + ACROSS_M / 2, ACROSS_M)

    @property
    def along(self) -> np.ndarray:
        return np.arange(0.0, self.length_m + ALONG_M / 2, ALONG_M)

    def line(self, kind: str, offset: float | np.ndarray, ends=None, pattern: str = "solid") -> None:
        """Add a truth line at an offset (of every station), from end to end."""
        s = self.along
        d = np.broadcast_to(offset, s.shape)
        a, b = ends or (0.0, self.length_m)
        here = np.flatnonzero((s >= a - 1e-9) & (s <= b + 1e-9))
        here = np.unique(np.r_[here[::10], here[-1]])
        self.lines.append((kind, np.column_stack([s[here], d[here]]), pattern))

    def height(self, s: np.ndarray, d: np.ndarray) -> np.ndarray:
        """Return the heights at stations and offsets. [m]"""
        row = np.clip(np.round(s / ALONG_M).astype(int), 0, len(self.along) - 1)
        column = np.clip(np.round((d + HALF_WIDTH_M) / ACROSS_M).astype(int), 0, len(self.across) - 1)
        return self.z[row, column]

    def paint(self, offset, width_m, rng, *, period_m=0.0, dash_m=0.0, wear=0.0, gain=2.2) -> None:
        """Paint a line, solid or dashed, worn in patches, and add it to the truth."""
        s, y = self.along, self.across
        d = np.broadcast_to(offset, s.shape)
        on = np.ones(len(s), dtype=bool)
        if period_m:
            start = rng.uniform(0.0, period_m)
            on = (s - start) % period_m < dash_m
        near = np.abs(y[None, :] - d[:, None]) <= width_m / 2
        near &= on[:, None]
        rows, columns = np.nonzero(near)
        patches = gaussian_filter(rng.normal(size=(len(s) // 5 + 1, len(y) // 5 + 1)), (4, 2))
        patches = patches / patches.std()
        kept = patches[rows // 5, columns // 5] > np.quantile(patches, wear) if wear else slice(None)
        self.brightness[rows[kept], columns[kept]] = gain * np.median(self.brightness)
        self.z[rows[kept], columns[kept]] += 0.002
        if not period_m:
            self.line("lane_marking", d)
            return
        edges = np.flatnonzero(np.diff(np.r_[False, on, False].astype(int)))
        for a, b in edges.reshape(-1, 2):
            if s[b - 1] - s[a] > 0.3:
                self.line("lane_marking_dash", d, (s[a], s[b - 1]))
        self.line("lane_marking", d, pattern="dashed")


def asphalt(
    length_m: float, rng: np.random.Generator, *, crossfall=0.025, grade=0.01, texture=0.0015
) -> Road:
    """Return a bare surface: crossfall to both sides, long waves, texture, patches and wheel tracks of brightness."""
    s = np.arange(0.0, length_m + ALONG_M / 2, ALONG_M)
    y = np.arange(-HALF_WIDTH_M, HALF_WIDTH_M + ACROSS_M / 2, ACROSS_M)
    z = grade * s[:, None] - crossfall * np.abs(y)[None, :]
    coarse = gaussian_filter(rng.normal(size=(len(s) // 10 + 1, len(y) // 10 + 1)), 6)
    z = z + 0.004 * np.kron(coarse / coarse.std(), np.ones((10, 10)))[: len(s), : len(y)]
    z = gaussian_filter1d(z, 20, axis=1) + texture * rng.normal(size=z.shape)
    patches = gaussian_filter(rng.normal(size=(len(s) // 25 + 1, len(y) // 25 + 1)), (10, 3))
    patches = np.kron(patches / patches.std(), np.ones((25, 25)))[: len(s), : len(y)]
    brightness = 100.0 * (1.0 + 0.06 * patches) * rng.gamma(25.0, 1 / 25.0, size=z.shape)
    for track in (-2.6, -0.9, 0.9, 2.6):
        brightness *= 1.0 - 0.08 * np.exp(-(((y - track) / 0.3) ** 2))[None, :]
    return Road(length_m, z, brightness)


def raised(road: Road, at, height_m, *, side: int, face_m=0.02, rounded_m=0.01, gain=1.0) -> None:
    """Raise everything beyond an offset on one side (+1 left, -1 right) by a kerb; `height_m` may vary along."""
    y, d = road.across, np.broadcast_to(at, road.along.shape)
    beyond = side * (y[None, :] - d[:, None])
    step = np.clip(beyond / face_m, 0.0, 1.0)
    if rounded_m:
        step = gaussian_filter1d(step, rounded_m / ACROSS_M, axis=1)
    road.z += step * np.broadcast_to(height_m, road.along.shape)[:, None]
    stone = (beyond > 0) & (beyond < 0.15)
    road.brightness[stone] *= gain


def grass(road: Road, at, rng, *, side: int, slope=-0.05, tussock_m=0.03, ditch_m=0.0, gain=1.3) -> None:
    """Turn everything beyond an offset to grass: rough, brighter, falling or with a ditch."""
    y, d = road.across, np.broadcast_to(at, road.along.shape)
    beyond = side * (y[None, :] - d[:, None])
    there = beyond > 0
    rough = gaussian_filter(rng.normal(size=road.z.shape), (2, 3))
    rough = np.abs(rough / rough.std())
    extra = slope * beyond + tussock_m * rough
    if ditch_m:
        extra -= ditch_m * np.exp(-(((beyond - 3.0) / 1.0) ** 2))
    road.z[there] += extra[there]
    road.brightness[there] *= gain * (1.0 + 0.2 * rough[there])


def car(road: Road, s0, d0, *, length_m=4.4, width_m=1.8, height_m=1.45) -> None:
    """Put a car on the road: a box with a bonnet."""
    s, y = road.along, road.across
    i = np.flatnonzero((s > s0) & (s < s0 + length_m))
    j = np.flatnonzero(np.abs(y - d0) < width_m / 2)
    h = np.where((s[i] - s0 < 1.0) | (s[i] - s0 > length_m - 0.8), 0.6 * height_m, height_m)
    road.z[np.ix_(i, j)] += h[:, None]
    road.brightness[np.ix_(i, j)] = 60.0


@dataclass(frozen=True)
class Scanner:
    """One profile scanner (or two), and what its numbers look like."""

    lines_per_m: float = 12.0
    points_per_line: int = 600
    noise_m: float = 0.005
    tilt_deg: tuple[float, ...] = (45.0, -45.0)
    offset: float = 0.0
    bits: int = 16
    footprint_m: float = 0.012
    speed_mps: float = 14.0
    drift_m: float = 0.02


def recorded(road: Road, rng: np.random.Generator, scanner: Scanner) -> tuple[Points, Trajectory]:
    """Drive over the road once per lane driven, there and back, and return what was recorded."""
    smear = (scanner.footprint_m / ALONG_M / 2, scanner.footprint_m / ACROSS_M / 2)
    bright = gaussian_filter(road.brightness, smear)
    clouds, poses, start_s = [], [], 0.0
    for number, lane in enumerate(road.driven_m):
        turned = -1 if number % 2 else 1
        drift = scanner.drift_m * np.sin(number * np.array([2.0, 3.0]))
        n = int(road.length_m * scanner.lines_per_m / len(scanner.tilt_deg))
        line_s = road.length_m / scanner.speed_mps / n
        for tilt in scanner.tilt_deg:
            for k, s0 in enumerate(((np.arange(n) + 0.5) / n * road.length_m)[::turned]):
                for side in (-1, 1):
                    s, d, z, strength, phase = _half_line(road, bright, rng, scanner, (s0, lane), tilt, side)
                    t = start_s + (k + 0.9 * phase) * line_s
                    clouds.append(np.column_stack([s + drift[0], d + drift[1], z, strength, t]))
        t = start_s + np.linspace(0.0, road.length_m / scanner.speed_mps, max(int(road.length_m), 2))
        along = np.linspace(0.0, road.length_m, len(t))[::turned]
        driven = np.full(len(t), lane)
        poses.append(np.column_stack([t, along + drift[0], driven + drift[1], road.height(along, driven)]))
        start_s = t[-1] + 60.0
    cloud, pose = np.concatenate(clouds), np.concatenate(poses)
    cloud = cloud[np.argsort(cloud[:, 4], kind="stable")]
    strength = np.clip(np.round(scanner.offset + cloud[:, 3]), 0, 2**scanner.bits - 1)
    points = Points(on_earth(road, cloud[:, :3]), intensity=strength, time_s=cloud[:, 4])
    return points, Trajectory(pose[:, 0], on_earth(road, pose[:, 1:]))


def _half_line(
    road: Road,
    bright: np.ndarray,
    rng: np.random.Generator,
    scanner: Scanner,
    van_m: tuple[float, float],
    tilt_deg: float,
    side: int,
) -> tuple[np.ndarray, ...]:
    """Return station, offset, height, brightness and phase of the points that one scan line sees on one side."""
    s0, lane = van_m
    tan, stretch = np.tan(np.radians(tilt_deg)), 1.0 / np.cos(np.radians(tilt_deg))
    y = road.across
    row = np.round((s0 + tan * (y - lane)) / ALONG_M).astype(int)
    half = np.flatnonzero((row >= 0) & (row < len(road.along)) & (side * (y - lane) >= 0))[::side]
    if len(half) < 10:
        return (np.zeros(0),) * 5
    # A ray ends where the elevation first passes its own
    eye = road.height(np.array(s0), np.array(lane)) + road.eye_m
    angle = np.arctan2(road.z[row[half], half] - eye, np.abs(y[half] - lane) * stretch + 1e-6)
    step = 2.0 * np.pi / scanner.points_per_line
    rays = np.arange(-np.pi / 2 + rng.uniform(0, step), 0.3, step)
    hit = np.searchsorted(np.maximum.accumulate(angle), rays)
    rays, hit = rays[hit < len(half)], np.maximum(hit[hit < len(half)], 1)
    low, high = angle[hit - 1], angle[hit]
    share = np.clip((rays - low) / np.maximum(high - low, 1e-12), 0.0, 1.0)
    at, before = half[hit], half[hit - 1]
    d = y[before] + share * (y[at] - y[before])
    z = road.z[row[before], before] * (1.0 - share) + road.z[row[at], at] * share
    range_m = np.hypot((d - lane) * stretch, z - eye)
    noise = scanner.noise_m * rng.normal(size=len(d))
    d, z = d + side * np.cos(rays) / stretch * noise, z + np.sin(rays) * noise
    incidence = np.clip(np.abs(np.sin(rays)), 0.05, 1.0)
    strength = bright[row[at], at] * incidence**0.3 * (4.0 / range_m) ** 0.4
    keep = range_m < FARTHEST_M
    columns = (s0 + tan * (d - lane), d, z, strength, 0.5 + side * (rays + np.pi / 2) / (2.0 * np.pi))
    return tuple(column[keep] for column in columns)


def on_earth(road: Road, sdz: np.ndarray) -> np.ndarray:
    """Turn station, offset and height into coordinates; the axis is straight or an arc. [m]"""
    s, d, z = sdz.T
    k = road.bend_per_m
    if k:
        x, y = np.sin(k * s) * (1 / k - d), 1 / k - np.cos(k * s) * (1 / k - d)
    else:
        x, y = s, d
    turn = np.radians(33.0)
    return np.column_stack(
        [np.cos(turn) * x - np.sin(turn) * y, np.sin(turn) * x + np.cos(turn) * y, z]
    ) + np.array(ORIGIN_M)


def truth_of(road: Road, points: Points) -> LineSet:
    """Return the lines to draw, with `observed` where enough points lie beside the vertex."""
    tree = cKDTree(points.xyz)
    xyz = [on_earth(road, np.column_stack([line, road.height(*line.T)])) for _, line, _ in road.lines]
    near = [SEEN_EDGE_M if kind == "road_boundary" else SEEN_PAINT_M for kind, _, _ in road.lines]
    observed = [
        tree.query_ball_point(one, reach, return_length=True) >= SEEN_POINTS
        for one, reach in zip(xyz, near, strict=True)
    ]
    return LineSet.from_lines(
        xyz,
        kind=[kind for kind, _, _ in road.lines],
        pattern=[pattern if kind.startswith("lane") else "" for kind, _, pattern in road.lines],
        observed=np.concatenate(observed),
    )


SCENES: dict[str, Callable[[float, np.random.Generator], Road]] = {}


def scene(build):
    """Name a scene by its function."""
    SCENES[build.__name__] = build
    return build


@scene
def street(length_m, rng):
    """Two lanes between kerbs of 3 to 12 cm with dropped ones, footways, parked cars, dark gutter stones."""
    road = asphalt(length_m, rng)
    s = road.along
    half = rng.uniform(3.2, 4.5)
    for side in (1, -1):
        height = np.full(len(s), rng.uniform(0.03, 0.12))
        for at in rng.uniform(5.0, length_m - 10.0, 3):
            ramp = np.clip((np.abs(s - at) - 2.0) / 0.7, 0.0, 1.0)
            height = np.minimum(height, 0.02 + (height - 0.02) * ramp)
        gutter = (side * road.across > half - 0.3) & (side * road.across < half)
        road.brightness[:, gutter] *= rng.choice([0.8, 1.0, 1.25])
        raised(road, side * half, height, side=side, gain=rng.uniform(0.9, 1.5))
        road.line("road_boundary", side * (half))
        raised(road, side * (half + rng.uniform(1.8, 2.6)), rng.uniform(0.3, 1.2), side=side, face_m=0.05)
    road.paint(0.0, 0.12, rng, period_m=9.0, dash_m=3.0, wear=rng.uniform(0, 0.3))
    side = rng.choice([-1, 1])
    for at in np.cumsum(rng.uniform(5.5, 25.0, 8)):
        if at < length_m - 6:
            car(road, at, side * (half - 1.05))
    road.driven_m = (-half / 2 * side, half / 2 * side)
    return road


@scene
def country(length_m, rng):
    """Two lanes with worn edge lines, verges that start level with the road, ditches; no kerb."""
    road = asphalt(length_m, rng)
    half = rng.uniform(2.9, 3.6)
    wander = 0.04 * gaussian_filter1d(rng.normal(size=len(road.along)), 60) * 10
    for side in (1, -1):
        edge = side * (half + rng.uniform(0.15, 0.5)) + wander
        grass(road, edge, rng, side=side, slope=rng.uniform(-0.12, -0.02), tussock_m=rng.uniform(0.01, 0.04),
              ditch_m=rng.uniform(0.0, 0.6), gain=rng.uniform(0.8, 1.6))  # fmt: skip
        road.line("road_boundary", edge)
        road.paint(side * half - side * 0.06, 0.12, rng, wear=rng.uniform(0.1, 0.5))
    road.paint(0.0, 0.12, rng, period_m=12.0, dash_m=4.0, wear=rng.uniform(0, 0.4))
    road.bend_per_m = 1.0 / rng.choice([-400.0, 250.0, 1000.0])
    road.driven_m = (-half / 2,)
    return road


@scene
def boulevard(length_m, rng):
    """Two carriageways of two lanes with a raised median between kerbs, outer kerbs, a cycle path beyond."""
    road = asphalt(length_m, rng, crossfall=0.015)
    median, width = rng.uniform(1.0, 2.5), rng.uniform(6.4, 7.2)
    for side in (1, -1):
        road.line("road_boundary", side * median)
        raised(road, side * (median + width), rng.uniform(0.08, 0.15), side=side, gain=1.2)
        road.line("road_boundary", side * (median + width))
        raised(road, side * (median + width + 2.0), 0.04, side=side)
        road.paint(side * (median + width / 2), 0.12, rng, period_m=6.0, dash_m=2.0, wear=rng.uniform(0, 0.3))
        road.paint(side * (median + 0.3), 0.12, rng, wear=rng.uniform(0, 0.3))
    inside = np.abs(road.across) < median
    road.z[:, inside] += 0.12
    road.brightness[:, inside] *= rng.uniform(0.8, 1.5)
    road.driven_m = (-(median + width / 4), -(median + 3 * width / 4))
    return road


@scene
def bays(length_m, rng):
    """A street with parking bays: short lines across beside the lane, cars in half of them, a far kerb."""
    road = asphalt(length_m, rng)
    y = road.across
    for side, half in ((1, rng.uniform(3.0, 3.6)), (-1, rng.uniform(7.8, 8.4))):
        raised(road, side * half, 0.1, side=side, gain=1.3)
        road.line("road_boundary", side * half)
    inner = -rng.uniform(3.0, 3.3)
    for at in np.arange(4.0, length_m - 4.0, 2.5):
        i = np.flatnonzero(np.abs(road.along - at) < 0.06)
        j = np.flatnonzero((y < inner) & (y > inner - 4.6))
        road.brightness[np.ix_(i, j)] = 210.0
        if rng.uniform() < 0.5:
            i = np.flatnonzero((road.along > at + 0.4) & (road.along < at + 2.1))
            j = np.flatnonzero((y < inner - 0.4) & (y > inner - 4.3))
            road.z[np.ix_(i, j)] += 1.4
            road.brightness[np.ix_(i, j)] = 60.0
    road.paint(inner, 0.12, rng, wear=0.1)
    road.driven_m = (-1.5, 1.5)
    return road


@scene
def setts(length_m, rng):
    """An old street: rough setts for the footways, low kerbs, bright seams of bitumen, manholes, no paint."""
    road = asphalt(length_m, rng, texture=0.003)
    half = rng.uniform(2.8, 3.4)
    for side in (1, -1):
        raised(road, side * half, rng.uniform(0.02, 0.06), side=side, face_m=0.03, rounded_m=0.015)
        road.line("road_boundary", side * half)
        beyond = side * road.across > half + 0.15
        road.z[:, beyond] += 0.006 * rng.normal(size=(len(road.along), int(beyond.sum())))
        raised(road, side * (half + 1.6), 3.0, side=side)
    j = np.abs(road.across - 0.4 - 0.3 * np.sin(road.along[:, None] / 15.0)) < 0.04
    road.brightness[j] *= 1.35
    for _ in range(6):
        s0, d0 = rng.uniform(2, length_m - 2), rng.uniform(-half + 0.5, half - 0.5)
        disc = np.hypot(road.along[:, None] - s0, road.across[None, :] - d0) < 0.32
        road.brightness[disc] *= rng.choice([0.5, 1.8])
    road.driven_m = (-1.2, 1.2)
    return road


@scene
def expressway(length_m, rng):
    """Three lanes one way with a hard shoulder, wide edge lines, a concrete barrier left, grass that falls away right."""
    road = asphalt(length_m, rng, crossfall=0.0)
    road.z += 0.025 * (road.across + 6.0)[None, :]
    left, right = 6.0, -9.0
    road.paint(left - 0.6, 0.2, rng, wear=0.1)
    road.paint(right + 2.6, 0.3, rng, wear=rng.uniform(0, 0.2))
    width = (left - 0.6 - (right + 2.6)) / 3
    for k in (1, 2):
        road.paint(left - 0.6 - k * width, 0.15, rng, period_m=18.0, dash_m=6.0, wear=rng.uniform(0, 0.3))
    grass(road, right, rng, side=-1, slope=-0.3, tussock_m=0.03)
    road.line("road_boundary", right)
    raised(road, left, 0.85, side=1, face_m=0.15)
    road.line("road_boundary", left)
    road.driven_m = (left - 0.6 - width * 1.5,)
    return road
