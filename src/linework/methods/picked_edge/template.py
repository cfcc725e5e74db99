"""Template of the grey values across a line, which matches are compared with and which they renew slowly."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from linework.arrays import FloatArray
from linework.kernels.images.line_matching import integral_of
from linework.methods.picked_edge.fitted import EDGE_LEFT, RENEWED
from linework.methods.picked_edge.profile import Pattern

#: Spacing of a template, finer than a pixel at the nearest place of any camera, and its half width. [m]
TEMPLATE_STEP_M, TEMPLATE_REACH_M = 0.005, 0.8
#: Width that is compared beside a stripe, and on either side of an edge: that of the narrowest verge. [m]
TEMPLATE_BESIDE_M, EDGE_M = 0.12, 0.22
#: Smallest width that is compared on either side of an edge. [m]
LEAST_TEMPLATE_SIDE_M = 0.08
#: Width of the sides of an edge that are averaged against the noise of single samples. [m]
_SIDE_M = 0.03
#: Largest shift of an edge in the template. [m]
_EDGE_REACH_M = 0.12


@dataclass(frozen=True, slots=True)
class Template:
    """Grey values across a line.

    Parameters
    ----------
    grey
        (n,) grey values every `TEMPLATE_STEP_M`; the first is `TEMPLATE_REACH_M` to the right of the middle.
    anchor_m
        Place of the line on it: the middle of both edges of a stripe, the half height of an edge. [m]
    width_m
        Width between both edges of a stripe; NaN for an edge. [m]
    rise
        Left less right of an edge; paint less road of a stripe. [grey values]
    free_m
        Distance from an edge to the next one. [m]
    total
        (n + 1,) running integral of `grey` (`linework.kernels.images.line_matching.integral_of`).
    """

    grey: FloatArray
    anchor_m: float
    width_m: float
    rise: float
    free_m: float
    total: FloatArray

    @property
    def is_stripe(self) -> bool:
        """Whether it is a stripe of paint."""
        return not np.isnan(self.width_m)

    @property
    def window_m(self) -> float:
        """Half the width that is compared. [m]"""  # noqa: D400
        if self.is_stripe:
            return 0.5 * self.width_m + TEMPLATE_BESIDE_M
        return min(max(self.free_m, LEAST_TEMPLATE_SIDE_M), EDGE_M)

    @property
    def mean(self) -> float:
        """Mean grey value of the part that is compared."""
        s = grid()
        return float(self.grey[np.abs(s - self.anchor_m) <= self.window_m].mean())


def grid() -> FloatArray:
    """Return (n,) places of the values of a template, positive to the left. [m]"""  # noqa: D400
    n = round(TEMPLATE_REACH_M / TEMPLATE_STEP_M)
    return np.asarray(TEMPLATE_STEP_M * np.arange(-n, n + 1), dtype=np.float64)


def template_of(s: FloatArray, grey: FloatArray, pattern: Pattern) -> Template:
    """Return the template of a pattern in grey values (k,) at distances `s` (k,) to the left [m], anchored on its edges."""
    seen = np.isfinite(grey)
    values = np.interp(grid() + pattern.at_m, s[seen], grey[seen])
    p = pattern
    return anchored(Template(values, 0.0, p.width_m, p.rise, p.free_m, integral_of(values)))


def renewed(template: Template, s: FloatArray, grey: FloatArray, seen: FloatArray) -> Template:
    """Return a template renewed by a match, with weight `RENEWED`.

    Parameters
    ----------
    s
        (k,) ascending places on the template. [m]
    grey
        (k,) grey values of the match, less its gain and offset.
    seen
        (k,) the template averaged over the same pixels: only the difference is added, so that coarse pixels do not
        blur the template.
    """
    difference = np.interp(grid(), s, grey - seen, left=0.0, right=0.0)
    values = template.grey + RENEWED * difference
    return anchored(replace(template, grey=values, total=integral_of(values)))


def anchored(template: Template) -> Template:
    """Return the template with the line placed on its edges again: matching alone drifts away from them."""
    s, grey, at = grid(), template.grey, template.anchor_m
    if not template.is_stripe:
        edge = _crossing(s, grey, at, template.rise, min(template.window_m, _EDGE_REACH_M))
        return template if edge is None else replace(template, anchor_m=edge[0], rise=edge[1])
    half = 0.5 * template.width_m
    reach = min(max(half, 2.0 * TEMPLATE_STEP_M), TEMPLATE_BESIDE_M)
    right = _crossing(s, grey, at - half, template.rise, reach)
    left = _crossing(s, grey, at + half, -template.rise, reach)
    if right is None or left is None or left[0] - right[0] < 2.0 * TEMPLATE_STEP_M:
        return template
    return replace(
        template, anchor_m=0.5 * (left[0] + right[0]), width_m=left[0] - right[0],
        rise=0.5 * (right[1] - left[1]),
    )  # fmt: skip


def _crossing(
    s: FloatArray, grey: FloatArray, at: float, rise: float, reach: float
) -> tuple[float, float] | None:
    """Return where an edge is at half its height [m], and its height; None where it has vanished."""
    side = max(0.5 * reach, _SIDE_M)
    right = grey[(s < at - 0.5 * reach) & (s >= at - 0.5 * reach - side)].mean()
    left = grey[(s > at + 0.5 * reach) & (s <= at + 0.5 * reach + side)].mean()
    if (left - right) * rise <= 0.0 or abs(left - right) < EDGE_LEFT * abs(rise):
        return None
    near = np.flatnonzero(np.abs(s - at) <= reach)
    above = (grey[near] - 0.5 * (left + right)) * np.sign(rise)
    turns = np.flatnonzero((above[:-1] < 0.0) & (above[1:] >= 0.0))
    if len(turns) == 0:
        return None
    i = turns[np.argmin(np.abs(s[near[turns]] - at))]
    share = above[i] / (above[i] - above[i + 1])
    return float(s[near[i]] + share * TEMPLATE_STEP_M), float(left - right)
