"""Kernels along followed lines: top edge of a sheet of points, local fits, cross-sections at every node.

Positions are local: x east and y north of the bins' south-west corner, z above a local origin. [m]
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from linework.arrays import FloatArray, IntArray
from linework.kernels.radon.corridor import (
    LOCAL_HEIGHT,
    LOCAL_LEFT,
    LOCAL_Z,
    NODE_HEADING,
    NODE_TOP,
    NODE_X,
    NODE_Y,
    TurnedBox,
    gather_in_box,
)

#: Bins of the depth profile: from 0.70 m above the top edge to 1.30 m below it, the highest rail in use.
DEPTH_BINS = 40
#: Height above the top edge at which the depth profile begins. [m]
DEPTH_ABOVE_M = 0.70
#: Height of a bin of the depth profile: a beam fills six. [m]
DEPTH_BIN_M = 0.05
#: Height above the ground below which a point is the ground or its noise: three sigma of 2 cm. [m]
BEAM_FLOOR_M = 0.06

#: Columns of a node's sheet: number of points, their mean offset and spread, the highest under the top edge. [m]
SHEET_POINTS, SHEET_OFFSET, SHEET_SPREAD, SHEET_TOP = 0, 1, 2, 3
#: Rows of what stands on either side of a sheet: points at its heights, below it, on the ground, before its foot.
SIDE_AT_SHEET, SIDE_BELOW, SIDE_GROUND, SIDE_APRON = 0, 1, 2, 3


class EdgeShape(NamedTuple):
    """What is below a top edge: height of the beam [m], and the weights of points right above it and below it."""

    beam: float
    above: float
    under: float


#: Height above a tried edge in which points count against it. [m]
_EDGE_CLEAR_M = 0.10
#: Range of depths below a tried edge in which points count against it: below a W-beam and its noise. [m]
_EDGE_UNDER_M, _EDGE_UNDER_END_M = 0.36, 0.46
#: The edge of a W-beam, which is 0.31 m high. Points outside weigh twice, per equal area: 0.30 m inside, 0.20 m outside.
W_BEAM_EDGE = EdgeShape(beam=0.30, above=3.0, under=3.0)
#: Step between tried edges: one sigma of the noise. [m]
_EDGE_STEP_M = 0.02

#: A sheet reaches from 3 cm above the top edge to 33 cm below it: a W-beam of 0.31 m and its noise. [m]
_SHEET_ABOVE_M, SHEET_BELOW_M = 0.03, 0.33
#: Depth below the top edge at which a W-beam has ended. [m]
_FOOT_M = 0.36
#: Deepest and farthest points that count as the slope before a barrier: below the top, and across. [m]
_APRON_BELOW_M, _APRON_REACH_M = 0.62, 0.40
#: Height above the road below which a point beside a sheet is on the ground or in grass. [m]
_GROUND_M = 0.12
#: Range of depths in which the offset of the top edge is measured: above the first crest of a W-beam. [m]
_EDGE_OFFSET_FROM_M, _EDGE_OFFSET_TO_M = 0.02, 0.10
#: Half width in which the top edge of a sheet is searched, in radii: without what hangs over its faces.
TOP_HALF_WIDTH = 0.75
#: Range above and below the fitted top in which edges are tried: three sigma of the noise. [m]
_TOP_REACH_M = 0.06
#: Ridge of the local fits, as a share of their weight: keeps a window of few nodes solvable.
_RIDGE = 1e-6


@njit(cache=True, nogil=True)
def top_edge(
    work: FloatArray, n: int, u: float, half_width: float, top: float, reach: float, shape: EdgeShape
) -> float:
    """Return the height of a beam's top edge: the highest point below the best edge [m], NaN without any.

    Edges within `reach` of `top` are tried. The best has most points in the beam below it, less what is right above and
    below the beam, with the weights of the shape (`W_BEAM_EDGE`: twice, per equal area): a bush over a rail does not
    lift it.

    Parameters
    ----------
    work, n
        (., 4) points of a box, of which the first n count; columns `LOCAL_ALONG` to `LOCAL_HEIGHT`.
    u, half_width
        Points within `half_width` of the offset `u` count. [m]
    top, reach
        Height about which edges are tried, and how far from it. [m]
    shape
        What is below the edge.
    """
    z = np.empty(n)
    m = 0
    for i in range(n):
        if abs(work[i, LOCAL_LEFT] - u) <= half_width:
            z[m] = work[i, LOCAL_Z]
            m += 1
    best, edge = 0.0, np.nan
    e = top - reach
    while e <= top + reach + 1e-9:
        inside, over, deep, highest = 0, 0, 0, -1e9
        for i in range(m):
            d = e - z[i]
            under = (d >= 0.0) & (d < shape.beam)
            inside += int(under)
            highest = max(highest, z[i] if under else -1e9)
            over += int((d < 0.0) & (d >= -_EDGE_CLEAR_M))
            deep += int((d >= _EDGE_UNDER_M) & (d < _EDGE_UNDER_END_M))
        score = inside - shape.above * over - shape.under * deep
        if score > best:  # the lowest of equal edges: it ends on a point
            best = score
            edge = highest
        e += _EDGE_STEP_M
    return edge


@njit(cache=True, nogil=True)
def fit_locally(
    s: FloatArray, v: FloatArray, weight: FloatArray, half_window: float
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Fit v(s) by a weighted quadratic about every node of one line.

    Weights fall off as a tricube towards the window's ends. What is fitted is the difference from the node's
    own value, so that the result does not depend on where the origin is.

    Parameters
    ----------
    s, v, weight
        (n,) rising chainages [m], values and weights of the nodes.
    half_window
        Half of the window. [m]

    Returns
    -------
    value, slope, rms, effective
        (n,) each: fitted value, its derivative by s, weighted rms of the residuals, and effective number of
        nodes (sum of weights squared over sum of squares). Without weight in the window: the node's own value,
        0, 0 and 1.
    """
    n = len(s)
    value, slope, rms, effective = v.copy(), np.zeros(n), np.zeros(n), np.ones(n)
    first = 0
    for i in range(n):
        while s[first] < s[i] - half_window:
            first += 1
        m = np.zeros((3, 3))
        b = np.zeros(3)
        w_total, w_square = 0.0, 0.0
        k = first
        while k < n and s[k] <= s[i] + half_window:
            d = (s[k] - s[i]) / half_window
            w = weight[k] * (1.0 - abs(d) ** 3) ** 3
            if w > 0.0:
                basis = (1.0, d, d * d)
                for p in range(3):
                    b[p] += w * basis[p] * (v[k] - v[i])
                    for q in range(3):
                        m[p, q] += w * basis[p] * basis[q]
                w_total += w
                w_square += w * w
            k += 1
        if w_total <= 0.0:
            continue
        for p in range(3):
            m[p, p] += _RIDGE * w_total
        c = np.linalg.solve(m, b)
        value[i], slope[i] = v[i] + c[0], c[1] / half_window
        total = 0.0
        k = first
        while k < n and s[k] <= s[i] + half_window:
            d = (s[k] - s[i]) / half_window
            w = weight[k] * (1.0 - abs(d) ** 3) ** 3
            r = v[k] - v[i] - (c[0] + c[1] * d + c[2] * d * d)
            total += w * r * r
            k += 1
        rms[i] = np.sqrt(total / w_total)
        effective[i] = w_total * w_total / w_square
    return value, slope, rms, effective


