"""Loops over the points near a line: binning, gathering in a box, circles, following, profiles.

Positions are local: x east and y north of the bins' south-west corner, z above a local origin. [m]
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

F64 = npt.NDArray[np.float64]
F32 = npt.NDArray[np.float32]
I64 = npt.NDArray[np.int64]
Mask = npt.NDArray[np.bool_]

DEPTH_BINS = 30  # of 5 cm: from 0.30 m above the top edge to 1.20 m below it
DEPTH_ABOVE_M = 0.30
DEPTH_BIN_M = 0.05


@njit(cache=True, nogil=True)
def near_mask(
    xyz: F64, height: F32, west: float, north: float, cell: float, near: Mask, low: float, high: float
) -> I64:
    """Return the indices of the points in the height range that lie on a set cell of a north-up image."""
    n_rows, n_cols = near.shape
    out = np.empty(len(xyz), dtype=np.int64)
    n = 0
    for i in range(len(xyz)):
        if height[i] < low or height[i] > high:
            continue
        c = int(np.floor((xyz[i, 0] - west) / cell))
        r = int(np.floor((north - xyz[i, 1]) / cell))
        if r >= 0 and r < n_rows and c >= 0 and c < n_cols and near[r, c]:
            out[n] = i
            n += 1
    return out[:n]


@njit(cache=True, nogil=True)
def bin_order(x: F64, y: F64, cell: float, n_x: int, n_y: int) -> tuple[I64, I64]:
    """Return a stable order of points by bin (row-major from the south-west), and the bins' starts."""
    starts = np.zeros(n_x * n_y + 1, dtype=np.int64)
    bins = np.empty(len(x), dtype=np.int64)
    for i in range(len(x)):
        b = int(y[i] / cell) * n_x + int(x[i] / cell)
        bins[i] = b
        starts[b + 1] += 1
    for b in range(n_x * n_y):
        starts[b + 1] += starts[b]
    fill = starts[:-1].copy()
    order = np.empty(len(x), dtype=np.int64)
    for i in range(len(x)):
        order[fill[bins[i]]] = i
        fill[bins[i]] += 1
    return order, starts


@njit(cache=True, nogil=True)
def gather(points: F64, starts: I64, n_x: int, n_y: int, cell: float, box: F64, out: F64) -> int:
    """Collect the points in a turned box into `out` (s along, u left, z, height above road); return how many.

    box: centre x, y, direction x, y, half length, half width, lowest height, highest height.
    """
    x0, y0, dx, dy = box[0], box[1], box[2], box[3]
    half_s, half_u, low, high = box[4], box[5], box[6], box[7]
    reach_x = abs(dx) * half_s + abs(dy) * half_u
    reach_y = abs(dy) * half_s + abs(dx) * half_u
    c0, c1 = int(np.floor((x0 - reach_x) / cell)), int(np.floor((x0 + reach_x) / cell))
    r0, r1 = int(np.floor((y0 - reach_y) / cell)), int(np.floor((y0 + reach_y) / cell))
    n = 0
    for r in range(max(r0, 0), min(r1, n_y - 1) + 1):
        for c in range(max(c0, 0), min(c1, n_x - 1) + 1):
            b = r * n_x + c
            for i in range(starts[b], starts[b + 1]):
                h = points[i, 3]
                if h < low or h > high:
                    continue
                ex, ey = points[i, 0] - x0, points[i, 1] - y0
                s = ex * dx + ey * dy
                u = ey * dx - ex * dy
                if abs(s) <= half_s and abs(u) <= half_u and n < len(out):
                    out[n, 0] = s
                    out[n, 1] = u
                    out[n, 2] = points[i, 2]
                    out[n, 3] = h
                    n += 1
    return n


