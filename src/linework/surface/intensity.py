"""Intensity normalisation: asphalt is 1 at every range and incidence, in three tiers by what is known.

1. With a trajectory: range and incidence of every point, a curve of the level of asphalt over both fitted to the
   points of the road, and the rest (drift, other asphalt) by blocks of 4 m.
2. Without a trajectory but with times: the same with the scanner's track, estimated from the points.
3. With neither: the level of asphalt is a percentile of the points in blocks of 2 m.

Published effect on marking points found by a threshold: F1 from 72.3 to 78.9 %. All counts are whole
numbers on lattices of the world, so that the counts of tiles add up to those of the survey.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from itertools import pairwise

import numpy as np
from scipy.ndimage import distance_transform_edt, map_coordinates

from linework.arrays import AnyArray, BoolArray, Float32Array, FloatArray, IntArray
from linework.kernels.cells import intensity as kernels
from linework.model.ground import Ground
from linework.model.points import Points
from linework.model.trajectory import Trajectory
from linework.surface.road import is_road_point

#: Height of a scanner on the roof of a van above the ground. [m]
MOUNT_M = 2.2
#: Sides of blocks: for remaining drift and changes of asphalt, a lane; for the range as well, half a lane. [m]
PART_M, INTENSITY_BLOCK_M = 4.0, 2.0
#: Quantile of the road's points that is the level of asphalt: paint is a minority, in a block on a line a large one.
PART_SHARE, BLOCK_SHARE = 0.5, 0.4
#: Fewest points of a level, which is then good to a fifth of the texture of asphalt.
LEAST_LEVEL_POINTS = 30
#: Quantile of the points of one range and incidence that is the level of asphalt: paint and most of a verge are above.
VIEW_SHARE = 0.2
#: Priors: intensity falls with range to the power -RANGE_POWER (0: corrected in the scanner, 2: by physics) and with the
#: cosine of incidence to INCIDENCE_POWER (1: matt, 0: rough); and their standard deviations.
RANGE_POWER, RANGE_SIGMA = 0.7, 0.5
INCIDENCE_POWER, INCIDENCE_SIGMA = 0.5, 0.3
#: Standard deviations of the second difference of the logarithm of the level over range, and of a quantile of asphalt
#: about it: patches of other asphalt differ by this.
BEND_SIGMA, LEVEL_SIGMA = 0.02, 0.1
#: Rounds of the reweighted fit.
_N_ROUNDS = 20


class Tier(IntEnum):
    """Source of the scanner's position in a normalisation."""

    TRAJECTORY = 1
    TRACK = 2
    LOCAL = 3


@dataclass(frozen=True, slots=True)
class ViewLevels:
    """Level of asphalt over range and incidence: exp(f(log range) + power * log cosine).

    Parameters
    ----------
    log_level
        (n,) f at the ranges of the kernel's bins.
    incidence_power
        Power of the cosine of incidence.
    """

    log_level: FloatArray
    incidence_power: float

    def of(self, range_m: Float32Array, cosine: Float32Array) -> Float32Array:
        """Return the level of asphalt at ranges [m] and cosines of incidence (n,), (n,) float32; NaN where unknown."""
        node = np.log2(np.maximum(range_m, 1.0)) * kernels.RANGES_PER_DOUBLING - 0.5
        f = np.interp(node, np.arange(len(self.log_level)), self.log_level)
        level = np.exp(f + self.incidence_power * np.log(np.maximum(cosine, 0.01)))
        return np.where(np.isnan(range_m), np.nan, level).astype(np.float32)


def full_scale(intensity: Float32Array) -> float:
    """Return the full scale of recorded intensities (n,): 255 (8 bit) or 65535 (16 bit).

    >>> full_scale(np.array([3.0, 180.0], dtype=np.float32))
    255.0
    """
    return 255.0 if len(intensity) == 0 or float(intensity.max()) <= 255.0 else 65535.0


