"""Kernels that follow thin sheets of points by circles, from many starts.

Positions are local: x east and y north of the bins' south-west corner, z above a local origin. [m]
`layers` are the three arrays of `linework.kernels.cells.bins.sort_into_layers`, `frame` is the number of bins to
the east and to the north and their side [m].
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from linework.arrays import FloatArray, IntArray
from linework.kernels.cells.bins import LayeredBins
from linework.kernels.radon.corridor import (
    LOCAL_LEFT,
    LOCAL_Z,
    NODE_HEADING,
    NODE_TOP,
    NODE_X,
    NODE_Y,
    TurnedBox,
    gather_level,
)
from linework.kernels.radon.sections import TOP_HALF_WIDTH, W_BEAM_EDGE, top_edge

#: Further columns of a node: points in the circle, their spread [m], measured (1) or predicted (0).
NODE_POINTS, NODE_SPREAD, NODE_MEASURED = 4, 5, 6
#: Number of columns of a node.
NODE_COLUMNS = 7

#: Nodes after which the filter has forgotten its initial state.
SETTLED = 6

#: Initial standard deviations of the filter: a start is good to a strip's half width across [m], to a step of the
#: turns that are tried [rad]; an 18 m bend is 0.056 / m [1/m].
_START_OFFSET_M, _START_HEADING_RAD, _START_CURVATURE_PER_M = 0.02, 0.03, 0.03
#: Initial standard deviations of the top's height, one step of the tried tops [m], and of its slope.
_START_TOP_M, _START_SLOPE = 0.05, 0.05
#: Noise of a circle's centre: half the depth of the corrugation, and range noise averaged. [m]
_CENTRE_NOISE_M = 0.025
#: Random walk of the curvature per root metre: an 18 m bend sets in within about 10 m. [1/m]
_CURVATURE_DRIFT = 0.012
#: Random walk of the top's slope per root metre.
_SLOPE_DRIFT = 0.01
#: Noise of one top edge. [m]
_EDGE_NOISE_M = 0.03
#: The variance of the centre of n points is (1 + this / n) times the square of `_CENTRE_NOISE_M`.
_FEW_POINTS = 6.0
#: Fewest points of a measured circle.
_LEAST_POINTS = 3
#: A circle is rejected this many standard deviations from the prediction, within these limits. [m]
_GATE_SIGMAS, _LEAST_GATE_M, _MOST_GATE_M = 3.0, 0.08, 0.25
#: Half width of the box about a node: the widest gate and a circle. [m]
_HALF_WIDTH_M = 0.35
#: Range below and above the top in which points are gathered: circle, top edge, and what is above. [m]
_LEVEL_BELOW_M, _LEVEL_ABOVE_M = 0.60, 0.20
#: Noise of the top: the circle holds points up to this height above it. [m]
_CIRCLE_ABOVE_M = 0.03
#: Range above and below the prediction in which top edges are tried. [m]
_TOP_SEARCH_M = 0.08
#: Most steps of a circle, and the shift below which it is at rest. [m]
_MOST_SHIFTS, _AT_REST_M = 6, 0.001
#: Two nodes lie on each other only when their headings differ by less than 20 degrees: sine of that.
_PARALLEL_SINE = 0.34
#: Number of nodes that room is made for at first; more is made as needed.
_ROOM = 4096


class FollowSettings(NamedTuple):
    """How circles follow a sheet.

    Parameters
    ----------
    spacing, radius, max_gap, half_along
        Spacing of the circles, their radius, longest stretch without a point, half length of a station. [m]
    low, high
        Range of heights above the road. [m]
    sheet
        Height of the sheet below its top. [m]
    """

    spacing: float
    radius: float
    max_gap: float
    half_along: float
    low: float
    high: float
    sheet: float


class FollowLimits(NamedTuple):
    """Numbers of nodes: fewest of a strand, most one way, and how many of those keep other starts away."""

    least: int
    most: int
    near: int


@njit(cache=True, nogil=True)
def circle_centre(
    work: FloatArray, n: int, u_start: float, radius: float, z_low: float, z_high: float
) -> tuple[float, int, float]:
    """Return offset [m], number and spread [m] of the points that a circle about `u_start` settles on.

    The circle moves to the mean of the points it holds until it rests (mean shift).

    Parameters
    ----------
    work, n
        (., 4) points of a box, of which the first n count.
    u_start, radius
        Offset at which the circle begins, and its radius. [m]
    z_low, z_high
        Range of heights. [m]
    """
    offsets = np.empty(n)
    m = 0
    for i in range(n):
        if work[i, LOCAL_Z] >= z_low and work[i, LOCAL_Z] <= z_high:
            offsets[m] = work[i, LOCAL_LEFT]
            m += 1
    u = u_start
    number = 0
    spread = 0.0
    for _ in range(_MOST_SHIFTS):
        total, square, number = 0.0, 0.0, 0
        for i in range(m):
            d = offsets[i] - u
            inside = abs(d) <= radius
            d = d if inside else 0.0  # a choice of values, not a branch
            total += d
            square += d * d
            number += int(inside)
        if number == 0:
            return u, 0, 0.0
        shift = total / number
        spread = np.sqrt(max(square / number - shift * shift, 0.0))
        u += shift
        if abs(shift) < _AT_REST_M:
            break
    return u, number, spread


@njit(cache=True, nogil=True)
def follow_sheet(
    points: FloatArray,
    layers: LayeredBins,
    frame: tuple[int, int, float],
    start: tuple[float, float, float, float],
    setting: FollowSettings,
    work: FloatArray,
    out: FloatArray,
) -> int:
    """Follow a thin sheet of points one way by circles at a fixed spacing, and return the number of nodes.

    A Kalman filter carries lateral offset, heading and curvature; another one the top's height and slope.

    Parameters
    ----------
    points, layers, frame
        Binned points (n, 4), their layers and bins.
    start
        x, y [m], heading [rad], top z [m].
    setting
        How to follow.
    work
        (m, 4) scratch: the points of a station.
    out
        (most, 7), written; columns `NODE_X` to `NODE_MEASURED`.
    """
    spacing, radius, max_gap, half_s, low, high, sheet = setting
    x, y, heading, top = start
    curvature, slope = 0.0, 0.0
    p00, p01, p02 = _START_OFFSET_M**2, 0.0, 0.0
    p11, p12, p22 = _START_HEADING_RAD**2, 0.0, _START_CURVATURE_PER_M**2
    q00, q01, q11 = _START_TOP_M**2, 0.0, _START_SLOPE**2
    noise = _CENTRE_NOISE_M
    drift = _CURVATURE_DRIFT**2 * spacing
    n_out, gap, blurred = 0, 0.0, 0.0
    while n_out < len(out):
        if n_out > 0:
            x += spacing * np.cos(heading + 0.5 * curvature * spacing)
            y += spacing * np.sin(heading + 0.5 * curvature * spacing)
            heading += curvature * spacing
            d, e = spacing, 0.5 * spacing * spacing
            a0, a1, a2 = p00 + d * p01 + e * p02, p01 + d * p11 + e * p12, p02 + d * p12 + e * p22
            b1, b2 = p11 + d * p12, p12 + d * p22
            p00, p01, p02 = a0 + d * a1 + e * a2, a1 + d * a2, a2
            p11, p12, p22 = b1 + d * b2, b2, p22 + drift
            top += slope * spacing
            q00, q01, q11 = q00 + 2 * d * q01 + d * d * q11, q01 + d * q11, q11 + _SLOPE_DRIFT**2 * spacing
        box = TurnedBox(x, y, np.cos(heading), np.sin(heading), half_s, _HALF_WIDTH_M, low, high)
        level = top - max(sheet, _LEVEL_BELOW_M), top + _LEVEL_ABOVE_M
        n = gather_level(points, layers, frame, box, level, work)
        z_low, z_high = top - sheet, top + _CIRCLE_ABOVE_M
        u, number, spread = circle_centre(work, n, 0.0, radius, z_low, z_high)
        gate = min(max(_GATE_SIGMAS * np.sqrt(p00 + noise * noise), _LEAST_GATE_M), _MOST_GATE_M)
        measured = number >= _LEAST_POINTS and abs(u) <= gate
        if measured:
            gap = 0.0
            weight = noise * noise * (1.0 + _FEW_POINTS / number)
            s = p00 + weight
            k0, k1, k2 = p00 / s, p01 / s, p02 / s
            x -= np.sin(heading) * k0 * u
            y += np.cos(heading) * k0 * u
            heading += k1 * u
            curvature += k2 * u
            p11, p12, p22 = p11 - k1 * p01, p12 - k1 * p02, p22 - k2 * p02
            p00, p01, p02 = p00 * (1 - k0), p01 * (1 - k0), p02 * (1 - k0)
            edge = top_edge(work, n, u, TOP_HALF_WIDTH * radius, top, _TOP_SEARCH_M, W_BEAM_EDGE)
            blurred = 0.0 if not np.isnan(edge) else blurred + spacing
            if blurred > 2.0 * max_gap:
                break  # no edge for too long: it is the bush over a beam that is followed
            if not np.isnan(edge):
                s = q00 + _EDGE_NOISE_M**2
                g0, g1 = q00 / s, q01 / s
                r = edge - top
                top += g0 * r
                slope += g1 * r
                q11 -= g1 * q01
                q00, q01 = q00 * (1 - g0), q01 * (1 - g0)
        else:
            gap += spacing
            if gap > max_gap or n_out == 0:
                break
        out[n_out, NODE_X], out[n_out, NODE_Y] = x, y
        out[n_out, NODE_HEADING], out[n_out, NODE_TOP] = heading, top
        out[n_out, NODE_POINTS], out[n_out, NODE_SPREAD] = number, spread
        out[n_out, NODE_MEASURED] = 1.0 if measured else 0.0
        n_out += 1
    while n_out > 0 and out[n_out - 1, NODE_MEASURED] == 0.0:
        n_out -= 1
    return n_out


@njit(cache=True, nogil=True)
def follow_both_ways(
    points: FloatArray,
    layers: LayeredBins,
    frame: tuple[int, int, float],
    start: FloatArray,
    setting: FollowSettings,
    work: FloatArray,
    ahead: FloatArray,
    back: FloatArray,
) -> tuple[int, int, int]:
    """Follow a start ahead and back, and return n_back, first, n_ahead.

    The line is back[:n_back] reversed, without its first node, and ahead[first:n_ahead]. Following back begins
    where the filter had settled, so that the first nodes are followed, not assumed.

    Parameters
    ----------
    start
        (4 or more,) columns `NODE_X` to `NODE_TOP`.
    ahead, back
        (., 7), written; see `follow_sheet`, as for the others.
    """
    begin = start[NODE_X], start[NODE_Y], start[NODE_HEADING], start[NODE_TOP]
    n_ahead = follow_sheet(points, layers, frame, begin, setting, work, ahead)
    if n_ahead == 0:
        return 0, 0, 0
    first = min(n_ahead - 1, SETTLED)
    turned = np.arctan2(-np.sin(ahead[first, NODE_HEADING]), -np.cos(ahead[first, NODE_HEADING]))
    begin = ahead[first, NODE_X], ahead[first, NODE_Y], turned, ahead[first, NODE_TOP]
    n_back = follow_sheet(points, layers, frame, begin, setting, work, back)
    return n_back, first, n_ahead


@njit(cache=True, nogil=True)
def is_taken(
    node: FloatArray,
    nodes: FloatArray,
    heads: IntArray,
    following: IntArray,
    frame: tuple[int, int, float],
    reach: tuple[float, float],
) -> bool:
    """Return whether a node lies on an entered one: within reach along and across it, and parallel.

    Parameters
    ----------
    node
        (3 or more,) columns `NODE_X` to `NODE_HEADING`.
    nodes, heads, following
        Entered nodes (n, 7), chained per bin: `heads` (bins,) int64 is the last one entered, `following` (n,)
        int64 the one entered before it; -1 ends a chain.
    frame
        The bins.
    reach
        Along and across [m], both below the side of a bin.
    """
    along, across = reach
    n_x, n_y, cell = frame
    x, y = node[NODE_X], node[NODE_Y]
    c, r = int(np.floor(x / cell)), int(np.floor(y / cell))
    for rr in range(max(r - 1, 0), min(r + 2, n_y)):
        for cc in range(max(c - 1, 0), min(c + 2, n_x)):
            k = heads[rr * n_x + cc]
            while k >= 0:
                dx, dy, angle = x - nodes[k, NODE_X], y - nodes[k, NODE_Y], nodes[k, NODE_HEADING]
                if dx * dx + dy * dy <= 1.01 * (along * along + across * across):
                    cos, sin = np.cos(angle), np.sin(angle)
                    if (
                        abs(dx * cos + dy * sin) <= along
                        and abs(dy * cos - dx * sin) <= across
                        and abs(np.sin(node[NODE_HEADING] - angle)) < _PARALLEL_SINE
                    ):
                        return True
                k = following[k]
    return False


@njit(cache=True, nogil=True)
def follow_sheets(
    points: FloatArray,
    layers: LayeredBins,
    frame: tuple[int, int, float],
    begin: FloatArray,
    setting: FollowSettings,
    reach: tuple[float, float],
    limits: FollowLimits,
    work: FloatArray,
) -> tuple[FloatArray, IntArray, IntArray, IntArray]:
    """Follow the starts in their order, each independently and over a limited length.

    A start near another one that was followed, and on its line, is skipped. What is followed from a start
    depends on nothing but the start and the points within reach.

    Parameters
    ----------
    points, layers, frame, setting, work
        See `follow_sheet`.
    begin
        (k, 5) starts, columns `NODE_X` to `START_SCORE`.
    reach
        Within which a start lies on a line; see `is_taken`. [m]
    limits
        Numbers of nodes.

    Returns
    -------
    nodes
        (n, 7), columns `NODE_X` to `NODE_MEASURED`, line after line.
    offsets
        (n_lines + 1,) int64: line i has the nodes from offsets[i] to offsets[i + 1].
    middle
        (n_lines,) int64: number of the node where the line was begun.
    number
        (n_lines,) int64: its start.
    """
    n_x, n_y, cell = frame
    least, most, near = limits
    ahead, back = np.empty((most, NODE_COLUMNS)), np.empty((most + SETTLED, NODE_COLUMNS))
    nodes, following = np.empty((_ROOM, NODE_COLUMNS)), np.empty(_ROOM, np.int64)
    heads = np.full(n_x * n_y, -1, dtype=np.int64)
    # For every line, those left out included: they keep other starts from being followed again
    ends, middle, number = np.zeros((3, len(begin)), dtype=np.int64)
    kept = np.zeros(len(begin), dtype=np.bool_)
    n, m = 0, 0
    for i in range(len(begin)):
        if is_taken(begin[i], nodes, heads, following, frame, reach):
            continue
        n_back, first, n_ahead = follow_both_ways(points, layers, frame, begin[i], setting, work, ahead, back)
        if n_ahead == 0:
            continue
        if n + n_back + n_ahead > len(nodes):
            room = len(nodes) + n_back + n_ahead
            nodes = np.concatenate((nodes, np.empty((room, NODE_COLUMNS))))
            following = np.concatenate((following, np.empty(room, np.int64)))
        begins = n
        for k in range(n_back - 1, 0, -1):
            nodes[n] = back[k]
            nodes[n, NODE_HEADING] += np.pi
            n += 1
        for k in range(first, n_ahead):
            nodes[n] = ahead[k]
            n += 1
        at = begins + max(n_back - 1 - first, 0)
        # Not those that are too short or have moved over to a line that was followed before
        kept[m] = n - begins >= least and not is_taken(nodes[at], nodes, heads, following, frame, reach)
        ends[m], middle[m], number[m] = n, at, i
        m += 1
        for k in range(max(at - near, begins), min(at + near + 1, n)):
            c, r = int(np.floor(nodes[k, NODE_X] / cell)), int(np.floor(nodes[k, NODE_Y] / cell))
            if c >= 0 and c < n_x and r >= 0 and r < n_y:
                following[k] = heads[r * n_x + c]
                heads[r * n_x + c] = k
    offsets, n_lines = np.zeros(m + 1, dtype=np.int64), 0
    for k in range(m):
        if kept[k]:
            begins = ends[k - 1] if k > 0 else 0
            shift = begins - offsets[n_lines]
            for j in range(begins, ends[k]):
                nodes[j - shift] = nodes[j]
            middle[n_lines], number[n_lines] = middle[k] - shift, number[k]
            n_lines += 1
            offsets[n_lines] = ends[k] - shift
    last = offsets[n_lines]
    return (
        nodes[:last].copy(),
        offsets[: n_lines + 1].copy(),
        middle[:n_lines].copy(),
        number[:n_lines].copy(),
    )
