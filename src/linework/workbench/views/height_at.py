"""How high the ground, a kerb's top, a rail or a cable is, from the few points around a place."""

from __future__ import annotations

import numpy as np

from linework.arrays import BoolArray, FloatArray

#: Height, and its standard deviation. [m]
Height = tuple[float, float]
#: From fewer points nothing is said.
LEAST = 5
#: A surface is as thick as this: noise of the scanner and texture of asphalt, three sigma each way. [m]
SURFACE_LAYER_M = 0.05
#: What all points share (calibration, path) is not in their spread; lines have it too: this is left between scans. [m]
COMMON_M = 0.003
#: A kerb's top is so far above its foot, at least and at most. [m]
KERB_M = (0.03, 0.40)
#: What stands is so far above the ground at least, and at most, by kind. [m]
LEAST_STANDS_M, MOST_STANDS_M = 0.25, {"guardrail": 1.3, "barrier": 1.8, "fence": 3.5}
#: At its edge a carriageway is as thick as this, and where it ends is known in height no better than this. [m]
ROAD_M, EDGE_SIGMA_M = 0.02, 0.01
#: Nobody drags a line onto another thing: what is farther than this from where it was is not it. [m]
SAME_HEIGHT_M, SAME_CABLE_M = KERB_M[1], 1.0
#: A cable: higher than lorries; points so far apart in height belong to two. [m]
HANGS_ABOVE_M, CABLES_APART_M = 3.5, 0.3
#: The top edge is where so many points are, within so much. [m]
_EDGE_POINTS, _EDGE_M = 3, 0.04


def edge_height(points: FloatArray) -> Height | None:
    """Return the height of the carriageway's edge: of the level that most points near the lowest layer have.

    Beside an edge are the foot of a kerb's face, or a verge that lies lower: both hold fewer points than the road.
    What is farther from the road's level than a kerb is high (hedges, cars, ditches) bounds no carriageway.
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
    """Return the height of the ground in the middle of points; None where they are too few.

    By a plane through the lowest layer that is supported; what is off it by more than 2.5 sigma is left out.

    Parameters
    ----------
    points
        (n, 4): east and north from the place, up, above the road (NaN: not known). [m]
    """
    if len(points) < LEAST:
        return None
    level = _level(points)
    kept = np.abs(level - _lowest(level) - 0.5 * SURFACE_LAYER_M) <= 0.5 * SURFACE_LAYER_M + 0.01
    return _plane(points, kept)


def kerb_top_height(points: FloatArray) -> Height | None:
    """Return the height of the top beside a step; of the ground where there is no step."""
    if len(points) < LEAST:
        return None
    level = _level(points)
    step = level - _lowest(level)
    upper = np.flatnonzero((step > KERB_M[0]) & (step < KERB_M[1]))
    if len(upper) < LEAST:
        return ground_height(points)
    # The top is level, the face is not: where most points are
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
    """Return the height of the top edge of what stands on the ground; None where nothing does.

    Parameters
    ----------
    highest_m
        No higher than this above the ground.
    near_m
        Where it was before, above the height origin; NaN: not known. A top edge near it is preferred.
    """
    level = _level(points)
    heights = np.sort(points[(level > LEAST_STANDS_M) & (level < highest_m), 2])
    if not np.isnan(near_m) and np.any(np.abs(heights - near_m) < CABLES_APART_M):
        heights = heights[heights < near_m + CABLES_APART_M]
    for i in range(len(heights) - 1, _EDGE_POINTS - 2, -1):
        # Stray points stand alone
        if heights[i] - heights[i - _EDGE_POINTS + 1] <= _EDGE_M:
            return float(heights[i]), 0.5 * _EDGE_M
    return None


def hanging_height(points: FloatArray, near_m: float) -> Height | None:
    """Return the height of a cable over the place, the nearest to where it was, else the lowest; None without one."""
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
    """Say whether a height agrees with where the line was.

    A carriageway's edge may turn out to be lower by a kerb: it was drawn on the kerb's top. It is never higher.
    """
    if kind == "cable":
        return abs(found[0] - near_m) <= CABLES_APART_M
    least_m = near_m - (KERB_M[1] if kind == "road_boundary" else SURFACE_LAYER_M)
    return least_m <= found[0] <= near_m + SURFACE_LAYER_M


def differs_from_line(found: Height, near_m: float, kind: str) -> bool:
    """Say whether a height differs so much from where the line was that another thing was measured."""
    return abs(found[0] - near_m) > (SAME_CABLE_M if kind == "cable" else SAME_HEIGHT_M)


def with_ambiguity(found: Height, other_m: float) -> Height:
    """Return a height whose sigma tells of another value for it: both differ by half of that from their middle."""
    return found[0], float(np.hypot(found[1], 0.5 * (found[0] - other_m)))


def _level(points: FloatArray) -> FloatArray:
    """Return heights above the road; where it is not known, above the lowest point."""
    above = points[:, 3]
    if np.isfinite(above).all():
        return np.asarray(above)
    return np.asarray(points[:, 2] - points[:, 2].min(initial=np.inf))


def _lowest(level: FloatArray) -> float:
    """Return where the lowest layer begins that has a tenth of the points below 0.5 m, and three."""
    heights = np.sort(level[level < max(0.5, float(level.min()) + 0.5)])
    least = max(3, len(heights) // 10)
    for i in range(len(heights) - least + 1):
        if heights[i + least - 1] - heights[i] <= SURFACE_LAYER_M:
            return float(heights[i])
    return float(heights[0])


def _plane(points: FloatArray, kept: BoolArray) -> Height | None:
    """Return the height at the middle of a plane through points, and how sure it is."""
    for _ in range(4):
        n = int(kept.sum())
        if n < LEAST:
            return None
        x, z = points[kept, :2], points[kept, 2]
        middle = x.mean(axis=0)
        # Few points on one scan line know no slope: it is held to a twentieth
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
