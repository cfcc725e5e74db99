"""The smooth line through all matches of a picked edge in all pairs, with sigmas from the images and the poses.

Separate from `method`: following needs matches only, the line is fitted once through all of them at the end.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from linework.arrays import BoolArray, FloatArray, IntArray, distance_along
from linework.kernels.tracking.smooth import smooth_beside, smooth_height, smooth_plane
from linework.methods.picked_edge.follow import UNSEEN_M
from linework.methods.picked_edge.state import BENDING, GRADING
from linework.model.images import Poses
from linework.model.lines import LineSet

#: Distance between vertices: the steps near the cameras. [m]
VERTEX_SPACING_M = 0.25
#: Residual from which a match is an outlier [sigma], and rounds of smoothing and removing outliers.
_OFF, _ROUNDS = 3.5, 2
#: Largest distance of a match from the line as followed: pairs err by some centimetres. [m]
_NEAR_M = 0.4
#: Largest standard deviation across: the line ends where it is not known better. [m]
MOST_LINE_SIGMA_M = 0.25
#: Standard deviation of the kinks in the line as followed from pair to pair. [m]
_KINK_M = 0.03
#: Standard deviation of the offset between pairs beforehand [m], and the fewest pairs that it is estimated from.
_POSE_M, _LEAST_PAIRS = 0.1, 3
#: Ratio of the standard deviation to the median absolute value of normal errors.
_MEDIAN_TO_SIGMA = 1.4826
#: Shortest step of a line that has a direction. [m]
_LEAST_STEP_M = 1e-3
#: Shortest gap in paint [m], and fewest gaps of a dashed line.
_GAP_M, _LEAST_GAPS = 1.5, 2


@dataclass(frozen=True, slots=True)
class EdgeSightings:
    """Matches of a line in single images, as columns.

    Parameters
    ----------
    expected
        (n, 3) expected place of the line. [m, local world]
    left
        (n, 3) unit direction to its left there.
    across_m, variance
        (n,) distance of the line to the left of there, and its variance. [m, m^2]
    lift
        (n,) apparent shift of the line to the left per metre of height. [m/m]
    pair
        (n,) int64: number of the pair.
    """

    expected: FloatArray
    left: FloatArray
    across_m: FloatArray
    variance: FloatArray
    lift: FloatArray
    pair: IntArray

    def take(self, kept: BoolArray) -> EdgeSightings:
        """Return the matches where `kept` (n,) is True."""
        return EdgeSightings(*(getattr(self, f.name)[kept] for f in fields(self)))


@dataclass(frozen=True, slots=True)
class SmoothEdge:
    """A smooth line.

    Parameters
    ----------
    xyz
        (n, 3) vertices. [m, local world]
    sigma_xy_m, sigma_z_m
        (n,) standard deviations across and of the height. [m]
    count
        (n,) int64: matches at each vertex.
    """

    xyz: FloatArray
    sigma_xy_m: FloatArray
    sigma_z_m: FloatArray
    count: IntArray


def edge_through(course: FloatArray, seen: EdgeSightings) -> SmoothEdge:
    """Return the smooth line that agrees best with all matches near the line as followed.

    Parameters
    ----------
    course
        (n, 3) places of the line as followed, in order. [m, local world]

    Notes
    -----
    A match in one image determines ``across + lift * up`` of the line; two images, or one and its neighbours, determine
    both. Matches of one pair have the error of its pose in common: its standard deviation is estimated from the spread
    of the pairs about the line, and enters the sigma divided by the root of the number of pairs at a vertex.
    """
    line = smooth_axis(course)
    seen = seen.take(_is_near(line, seen))
    between = np.zeros(2)
    for _ in range(_ROUNDS):
        left = _left_of(line)
        at, offset, height = _beside(line, left, seen)
        rows = np.column_stack([np.ones(len(at)), seen.lift])
        value = offset + seen.across_m * np.sum(seen.left[:, :2] * left[at], axis=1) + seen.lift * height
        variance = seen.variance + (rows**2) @ between**2
        moved, covariance = _smoothed(at, rows, value, variance, len(line))
        rest = value - np.sum(rows * moved[at], axis=1)
        spread = np.einsum("ni,nij,nj->n", rows, covariance[at], rows)
        between = _between_pairs(rows, rest, seen.variance, seen.pair)
        line = line + np.column_stack([moved[:, :1] * left, moved[:, 1]])
        seen = seen.take(np.abs(rest) < _OFF * np.sqrt(variance + spread + (rows**2) @ between**2))
    at, *_ = _beside(line, _left_of(line), seen)
    pairs = _pairs_at(at, seen.pair, len(line))
    sigma = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2) + between**2 / pairs[:, None])
    count = np.bincount(at, minlength=len(line))
    known = np.flatnonzero((sigma[:, 0] <= MOST_LINE_SIGMA_M) & (count > 0))
    whole = slice(int(known[0]), int(known[-1]) + 1) if len(known) > 1 else slice(None)
    return SmoothEdge(line[whole], sigma[whole, 0], sigma[whole, 1], count[whole])


def smooth_axis(course: FloatArray) -> FloatArray:
    """Return (m, 3) places every `VERTEX_SPACING_M` along a line of (n, 3) places, smoothed. [m, local world]"""  # noqa: D400
    step = np.hypot(*np.diff(course[:, :2], axis=0).T)
    course = course[np.concatenate([[True], step > _LEAST_STEP_M])]
    t = distance_along(course)
    at: FloatArray = VERTEX_SPACING_M * np.arange(
        max(int(np.floor(t[-1] / VERTEX_SPACING_M)), 1) + 1, dtype=np.float64
    )
    xyz = np.column_stack([np.interp(at, t, c) for c in course.T])
    variance, change = np.full(len(at), _KINK_M**2), np.full(len(at), BENDING)
    state, *_ = smooth_plane(at, np.ascontiguousarray(xyz[:, :2]), variance, change)
    z, _ = smooth_height(at, xyz[:, 2].copy(), variance, GRADING)
    return np.column_stack([state[:, 0], z])


def _is_near(line: FloatArray, seen: EdgeSightings) -> BoolArray:
    """Return (n,) bool: the match is near the line; those that a nearer pair corrected are not."""
    at, offset, height = _beside(line, _left_of(line), seen)
    along = np.hypot(*(seen.expected - line[at])[:, :2].T) ** 2 - offset**2
    return np.asarray((np.abs(offset + seen.across_m + seen.lift * height) < _NEAR_M) & (along < _NEAR_M**2))


def _smoothed(
    at: IntArray, rows: FloatArray, value: FloatArray, variance: FloatArray, n: int
) -> tuple[FloatArray, FloatArray]:
    """Return (n, 2) corrections of the line to the left and up at each vertex, and their (n, 2, 2) covariances."""
    information, right = np.zeros((n, 2, 2)), np.zeros((n, 2))
    np.add.at(information, at, rows[:, :, None] * rows[:, None, :] / variance[:, None, None])
    np.add.at(right, at, rows * (value / variance)[:, None])
    return smooth_beside(information, right, VERTEX_SPACING_M, BENDING, GRADING)


def _left_of(line: FloatArray) -> FloatArray:
    """Return (n, 2) unit directions to the left of a line in plan."""
    n = len(line) - 1
    k = np.arange(n + 1)
    way = line[np.minimum(k + 1, n), :2] - line[np.maximum(k - 1, 0), :2]
    way /= np.maximum(np.hypot(*way.T), 1e-9)[:, None]
    return np.column_stack([-way[:, 1], way[:, 0]])


def _beside(
    line: FloatArray, left: FloatArray, seen: EdgeSightings
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Return the vertex next to each expected place, and the place's distance to the left of and above the line."""
    from scipy.spatial import cKDTree

    _, at = cKDTree(line[:, :2]).query(seen.expected[:, :2])
    apart = seen.expected - line[at]
    along = np.column_stack([left[:, 1], -left[:, 0]])[at]
    forward = np.sum(apart[:, :2] * along, axis=1)
    # Height of the line between vertices
    grade = np.gradient(line[:, 2]) / VERTEX_SPACING_M if len(line) > 1 else np.zeros(1)
    return at, np.sum(apart[:, :2] * left[at], axis=1), apart[:, 2] - forward * grade[at]


