"""Loops over the points near a line: gathering in a box, beams seen from their ends, local fits, profiles.

Positions are local: x east and y north of the bins' south-west corner, z above a local origin. [m]
"""

from __future__ import annotations

import numpy as np
from numba import njit

from linework.arrays import FloatArray, IntArray

DEPTH_BINS = 40  # of 5 cm: from 0.70 m above the top edge to 1.30 m below it
DEPTH_ABOVE_M = 0.70
DEPTH_BIN_M = 0.05
BEAM_FLOOR_M = 0.06  # above the ground: lower is the ground and its noise


@njit(cache=True, nogil=True)
def crossed(half: float, a: float, b: float, south: float, north: float) -> tuple[float, float]:
    """Return the range of x in which the strip ``|a x + b y| <= half`` crosses the row south <= y <= north."""
    if abs(a) < 1e-6:
        return -1e9, 1e9
    reach = half / abs(a) + 1e-6  # a hair wider, for rounding
    return -max(b * south / a, b * north / a) - reach, -min(b * south / a, b * north / a) + reach


@njit(cache=True, nogil=True)
def gather_in_box(
    points: FloatArray, starts: IntArray, n_x: int, n_y: int, cell: float, box: FloatArray, out: FloatArray
) -> int:
    """Collect the points in a turned box into `out` (s along, u left, z, height above road); return how many.

    box: centre x, y, direction x, y, half length, half width, lowest height, highest height.
    """
    x0, y0, dx, dy = box[0], box[1], box[2], box[3]
    half_s, half_u, low, high = box[4], box[5], box[6], box[7]
    last = len(out) - 1
    reach_y = abs(dy) * half_s + abs(dx) * half_u
    r0, r1 = int(np.floor((y0 - reach_y) / cell)), int(np.floor((y0 + reach_y) / cell))
    n = 0
    for r in range(max(r0, 0), min(r1, n_y - 1) + 1):
        # Of each row only the bins that both strips cross; their points lie one after the other
        west_s, east_s = crossed(half_s, dx, dy, r * cell - y0, (r + 1) * cell - y0)
        west_u, east_u = crossed(half_u, -dy, dx, r * cell - y0, (r + 1) * cell - y0)
        c0 = int(max(np.floor((x0 + max(west_s, west_u)) / cell), 0.0))
        c1 = int(min(np.floor((x0 + min(east_s, east_u)) / cell), n_x - 1.0))
        if c0 > c1:
            continue
        for i in range(starts[r * n_x + c0], starts[r * n_x + c1 + 1]):
            h = points[i, 3]
            ex, ey = points[i, 0] - x0, points[i, 1] - y0
            s = ex * dx + ey * dy
            u = ey * dx - ex * dy
            inside = (abs(s) <= half_s) & (abs(u) <= half_u) & (h >= low) & (h <= high) & (n < last)
            # Written in any case, kept or not: a branch here is as good as random, and half as fast
            out[n, 0], out[n, 1], out[n, 2], out[n, 3] = s, u, points[i, 2], h
            n += int(inside)
    return n


@njit(cache=True, nogil=True)
def _filled_along(
    work: FloatArray, n: int, tan: float, u: float, half_width: float, top: float, beam: float, half_s: float
) -> float:
    """Return the share of half metres along a strip in which the beam has a point."""
    n_bins = max(int(2 * half_s / 0.5), 1)
    filled = np.zeros(n_bins)
    for i in range(n):
        d = top - work[i, 2]
        if d >= -0.05 and d <= beam and abs(work[i, 1] - tan * work[i, 0] - u) <= half_width:
            filled[min(int((work[i, 0] + half_s) / 0.5), n_bins - 1)] = 1.0
    return float(np.sum(filled)) / n_bins