def normalised_intensity(
    points: Points, surface: Ground, trajectory: Trajectory | None = None, laser: AnyArray | None = None
) -> tuple[Float32Array, Tier]:
    """Return intensities with asphalt at 1, (n,) float32, and the tier used.

    Parameters
    ----------
    points
        With intensities; tiers 1 and 2 need times.
    trajectory
        Path of the van, on the ground; None: unknown.
    laser
        (n,) number of the laser of a spinning scanner: each has a gain of its own. None: there is one.

    Raises
    ------
    ValueError
        When the points have no intensities.

    Notes
    -----
    Points recorded at full scale were at least as bright: their normalised value is a lower bound, and they do not
    enter any fit. Points outside the times of the trajectory are normalised by tier 3.
    """
    if points.intensity is None:
        raise ValueError("intensity: the points have none")
    if len(points) == 0:
        return points.intensity, Tier.LOCAL
    on_road = is_road_point(surface, points.xyz) & (points.intensity < full_scale(points.intensity))
    normal, tier = _normalised(points, points.intensity, surface, trajectory, on_road)
    if laser is not None:
        # Gains show once range and incidence are out, and change the levels of asphalt once more
        evened = points.intensity / gain_of_lasers(normal, laser, on_road)
        normal, tier = _normalised(points, evened, surface, trajectory, on_road)
    return normal, tier


def gain_of_lasers(normal: Float32Array, laser: AnyArray, on_road: BoolArray) -> Float32Array:
    """Return the gain of each point's laser over all of them, (n,) float32; 1 for lasers with few points on the road.

    Parameters
    ----------
    normal, laser, on_road
        (n,) intensity with asphalt at 1, (n,) number of the laser, and (n,) bool.

    >>> normal = np.repeat(np.array([0.9, 1.2], dtype=np.float32), 50)
    >>> gain = gain_of_lasers(normal, np.repeat([3, 7], 50), np.ones(100, dtype=bool))
    >>> np.allclose(gain, normal)
    True
    """
    gain: Float32Array = np.ones(len(normal), dtype=np.float32)
    usable = on_road & np.isfinite(normal) & (normal > 0.0)
    for number in np.unique(laser[usable]):
        own = laser == number
        values = normal[own & usable]
        if len(values) >= LEAST_LEVEL_POINTS:
            gain[own] = np.median(values)
    return gain


def _normalised(
    points: Points,
    intensity: Float32Array,
    surface: Ground,
    trajectory: Trajectory | None,
    on_road: BoolArray,
) -> tuple[Float32Array, Tier]:
    tier = Tier.LOCAL
    path = None
    if points.time_s is not None:
        path, tier = scanner_track(points.take(on_road)), Tier.TRACK
        if trajectory is not None and len(trajectory) > 1:
            path, tier = path_at_scanner(trajectory, path), Tier.TRAJECTORY
    if path is None:
        level = local_level(points.xyz, intensity, on_road, INTENSITY_BLOCK_M, BLOCK_SHARE)
        return _over(intensity, level), Tier.LOCAL
    range_m, cosine = view_of(points, path, surface)
    levels = fit_views(kernels.count_views(intensity, range_m, cosine, on_road))
    ratio = _over(intensity, levels.of(range_m, cosine))
    seen = ~np.isnan(ratio)
    normal = _over(ratio, local_level(points.xyz, ratio, on_road & seen, PART_M, PART_SHARE))
    if not seen.all():
        other = local_level(points.xyz, intensity, on_road, INTENSITY_BLOCK_M, BLOCK_SHARE)
        normal = np.where(seen, normal, _over(intensity, other))
    return normal, tier if seen.any() else Tier.LOCAL


def view_of(
    points: Points, path: Trajectory, surface: Ground, mount_m: float = MOUNT_M
) -> tuple[Float32Array, Float32Array]:
    """Return range [m] and cosine of incidence on the road of each point, (n,) float32; NaN beyond the path's times.

    Raises
    ------
    ValueError
        When the points have no times.
    """
    if points.time_s is None:
        raise ValueError("time_s: the points have none")
    g = surface.grid
    south_east = np.gradient(np.nan_to_num(surface.road_m), g.cell_width_m)
    slopes = np.stack([south_east[1], -south_east[0]], axis=-1).astype(np.float32)
    frame = (g.east_m, g.north_m, g.cell_width_m)
    range_m, cosine = kernels.viewing_geometry(
        points.xyz, points.time_s, path.time_s, path.xyz, mount_m, frame, slopes
    )
    return range_m, cosine