@njit(cache=True, nogil=True)
def _filled_along(
    work: F64, n: int, tan: float, u: float, half_width: float, top: float, beam: float, half_s: float
) -> float:
    """Return the share of half metres along a strip in which the beam has a point."""
    n_bins = max(int(2 * half_s / 0.5), 1)
    filled = np.zeros(n_bins)
    for i in range(n):
        d = top - work[i, 2]
        if d >= -0.05 and d <= beam and abs(work[i, 1] - tan * work[i, 0] - u) <= half_width:
            filled[min(int((work[i, 0] + half_s) / 0.5), n_bins - 1)] = 1.0
    return filled.mean()


@njit(cache=True, nogil=True)
def find_beams(
    points: F64,
    starts: I64,
    n_x: int,
    n_y: int,
    cell: float,
    box: F64,
    turns: F64,
    shape: F64,
    work: F64,
    out: F64,
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
    n = gather(points, starts, n_x, n_y, cell, box, work)
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
    n_z = int((z_top - z_low) / step_z) + 1 + 2 * pad
    counts = np.zeros((n_u, n_z + 1))
    found = 0
    best = np.zeros(n_u)
    best_turn = np.zeros(n_u)
    best_top = np.zeros(n_u)
    for t in range(len(turns)):
        tan = np.tan(turns[t])
        counts[:] = 0.0
        for i in range(n):
            b = int((work[i, 1] - tan * work[i, 0] + half_u) / step_u)
            if b >= 0 and b < n_u:
                counts[b, int((work[i, 2] - z_low) / step_z) + pad + 1] += 1.0
        for b in range(n_u):
            for k in range(n_z):
                counts[b, k + 1] += counts[b, k]
        for b in range(n_u - 1):
            k_low = max(pad, int((level + lowest - z_low) / step_z) + pad)
            k_high = min(n_z - pad, int((level + highest - z_low) / step_z) + pad)
            for k in range(k_low, k_high):
                # the beam fills bins k - n_beam + 1 .. k; a bin on either side is left to blur
                top = counts[b, k + 1] + counts[b + 1, k + 1]
                low = counts[b, k + 1 - n_beam] + counts[b + 1, k + 1 - n_beam]
                inside = top - low
                if inside < least or inside <= best[b]:
                    continue
                above = counts[b, k + 2 + n_clear] + counts[b + 1, k + 2 + n_clear]
                above -= counts[b, k + 2] + counts[b + 1, k + 2]
                below = counts[b, k - n_beam] + counts[b + 1, k - n_beam]
                below -= counts[b, k - n_beam - n_clear] + counts[b + 1, k - n_beam - n_clear]
                score = inside - 2.0 * (above + below) * n_beam / n_clear
                if score > best[b] and score >= clarity * inside:
                    best[b] = score
                    best_turn[b] = turns[t]
                    best_top[b] = z_low + (k - pad + 1) * step_z
    while found < len(out):
        b = int(np.argmax(best))
        if best[b] < least:
            break
        u = (b + 1.0) * step_u - half_u
        if _filled_along(work, n, np.tan(best_turn[b]), u, step_u, best_top[b], beam, box[4]) >= 0.6:
            out[found, 0] = best_turn[b]
            out[found, 1] = u
            out[found, 2] = best_top[b]
            out[found, 3] = best[b]
            found += 1
        for k in range(max(b - 2, 0), min(b + 3, n_u)):
            best[k] = 0.0
    return found


@njit(cache=True, nogil=True)
def mark(nodes: F64, first: int, heads: I64, following: I64, n_x: int, n_y: int, cell: float) -> None:
    """Enter nodes[first:] (x, y, heading) into the cells' chains: `heads` per cell, `following` per node."""
    for i in range(first, len(nodes)):
        c, r = int(np.floor(nodes[i, 0] / cell)), int(np.floor(nodes[i, 1] / cell))
        if c >= 0 and c < n_x and r >= 0 and r < n_y:
            following[i] = heads[r * n_x + c]
            heads[r * n_x + c] = i


@njit(cache=True, nogil=True)
def marked(
    nodes: F64,
    entered: F64,
    heads: I64,
    following: I64,
    n_x: int,
    n_y: int,
    cell: float,
    along: float,
    across: float,
) -> Mask:
    """Return which nodes (x, y, heading) lie on an entered one: near it, across it even nearer, parallel."""
    out = np.zeros(len(nodes), dtype=np.bool_)
    for i in range(len(nodes)):
        x, y = nodes[i, 0], nodes[i, 1]
        c, r = int(np.floor(x / cell)), int(np.floor(y / cell))
        for rr in range(max(r - 1, 0), min(r + 2, n_y)):
            for cc in range(max(c - 1, 0), min(c + 2, n_x)):
                k = heads[rr * n_x + cc]
                while k >= 0 and not out[i]:
                    dx, dy, angle = x - entered[k, 0], y - entered[k, 1], entered[k, 2]
                    cos, sin = np.cos(angle), np.sin(angle)
                    if (
                        abs(dx * cos + dy * sin) <= along
                        and abs(dy * cos - dx * sin) <= across
                        and abs(np.sin(nodes[i, 2] - angle)) < 0.34  # 20 degrees
                    ):
                        out[i] = True
                    k = following[k]
    return out


@njit(cache=True, nogil=True)
def circle_centre(
    work: F64, n: int, u_start: float, radius: float, z_low: float, z_high: float
) -> tuple[float, int, float]:
    """Return offset, number and spread of the points that a circle grown about `u_start` settles on.

    The circle moves to the mean of the points it holds until it rests (mean shift).
    """
    u = u_start
    number = 0
    spread = 0.0
    for _ in range(6):
        total, square, number = 0.0, 0.0, 0
        for i in range(n):
            if work[i, 2] < z_low or work[i, 2] > z_high:
                continue
            d = work[i, 1] - u
            if abs(d) <= radius:
                total += d
                square += d * d
                number += 1
        if number == 0:
            return u, 0, 0.0
        shift = total / number
        spread = np.sqrt(max(square / number - shift * shift, 0.0))
        u += shift
        if abs(shift) < 0.001:
            break
    return u, number, spread


@njit(cache=True, nogil=True)
def top_edge(work: F64, n: int, u: float, half_width: float, top: float, reach: float) -> float:
    """Return the highest point under the edge that best parts a beam from what is above it; NaN if none.

    Edges within `reach` of `top` are tried. The best has most points in the 0.30 m below it, less twice
    what equal areas right above and below the beam hold: a bush over a rail does not lift it.
    """
    best, edge = 0.0, np.nan
    e = top - reach
    while e <= top + reach + 1e-9:
        inside, outside, highest = 0, 0, -1e9
        for i in range(n):
            if abs(work[i, 1] - u) > half_width:
                continue
            d = e - work[i, 2]
            if d >= 0.0 and d < 0.30:
                inside += 1
                highest = max(highest, work[i, 2])
            elif (d < 0.0 and d >= -0.10) or (d >= 0.36 and d < 0.46):
                outside += 1
        score = inside - 3.0 * outside
        if score > best:  # the lowest of equal edges: it ends on a point
            best = score
            edge = highest
        e += 0.02
    return edge


@njit(cache=True, nogil=True)
def follow(
    points: F64,
    starts: I64,
    n_x: int,
    n_y: int,
    cell: float,
    start: F64,
    setting: F64,
    work: F64,
    out: F64,
) -> int:
    """Follow a thin sheet of points from `start` by circles at a fixed spacing; return the number of nodes.

    start: x, y, direction x, y, top z.
    setting: spacing, circle radius, largest gap, half length, lowest and highest height, sheet height.
    out, per node: x, y, heading, top z, number of points, spread, measured (1) or predicted (0).
    A Kalman filter carries lateral offset, heading and curvature; another the top's height and slope.
    """
    spacing, radius, max_gap, half_s = setting[0], setting[1], setting[2], setting[3]
    low, high, sheet = setting[4], setting[5], setting[6]
    x, y = start[0], start[1]
    heading = np.arctan2(start[3], start[2])
    curvature = 0.0
    top, slope = start[4], 0.0
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
        n = gather(points, starts, n_x, n_y, cell, box, work)
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
def fit_locally(s: F64, v: F64, weight: F64, half_window: float) -> tuple[F64, F64, F64, F64]:
    """Fit v(s) by a quadratic about every node; return value, slope, residual rms and effective number.

    Weights fall off as a tricube towards the window's ends.
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
                    b[p] += w * basis[p] * v[k]
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
        value[i], slope[i] = c[0], c[1] / half_window
        total = 0.0
        k = first
        while k < n and s[k] <= s[i] + half_window:
            d = (s[k] - s[i]) / half_window
            w = weight[k] * (1.0 - abs(d) ** 3) ** 3
            r = v[k] - (c[0] + c[1] * d + c[2] * d * d)
            total += w * r * r
            k += 1
        rms[i] = np.sqrt(total / w_total)
        effective[i] = w_total * w_total / w_square
    return value, slope, rms, effective


@njit(cache=True, nogil=True)
def profile_along(
    points: F64,
    starts: I64,
    n_x: int,
    n_y: int,
    cell: float,
    nodes: F64,
    half_s: float,
    radius: float,
    reach: float,
    work: F64,
) -> tuple[F64, F64, F64, F64]:
    """Measure the cross-section at every node (x, y, heading, top z).

    Returns
    -------
    sheet
        (n, 6): points of the sheet within `radius`, their mean offset and spread, the highest point under
        the top edge, lowest and highest s of them.
    depth
        (n, 2, DEPTH_BINS): points within `radius`, left and right of the line, per 5 cm below the top
        edge, from 0.30 m above it.
    sides
        (n, 4, 2): points left and right of it within `reach`: at the sheet's heights; below them (deeper
        than 0.45 m under the top); on the ground (lower than 0.12 m); and within 0.40 m between ground
        and sheet (0.36 to 0.62 m under the top).
    edge
        (n,): mean offset of the sheet's points 2 to 10 cm below the top; NaN where none.
    """
    n_nodes = len(nodes)
    sheet = np.zeros((n_nodes, 6))
    depth = np.zeros((n_nodes, 2, DEPTH_BINS))
    sides = np.zeros((n_nodes, 4, 2))
    edge = np.full(n_nodes, np.nan)
    box = np.empty(8)
    box[4], box[5], box[6], box[7] = half_s, reach, -10.0, 10.0
    for i in range(n_nodes):
        box[0], box[1] = nodes[i, 0], nodes[i, 1]
        box[2], box[3] = np.cos(nodes[i, 2]), np.sin(nodes[i, 2])
        top = nodes[i, 3]
        n = gather(points, starts, n_x, n_y, cell, box, work)
        number, total, square = 0, 0.0, 0.0
        n_edge, u_edge = 0, 0.0
        s_low, s_high = np.inf, -np.inf
        for k in range(n):
            below = top - work[k, 2]
            u = work[k, 1]
            side = 0 if u > 0 else 1
            inside = below > -0.03 and below < 0.33
            if below >= 0.36 and below <= 0.62 and abs(u) <= 0.40 and work[k, 3] >= 0.12:
                sides[i, 3, side] += 1.0
            if abs(u) <= radius:
                b = int(np.floor((below + DEPTH_ABOVE_M) / DEPTH_BIN_M))
                if b >= 0 and b < DEPTH_BINS:
                    depth[i, side, b] += 1.0
                if inside:
                    number += 1
                    total += u
                    square += u * u
                    s_low, s_high = min(s_low, work[k, 0]), max(s_high, work[k, 0])
                if below >= 0.02 and below <= 0.10:
                    n_edge += 1
                    u_edge += u
                continue
            if inside:
                sides[i, 0, side] += 1.0
            if below >= 0.45:
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
            sheet[i, 4], sheet[i, 5] = s_low, s_high
        sheet[i, 3] = top_edge(work, n, 0.0, 0.75 * radius, top, 0.06)
    return sheet, depth, sides, edge
