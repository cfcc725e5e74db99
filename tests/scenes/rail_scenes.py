"""Roadsides made by hand, point by point: what stands where, and where its line is, is known exactly."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from linework.imaging.raster import grid_for, in_height_band
from linework.methods.radon.method import Radon, RadonConfig
from linework.methods.rails.circles import Bins, bin_near
from linework.model.grid import Image
from linework.model.points import Points
from linework.model.tile import TileData
from linework.surface.road import Ground, RoadConfig, find_ground, height_above_ground, height_above_road

NOISE_M = 0.005
#: Height of the scanner over the road, at u = 0.
EYE_M = 2.2
#: Top edge, height and depth of the beams below: an ordinary W-beam.
TOP_M, BEAM_M, DEPTH_M = 0.75, 0.31, 0.08
#: The W from its lower edge up, and how far each height stands out towards the traffic.
W_HEIGHT = np.array([0.0, 0.10, 0.22, 0.34, 0.42, 0.58, 0.66, 0.78, 0.90, 1.0])
W_DEPTH = np.array([0.0, 0.25, 1.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.25, 0.0])

RADON = RadonConfig()
ONLY_RAILS = Radon(RADON, kinds=("guardrail", "barrier"))


# Everything is made along a road: s [m] along it, u [m] to its left, h [m] above it, as (n, 3)


def sheet(rng, s, u_of_h, h, per_m=150, noise_m=NOISE_M):
    """Points of a sheet that runs from s[0] to s[1], from h[0] to h[1]; `u_of_h` gives its offset."""
    n = round(per_m * (s[1] - s[0]))
    at, up = rng.uniform(*s, n), rng.uniform(*h, n)
    return np.column_stack([at, u_of_h(up) + rng.normal(0, noise_m, n), up + rng.normal(0, noise_m, n)])


def beam(rng, s, u, faces=-1, top_m=TOP_M, per_m=150, noise_m=NOISE_M):
    """The face of a W-beam; `u` is midway between crest and valley, `faces` the side of its crests."""

    def offset(h):
        return u + faces * DEPTH_M * (np.interp((h - top_m) / BEAM_M + 1, W_HEIGHT, W_DEPTH) - 0.5)

    return sheet(rng, s, offset, (top_m - BEAM_M, top_m), per_m, noise_m)


def posts(rng, s, u, top_m=TOP_M):
    """Posts 10 cm wide every 2 m, from the ground to the beam's lower edge."""
    at = np.arange(s[0] + 0.3, s[1], 2.0)
    return np.concatenate([sheet(rng, (p, p + 0.1), lambda h: u + 0 * h, (0, top_m - 0.3)) for p in at])


def rail(rng, s=(2.0, 38.0), u=5.0, faces=-1, **beam_of):
    """A guardrail on posts."""
    behind = u - faces * (0.5 * DEPTH_M + 0.05)
    return np.concatenate([beam(rng, s, u, faces, **beam_of), posts(rng, s, behind)])


def hedge(rng, s=(2.0, 38.0), u=(5.0, 6.0), h=(0.0, 1.1), per_m3=900):
    """Twigs at random in a box; rays get 0.25 m into it on average."""
    n = round(per_m3 * (s[1] - s[0]) * (u[1] - u[0]) * (h[1] - h[0]))
    depth = rng.uniform(0.0, u[1] - u[0], n)
    kept = rng.uniform(size=n) < np.exp(-depth / 0.25)
    return np.column_stack([rng.uniform(*s, n), u[0] + depth, rng.uniform(*h, n)])[kept]


def wall(rng, s=(2.0, 38.0), u=5.0, top_m=2.0):
    """An upright face."""
    return sheet(rng, s, lambda h: u + 0 * h, (0.0, top_m), per_m=250 * top_m)


def car(rng, s, u=3.0):
    """A car's side, 4.4 m long: body to 0.85 m, bonnet, windows set in, roof."""
    body = sheet(rng, (s, s + 4.4), lambda h: u + 0.03 * np.sin(6 * h), (0.18, 0.85), 250)
    cabin = sheet(rng, (s + 1.2, s + 3.8), lambda h: u + 0.35 * (h - 0.7), (0.85, 1.40), 200)
    bonnet = np.column_stack([rng.uniform(s, s + 1.2, 300), rng.uniform(u, u + 1.7, 300), np.full(300, 0.87)])
    roof = np.column_stack(
        [rng.uniform(s + 1.4, s + 3.6, 300), rng.uniform(u, u + 1.6, 300), np.full(300, 1.4)]
    )
    return np.concatenate([body, cabin, bonnet, roof])


