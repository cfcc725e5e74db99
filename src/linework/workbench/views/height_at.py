"""Height of the ground, a kerb's top, a rail or a cable, from the few points around a place.

Separate from `heights`, because it needs no survey. Points are (n, 4): east and north of the place, height above the
height origin, and height above the road (NaN: unknown). [m]
"""

from __future__ import annotations

import numpy as np

from linework.arrays import BoolArray, FloatArray

#: Height, and its standard deviation. [m]
Height = tuple[float, float]
#: Fewest points that give a height.
LEAST = 5
#: Thickness of a measured surface: noise of the scanner and texture of asphalt, three sigma each way. [m]
SURFACE_LAYER_M = 0.05
#: Sigma of the error that neighbouring points have in common (calibration, trajectory), which their spread does not
#: show. [m]
COMMON_M = 0.003
#: Minimum and maximum kerb height. [m]
KERB_M = (0.03, 0.40)
#: Minimum height of a standing object above the ground, and its maximum by kind. [m]
LEAST_STANDS_M, MOST_STANDS_M = 0.25, {"guardrail": 1.3, "barrier": 1.8, "fence": 3.5}
#: Thickness of the carriageway near its edge, where it is smooth, and least sigma of the height of its edge. [m]
ROAD_M, EDGE_SIGMA_M = 0.02, 0.01
#: Largest change of height when a line is dragged, for most kinds and for cables; more is another object. [m]
SAME_HEIGHT_M, SAME_CABLE_M = KERB_M[1], 1.0
#: Minimum height of a cable, above lorries; gap in height between points of two cables. [m]
HANGS_ABOVE_M, CABLES_APART_M = 3.5, 0.3
#: Points that make a top edge, and the height range that they lie in [m].
_EDGE_POINTS, _EDGE_M = 3, 0.04


def edge_height(points: FloatArray) -> Height | None:
    """Return the height of the carriageway's edge: the most frequent level near the lowest layer.

    Beside an edge is the foot of a kerb's face, or a lower verge; either has fewer points than the road. Points farther
    from the road's level than the height of a kerb (hedges, cars, ditches) are not part of an edge.

    Parameters
    ----------
    points
        (n, 4), see above; None is returned if there are too few.
    """
    points = points[~(np.abs(points[:, 3]) > KERB_M[1])]
    if len(points) < LEAST:
        return None
    level = _level(points)
    low = _lowest(level)
    heights = np.sort(level[(level >= low) & (level <= low + SURFACE_LAYER_M + ROAD_M)])
    counts = np.searchsorted(heights, heights + ROAD_M) - np.arange(len(heights))
    road = float(heights[int(np.argmax(counts))])
    found = _plane(points, (level >= road - 0.002) & (level <= road + ROAD_M))
    return None if found is None else (found[0], float(np.hypot(found[1], EDGE_SIGMA_M)))


def ground_height(points: FloatArray) -> Height | None:
    """Return the height of the ground in the middle of points (n, 4); None where they are too few.

    Fits a plane to the lowest supported layer, without points more than 2.5 sigma from it.
    """
    if len(points) < LEAST:
        return None
    level = _level(points)
    kept = np.abs(level - _lowest(level) - 0.5 * SURFACE_LAYER_M) <= 0.5 * SURFACE_LAYER_M + 0.01
    return _plane(points, kept)


