"""Requests to the pictures worker: the height of a line at places, measured in the points around them.

Separate from `height_at`, which measures at one place: here are the points, and the choice among reaches.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from linework.arrays import BoolArray, FloatArray
from linework.errors import UsageError
from linework.model.grid import Bounds
from linework.model.lines import KINDS
from linework.model.trajectory import Trajectory
from linework.workbench.views.height_at import (
    MOST_STANDS_M,
    SURFACE_LAYER_M,
    Height,
    agrees_with_line,
    differs_from_line,
    edge_height,
    ground_height,
    hanging_height,
    kerb_top_height,
    standing_height,
    with_ambiguity,
)
from linework.workbench.views.patches import PatchReader, PointPatch
from linework.workbench.views.tiles import patch_reader
from linework.workbench.worker.session import SurveySession

#: Radii around a place within which points are used; a larger one where the smaller one holds too few. [m]
REACHES_M = (0.3, 0.6, 1.2)
#: Side of squares whose places are measured together. [m]
_PIECE_M = 16.0
#: Sigma of the ground's height below the van's path [m], and its slope away from it: roads drain by 3 %.
PATH_SIGMA_M, CROSSFALL = 0.05, 0.03
#: Distance from the path up to which it gives a height: beyond it the road has ended. [m]
FAR_FROM_PATH_M = 15.0
#: Kinds that do not lie on the ground.
_ABOVE_GROUND = ("kerb_top", "cable", *MOST_STANDS_M)
#: Kinds that lie at a step, where the height of the line tells which side is meant.
_STEPS = ("road_boundary", "kerb_top")


def heights_at(
    session: SurveySession, kind: str, places: Sequence[Sequence[float]]
) -> tuple[FloatArray, FloatArray]:
    """Return (n,) heights of a kind of line at places [m, world], and (n,) standard deviations [m]; NaN: unknown.

    Parameters
    ----------
    places
        n of (east, north) or (east, north, up) [m, world]: of several cables or rails the one nearest to `up` is
        measured.

    Raises
    ------
    UsageError
        There is no such kind.

    Notes
    -----
    Without points the ground is estimated from the van's path, with a sigma that grows with the distance from it; what
    stands or hangs there is unknown.
    """
    plain = kind.removesuffix("_stereo")
    if plain not in KINDS:
        raise UsageError(f"no kind {kind[:40]!r}", advice=f"choose from {', '.join(KINDS)}")
    at = np.array([(*place, np.nan)[:3] for place in places], dtype=np.float64).reshape(-1, 3)
    reader = patch_reader(session)
    if reader is not None:
        return _from_points(reader, plain, at)
    if plain in _ABOVE_GROUND:
        return np.full(len(at), np.nan), np.full(len(at), np.nan)
    return heights_from_path(session.recordings.trajectory, at[:, :2])


def heights_from_path(path: Trajectory | None, at: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return (n,) heights of the ground at (n, 2) places beside the van's path [m, world], and their sigmas [m]."""
    height, sigma = np.full(len(at), np.nan), np.full(len(at), np.nan)
    if path is None or len(path) < 2:
        return height, sigma
    first, step = path.xyz[:-1], np.diff(path.xyz, axis=0)
    length2 = np.maximum((step[:, :2] ** 2).sum(axis=1), 1e-12)
    for i, place in enumerate(at):
        along = np.clip(((place - first[:, :2]) * step[:, :2]).sum(axis=1) / length2, 0.0, 1.0)
        foot = first + along[:, None] * step
        apart = np.hypot(*(foot[:, :2] - place).T)
        k = int(np.argmin(apart))
        if apart[k] <= FAR_FROM_PATH_M:
            height[i], sigma[i] = foot[k, 2], np.hypot(PATH_SIGMA_M, CROSSFALL * apart[k])
    return height, sigma


