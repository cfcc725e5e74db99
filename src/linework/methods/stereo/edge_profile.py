"""Edges of a profile across a line, and whether two of them are the sides of a stripe of paint."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from linework.model.arrays import FloatArray

#: An edge's grey values differ by at least this, and by so many times what neighbours differ by elsewhere.
LEAST_RISE, LEAST_RATIO = 6.0, 4.0
#: Both sides of a stripe of paint: the lower is at least this share of the higher.
_ALIKE = 0.4
#: Worn paint is so much brighter than the road. [grey values]
_LEAST_PAINT = 10.0
#: Paint of lines is 0.05 to 0.5 m wide. [m]
_WIDTH_M = (0.04, 0.55)


@dataclass(frozen=True, slots=True)
class Edge:
    """Where grey values rise from right to left by `rise` (or fall, negative). [m, grey values]"""  # noqa: D400

    at_m: float
    rise: float


@dataclass(frozen=True, slots=True)
class Pattern:
    """What was picked: the middle of a stripe and its width, or an edge (width NaN). [m, grey values]"""  # noqa: D400

    at_m: float
    width_m: float
    rise: float


def edges_in(s: FloatArray, grey: FloatArray) -> list[Edge]:
    """Return the edges of a profile, from right to left.

    Parameters
    ----------
    s, grey
        (n,) places [m] and grey values, one per pixel.

    Notes
    -----
    An edge is where the slope is steepest; it reaches to either side to where the slope has gone to a fifth, and
    its place is where half of its rise is reached.
    """
    smooth = np.convolve(np.pad(grey, 1, mode="edge"), (0.25, 0.5, 0.25), mode="valid")
    slope = np.gradient(smooth)
    typical = 1.4826 * float(np.median(np.abs(slope - np.median(slope))))
    found: list[tuple[int, Edge]] = []
    steep = np.abs(slope)
    for i in range(1, len(s) - 1):
        if not (steep[i] >= steep[i - 1] and steep[i] > steep[i + 1]):
            continue
        sign = np.sign(slope[i])
        a, b = i, i
        while a > 0 and sign * slope[a] > 0.2 * steep[i]:
            a -= 1
        while b < len(s) - 1 and sign * slope[b] > 0.2 * steep[i]:
            b += 1
        rise = float(smooth[b] - smooth[a])
        if abs(rise) < max(LEAST_RISE, LEAST_RATIO * typical):
            continue
        level = 0.5 * (smooth[a] + smooth[b])
        part = sign * (smooth[a : b + 1] - level)
        k = int(np.argmax(part >= 0.0))
        share = part[k] / (part[k] - part[k - 1]) if k else 0.0
        edge = Edge(float(s[a + k] - share * (s[1] - s[0])), rise)
        # Two steepest places on one way up are one edge
        if found and found[-1][0] > a and found[-1][1].rise * rise > 0.0:
            edge = max(edge, found.pop()[1], key=lambda e: abs(e.rise))
        found.append((b, edge))
    return [edge for _, edge in found]


def stripe_or_edge(edges: list[Edge], reach_m: float, on_paint_m: float, kind: str) -> Pattern | None:
    """Return the pattern nearest to the middle of a profile.

    Parameters
    ----------
    reach_m
        An edge farther away was not picked. [m]
    on_paint_m
        The pick may be on the paint, so far from both edges. [m]
    kind
        "lane_marking", "road_boundary" or "": what is wanted.
    """
    stripes = _stripes(edges)
    found: list[tuple[float, Pattern]] = []
    for right, left in stripes:
        width = left.at_m - right.at_m
        on_it = right.at_m - reach_m <= 0.0 <= left.at_m + reach_m and 0.5 * width <= on_paint_m + reach_m
        if on_it and kind in ("", "lane_marking"):
            away = 0.0 if right.at_m <= 0.0 <= left.at_m else min(abs(right.at_m), abs(left.at_m))
            rise = 0.5 * (right.rise - left.rise)
            found.append((away, Pattern(0.5 * (right.at_m + left.at_m), width, rise)))
    sides = [edge for pair in stripes for edge in pair]
    if kind in ("", "road_boundary"):
        single = [edge for edge in edges if abs(edge.at_m) <= reach_m and edge not in sides]
        found += [(abs(edge.at_m), Pattern(edge.at_m, float("nan"), edge.rise)) for edge in single]
    return min(found, key=lambda f: f[0])[1] if found else None


def _stripes(edges: list[Edge]) -> list[tuple[Edge, Edge]]:
    """Return pairs of edges that are the right and left side of something bright between darker sides."""
    found = []
    for right, left in pairwise(edges):
        width = left.at_m - right.at_m
        if not (right.rise > 0.0 > left.rise and _WIDTH_M[0] <= width <= _WIDTH_M[1]):
            continue
        heights = sorted((right.rise, -left.rise))
        if heights[0] >= max(_ALIKE * heights[1], _LEAST_PAINT):
            found.append((right, left))
    return found