def kerb_top_height(points: FloatArray) -> Height | None:
    """Return the height of the top of a step in points (n, 4); of the ground where there is no step.

    Cars beside a kerb, and wires above it, are higher than a kerb.
    """
    points = points[~(np.abs(points[:, 3]) > KERB_M[1])]
    if len(points) < LEAST:
        return None
    level = _level(points)
    step = level - _lowest(level)
    upper = np.flatnonzero((step > KERB_M[0]) & (step < KERB_M[1]))
    if len(upper) < LEAST:
        return ground_height(points)
    # The top is level and the face is not: take the level with the most points
    heights = np.sort(step[upper])
    counts = np.searchsorted(heights, heights + 0.03) - np.arange(len(heights))
    low = heights[int(np.argmax(counts))]
    top = upper[(step[upper] >= low) & (step[upper] <= low + 0.03)]
    nearest = top[
        np.argsort(np.hypot(points[top, 0], points[top, 1]), kind="stable")[: max(LEAST, len(top) // 2)]
    ]
    z = points[nearest, 2]
    return float(np.median(z)), float(np.hypot(z.std() / np.sqrt(len(z)), 2.0 * COMMON_M))


def standing_height(points: FloatArray, highest_m: float, near_m: float) -> Height | None:
    """Return the height of the top edge of a standing object in points (n, 4); None if there is none.

    Parameters
    ----------
    highest_m
        Maximum height above the ground. [m]
    near_m
        Previous height of the top edge above the height origin; NaN: unknown. A top edge near it is preferred. [m]
    """
    level = _level(points)
    heights = np.sort(points[(level > LEAST_STANDS_M) & (level < highest_m), 2])
    if not np.isnan(near_m) and np.any(np.abs(heights - near_m) < CABLES_APART_M):
        heights = heights[heights < near_m + CABLES_APART_M]
    for i in range(len(heights) - 1, _EDGE_POINTS - 2, -1):
        # Stray points have no neighbours in height
        if heights[i] - heights[i - _EDGE_POINTS + 1] <= _EDGE_M:
            return float(heights[i]), 0.5 * _EDGE_M
    return None


def hanging_height(points: FloatArray, near_m: float) -> Height | None:
    """Return the height of the cable nearest to a previous height (NaN: the lowest) in points (n, 4), or None."""
    level = _level(points)
    heights = np.sort(points[level > HANGS_ABOVE_M, 2])
    if len(heights) == 0:
        return None
    groups = np.split(heights, np.flatnonzero(np.diff(heights) > CABLES_APART_M) + 1)
    if np.isnan(near_m):
        cable = next((group for group in groups if len(group) > 1), groups[0])
    else:
        cable = min(groups, key=lambda group: abs(float(np.median(group)) - near_m))
    spread = cable.std() if len(cable) > 1 else 0.03
    return float(np.median(cable)), float(np.hypot(spread / np.sqrt(len(cable)), 0.01))


def agrees_with_line(found: Height, near_m: float, kind: str) -> bool:
    """Return whether a height agrees with the earlier height of the line [m].

    A carriageway's edge may be lower by the height of a kerb, if the line was drawn on its top, but never higher.
    """
    if kind == "cable":
        return abs(found[0] - near_m) <= CABLES_APART_M
    least_m = near_m - (KERB_M[1] if kind == "road_boundary" else SURFACE_LAYER_M)
    return least_m <= found[0] <= near_m + SURFACE_LAYER_M


def differs_from_line(found: Height, near_m: float, kind: str) -> bool:
    """Return whether a height differs so much from the earlier one [m] that another object was measured."""
    return abs(found[0] - near_m) > (SAME_CABLE_M if kind == "cable" else SAME_HEIGHT_M)


def with_ambiguity(found: Height, other_m: float) -> Height:
    """Return a height whose sigma includes another possible value: half of their difference."""
    return found[0], float(np.hypot(found[1], 0.5 * (found[0] - other_m)))


def _level(points: FloatArray) -> FloatArray:
    """Return (n,) heights above the road; if it is unknown, above the lowest point. [m]"""  # noqa: D400
    above = points[:, 3]
    if np.isfinite(above).all():
        return np.asarray(above)
    return np.asarray(points[:, 2] - points[:, 2].min(initial=np.inf))


def _lowest(level: FloatArray) -> float:
    """Return the bottom of the lowest layer that holds a tenth of the points below 0.5 m, and at least three."""
    heights = np.sort(level[level < max(0.5, float(level.min()) + 0.5)])
    least = max(3, len(heights) // 10)
    for i in range(len(heights) - least + 1):
        if heights[i + least - 1] - heights[i] <= SURFACE_LAYER_M:
            return float(heights[i])
    return float(heights[0])


def _plane(points: FloatArray, kept: BoolArray) -> Height | None:
    """Return the height of a plane through the kept points at the place itself, and its sigma."""
    for _ in range(4):
        n = int(kept.sum())
        if n < LEAST:
            return None
        x, z = points[kept, :2], points[kept, 2]
        middle = x.mean(axis=0)
        # Few points on one scan line do not determine a slope: it is regularised (sigma 0.05 for a spread of 1 cm)
        design = np.column_stack([np.ones(n), x - middle])
        normal = design.T @ design + np.diag([0.0, 0.04, 0.04])
        mean = z.mean()
        solution = np.linalg.solve(normal, design.T @ (z - mean))
        rest = points[:, 2] - mean - solution[0] - (points[:, :2] - middle) @ solution[1:]
        spread = max(float(np.sqrt((rest[kept] ** 2).sum() / max(n - 3, 1))), 0.001)
        again = kept & (np.abs(rest) <= 2.5 * spread)
        if again.sum() == n:
            break
        kept = again
    at = np.r_[1.0, -middle]
    height = mean + float(at @ solution)
    return float(height), float(np.hypot(spread * np.sqrt(at @ np.linalg.solve(normal, at)), COMMON_M))