def boards(rng, s=(2.0, 38.0), u=5.0, tops=(0.36, 0.70, 1.05)):
    """A fence of three boards 12 cm high on posts."""
    rows = [sheet(rng, s, lambda h: u + 0 * h, (top - 0.12, top), 60) for top in tops]
    return np.concatenate([*rows, posts(rng, s, u + 0.05, tops[-1])])


def new_jersey(rng, s=(2.0, 38.0), u=5.0, top_m=0.81):
    """The face of a concrete barrier turned to the road, its top edge at `u`; foot 0.22 m before it."""
    return sheet(
        rng, s, lambda h: u - np.interp(h, [0, 0.08, 0.33, top_m], [0.22, 0.22, 0.07, 0.0]), (0, top_m), 400
    )


def kerb(rng, s=(0.0, 40.0), u=4.0, top_m=0.14):
    """The upright face of a kerb."""
    return sheet(rng, s, lambda h: u + 0 * h, (0.0, top_m), 100)


def ground(rng, s=(0.0, 40.0), u=(-5.0, 9.0), per_m2=90):
    """Flat ground."""
    n = round(per_m2 * (s[1] - s[0]) * (u[1] - u[0]))
    return np.column_stack([rng.uniform(*s, n), rng.uniform(*u, n), rng.normal(0, NOISE_M, n)])


def unhidden(suh, u, h, s=(2.0, 38.0)):
    """What a scanner 2.2 m above u = 0 sees past a screen at `u`, `h` [m] low and high."""
    behind = suh[:, 1] > u + 0.06
    crossing = EYE_M + (suh[:, 2] - EYE_M) * u / np.where(behind, suh[:, 1], 1.0)
    between = (crossing > h[0]) & (crossing < h[1]) & (suh[:, 0] > s[0]) & (suh[:, 0] < s[1])
    return suh[~(behind & between)]


#: What a beam at u = 5 hides, and a wall there.
BEAM_SCREEN = (5.0, (TOP_M - BEAM_M, TOP_M))


def scene(rng, *things, behind=(), screen=None):
    """Things on flat ground, and `behind` them what a screen (u, heights) there does not hide."""
    back = np.concatenate([ground(rng), *behind])
    return np.concatenate([back if screen is None else unhidden(back, *screen), *things])


def rail_scene(rng, *more, behind=(), **rail_of):
    """A guardrail at u = 5 on flat ground, seen from the road, with more before and behind it."""
    return scene(rng, rail(rng, **rail_of), *more, behind=behind, screen=BEAM_SCREEN)


def straight(suh, angle_rad=0.0, origin=(0.0, 0.0, 0.0)):
    """World positions along a straight road that starts at `origin`."""
    cos, sin = np.cos(angle_rad), np.sin(angle_rad)
    x, y, z = np.asarray(suh, dtype=np.float64).T
    return np.column_stack([x * cos - y * sin, x * sin + y * cos, z]) + np.asarray(origin)


def bend(suh, radius_m, origin=(0.0, 0.0, 0.0)):
    """World positions along a road that turns left at `radius_m`, the radius of u = 0."""
    s, u, h = np.asarray(suh, dtype=np.float64).T
    r, angle = radius_m - u, s / radius_m
    return np.column_stack([r * np.sin(angle), radius_m - r * np.cos(angle), h]) + np.asarray(origin)


@dataclass(frozen=True)
class Prepared:
    """A scene as the steps get it."""

    points: Points
    surface: Ground
    height_m: np.ndarray
    binary: Image
    bins: Bins


def prepare(xyz):
    """Road, heights, binary image and bins of a scene."""
    points = Points(xyz)
    surface = find_ground(points, None, RoadConfig())
    height = np.minimum(height_above_road(surface, points.xyz), height_above_ground(surface, points.xyz))
    grid = grid_for(points, RADON.cell_m)
    binary = in_height_band(points.xyz, height, grid, RADON.min_height_m, RADON.max_height_m)
    return Prepared(points, surface, height, binary, bin_near(points.xyz, height, binary))


def extract(xyz, method=ONLY_RAILS):
    """The lines of a scene."""
    points = Points(xyz)
    return method.extract(TileData("scene", points.bounds.grown(1.0), points))
