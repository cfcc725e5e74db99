"""Following thin sheets of points by circles, from many starts.

Positions are local: x east and y north of the bins' south-west corner, z above a local origin. [m]
`layers` are the three arrays of `linework.kernels.cells.bins.sort_into_layers`, `frame` is the bins' n_x, n_y and size.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import FloatArray, IntArray
from linework.kernels.cells.bins import layer_of
from linework.kernels.radon.corridor import crossed, top_edge

LayeredBins = tuple[IntArray, FloatArray, IntArray]

SETTLED = 6  # nodes after which the filter no longer knows what it was begun with


@njit(cache=True, nogil=True)
def gather_level(
    points: FloatArray,
    layers: LayeredBins,
    frame: tuple[int, int, float],
    box: FloatArray,
    level: tuple[float, float],
    out: FloatArray,
) -> int:
    """Collect like `gather` the points whose z lies within `level`: of each bin only the layers it meets."""
    slot, floor, begin = layers
    n_x, n_y, cell = frame
    last = len(out) - 1
    x0, y0, dx, dy = box[0], box[1], box[2], box[3]
    half_s, half_u, low, high = box[4], box[5], box[6], box[7]
    reach_y = abs(dy) * half_s + abs(dx) * half_u
    r0, r1 = int(np.floor((y0 - reach_y) / cell)), int(np.floor((y0 + reach_y) / cell))
    n = 0
    for r in range(max(r0, 0), min(r1, n_y - 1) + 1):
        west_s, east_s = crossed(half_s, dx, dy, r * cell - y0, (r + 1) * cell - y0)
        west_u, east_u = crossed(half_u, -dy, dx, r * cell - y0, (r + 1) * cell - y0)
        c0 = int(max(np.floor((x0 + max(west_s, west_u)) / cell), 0.0))
        c1 = int(min(np.floor((x0 + min(east_s, east_u)) / cell), n_x - 1.0))
        for c in range(c0, c1 + 1):
            k = slot[r * n_x + c]
            if k < 0 or floor[k] > level[1]:
                continue
            first = begin[k, layer_of(level[0], floor[k])]
            for i in range(first, begin[k, layer_of(level[1], floor[k]) + 1]):
                z, h = points[i, 2], points[i, 3]
                ex, ey = points[i, 0] - x0, points[i, 1] - y0
                s = ex * dx + ey * dy
                u = ey * dx - ex * dy
                inside = (abs(s) <= half_s) & (abs(u) <= half_u) & (h >= low) & (h <= high)
                inside = inside & (z >= level[0]) & (z <= level[1]) & (n < last)
                # Written in any case, kept or not: which points are inside is as good as random
                out[n, 0], out[n, 1], out[n, 2], out[n, 3] = s, u, z, h
                n += int(inside)
    return n


@njit(cache=True, nogil=True)
def circle_centre(
    work: FloatArray, n: int, u_start: float, radius: float, z_low: float, z_high: float
) -> tuple[float, int, float]:
    """Return offset, number and spread of the points that a circle grown about `u_start` settles on.

    The circle moves to the mean of the points it holds until it rests (mean shift).
    """
    offsets = np.empty(n)
    m = 0
    for i in range(n):
        if work[i, 2] >= z_low and work[i, 2] <= z_high:
            offsets[m] = work[i, 1]
            m += 1
    u = u_start
    number = 0
    spread = 0.0
    for _ in range(6):
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
        if abs(shift) < 0.001:
            break
    return u, number, spread


@njit(cache=True, nogil=True)
def follow_sheet(
    points: FloatArray,
    layers: LayeredBins,
    frame: tuple[int, int, float],
    start: tuple[float, float, float, float],
    setting: FloatArray,
    work: FloatArray,
    out: FloatArray,
) -> int:
    """Follow a thin sheet of points from `start` by circles at a fixed spacing; return the number of nodes.

    start: x, y, heading, top z.
    setting: spacing, circle radius, largest gap, half length, lowest and highest height, sheet height.
    out, per node: x, y, heading, top z, number of points, spread, measured (1) or predicted (0).
    A Kalman filter carries lateral offset, heading and curvature; another the top's height and slope.
    """
    spacing, radius, max_gap, half_s = setting[0], setting[1], setting[2], setting[3]
    low, high, sheet = setting[4], setting[5], setting[6]
    x, y, heading, top = start
    curvature, slope = 0.0, 0.0
    p00, p01, p02, p11, p12, p22 = 0.02**2, 0.0, 0.0, 0.03**2, 0.0, 0.03**2
    q00, q01, q11 = 0.05**2, 0.0, 0.05**2
    noise = 0.025  # half the depth of the corrugation, and range noise averaged
    drift = 0.012**2 * spacing  # of the curvature: an 18 m bend sets in within about 10 m
    box = np.empty(8)
    box[4], box[5], box[6], box[7] = half_s, 0.35, low, high
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
            q00, q01, q11 = q00 + 2 * d * q01 + d * d * q11, q01 + d * q11, q11 + 0.01**2 * spacing
        box[0], box[1], box[2], box[3] = x, y, np.cos(heading), np.sin(heading)
        level = top - max(sheet, 0.60), top + 0.20  # what circle and edge look at
        n = gather_level(points, layers, frame, box, level, work)
        z_low, z_high = top - sheet, top + 0.03
        u, number, spread = circle_centre(work, n, 0.0, radius, z_low, z_high)
        gate = min(max(3.0 * np.sqrt(p00 + noise * noise), 0.08), 0.25)
        measured = number >= 3 and abs(u) <= gate
        if measured:
            gap = 0.0
            weight = noise * noise * (1.0 + 6.0 / number)
            s = p00 + weight
            k0, k1, k2 = p00 / s, p01 / s, p02 / s
            x -= np.sin(heading) * k0 * u
            y += np.cos(heading) * k0 * u
            heading += k1 * u
            curvature += k2 * u
            p11, p12, p22 = p11 - k1 * p01, p12 - k1 * p02, p22 - k2 * p02
            p00, p01, p02 = p00 * (1 - k0), p01 * (1 - k0), p02 * (1 - k0)
            edge = top_edge(work, n, u, 0.75 * radius, top, 0.08)
            blurred = 0.0 if not np.isnan(edge) else blurred + spacing
            if blurred > 2.0 * max_gap:
                break  # for long no edge at all: this is not a beam in a bush, but the bush
            if not np.isnan(edge):
                s = q00 + 0.03**2
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
        out[n_out, 0], out[n_out, 1], out[n_out, 2], out[n_out, 3] = x, y, heading, top
        out[n_out, 4], out[n_out, 5], out[n_out, 6] = number, spread, 1.0 if measured else 0.0
        n_out += 1
    while n_out > 0 and out[n_out - 1, 6] == 0.0:
        n_out -= 1
    return n_out


@njit(cache=True, nogil=True)
def follow_both_ways(
    points: FloatArray,
    layers: LayeredBins,
    frame: tuple[int, int, float],
    start: FloatArray,
    setting: FloatArray,
    work: FloatArray,
    ahead: FloatArray,
    back: FloatArray,
) -> tuple[int, int, int]:
    """Follow from a start (x, y, heading, top z) into `ahead`, and the other way into `back`.

    The line is back[:n_back] turned round, its first node left out, and ahead[first:n_ahead]; returns
    n_back, first, n_ahead. The way back begins where the filter had settled, so that the first nodes are
    followed, not assumed.
    """
    begin = start[0], start[1], start[2], start[3]
    n_ahead = follow_sheet(points, layers, frame, begin, setting, work, ahead)
    if n_ahead == 0:
        return 0, 0, 0
    first = min(n_ahead - 1, SETTLED)
    turned = np.arctan2(-np.sin(ahead[first, 2]), -np.cos(ahead[first, 2]))
    begin = ahead[first, 0], ahead[first, 1], turned, ahead[first, 3]
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
    """Return whether a node (x, y, heading) lies on an entered one: near it, across even nearer, parallel.

    reach: along and across [m], both below `cell`. Entered nodes are chained per cell: `heads`, `following`.
    """
    along, across = reach
    n_x, n_y, cell = frame
    x, y = node[0], node[1]
    c, r = int(np.floor(x / cell)), int(np.floor(y / cell))
    for rr in range(max(r - 1, 0), min(r + 2, n_y)):
        for cc in range(max(c - 1, 0), min(c + 2, n_x)):
            k = heads[rr * n_x + cc]
            while k >= 0:
                dx, dy, angle = x - nodes[k, 0], y - nodes[k, 1], nodes[k, 2]
                if dx * dx + dy * dy <= 1.01 * (along * along + across * across):
                    cos, sin = np.cos(angle), np.sin(angle)
                    if (
                        abs(dx * cos + dy * sin) <= along
                        and abs(dy * cos - dx * sin) <= across
                        and abs(np.sin(node[2] - angle)) < 0.34  # 20 degrees
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
    setting: FloatArray,
    reach: tuple[float, float],
    limits: tuple[int, int, int],
    work: FloatArray,
) -> tuple[FloatArray, IntArray, IntArray, IntArray]:
    """Follow the starts (x, y, heading, top z), in their order, each for itself and not far.

    A start near another one that was followed, and on its line, is passed over. What is followed from a
    start depends on nothing but the start and the points within reach.

    limits: fewest nodes of a line, most nodes one way, and how many of those keep other starts away.

    Returns
    -------
    nodes
        (n, 7): see `follow_sheet`, line after line.
    offsets
        (n_lines + 1,): line i has the nodes from offsets[i] to offsets[i + 1].
    middle
        (n_lines,): number of the node that lies where the line was begun.
    number
        (n_lines,): which start it was.
    """
    n_x, n_y, cell = frame
    least, most, near = limits
    ahead, back = np.empty((most, 7)), np.empty((most + SETTLED, 7))
    nodes, following = np.empty((4096, 7)), np.empty(4096, np.int64)
    heads = np.full(n_x * n_y, -1, dtype=np.int64)
    # Of every line, also of those that are left out, which keep other starts from being followed again
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
            nodes = np.concatenate((nodes, np.empty((room, 7))))
            following = np.concatenate((following, np.empty(room, np.int64)))
        begins = n
        for k in range(n_back - 1, 0, -1):
            nodes[n] = back[k]
            nodes[n, 2] += np.pi
            n += 1
        for k in range(first, n_ahead):
            nodes[n] = ahead[k]
            n += 1
        at = begins + max(n_back - 1 - first, 0)
        # Too short; or the circles have moved over to a line that was followed before
        kept[m] = n - begins >= least and not is_taken(nodes[at], nodes, heads, following, frame, reach)
        ends[m], middle[m], number[m] = n, at, i
        m += 1
        for k in range(max(at - near, begins), min(at + near + 1, n)):
            c, r = int(np.floor(nodes[k, 0] / cell)), int(np.floor(nodes[k, 1] / cell))
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