def _from_points(reader: PatchReader, kind: str, at: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return (n,) heights and sigmas at (n, 3) places, square by square: places far apart share no points."""
    height, sigma = np.full(len(at), np.nan), np.full(len(at), np.nan)
    pieces = np.floor(at[:, :2] / _PIECE_M).astype(np.int64)
    for piece in np.unique(pieces, axis=0):
        chosen = np.flatnonzero((pieces == piece).all(axis=1))
        low, high = at[chosen, :2].min(axis=0), at[chosen, :2].max(axis=0)
        bounds = Bounds(*low, *high).grown(REACHES_M[-1])
        points = _near(reader, bounds, at[chosen, :2])
        for i in chosen:
            found = _one(points, at[i], kind, reader.z0_m)
            if found is not None:
                height[i], sigma[i] = found[0] + reader.z0_m, found[1]
    return height, sigma


def _near(reader: PatchReader, bounds: Bounds, at: FloatArray) -> FloatArray:
    """Return (n, 4) of points near places: east, north [m, world], up from the height origin, above the road [m]."""
    parts = [np.zeros((0, 4))]
    for patch in reader.patches(bounds):
        index = np.flatnonzero(_beside(patch, at))
        x, y, z, above, _ = (column[index].astype(np.float64) for column in patch.columns)
        parts.append(np.stack([x + patch.corner[0], y + patch.corner[1], z, above], axis=1))
    points = np.concatenate(parts)
    return np.asarray(points[np.argsort(points[:, 0], kind="stable")])


def _beside(patch: PointPatch, at: FloatArray) -> BoolArray:
    """Return which points of a patch lie in 1 m cells within the largest reach of a place."""
    reach, n = REACHES_M[-1], 66
    cells = np.zeros((n, n), np.bool_)
    local = at - np.array(patch.corner[:2])
    for x, y in local:
        rows = slice(max(0, int(y - reach) + 1), max(0, int(y + reach) + 2))
        cells[rows, max(0, int(x - reach) + 1) : max(0, int(x + reach) + 2)] = True
    out: BoolArray = cells[patch.y.astype(np.int64) + 1, patch.x.astype(np.int64) + 1]
    return out


def _one(points: FloatArray, place: FloatArray, kind: str, z0_m: float) -> Height | None:
    """Return the height at one place from the smallest reach that has enough of the points (n, 4), sorted by east.

    If the earlier height of the line is known, a reach that agrees with it is preferred to a smaller one that does
    not. If it is not, the widest reach shows what else the height could be.
    """
    near_m, first = place[2] - z0_m, None
    for reach in REACHES_M:
        local = _within(points, place, reach)
        found = _height(local, kind, near_m)
        if found is None:
            continue
        if kind == "lane_marking":
            return found
        if np.isnan(near_m):
            widest = _height(_within(points, place, REACHES_M[-1]), kind, near_m)
            return with_ambiguity(found, found[0] if widest is None else widest[0])
        again = None if agrees_with_line(found, near_m, kind) else _level_before(local, kind, near_m)
        if again is not None or agrees_with_line(found, near_m, kind):
            return with_ambiguity(again or found, near_m)
        first = first or found
    return None if first is None or differs_from_line(first, near_m, kind) else with_ambiguity(first, near_m)


def _within(points: FloatArray, place: FloatArray, reach_m: float) -> FloatArray:
    """Return the points, sorted by east, within a distance of a place, relative to it."""
    first, last = np.searchsorted(points[:, 0], (place[0] - reach_m, place[0] + reach_m))
    local = points[first:last] - np.array([*place[:2], 0.0, 0.0])
    return np.asarray(local[np.hypot(local[:, 0], local[:, 1]) <= reach_m])


def _level_before(local: FloatArray, kind: str, near_m: float) -> Height | None:
    """Return the height of the ground that is as high as the line was, beside a step."""
    return ground_height(local[np.abs(local[:, 2] - near_m) <= SURFACE_LAYER_M]) if kind in _STEPS else None


def _height(local: FloatArray, kind: str, near_m: float) -> Height | None:
    if len(local) == 0:
        return None
    if kind == "cable":
        return hanging_height(local, near_m)
    if kind in MOST_STANDS_M:
        return standing_height(local, MOST_STANDS_M[kind], near_m)
    if kind == "kerb_top":
        return kerb_top_height(local)
    return edge_height(local) if kind == "road_boundary" else ground_height(local)