def _between_pairs(rows: FloatArray, rest: FloatArray, variance: FloatArray, pair: IntArray) -> FloatArray:
    """Return (2,) robust standard deviations between pairs, across and up; 0 for few pairs. [m]"""  # noqa: D400
    numbers, i = np.unique(pair, return_inverse=True)
    if len(numbers) < _LEAST_PAIRS:
        return np.zeros(2)
    offsets = np.zeros((len(numbers), 2))
    for k in range(len(numbers)):
        mine = i == k
        weighted = rows[mine] / variance[mine, None]
        normal = weighted.T @ rows[mine] + np.eye(2) / _POSE_M**2
        offsets[k] = np.linalg.solve(normal, weighted.T @ rest[mine])
    return np.asarray(_MEDIAN_TO_SIGMA * np.median(np.abs(offsets), axis=0))


def _pairs_at(at: IntArray, pair: IntArray, n: int) -> FloatArray:
    """Return (n,) number of pairs that show each vertex, at least 1."""
    both = np.unique(np.column_stack([at, pair]), axis=0)
    return np.maximum(np.bincount(both[:, 0], minlength=n), 1).astype(np.float64)


def line_of(edge: SmoothEdge, kind: str, width_m: float) -> LineSet:
    """Return a followed edge as a set of one line.

    Parameters
    ----------
    width_m
        Width of the paint; NaN for a bare edge. [m]
    """
    bridged, pattern = gaps_of(edge.count == 0, is_stripe=not np.isnan(width_m))
    return LineSet.from_lines(
        [edge.xyz], kind=np.array([kind]), method=np.array(["stereo"]), pattern=np.array([pattern]),
        sigma_xy_m=edge.sigma_xy_m, sigma_z_m=edge.sigma_z_m, bridged=bridged,
        width_m=np.array([width_m]), confidence=np.array([1.0 - float(bridged.mean())]),
    )  # fmt: skip


