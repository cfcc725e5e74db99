"""Kernels over the points in boxes about a line: which points a box holds, and beams in end view.

Positions are local: x east and y north of the bins' south-west corner, z above a local origin. [m]
Points and their bins are those of `linework.kernels.cells.bins.sort_into_bins`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from linework.arrays import FloatArray, IntArray
from linework.kernels.cells.bins import BIN_HEIGHT, BIN_X, BIN_Y, BIN_Z, LayeredBins, layer_of

#: Columns of the points of a box: along and to the left of its axis, z, height above the road. [m]
LOCAL_ALONG, LOCAL_LEFT, LOCAL_Z, LOCAL_HEIGHT = 0, 1, 2, 3
#: Columns of a beam in a box: turn against the box [rad], offset to the left [m], top z [m], score [points].
BEAM_TURN, BEAM_OFFSET, BEAM_TOP, BEAM_SCORE = 0, 1, 2, 3
#: Columns of a node and of a start: x, y [m], heading [rad], top z [m]; of a start also its score [points].
NODE_X, NODE_Y, NODE_HEADING, NODE_TOP, START_SCORE = 0, 1, 2, 3, 4

#: Most beams found in one box.
_MOST_BEAMS = 6
#: Half width of the box about a seed segment, which is good to a cell of 0.20 m. [m]
_SEED_HALF_WIDTH_M = 0.35
#: Range of heights above the road of the box about a seed segment: foot of a bank to above a rail. [m]
_SEED_LOW_M, _SEED_HIGH_M = -1.0, 2.2
#: Step between tried tops of a beam. [m]
_TOP_STEP_M = 0.05
#: Weight of points right above and below a beam, per equal area.
_CLEAR_WEIGHT = 2.0
#: Density of a sheet below the height of a beam, against that of the beam's height: one head sees the upper half of a
#: fence, two the lower one, or the other way round.
_SHEET_SHARE = 0.5
#: Fewest points of a sheet on the height of a beam, in those of a beam: what a wall's noise leaves beside it is thinner.
_LEAST_SHEET = 4.0
#: Share of these points that must remain when those above are subtracted: one in seven is above, in equal areas.
_EDGE_CLARITY = 0.7
#: Score of a sheet over the least of a beam, per point: a sheet shows one free edge where a beam shows two, so that a beam
#: at the same place comes first.
_ONE_EDGE = 0.01
#: Length of the pieces of a box that a beam must fill: two scan lines each at the widest spacing. [m]
_FILLED_STEP_M = 0.5
#: Least share of these pieces with a point. Tuned on simulated surveys of seeds 1 to 4; see docs/methods/radon.md.
_LEAST_FILLED = 0.6


class TurnedBox(NamedTuple):
    """A box about a place, turned to a direction: centre [m], unit direction, half sizes and heights [m]."""

    x: float
    y: float
    ahead_x: float
    ahead_y: float
    half_along: float
    half_across: float
    low: float
    high: float


class BeamShape(NamedTuple):
    """What a beam looks like from its end, for `find_beams`.

    Parameters
    ----------
    strip, beam, clear
        Width of a strip, height of a beam, and height above and below it that is to be clear. [m]
    least, clarity
        Fewest points, and the least share of them that the score must reach.
    lowest, highest
        Range of the top above the road. [m]
    sheet, highest_sheet
        How far below its upper edge a sheet is seen, and the highest that this edge is above the road. [m]
    """

    strip: float
    beam: float
    clear: float
    least: float
    clarity: float
    lowest: float
    highest: float
    sheet: float
    highest_sheet: float


@njit(cache=True, nogil=True)
def crossed(half: float, a: float, b: float, south: float, north: float) -> tuple[float, float]:
    """Return the range of x [m] in which the strip ``|a x + b y| <= half`` crosses the row south <= y <= north."""
    if abs(a) < 1e-6:
        return -1e9, 1e9
    reach = half / abs(a) + 1e-6  # a hair wider, for rounding
    return -max(b * south / a, b * north / a) - reach, -min(b * south / a, b * north / a) + reach


@njit(cache=True, nogil=True)
def gather_in_box(
    points: FloatArray, starts: IntArray, n_x: int, n_y: int, cell: float, box: TurnedBox, out: FloatArray
) -> int:
    """Collect the points in a turned box and return their number.

    Parameters
    ----------
    points, starts, n_x, n_y, cell
        Binned points (n, 4), their bins, number and side of the bins [m].
    box
        The box; `low` and `high` are heights above the road.
    out
        (m, 4), written; columns `LOCAL_ALONG` to `LOCAL_HEIGHT` [m]. What does not fit is left out.
    """
    x0, y0, dx, dy, half_s, half_u, low, high = box
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
            h = points[i, BIN_HEIGHT]
            ex, ey = points[i, BIN_X] - x0, points[i, BIN_Y] - y0
            s = ex * dx + ey * dy
            u = ey * dx - ex * dy
            inside = (abs(s) <= half_s) & (abs(u) <= half_u) & (h >= low) & (h <= high) & (n < last)
            # Written whether kept or not: a branch here cannot be predicted, and halves the speed
            out[n, LOCAL_ALONG], out[n, LOCAL_LEFT] = s, u
            out[n, LOCAL_Z], out[n, LOCAL_HEIGHT] = points[i, BIN_Z], h
            n += int(inside)
    return n


@njit(cache=True, nogil=True)
def gather_level(
    points: FloatArray,
    layers: LayeredBins,
    frame: tuple[int, int, float],
    box: TurnedBox,
    level: tuple[float, float],
    out: FloatArray,
) -> int:
    """Collect the points of a box between two heights, by layers, and return their number.

    Parameters
    ----------
    points, layers, frame
        Binned points (n, 4), their layers and bins.
    box, out
        See `gather_in_box`.
    level
        Lowest and highest z. [m]
    """
    slot, floor, begin = layers
    n_x, n_y, cell = frame
    last = len(out) - 1
    x0, y0, dx, dy, half_s, half_u, low, high = box
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
                z, h = points[i, BIN_Z], points[i, BIN_HEIGHT]
                ex, ey = points[i, BIN_X] - x0, points[i, BIN_Y] - y0
                s = ex * dx + ey * dy
                u = ey * dx - ex * dy
                inside = (abs(s) <= half_s) & (abs(u) <= half_u) & (h >= low) & (h <= high)
                inside = inside & (z >= level[0]) & (z <= level[1]) & (n < last)
                # Written whether kept or not: a branch here cannot be predicted
                out[n, LOCAL_ALONG], out[n, LOCAL_LEFT] = s, u
                out[n, LOCAL_Z], out[n, LOCAL_HEIGHT] = z, h
                n += int(inside)
    return n


@njit(cache=True, nogil=True)
def _filled_along(
    work: FloatArray, n: int, tan: float, u: float, half_width: float, top: float, beam: float, half_s: float
) -> float:
    """Return the share of the pieces along a strip (`_FILLED_STEP_M`) in which the beam has a point."""
    n_bins = max(int(2 * half_s / _FILLED_STEP_M), 1)
    filled = np.zeros(n_bins)
    for i in range(n):
        d = top - work[i, LOCAL_Z]
        if (
            d >= -_TOP_STEP_M
            and d <= beam
            and abs(work[i, LOCAL_LEFT] - tan * work[i, LOCAL_ALONG] - u) <= half_width
        ):
            filled[min(int((work[i, LOCAL_ALONG] + half_s) / _FILLED_STEP_M), n_bins - 1)] = 1.0
    return float(np.sum(filled)) / n_bins


@njit(cache=True, nogil=True)
def find_beams(
    points: FloatArray,
    starts: IntArray,
    n_x: int,
    n_y: int,
    cell: float,
    box: TurnedBox,
    turns: FloatArray,
    shape: BeamShape,
    work: FloatArray,
    out: FloatArray,
) -> int:
    """Find the beams in a box, in end view, and return their number.

    The Radon transform of the points themselves over a few small turns, in strips across (u) and in
    height (z). A beam is a strip with points over its height and none above it and none below it: its
    score is their number, less twice those in equal areas above and below. Of a sheet, such as a fence of mesh,
    only the upper edge is free; it is found by that, where the sheet is seen down to twice the height of a beam.

    Parameters
    ----------
    points, starts, n_x, n_y, cell, box
        See `gather_in_box`.
    turns
        (k,) directions that are tried, against the box. [rad]
    shape
        Shape of a beam.
    work
        (m, 4) scratch: the points of the box.
    out
        (most, 4), written; columns `BEAM_TURN` to `BEAM_SCORE`. Beams differ by two strips or more.
    """
    strip, beam, clear, least, clarity, lowest, highest, sheet, highest_sheet = shape
    n = gather_in_box(points, starts, n_x, n_y, cell, box, work)
    if n < least:
        return 0
    z_low, level = np.inf, 0.0
    for i in range(n):
        z_low = min(z_low, work[i, LOCAL_Z])
        level += (work[i, LOCAL_Z] - work[i, LOCAL_HEIGHT]) / n  # of the road
    half_u, step_u, step_z = box.half_across, 0.5 * strip, _TOP_STEP_M
    n_u = int(2 * half_u / step_u) + 2
    n_beam, n_clear, n_sheet = round(beam / step_z), round(clear / step_z), round(sheet / step_z)
    # A sheet is told by the lower half of the second beam's height: a concrete barrier slopes away there
    n_half = max(n_beam // 2, 1)
    n_deep = max(n_beam + n_clear, n_sheet)
    pad = n_deep + 1
    z_top = z_low
    for i in range(n):
        z_top = max(z_top, work[i, LOCAL_Z])
    k_low = max(pad, int((level + lowest - z_low) / step_z) + pad)
    k_beam = int((level + highest - z_low) / step_z) + pad
    # What is seen below its edge is the sheet's own, not the ground's
    k_sheet = int((level + sheet + clear - z_low) / step_z) + pad
    k_high = max(k_beam, int((level + highest_sheet - z_low) / step_z) + pad)
    k_high = min(k_high, int((z_top - z_low) / step_z) + 1 + pad)
    # Only points at heights that a beam and its surroundings may have: most points are of the road
    first, n_z = k_low - n_deep, k_high - k_low + n_deep + n_clear + 2
    s, u, layer = np.empty(n), np.empty(n), np.empty(n, dtype=np.int64)
    m = 0
    for i in range(n):
        k = int((work[i, LOCAL_Z] - z_low) / step_z) + pad + 1 - first
        if k >= 1 and k < n_z:
            s[m], u[m], layer[m] = work[i, LOCAL_ALONG], work[i, LOCAL_LEFT], k
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
                under = below_top[k + 1 - n_sheet + n_half] - below_top[k + 1 - n_sheet]
                below = below_top[k - n_beam] - below_top[k - n_beam - n_clear]
                score = inside - _CLEAR_WEIGHT * (above + below) * n_beam / n_clear
                if k >= k_beam - first or score < clarity * inside:
                    # No beam: a sheet, if it is seen down to the ground and nothing is above it
                    score = inside - _CLEAR_WEIGHT * above * n_beam / n_clear
                    if k < k_sheet - first or inside < _LEAST_SHEET * least:
                        continue
                    if under * n_beam < _SHEET_SHARE * inside * n_half or score < _EDGE_CLARITY * inside:
                        continue
                    score = least + _ONE_EDGE * score
                if score > best[b]:
                    best[b] = score
                    best_turn[b] = turns[t]
                    best_top[b] = z_low + (k + first - pad + 1) * step_z
    while found < len(out):
        b = int(np.argmax(best))
        if best[b] < least:
            break
        offset = (b + 1.0) * step_u - half_u
        filled = _filled_along(
            work, n, np.tan(best_turn[b]), offset, step_u, best_top[b], beam, box.half_along
        )
        if filled >= _LEAST_FILLED:
            out[found, BEAM_TURN] = best_turn[b]
            out[found, BEAM_OFFSET] = offset
            out[found, BEAM_TOP] = best_top[b]
            out[found, BEAM_SCORE] = best[b]
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
    shape: BeamShape,
    work: FloatArray,
) -> FloatArray:
    """Find the beams in the boxes about seed segments.

    Parameters
    ----------
    points, starts, n_x, n_y, cell, turns, shape, work
        See `find_beams`.
    segments
        (n, 4) x and y of both ends. [m]

    Returns
    -------
    (m, 5) starts: columns `NODE_X` to `START_SCORE`.
    """
    places, out = np.empty((_MOST_BEAMS, 4)), np.empty((_MOST_BEAMS * len(segments), 5))
    m = 0
    for i in range(len(segments)):
        dx, dy = segments[i, 2] - segments[i, 0], segments[i, 3] - segments[i, 1]
        heading = np.arctan2(dy, dx)
        box = TurnedBox(
            0.5 * (segments[i, 0] + segments[i, 2]),
            0.5 * (segments[i, 1] + segments[i, 3]),
            np.cos(heading),
            np.sin(heading),
            0.5 * np.hypot(dx, dy),
            _SEED_HALF_WIDTH_M,
            _SEED_LOW_M,
            _SEED_HIGH_M,
        )
        n = find_beams(points, starts, n_x, n_y, cell, box, turns, shape, work, places)
        for k in range(n):
            u = places[k, BEAM_OFFSET]
            out[m, NODE_X], out[m, NODE_Y] = box.x - u * box.ahead_y, box.y + u * box.ahead_x
            out[m, NODE_HEADING] = heading + places[k, BEAM_TURN]
            out[m, NODE_TOP], out[m, START_SCORE] = places[k, BEAM_TOP], places[k, BEAM_SCORE]
            m += 1
    return out[:m].copy()
