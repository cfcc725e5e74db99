"""Edges of a profile across a line, and whether two of them are the sides of a stripe of paint."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from linework.arrays import FloatArray

#: An edge's grey values differ by at least this, and in each half of its length by this share of it: what lies
#: across a line, or is grain of the road, is in one half only.
LEAST_RISE, _IN_HALVES = 6.0, 0.5
#: Widths of the sides that are compared, for sharp and for soft edges. [m, pixels]
_SIDES = ((0.04, 2.0), (0.10, 4.0))
#: Both sides of a stripe of paint: the lower is at least this share of the higher, and so much brighter than the
#: road where the paint is worn. [-, grey values]
_ALIKE, _LEAST_PAINT = 0.4, 10.0
#: Paint of lines is 0.05 to 0.5 m wide. [m]
_WIDTH_M = (0.04, 0.55)


@dataclass(frozen=True, slots=True)
class GreyProfile:
    """Grey values across a line.

    Parameters
    ----------
    s
        (n,) places to the left [m], one per pixel.
    grey
        (n,) averaged along.
    halves
        (2, n) averaged along the nearer and the farther half.
    pixel_m
        What a pixel covers. [m]
    """

    s: FloatArray
    grey: FloatArray
    halves: FloatArray
    pixel_m: float


@dataclass(frozen=True, slots=True)
class Edge:
    """Where grey values rise from right to left by `rise` (or fall, negative). [m, grey values]"""  # noqa: D400

    at_m: float
    rise: float


@dataclass(frozen=True, slots=True)
class Pattern:
    """What was picked: the middle of a stripe and its width, or an edge (width NaN); how far the next edge is. [m]"""  # noqa: D400

    at_m: float
    width_m: float
    rise: float
    free_m: float = float("inf")


def rises(grey: FloatArray, n: int) -> FloatArray:
    """Return (m - 2 n + 1,) the mean of n values less that of the n before them, at each place between values."""
    total = np.concatenate([[0.0], np.cumsum(grey)])
    means = (total[n:] - total[:-n]) / n
    return np.asarray(means[n:] - means[:-n])


def edges_in(profile: GreyProfile, sides: tuple[float, float]) -> list[Edge]:
    """Return the edges of a profile, from right to left.

    Parameters
    ----------
    sides
        Least width of the sides that are compared. [m, pixels]

    Notes
    -----
    An edge is where the means of both sides differ most; its place is the middle of the rise there.
    """
    n = max(round(sides[0] / profile.pixel_m), round(sides[1]))
    rise = rises(profile.grey, n)
    halves = [rises(half, n) for half in profile.halves]
    found = []
    for i in range(len(rise)):
        near = rise[max(i - n + 1, 0) : i + n]
        if abs(rise[i]) < LEAST_RISE or abs(rise[i]) < np.abs(near).max():
            continue
        if all(half[i] * np.sign(rise[i]) >= _IN_HALVES * abs(rise[i]) for half in halves):
            found.append(Edge(_middle(profile, i + n, n), float(rise[i])))
    return found


def _middle(profile: GreyProfile, i: int, n: int) -> float:
    """Return where, around the place between values i - 1 and i, half of the rise is reached. [m]"""  # noqa: D400
    part = profile.grey[i - n : i + n]
    low, high = part[: max(n // 2, 1)].mean(), part[-max(n // 2, 1) :].mean()
    level = (part - 0.5 * (low + high)) * np.sign(high - low)
    turns = np.flatnonzero((level[:-1] < 0.0) & (level[1:] >= 0.0))
    middle = float(profile.s[i] - 0.5 * profile.pixel_m)
    if len(turns) == 0:
        return middle
    k = int(turns[np.argmin(np.abs(turns + 1 - n))])
    share = level[k] / (level[k] - level[k + 1])
    return float(profile.s[i - n + k] + share * profile.pixel_m)


def pattern_at(profile: GreyProfile, reach_m: float, on_paint_m: float, kind: str) -> Pattern | None:
    """Return the pattern nearest to the middle of a profile: of its sharp edges, else of its soft ones.

    Parameters
    ----------
    reach_m
        An edge farther away was not picked. [m]
    on_paint_m
        The pick may be on the paint, so far from both edges. [m]
    kind
        "lane_marking", "road_boundary" or "": what is wanted.
    """
    for sides in _SIDES:
        edges = edges_in(profile, sides)
        stripes = _stripes(profile, edges)
        found: list[tuple[float, Pattern]] = []
        for right, left in stripes if kind != "road_boundary" else ():
            width = left.at_m - right.at_m
            if right.at_m <= reach_m and left.at_m >= -reach_m and 0.5 * width <= on_paint_m + reach_m:
                away = 0.0 if right.at_m <= 0.0 <= left.at_m else min(abs(right.at_m), abs(left.at_m))
                rise = 0.5 * (right.rise - left.rise)
                found.append((away, Pattern(0.5 * (right.at_m + left.at_m), width, rise)))
        taken = [edge for pair in stripes for edge in pair]
        if kind != "lane_marking":
            single = [edge for edge in edges if abs(edge.at_m) <= reach_m and edge not in taken]
            found += [(abs(e.at_m), Pattern(e.at_m, float("nan"), e.rise, _free(e, edges))) for e in single]
        if found:
            return min(found, key=lambda f: f[0])[1]
    return None


def _free(edge: Edge, edges: list[Edge]) -> float:
    """Return how far from an edge the next one begins that is as high or higher. [m]"""  # noqa: D400
    others = [abs(e.at_m - edge.at_m) for e in edges if e is not edge and abs(e.rise) >= 0.7 * abs(edge.rise)]
    return min(others, default=float("inf")) - _SIDES[0][0]


def _stripes(profile: GreyProfile, edges: list[Edge]) -> list[tuple[Edge, Edge]]:
    """Return pairs of edges that are the right and left side of something bright between darker sides."""
    found = []
    for i, right in enumerate(edges):
        for left in edges[i + 1 :]:
            width = left.at_m - right.at_m
            if not (right.rise > 0.0 > left.rise and _WIDTH_M[0] <= width <= _WIDTH_M[1]):
                continue
            heights = sorted((right.rise, -left.rise))
            inside = (profile.s > right.at_m) & (profile.s < left.at_m)
            beside = (profile.s > left.at_m + profile.pixel_m) & (profile.s < left.at_m + 0.1)
            beside |= (profile.s < right.at_m - profile.pixel_m) & (profile.s > right.at_m - 0.1)
            if heights[0] < max(_ALIKE * heights[1], _LEAST_PAINT) or not (inside.any() and beside.any()):
                continue
            # Worn paint has edges inside; what is between must be paint on the whole
            if profile.grey[inside].mean() - profile.grey[beside].mean() >= 0.5 * heights[0]:
                found.append((right, left))
                break
    return found