@njit(cache=True, nogil=True)
def find_beams(
    points: FloatArray,
    starts: IntArray,
    n_x: int,
    n_y: int,
    cell: float,
    box: FloatArray,
    turns: FloatArray,
    shape: FloatArray,
    work: FloatArray,
    out: FloatArray,
) -> int:
    """Find where in a box a beam seen from its end would stand; write its places, return how many.

    The Radon transform of the points themselves over a few small turns, in strips across (u) and in
    height (z). A beam is a strip with points over its height and none above it and none below it: its
    score is their number, less twice those in equal areas above and below.

    shape: strip [m], beam height, clear height above and below [m], fewest points, least share of them
    that the score must reach, lowest and highest top above the road [m].
    out, per place: turn [rad], offset u [m], top z [m], score; places differ by two strips or more.
    """
    strip, beam, clear, least, clarity = shape[0], shape[1], shape[2], shape[3], shape[4]
    lowest, highest = shape[5], shape[6]
    n = gather_in_box(points, starts, n_x, n_y, cell, box, work)
    if n < least:
        return 0
    z_low, level = np.inf, 0.0
    for i in range(n):
        z_low = min(z_low, work[i, 2])
        level += (work[i, 2] - work[i, 3]) / n  # of the road
    half_u, step_u, step_z = box[5], 0.5 * strip, 0.05
    n_u = int(2 * half_u / step_u) + 2
    n_beam, n_clear = round(beam / step_z), round(clear / step_z)
    pad = n_beam + n_clear + 1
    z_top = z_low
    for i in range(n):
        z_top = max(z_top, work[i, 2])
    k_low = max(pad, int((level + lowest - z_low) / step_z) + pad)
    k_high = int((z_top - z_low) / step_z) + 1 + pad
    k_high = min(k_high, int((level + highest - z_low) / step_z) + pad)
    # Only points of heights that a beam and its surroundings may have: most are of the road
    first, n_z = k_low - n_beam - n_clear, k_high - k_low + n_beam + 2 * n_clear + 2
    s, u, layer = np.empty(n), np.empty(n), np.empty(n, dtype=np.int64)
    m = 0
    for i in range(n):
        k = int((work[i, 2] - z_low) / step_z) + pad + 1 - first
        if k >= 1 and k < n_z:
            s[m], u[m], layer[m] = work[i, 0], work[i, 1], k
            m += 1
    if m < least or k_low >= k_high:
        return 0
    counts = np.zeros((n_u, n_z))
    below_top = np.zeros(n_z)
    found = 0
    best = np.zeros(n_u)
    best_turn = np.zeros(n_u)
    best_top = np.zeros(n_u)
    for t in range(len(turns)):
        tan = np.tan(turns[t])
        counts[:] = 0.0
        for i in range(m):
            b = int((u[i] - tan * s[i] + half_u) / step_u)
            if b >= 0 and b < n_u:
                counts[b, layer[i]] += 1.0
        for b in range(n_u - 1):
            for k in range(1, n_z):
                below_top[k] = below_top[k - 1] + counts[b, k] + counts[b + 1, k]
            if below_top[n_z - 1] < least:
                continue
            for k in range(k_low - first, k_high - first):
                # the beam fills bins k - n_beam + 1 .. k; a bin on either side is left to blur
                inside = below_top[k + 1] - below_top[k + 1 - n_beam]
                if inside < least or inside <= best[b]:
                    continue
                above = below_top[k + 2 + n_clear] - below_top[k + 2]
                below = below_top[k - n_beam] - below_top[k - n_beam - n_clear]
                score = inside - 2.0 * (above + below) * n_beam / n_clear
                if score > best[b] and score >= clarity * inside:
                    best[b] = score
                    best_turn[b] = turns[t]
                    best_top[b] = z_low + (k + first - pad + 1) * step_z
    while found < len(out):
        b = int(np.argmax(best))
        if best[b] < least:
            break
        offset = (b + 1.0) * step_u - half_u
        if _filled_along(work, n, np.tan(best_turn[b]), offset, step_u, best_top[b], beam, box[4]) >= 0.6:
            out[found, 0] = best_turn[b]
            out[found, 1] = offset
            out[found, 2] = best_top[b]
            out[found, 3] = best[b]
            found += 1
        for k in range(max(b - 2, 0), min(b + 3, n_u)):
            best[k] = 0.0
    return found


@njit(cache=True, nogil=True)
def find_beam_starts(
    points: FloatArray,
    starts: IntArray,
    n_x: int,
    n_y: int,
    cell: float,
    segments: FloatArray,
    turns: FloatArray,
    shape: FloatArray,
    work: FloatArray,
) -> FloatArray:
    """Find beams in the boxes about segments (n, 4: x, y of both ends); see `find_beams`.

    Returns (m, 5): x, y, heading, top z, score.
    """
    places, out = np.empty((6, 4)), np.empty((6 * len(segments), 5))
    box = np.empty(8)
    box[5], box[6], box[7] = 0.35, -1.0, 2.2
    m = 0
    for i in range(len(segments)):
        dx, dy = segments[i, 2] - segments[i, 0], segments[i, 3] - segments[i, 1]
        heading = np.arctan2(dy, dx)
        box[0], box[1] = 0.5 * (segments[i, 0] + segments[i, 2]), 0.5 * (segments[i, 1] + segments[i, 3])
        box[2], box[3], box[4] = np.cos(heading), np.sin(heading), 0.5 * np.hypot(dx, dy)
        n = find_beams(points, starts, n_x, n_y, cell, box, turns, shape, work, places)
        for k in range(n):
            u = places[k, 1]
            out[m, 0], out[m, 1] = box[0] - u * box[3], box[1] + u * box[2]
            out[m, 2], out[m, 3], out[m, 4] = heading + places[k, 0], places[k, 2], places[k, 3]
            m += 1
    return out[:m].copy()