def fit_views(counts: IntArray) -> ViewLevels:
    """Fit the level of asphalt over range and incidence to a histogram of the kernel's `count_views`.

    By weighted least squares to a low quantile of all bins of range and incidence with enough points. Asphalt is the
    darkest ground: bins brighter than the curve, verges and footways taken for road, lose most of their weight. On a
    level road range and incidence are correlated: then the power of the incidence stays near its prior, and the curve
    over range takes up the rest.

    Parameters
    ----------
    counts
        (ranges, cosines, intensities) int64.
    """
    total = counts.sum(axis=-1)
    rows, cols = np.nonzero(total >= LEAST_LEVEL_POINTS)
    n, m = counts.shape[0], len(rows)
    design, right = np.zeros((m + 2 * n - 2, n + 1)), np.zeros(m + 2 * n - 2)
    design[np.arange(m), rows] = 1.0
    design[:m, n] = -np.log(2.0) * (cols + 0.5) / kernels.COSINES_PER_HALVING
    right[:m] = np.log(share_of_counts(counts[rows, cols], VIEW_SHARE))
    # Priors: the curve falls with range and bends little; the power of the incidence
    bend, fall = m + np.arange(n - 2), m + n - 2 + np.arange(n - 1)
    for column, value in ((0, 1.0), (1, -2.0), (2, 1.0)):
        design[bend, bend - m + column] = value / BEND_SIGMA
    step = np.log(2.0) / kernels.RANGES_PER_DOUBLING
    design[fall, np.arange(n - 1)], design[fall, np.arange(1, n)] = -1.0, 1.0
    design[fall] /= step * RANGE_SIGMA * np.sqrt(n)
    right[fall] = -RANGE_POWER / (RANGE_SIGMA * np.sqrt(n))
    design[-1, n], right[-1] = 1.0 / INCIDENCE_SIGMA, INCIDENCE_POWER / INCIDENCE_SIGMA
    solution = np.zeros(n + 1)
    weight = np.ones(len(design))
    for k in range(_N_ROUNDS):
        brighter = np.maximum(right[:m] - design[:m] @ solution, 0.0) if k else np.zeros(m)
        weight[:m] = np.sqrt(total[rows, cols] / total.max()) / LEVEL_SIGMA
        weight[:m] /= 1.0 + (brighter / (2.0 * LEVEL_SIGMA)) ** 2
        solution = np.linalg.lstsq(design * weight[:, None], right * weight, rcond=None)[0]
    return ViewLevels(solution[:n], float(solution[n]))


def local_level(
    xyz: FloatArray, value: Float32Array, chosen: BoolArray, block_m: float, share: float
) -> Float32Array:
    """Return the quantile of the chosen points around each point, (n,) float32; NaN without enough of them.

    By blocks of the world's lattice, bilinear between their centres; blocks with too few chosen points take the level
    of the nearest one that has enough.

    Parameters
    ----------
    xyz, value, chosen
        (n, 3) points [m, world], (n,) float32 values and (n,) bool.
    block_m
        Side of a block. [m]
    share
        The quantile, 0 to 1.
    """
    low = np.floor(xyz[:, :2].min(axis=0) / block_m).astype(np.int64)
    n_cols, n_rows = (np.floor(xyz[:, :2].max(axis=0) / block_m).astype(np.int64) - low + 1).tolist()
    counts = kernels.count_in_blocks(xyz, value, chosen, block_m, (int(low[0]), int(low[1])), n_rows, n_cols)
    level = np.log(share_of_counts(counts, share))
    level[counts.sum(axis=-1) < LEAST_LEVEL_POINTS] = np.nan
    if np.isnan(level).all():
        return np.full(len(xyz), np.nan, np.float32)
    nearest = distance_transform_edt(np.isnan(level), return_distances=False, return_indices=True)
    places = (xyz[:, :2] / block_m - low - 0.5).T[::-1]
    log_level = map_coordinates(level[tuple(nearest)], places, order=1, mode="nearest")
    return np.asarray(np.exp(log_level), dtype=np.float32)


def share_of_counts(counts: AnyArray, share: float) -> FloatArray:
    """Return the quantile `share` of histograms (..., n) by the bins of the kernel, (...).

    >>> counts = np.zeros(kernels.N_INTENSITY_BINS, dtype=np.int64)
    >>> counts[kernels.bin_of(100.0)] = 5
    >>> bool(abs(share_of_counts(counts, 0.5) - 100.0) < 3.0)
    True
    """
    below = np.cumsum(counts, axis=-1)
    wanted = share * below[..., -1:]
    at = np.argmax(below >= wanted, axis=-1)[..., None]
    inside = np.maximum(np.take_along_axis(counts, at, axis=-1), 1)
    before = np.take_along_axis(below, at, axis=-1) - np.take_along_axis(counts, at, axis=-1)
    node = at + np.clip((wanted - before) / inside, 0.0, 1.0)
    return np.asarray(2.0 ** (node[..., 0] / kernels.PER_DOUBLING + kernels.LOWEST))


def _over(value: Float32Array, level: Float32Array) -> Float32Array:
    return np.asarray(value / level, dtype=np.float32)


# The scanner's track from the points alone: on the road it is above the densest place of every moment