@njit(cache=True, nogil=True)
def fit_lines_locally(
    s: FloatArray, v: FloatArray, weight: FloatArray, half_window: float, offsets: IntArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Fit each of many lines by `fit_locally`: line i has the nodes from offsets[i] to offsets[i + 1]."""
    n = len(s)
    value, slope, rms, effective = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    for i in range(len(offsets) - 1):
        a, b = offsets[i], offsets[i + 1]
        value[a:b], slope[a:b], rms[a:b], effective[a:b] = fit_locally(
            s[a:b], v[a:b], weight[a:b], half_window
        )
    return value, slope, rms, effective


@njit(cache=True, nogil=True)
def profile_along(
    points: FloatArray,
    starts: IntArray,
    n_x: int,
    n_y: int,
    cell: float,
    nodes: FloatArray,
    half_s: float,
    radius: float,
    reach: float,
    shape: EdgeShape,
    work: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Measure the cross-section at every node of lines.

    Parameters
    ----------
    points, starts, n_x, n_y, cell
        See `gather_in_box`.
    nodes
        (n, 4), columns `NODE_X` to `NODE_TOP`.
    half_s, radius, reach
        Half length of a station along the line, half width of the sheet, half width of its surroundings. [m]
    shape
        What is below the top edge.
    work
        (m, 4) scratch: the points of a station.

    Returns
    -------
    sheet
        (n, 4), columns `SHEET_POINTS` to `SHEET_TOP`: points of the sheet within `radius`, their mean offset
        and spread [m], the highest point under the top edge [m, NaN where none].
    depth
        (n, 2, DEPTH_BINS): points within `radius`, left and right of the line, not on the ground, per 5 cm
        below the top edge, from 0.70 m above it.
    sides
        (n, 4, 2), rows `SIDE_AT_SHEET` to `SIDE_APRON`: points left and right of it within `reach`: at the
        sheet's heights; below them (deeper than 0.36 m under the top); on the ground (lower than 0.12 m);
        and within 0.40 m between ground and sheet (0.36 to 0.62 m under the top).
    edge
        (n,) mean offset of the sheet's points 2 to 10 cm below the top; NaN where none. [m]
    """
    n_nodes = len(nodes)
    sheet = np.zeros((n_nodes, 4))
    depth = np.zeros((n_nodes, 2, DEPTH_BINS))
    sides = np.zeros((n_nodes, 4, 2))
    edge = np.full(n_nodes, np.nan)
    for i in range(n_nodes):
        heading, top = nodes[i, NODE_HEADING], nodes[i, NODE_TOP]
        box = TurnedBox(
            nodes[i, NODE_X], nodes[i, NODE_Y], np.cos(heading), np.sin(heading), half_s, reach, -10.0, 10.0
        )
        n = gather_in_box(points, starts, n_x, n_y, cell, box, work)
        number, total, square = 0, 0.0, 0.0
        n_edge, u_edge = 0, 0.0
        for k in range(n):
            below = top - work[k, LOCAL_Z]
            u, height = work[k, LOCAL_LEFT], work[k, LOCAL_HEIGHT]
            side = 0 if u > 0 else 1
            inside = below > -_SHEET_ABOVE_M and below < SHEET_BELOW_M and height >= BEAM_FLOOR_M
            is_apron = below >= _FOOT_M and below <= _APRON_BELOW_M and abs(u) <= _APRON_REACH_M
            if is_apron and height >= _GROUND_M:
                sides[i, SIDE_APRON, side] += 1.0
            if abs(u) <= radius:
                b = int(np.floor((below + DEPTH_ABOVE_M) / DEPTH_BIN_M))
                if b >= 0 and b < DEPTH_BINS and height >= BEAM_FLOOR_M:
                    depth[i, side, b] += 1.0
                if inside:
                    number += 1
                    total += u
                    square += u * u
                if below >= _EDGE_OFFSET_FROM_M and below <= _EDGE_OFFSET_TO_M:
                    n_edge += 1
                    u_edge += u
                continue
            if inside:
                sides[i, SIDE_AT_SHEET, side] += 1.0
            if below >= _FOOT_M:
                sides[i, SIDE_BELOW, side] += 1.0
            if height < _GROUND_M:
                sides[i, SIDE_GROUND, side] += 1.0
        if n_edge > 0:
            edge[i] = u_edge / n_edge
        sheet[i, SHEET_POINTS] = number
        if number > 0:
            mean = total / number
            sheet[i, SHEET_OFFSET] = mean
            sheet[i, SHEET_SPREAD] = np.sqrt(max(square / number - mean * mean, 0.0))
        sheet[i, SHEET_TOP] = top_edge(work, n, 0.0, TOP_HALF_WIDTH * radius, top, _TOP_REACH_M, shape)
    return sheet, depth, sides, edge


@njit(cache=True, nogil=True)
def count_outlines(
    points: FloatArray,
    starts: IntArray,
    n_x: int,
    n_y: int,
    cell: float,
    nodes: FloatArray,
    windows: IntArray,
    half_s: float,
    half_u: float,
    depths: tuple[float, float],
    bin_m: float,
    work: FloatArray,
) -> FloatArray:
    """Count the points of cross-sections of windows along a line, in cells across and in height.

    Parameters
    ----------
    points, starts, n_x, n_y, cell, nodes, half_s, work
        See `profile_along`.
    windows
        (k, 2): first node of each window, and the one after its last; neither ever falls from one to the next.
    half_u, depths, bin_m
        Half width of a section; its range of heights above the top edge; side of a cell. [m]

    Returns
    -------
    (k, heights, widths) float64: from the lowest height up, from right to left. Points of the ground are left out.
    """
    low, high = depths
    n_z, n_u = round((high - low) / bin_m), round(2.0 * half_u / bin_m)
    counts = np.zeros((len(windows), n_z, n_u))
    first, last = 0, 0
    for i in range(len(nodes)):
        # The windows that hold this node
        while first < len(windows) and windows[first, 1] <= i:
            first += 1
        while last < len(windows) and windows[last, 0] <= i:
            last += 1
        if first >= last:
            continue
        heading, top = nodes[i, NODE_HEADING], nodes[i, NODE_TOP]
        box = TurnedBox(
            nodes[i, NODE_X], nodes[i, NODE_Y], np.cos(heading), np.sin(heading), half_s, half_u, -10.0, 10.0
        )
        n = gather_in_box(points, starts, n_x, n_y, cell, box, work)
        for k in range(n):
            b = int(np.floor((work[k, LOCAL_Z] - top - low) / bin_m))
            c = min(int((work[k, LOCAL_LEFT] + half_u) / bin_m), n_u - 1)
            if b >= 0 and b < n_z and work[k, LOCAL_HEIGHT] >= BEAM_FLOOR_M:
                for w in range(first, last):
                    counts[w, b, c] += 1.0
    return counts
