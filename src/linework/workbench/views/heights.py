"""Works of the desk of pictures: how high a line is at a place, by what the points there say."""

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

#: Points so near to a place say how high it is; where there are too few, those twice as near again, and so on. [m]
REACHES_M = (0.3, 0.6, 1.2)
#: Places are worked together within squares of this. [m]
_PIECE_M = 16.0
#: From the van's path the ground is known so well [m], and falls away from it by so much: 3 % drain a road.
PATH_SIGMA_M, CROSSFALL = 0.05, 0.03
#: Farther from the path nobody knows. [m]
FAR_FROM_PATH_M = 15.0
#: Kinds that do not lie on the ground.
_ABOVE_GROUND = ("kerb_top", "cable", *MOST_STANDS_M)
#: Kinds that lie on one side of a step, and on which is known from where they were.
_STEPS = ("road_boundary", "kerb_top")


def heights_at(
    table: SurveySession, kind: str, places: Sequence[Sequence[float]]
) -> tuple[FloatArray, FloatArray]:
    """Return (n,) heights of a kind of line at places [m, world], and (n,) standard deviations; NaN where unknown.

    Parameters
    ----------
    places
        (n, 2) or (n, 3): east, north, and where it was: of several cables, or rails, the nearest to it is taken.

    Raises
    ------
    UsageError
        There is no such kind.

    Notes
    -----
    A survey without points knows the ground from the van's path alone: how far from it is in the sigma. Nothing is
    known of what stands or hangs there.
    """
    plain = kind.removesuffix("_stereo")
    if plain not in KINDS:
        raise UsageError(f"no kind {kind[:40]!r}", advice=f"choose from {', '.join(KINDS)}")
    at = np.array([(*place, np.nan)[:3] for place in places], dtype=np.float64).reshape(-1, 3)
    reader = patch_reader(table)
    if reader is not None:
        return _from_points(reader, plain, at)
    if plain in _ABOVE_GROUND:
        return np.full(len(at), np.nan), np.full(len(at), np.nan)
    return heights_from_path(table.recordings.trajectory, at[:, :2])


def heights_from_path(path: Trajectory | None, at: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return heights of the ground beside the van's path, and their standard deviations."""
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
    """Return heights by the points around each place, piece by piece: places far apart do not meet."""
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
    """Return (n, 4) east, north, up [m, world; up from the height origin], above the road, of points near places."""
    parts = [np.zeros((0, 4))]
    for patch in reader.patches(bounds):
        index = np.flatnonzero(_beside(patch, at))
        x, y, z, above, _ = (column[index].astype(np.float64) for column in patch.columns)
        parts.append(np.stack([x + patch.corner[0], y + patch.corner[1], z, above], axis=1))
    points = np.concatenate(parts)
    return np.asarray(points[np.argsort(points[:, 0], kind="stable")])


def _beside(patch: PointPatch, at: FloatArray) -> BoolArray:
    """Return which points of a patch lie in cells that the largest reach of some place touches."""
    reach, n = REACHES_M[-1], 66
    cells = np.zeros((n, n), np.bool_)
    local = at - np.array(patch.corner[:2])
    for x, y in local:
        rows = slice(max(0, int(y - reach) + 1), max(0, int(y + reach) + 2))
        cells[rows, max(0, int(x - reach) + 1) : max(0, int(x + reach) + 2)] = True
    out: BoolArray = cells[patch.y.astype(np.int64) + 1, patch.x.astype(np.int64) + 1]
    return out


def _one(points: FloatArray, place: FloatArray, kind: str, z0_m: float) -> Height | None:
    """Return height and sigma at one place, by the smallest reach that has enough points, sorted by east.

    Where it is known how high the line was, a reach that agrees with that is better than a smaller one that does not;
    where it is not, the widest reach says what else there is.
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
    """Return the points, sorted by east, that are so near to a place, from there."""
    first, last = np.searchsorted(points[:, 0], (place[0] - reach_m, place[0] + reach_m))
    local = points[first:last] - np.array([*place[:2], 0.0, 0.0])
    return np.asarray(local[np.hypot(local[:, 0], local[:, 1]) <= reach_m])


def _level_before(local: FloatArray, kind: str, near_m: float) -> Height | None:
    """Return the height of what lies as high as the line did, beside a step."""
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
