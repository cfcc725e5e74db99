"""Back to the points: circles along the seed lines, followed on through bends, fitted locally."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from linework.kernels import corridor as kernels
from linework.methods.radon.seeds import Segments
from linework.model.arrays import AnyArray, Float32Array, FloatArray, IntArray
from linework.model.grid import Image
from linework.model.settings import setting


@dataclass(frozen=True, slots=True, kw_only=True)
class CircleConfig:
    """Settings of the circles."""

    spacing_m: float = setting(
        0.5,
        unit="m",
        reason="two circles per metre: two scan lines each at the widest spacing",
        low=0.05,
        high=10,
    )
    radius_m: float = setting(
        0.08,
        unit="m",
        reason="a beam is 8 cm deep: its half depth and two sigma of 2 cm noise",
        low=0.01,
        high=2,
    )
    max_gap_m: float = setting(
        2.0,
        unit="m",
        reason="a post's spacing without a return; longer is a gap in the rail",
        low=0,
        high=100,
    )
    fit_window_m: float = setting(
        3.0,
        unit="m",
        reason="half window of the local fit: eight posts' bending, 18 m bends",
        low=0.5,
        high=50,
    )
    sheet_m: float = setting(
        0.36, unit="m", reason="height of a W-beam (31 cm) and the noise of its top", low=0.05, high=2
    )


@dataclass(frozen=True, slots=True)
class Bins:
    """Points near candidate features, binned for quick access.

    Parameters
    ----------
    points
        (n, 4) float64 [m]: x, y from `origin`, z above it, height above road; in order of bins.
    origin
        (3,) float64 [m, world].
    n_most
        Points in the fullest bin.
    """

    points: FloatArray
    starts: IntArray
    n_x: int
    n_y: int
    cell_m: float
    origin: FloatArray
    n_most: int = 1

    @property
    def work(self) -> FloatArray:
        """A buffer that holds all points of a box of a few metres."""
        return np.empty((64 * self.n_most, 4))


def bin_near(xyz: FloatArray, height_m: Float32Array, binary: Image) -> Bins:
    """Bin the points within a metre of the image's set cells, from 0.6 m below the road to 2.2 m above it.

    That is what the profile looks at: the foot of a bank behind a rail, and what stands above one.
    """
    grid = binary.grid
    reach = max(round(1.0 / grid.cell_width_m), 1)
    near = ndimage.binary_dilation(binary.values, iterations=reach)
    index = kernels.near_mask(xyz, height_m, grid.east_m, grid.north_m, grid.cell_width_m, near, -0.6, 2.2)
    return bin_points(xyz, height_m, index)


def bin_points(xyz: FloatArray, height_m: Float32Array, index: AnyArray, cell_m: float = 0.5) -> Bins:
    """Bin the points chosen by `index`."""
    chosen = xyz[index]
    if len(chosen) == 0:
        return Bins(np.zeros((0, 4)), np.zeros(2, dtype=np.int64), 1, 1, cell_m, np.zeros(3), 1)
    # Column by column: ten times as fast as along the first axis
    origin = np.floor(np.array([column.min() for column in chosen.T]) / cell_m) * cell_m
    local = chosen - origin
    n_x, n_y = (int(column.max() // cell_m) + 1 for column in local.T[:2])
    order, starts = kernels.bin_order(local[:, 0], local[:, 1], cell_m, n_x, n_y)
    points = np.concatenate([local, height_m[index, None]], axis=1)[order]
    n_most = int(np.max(np.diff(starts), initial=1))
    return Bins(np.ascontiguousarray(points), starts, n_x, n_y, cell_m, origin, n_most)


def find_starts(segments: Segments, bins: Bins, config: CircleConfig) -> FloatArray:
    """Return (n, 5) places to follow from: x, y [m from the origin], heading [rad], top z [m], score.

    A seed line is good to a cell of the image. Around it the Radon transform is taken once more, of the
    points themselves and over small turns, for strips that look like a beam from its end: points over a
    beam's height, none above, none below. Seeds in hedges, walls and cars end here.
    """
    turns = np.radians(np.arange(-3.0, 3.01, 0.5))
    shape = np.array([config.radius_m, config.sheet_m - 0.06, 0.10, 6.0, 0.4, 0.45, 1.3])
    work, places = bins.work, np.empty((6, 4))
    out = []
    for start, end in zip(segments.start_xy, segments.end_xy, strict=True):
        middle = 0.5 * (start + end) - bins.origin[:2]
        heading = math.atan2(end[1] - start[1], end[0] - start[0])
        along = np.array([math.cos(heading), math.sin(heading)])
        box = np.array([*middle, *along, 0.5 * math.dist(start, end), 0.35, -1.0, 2.2])
        args = (bins.points, bins.starts, bins.n_x, bins.n_y, bins.cell_m)
        n = kernels.find_beams(*args, box, turns, shape, work, places)
        for turn, u, top, score in places[:n]:
            out.append((middle[0] - u * along[1], middle[1] + u * along[0], heading + turn, top, score))
    return np.array(out).reshape(-1, 5)


def follow_sheet(
    start: FloatArray, bins: Bins, band_m: tuple[float, float], config: CircleConfig
) -> FloatArray:
    """Follow a sheet both ways from a start (x, y, heading, top z); return its nodes (n, 7), see the kernel.

    Columns: x, y, heading, top z, number of points, spread, measured.
    """
    setting_ = np.array(
        [config.spacing_m, config.radius_m, config.max_gap_m, config.spacing_m, *band_m, config.sheet_m]
    )
    work = bins.work
    room = np.empty((20_000, 7))
    ahead = np.array([start[0], start[1], math.cos(start[2]), math.sin(start[2]), start[3]])
    args = (bins.points, bins.starts, bins.n_x, bins.n_y, bins.cell_m)
    n = kernels.follow(*args, ahead, setting_, work, room)
    forward = room[:n].copy()
    if n == 0:
        return forward
    # Back from where the filter had settled, so that the first nodes are followed, not assumed
    i = min(n - 1, 6)
    back = np.array([*forward[i, :2], -math.cos(forward[i, 2]), -math.sin(forward[i, 2]), forward[i, 3]])
    n = kernels.follow(*args, back, setting_, work, room)
    backward = room[:n][::-1].copy()
    backward[:, 2] += math.pi
    nodes = np.concatenate([backward[:-1], forward[i:]]) if n else forward[i:]
    known = ~np.isnan(nodes[:, 3])
    if not known.any():
        return nodes[:0]
    at = np.arange(len(nodes))
    nodes[:, 3] = np.interp(at, at[known], nodes[known, 3])
    return nodes