def with_pose_sigmas(lines: LineSet, poses: Poses, used: IntArray) -> LineSet:
    """Return a line with the sigma of its poses added, whose errors are correlated, and with its first and last time.

    Parameters
    ----------
    used
        (k,) int64: poses of the pairs that show the line.
    """
    sigma = poses.sigma_xyz_m[used]
    plan, up = float(np.mean(np.hypot(sigma[:, 0], sigma[:, 1]))) / np.sqrt(2.0), float(np.mean(sigma[:, 2]))
    plan, up = (0.0 if np.isnan(v) else v for v in (plan, up))
    return lines.with_columns(
        sigma_xy_m=np.hypot(lines.sigma_xy_m, plan), sigma_z_m=np.hypot(lines.sigma_z_m, up),
        time_start_s=np.array([poses.time_s[used].min()]), time_end_s=np.array([poses.time_s[used].max()]),
    )  # fmt: skip


def gaps_of(unseen: BoolArray, *, is_stripe: bool) -> tuple[BoolArray, str]:
    """Return (n,) bool where a line is bridged, and its pattern: the gaps of a dashed line are not bridged.

    Parameters
    ----------
    unseen
        (n,) bool: no match at the vertex.
    is_stripe
        The line is paint: pattern "dashed" or "solid"; else "".
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[0], unseen.astype(np.int64), [0]])))
    runs = edges.reshape(-1, 2)
    gaps = runs[np.diff(runs, axis=1)[:, 0] * VERTEX_SPACING_M >= _GAP_M]
    bridged = np.zeros(len(unseen), dtype=bool)
    for a, b in gaps:
        bridged[a:b] = True
    if not is_stripe:
        return bridged, ""
    paint = gaps[1:, 0] - gaps[:-1, 1]
    if len(gaps) >= _LEAST_GAPS and np.median(paint) * VERTEX_SPACING_M <= UNSEEN_M:
        return np.zeros(len(unseen), dtype=bool), "dashed"
    return bridged, "solid"
