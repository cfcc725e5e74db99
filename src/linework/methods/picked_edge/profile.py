"""Edges of a profile of grey values, and the pairs of them that are the sides of a stripe of paint."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from linework.arrays import FloatArray
from linework.methods.picked_edge.fitted import (
    ALIKE_SIDES,
    EDGE_SIDES,
    IN_HALVES,
    LEAST_PAINT,
    LEAST_RISE,
    NEXT_EDGE_SHARE,
    PAINT_BETWEEN,
)

#: Smallest and largest width of a stripe: paint of lines is 0.05 to 0.5 m wide. [m]
_WIDTH_M = (0.04, 0.55)
#: Width of the road beside a stripe that it is compared with. [m]
_BESIDE_STRIPE_M = 0.1


@dataclass(frozen=True, slots=True)
class GreyProfile:
    """Grey values across a line.

    Parameters
    ----------
    s
        (n,) distances to the left, one per pixel. [m]
    grey
        (n,) grey values averaged along the line.
    halves
        (2, n) averages along the nearer and the farther half.
    pixel_m
        Extent of a pixel. [m]
    """

    s: FloatArray
    grey: FloatArray
    halves: FloatArray
    pixel_m: float


@dataclass(frozen=True, slots=True)
class Edge:
    """A step of grey values from right to left: its place [m, to the left] and its rise, negative for a fall."""

    at_m: float
    rise: float


@dataclass(frozen=True, slots=True)
class Pattern:
    """A stripe or an edge in a profile.

    Parameters
    ----------
    at_m
        Middle of the stripe, or place of the edge, to the left. [m]
    width_m
        Width of the stripe; NaN for an edge. [m]
    rise
        Paint less road; for an edge, left less right. [grey values]
    free_m
        Distance to the next edge. [m]
    """

    at_m: float
    width_m: float
    rise: float
    free_m: float = float("inf")


def rises(grey: FloatArray, n: int) -> FloatArray:
    """Return (m - 2 n + 1,) the mean of n values less that of the n before them, between the values of `grey` (m,)."""
    total = np.concatenate([[0.0], np.cumsum(grey)])
    means = (total[n:] - total[:-n]) / n
    return np.asarray(means[n:] - means[:-n])


def edges_in(profile: GreyProfile, sides: tuple[float, float]) -> list[Edge]:
    """Return the edges of a profile, from right to left.

    Parameters
    ----------
    sides
        Smallest width of the sides that are compared. [m, pixels]

    Notes
    -----
    An edge is where the means of both sides differ most; its place is where half of the rise is reached.
    """
    n = max(round(sides[0] / profile.pixel_m), round(sides[1]))
    rise = rises(profile.grey, n)
    halves = [rises(half, n) for half in profile.halves]
    found = []
    for i in range(len(rise)):
        near = rise[max(i - n + 1, 0) : i + n]
        if abs(rise[i]) < LEAST_RISE or abs(rise[i]) < np.abs(near).max():
            continue
        if all(half[i] * np.sign(rise[i]) >= IN_HALVES * abs(rise[i]) for half in halves):
            found.append(Edge(_middle(profile, i + n, n), float(rise[i])))
    return found


def _middle(profile: GreyProfile, i: int, n: int) -> float:
    """Return where half of the rise is reached, near the place between values i - 1 and i. [m]"""  # noqa: D400
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
    """Return the pattern nearest to the middle of a profile: of its sharp edges, else of its soft ones; or None.

    Parameters
    ----------
    reach_m
        Largest distance of an edge from the middle. [m]
    on_paint_m
        Largest distance of the middle from both edges of a stripe that it lies on. [m]
    kind
        "lane_marking": stripes only; "road_boundary": edges only; "": both.
    """
    for sides in EDGE_SIDES:
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
    """Return the distance from an edge to where the next one of about the same height begins. [m]"""  # noqa: D400
    least = NEXT_EDGE_SHARE * abs(edge.rise)
    others = [abs(e.at_m - edge.at_m) for e in edges if e is not edge and abs(e.rise) >= least]
    return min(others, default=float("inf")) - EDGE_SIDES[0][0]


def _stripes(profile: GreyProfile, edges: list[Edge]) -> list[tuple[Edge, Edge]]:
    """Return pairs of right and left edges that bound something brighter than what is beside it."""
    found = []
    for i, right in enumerate(edges):
        for left in edges[i + 1 :]:
            width = left.at_m - right.at_m
            if not (right.rise > 0.0 > left.rise and _WIDTH_M[0] <= width <= _WIDTH_M[1]):
                continue
            heights = sorted((right.rise, -left.rise))
            inside = (profile.s > right.at_m) & (profile.s < left.at_m)
            beside = (profile.s > left.at_m + profile.pixel_m) & (profile.s < left.at_m + _BESIDE_STRIPE_M)
            beside |= (profile.s < right.at_m - profile.pixel_m) & (profile.s > right.at_m - _BESIDE_STRIPE_M)
            if heights[0] < max(ALIKE_SIDES * heights[1], LEAST_PAINT) or not (inside.any() and beside.any()):
                continue
            # Worn paint has edges inside; what is between both sides must be paint on average
            if profile.grey[inside].mean() - profile.grey[beside].mean() >= PAINT_BETWEEN * heights[0]:
                found.append((right, left))
                break
    return found