#: Length of a moment, in which the scanner has one position: 5 turns a second leave a whole turn in it; 6 m at
#: 100 km/h. [s]
MOMENT_S = 0.2
#: Radii about the last estimate within which the position is refined, in turn: from two lanes to a lane and a half. [m]
NEAR_ESTIMATE_M = (8.0, 4.0, 2.5, 2.5, 2.5)
#: Moments over which the positions are smoothed: a van does not swerve within a second.
N_SMOOTH = 5
#: Greatest distance of a scanner's footprint from the origin of the van. [m]
FARTHEST_SCANNER_M = 5.0


def scanner_track(points: Points) -> Trajectory | None:
    """Return the scanner's track on the surface of the road, or None where the points do not determine it.

    Parameters
    ----------
    points
        On the road, with times, in any order.

    Notes
    -----
    The points of a scanner that turns at a constant rate are the denser the nearer they are, as range and incidence
    both spread them: the densest place is below it. The median of the points of a moment, taken repeatedly among those
    near the last one, converges to it from the middle of the road.
    """
    if points.time_s is None or len(points) == 0:
        return None
    order = np.argsort(points.time_s, kind="stable")
    moment = np.floor(points.time_s[order] / MOMENT_S)
    xyz = points.xyz[order]
    starts = np.concatenate([[0], np.flatnonzero(np.diff(moment)) + 1, [len(moment)]])
    times, places = [], []
    for first, last in pairwise(starts.tolist()):
        if last - first >= LEAST_LEVEL_POINTS:
            times.append((moment[first] + 0.5) * MOMENT_S)
            places.append(_densest(xyz[first:last]))
    if len(times) < 2:
        return None
    time_s, place = np.array(times), np.array(places)
    smooth = [_running_median(time_s, column) for column in place.T]
    # Extended by a moment at either end, so that it covers the times of all points
    ends = np.array([time_s[0] - MOMENT_S, *time_s, time_s[-1] + MOMENT_S])
    return Trajectory(ends, np.stack([np.concatenate([s[:1], s, s[-1:]]) for s in smooth], axis=-1))


def path_at_scanner(path: Trajectory, track: Trajectory | None) -> Trajectory:
    """Return the path of the van shifted to the scanner's track, by the median offset along and across.

    Scanners look down some metres behind the origin of the vehicle, and that distance is seldom recorded. The median
    over the path is exact to a few centimetres where single moments of the track are not; beyond 5 m it is not used.
    """
    if track is None:
        return path
    step = np.gradient(path.xyz[:, :2], axis=0)
    length = np.hypot(*step.T)
    ahead = step / np.maximum(length, 1e-9)[:, None]
    known = (path.time_s >= track.time_s[0]) & (path.time_s <= track.time_s[-1]) & (length > 1e-3)
    if not known.any():
        return path
    way = np.stack([np.interp(path.time_s, track.time_s, column) for column in track.xyz.T], axis=-1)
    off = (way - path.xyz)[known]
    along = float(np.median(np.sum(off[:, :2] * ahead[known], axis=1)))
    left = float(np.median(off[:, 1] * ahead[known, 0] - off[:, 0] * ahead[known, 1]))
    if np.hypot(along, left) > FARTHEST_SCANNER_M:
        return path
    xyz = path.xyz + np.column_stack([
        along * ahead[:, 0] - left * ahead[:, 1],
        along * ahead[:, 1] + left * ahead[:, 0],
        np.full(len(path), float(np.median(off[:, 2]))),
    ])  # fmt: skip
    return Trajectory(path.time_s, xyz)


def _densest(xyz: FloatArray) -> FloatArray:
    """Return the centre (3,) of the densest part of points (n, 3). [m]."""
    place = np.median(xyz, axis=0)
    for near_m in NEAR_ESTIMATE_M:
        near = xyz[np.hypot(xyz[:, 0] - place[0], xyz[:, 1] - place[1]) <= near_m]
        if len(near) < LEAST_LEVEL_POINTS // 3:
            break
        place = np.median(near, axis=0)
    return np.asarray(place)


def _running_median(time_s: FloatArray, value: FloatArray) -> FloatArray:
    """Return values (n,) smoothed by the mean of their neighbours in time (n,), without the outer quarters."""
    out = np.empty(len(value))
    half = N_SMOOTH * MOMENT_S / 2.0
    for i, t in enumerate(time_s):
        near = value[np.abs(time_s - t) <= half + 1e-9]
        out[i] = np.mean(np.sort(near)[len(near) // 4 : len(near) - len(near) // 4])
    return out