@njit(cache=True, nogil=True)
def top_edge(work: FloatArray, n: int, u: float, half_width: float, top: float, reach: float) -> float:
    """Return the highest point under the edge that best parts a beam from what is above it; NaN if none.

    Edges within `reach` of `top` are tried. The best has most points in the 0.30 m below it, less twice
    what equal areas right above and below the beam hold: a bush over a rail does not lift it.
    """
    z = np.empty(n)
    m = 0
    for i in range(n):
        if abs(work[i, 1] - u) <= half_width:
            z[m] = work[i, 2]
            m += 1
    best, edge = 0.0, np.nan
    e = top - reach
    while e <= top + reach + 1e-9:
        inside, outside, highest = 0, 0, -1e9
        for i in range(m):
            d = e - z[i]
            under = (d >= 0.0) & (d < 0.30)
            inside += int(under)
            highest = max(highest, z[i] if under else -1e9)
            outside += int(((d < 0.0) & (d >= -0.10)) | ((d >= 0.36) & (d < 0.46)))
        score = inside - 3.0 * outside
        if score > best:  # the lowest of equal edges: it ends on a point
            best = score
            edge = highest
        e += 0.02
    return edge


@njit(cache=True, nogil=True)
def fit_locally(
    s: FloatArray, v: FloatArray, weight: FloatArray, half_window: float
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Fit v(s) by a quadratic about every node; return value, slope, residual rms and effective number.

    Weights fall off as a tricube towards the window's ends. What is fitted is the difference from the node's
    own value, so that the result does not depend on where the origin is.
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
            m[p, p] += 1e-6 * w_total
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
    """Fit many lines like `fit_locally`, each for itself: line i has nodes offsets[i] to offsets[i + 1]."""
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
    work: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Measure the cross-section at every node (x, y, heading, top z).

    Returns
    -------
    sheet
        (n, 4): points of the sheet within `radius`, their mean offset and spread, the highest point under
        the top edge.
    depth
        (n, 2, DEPTH_BINS): points within `radius`, left and right of the line, not on the ground, per 5 cm
        below the top edge, from 0.70 m above it.
    sides
        (n, 4, 2): points left and right of it within `reach`: at the sheet's heights; below them (deeper
        than 0.36 m under the top); on the ground (lower than 0.12 m); and within 0.40 m between ground
        and sheet (0.36 to 0.62 m under the top).
    edge
        (n,): mean offset of the sheet's points 2 to 10 cm below the top; NaN where none.
    """
    n_nodes = len(nodes)
    sheet = np.zeros((n_nodes, 4))
    depth = np.zeros((n_nodes, 2, DEPTH_BINS))
    sides = np.zeros((n_nodes, 4, 2))
    edge = np.full(n_nodes, np.nan)
    box = np.empty(8)
    box[4], box[5], box[6], box[7] = half_s, reach, -10.0, 10.0
    for i in range(n_nodes):
        box[0], box[1] = nodes[i, 0], nodes[i, 1]
        box[2], box[3] = np.cos(nodes[i, 2]), np.sin(nodes[i, 2])
        top = nodes[i, 3]
        n = gather_in_box(points, starts, n_x, n_y, cell, box, work)
        number, total, square = 0, 0.0, 0.0
        n_edge, u_edge = 0, 0.0
        for k in range(n):
            below = top - work[k, 2]
            u = work[k, 1]
            side = 0 if u > 0 else 1
            inside = below > -0.03 and below < 0.33 and work[k, 3] >= BEAM_FLOOR_M
            if below >= 0.36 and below <= 0.62 and abs(u) <= 0.40 and work[k, 3] >= 0.12:
                sides[i, 3, side] += 1.0
            if abs(u) <= radius:
                b = int(np.floor((below + DEPTH_ABOVE_M) / DEPTH_BIN_M))
                if b >= 0 and b < DEPTH_BINS and work[k, 3] >= BEAM_FLOOR_M:
                    depth[i, side, b] += 1.0
                if inside:
                    number += 1
                    total += u
                    square += u * u
                if below >= 0.02 and below <= 0.10:
                    n_edge += 1
                    u_edge += u
                continue
            if inside:
                sides[i, 0, side] += 1.0
            if below >= 0.36:
                sides[i, 1, side] += 1.0
            if work[k, 3] < 0.12:
                sides[i, 2, side] += 1.0
        if n_edge > 0:
            edge[i] = u_edge / n_edge
        sheet[i, 0] = number
        if number > 0:
            mean = total / number
            sheet[i, 1] = mean
            sheet[i, 2] = np.sqrt(max(square / number - mean * mean, 0.0))
        sheet[i, 3] = top_edge(work, n, 0.0, 0.75 * radius, top, 0.06)
    return sheet, depth, sides, edge
