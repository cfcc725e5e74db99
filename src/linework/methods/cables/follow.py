"""Wires in the vertical slice of a seed line, each followed to its ends."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from linework.arrays import BoolArray, FloatArray, IntArray
from linework.kernels.cables import search as kernels
from linework.kernels.cables import tube
from linework.methods.cables.band import RING, Widths
from linework.methods.cables.seeds import Seed

#: Sides of a cell of a slice along, up and across: one vote per half metre of wire, whatever its number of points. [m]
SLICE_ALONG_M, UP_M, SLICE_ACROSS_M = 0.5, 0.1, 0.2
#: Slopes and curvatures [1/m] that are tried in a slice. Half a step moves the end of a 24 m window by 6 cm; 0.02 per m
#: is a wire of 30 m that sags 2.2 m; a 15 m drop line to a house may rise by a third.
SLOPES = np.arange(-35, 36) * 0.01
CURVATURES = np.array([0.0, 0.0015, 0.004, 0.008, 0.014, 0.022])
#: Fewest votes, half metres of wire, of a curve in the slice.
LEAST_VOTES = 7
#: Shortest length of a wire in a slice. [m]
LEAST_SEEN_M = 4.0
#: Consecutive curves that are not wires after which a slice is given up: leaves make any number of them.
MOST_FAILURES = 3
#: Least share of a wire's metres with points.
LEAST_OCCUPIED = 0.35
#: Largest share of these whose ring holds more than a third as many points as the wire.
MOST_RINGED = 0.5
#: Cells across rows of points [m], and the widest row: four deviations of the widest scatter of a wire's points, in gates.
ROW_CELL_M, MOST_ROW_GATES = 0.05, 4.0
#: Metres of a stretch in which rows are looked for, more where points are few: over longer ones a line that drifts from
#: row to row smears them. Mean number of points in a cell from which chance leaves few of them half as full.
ROW_METRES, ROW_CELL_POINTS = 4, 4.0
#: Fewest points a metre of a row: with fewer, chance makes rows of the points of a wall or of leaves. [1/m]
LEAST_ROW_POINTS_PER_M = 2.0
#: Side of a column of isolated points: a slice is a metre wide. [m]
LONELY_COLUMN_M = 2.0
#: Largest distance of a seed from the points that voted for it: the diagonal of the largest window. [m]
SEED_REACH_M = 150.0


@dataclass(frozen=True, slots=True)
class PlanLine:
    """A line in plan: stations s along the unit vector (ux, uy) from (x, y), offsets o to the left [m].

    Parameters
    ----------
    bow_per_m
        Curvature to the left at (x, y): wind pushes a wire aside in proportion to its sag. Stations are those of the
        tangent: over 300 m a bow of half a metre is 2 mm longer. [1/m]
    """

    x: float
    y: float
    ux: float
    uy: float
    bow_per_m: float = 0.0

    def stations(self, xy: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return stations and offsets of points (n, 2), (n,) each [m]."""
        dx, dy = xy[:, 0] - self.x, xy[:, 1] - self.y
        s, o = dx * self.ux + dy * self.uy, dy * self.ux - dx * self.uy
        return (s, o - self.aside(s)) if self.bow_per_m else (s, o)

    def aside(self, station_m: FloatArray) -> FloatArray:
        """Return how far to the left of its tangent the line is at stations (n,), (n,) [m]."""
        return 0.5 * self.bow_per_m * station_m * station_m

    def places(self, station_m: FloatArray) -> FloatArray:
        """Return the positions of stations (n,), (n, 2) [m]."""
        aside = self.aside(station_m)
        x, y = self.x - aside * self.uy, self.y + aside * self.ux
        return np.stack([x + station_m * self.ux, y + station_m * self.uy], axis=-1)

    def turned(self, offset_m: float, slope: float) -> PlanLine:
        """Return the straight line o = offset + slope * s in the stations of this one."""
        stretch = math.hypot(1.0, slope)
        return PlanLine(
            self.x - self.uy * offset_m,
            self.y + self.ux * offset_m,
            (self.ux - self.uy * slope) / stretch,
            (self.uy + self.ux * slope) / stretch,
        )


@dataclass(frozen=True, slots=True)
class IsolatedPoints:
    """Points that may be wires, in columns for quick access to those about a line.

    Parameters
    ----------
    xyz
        (n, 3) points. [m]
    keys, start, order, grid
        As in `linework.methods.cables.band.CableBand`.
    across_m
        Largest distance between two of them in plan. [m]
    """

    xyz: FloatArray
    keys: IntArray
    start: IntArray
    order: IntArray
    grid: FloatArray
    across_m: float

    @classmethod
    def of(cls, xyz: FloatArray) -> IsolatedPoints:
        """Sort points (n, 3) [m] into columns."""
        cells = np.floor(xyz[:, :2] / LONELY_COLUMN_M).astype(np.int64)
        west, south = cells.min(axis=0) if len(cells) else (0, 0)
        n_cols = int(cells[:, 0].max() - west) + 1 if len(cells) else 1
        key = (cells[:, 1] - south) * n_cols + cells[:, 0] - west
        order = np.argsort(key, kind="stable")
        keys, first = np.unique(key[order], return_index=True)
        grid = np.array([LONELY_COLUMN_M, float(n_cols), float(west), float(south)])
        across_m = float(np.hypot(*np.ptp(xyz[:, :2], axis=0))) if len(xyz) else 0.0
        return cls(xyz, keys, np.append(first, len(xyz)), order, grid, across_m)

    def slice(
        self, plan: PlanLine, half_width_m: float, half_length_m: float, free: BoolArray | None = None
    ) -> tuple[IntArray, FloatArray, FloatArray, FloatArray]:
        """Return the points about a line in plan, by station: indices, stations, offsets, heights, (k,) each [m].

        No points where fewer than `LEAST_VOTES` of them are `free` (n,) bool.
        """
        # A seed lies in a window about some of the points
        reach_m = min(half_length_m, self.across_m + SEED_REACH_M)
        line = np.array([plan.x, plan.y, plan.ux, plan.uy, -reach_m, reach_m])
        near: IntArray = kernels.near_segment(
            self.keys, self.start, self.order, self.grid, self.xyz[:, :2], line, half_width_m
        )
        if free is not None and np.count_nonzero(free[near]) < LEAST_VOTES:
            near = near[:0]  # the usual case: another seed led to the same wires before
        s, o = plan.stations(self.xyz[near, :2])
        z = self.xyz[near, 2]
        by = np.lexsort((z, o, s))
        return near[by], s[by], o[by], z[by]


class LinesInSlice(NamedTuple):
    """Points of lines in the slice of a seed line, indices into the isolated points.

    Parameters
    ----------
    wires
        Of each wire, followed beyond the window. Other lines may be among them: they are tested later.
    crowded
        Of each line in a narrow row with others beside or above it: wires of a bundle may be.
    """

    wires: list[IntArray]
    crowded: list[IntArray]


def follow_seed(
    lonely: IsolatedPoints, free: BoolArray, seed: Seed, *, widths: Widths, max_gap_m: float
) -> LinesInSlice:
    """Return the points of each wire in the slice of a seed line.

    Parameters
    ----------
    lonely
        Points that may be wires.
    free
        (n,) bool: points of no wire yet.
    widths
        Widths across a wire.
    max_gap_m
        Longest stretch without a point that a wire is followed over. [m]
    """
    plan = PlanLine(seed.x, seed.y, seed.ux, seed.uy)
    near, s, o, z = lonely.slice(plan, widths.slice_m, seed.half_m * math.sqrt(2.0), free)
    left = free[near]
    wires, crowded = list[IntArray](), list[IntArray]()
    failed = 0
    while failed < MOST_FAILURES and np.count_nonzero(left) >= LEAST_VOTES:
        curve = _best_curve(s, o, z, left, widths.vote_m)
        if curve is None:
            break
        member = tube.settle(s, o, z, left, curve, widths.gate_m)
        failed += 1
        left &= ~member
        if not np.any(member):
            break
        if _thin(s, o, z, member, widths):
            grown = _grown(lonely, free, plan, (s[member], o[member]), near[member], widths, max_gap_m)
            if len(grown):
                failed = 0
                left &= ~np.isin(near, grown)
                wires.append(grown)
        elif _may_be_bundle(s, o, z, member, widths):
            crowded.append(near[member])
    return LinesInSlice(wires, crowded)


def _best_curve(
    s: FloatArray, o: FloatArray, z: FloatArray, left: BoolArray, vote_m: float
) -> kernels.SliceCurve | None:
    """Return the curve with most votes in the slice, or None where none has enough.

    Every half metre has one vote, shared by its cells, so that a wall or a crown has no more than a wire.
    """
    sides = (SLICE_ALONG_M, UP_M, SLICE_ACROSS_M, vote_m)
    seen, curve = kernels.best_curve((s, o, z), left, (SLOPES, CURVATURES), sides)
    return curve if seen >= LEAST_VOTES else None


def _thin(s: FloatArray, o: FloatArray, z: FloatArray, member: BoolArray, widths: Widths) -> bool:
    """Return whether the members are long, occupied and isolated enough for a wire."""
    length, occupied, ringed = tube.thinness(s, o, z, member, widths.gates)
    return bool(length >= LEAST_SEEN_M and occupied >= LEAST_OCCUPIED and ringed <= MOST_RINGED)


def _may_be_bundle(s: FloatArray, o: FloatArray, z: FloatArray, member: BoolArray, widths: Widths) -> bool:
    """Return whether the members are long and occupied, in narrow rows with what is beside them."""
    length, occupied, _ = tube.thinness(s, o, z, member, widths.gates)
    n = np.count_nonzero(member)
    if length < LEAST_SEEN_M or occupied < LEAST_OCCUPIED or n < LEAST_ROW_POINTS_PER_M * length:
        return False
    s0 = s[member].mean()
    up = z - np.polyval(np.polyfit(s[member] - s0, z[member], 2), s - s0)
    aside = o - np.polyval(np.polyfit(s[member] - s0, o[member], 1), s - s0)
    along = (s >= s[member].min()) & (s <= s[member].max())
    return is_in_rows(s[along], aside[along], up[along], widths)


def is_in_rows(s: FloatArray, aside_m: FloatArray, up_m: FloatArray, widths: Widths) -> bool:
    """Return whether points about a line are in narrow rows, side by side or one above another, in most of its metres.

    Parameters
    ----------
    s, aside_m, up_m
        (n,) stations, offsets to its left and heights above it, of all points about it. [m]
    widths
        Widths across a wire: leaves, walls and roofs fill what is beyond the ring in both directions, decks the plane.
    """
    reach_m, ring_m = widths.crowd_m, RING * widths.gate_m
    near = (np.abs(aside_m) <= reach_m) & (np.abs(up_m) <= reach_m)
    metre = np.floor(s[near] - s.min()).astype(np.int64)
    for along, away in ((aside_m[near], up_m[near]), (up_m[near], aside_m[near])):
        is_in = np.abs(away) <= ring_m
        inside, beyond = (np.bincount(metre[part], minlength=metre.max() + 1) for part in (is_in, ~is_in))
        is_seen = inside > 0
        if is_seen.any() and (is_seen & (beyond > inside / 3.0)).sum() <= MOST_RINGED * is_seen.sum():
            return _widest_row_m(metre[is_in], along[is_in], reach_m) <= MOST_ROW_GATES * widths.gate_m
    return False


def _widest_row_m(metre: IntArray, across_m: FloatArray, reach_m: float) -> float:
    """Return the median over stretches of the width of the widest row of points, (n,) each [m]."""
    n_cells = math.ceil(2.0 * reach_m / ROW_CELL_M)
    cell = np.minimum(np.floor((across_m + reach_m) / ROW_CELL_M).astype(np.int64), n_cells - 1)
    metres_that_tell = math.ceil(ROW_CELL_POINTS * n_cells * (int(np.ptp(metre)) + 1) / len(metre))
    stretch = np.unique(metre // max(ROW_METRES, metres_that_tell), return_inverse=True)[1]
    count = np.zeros((int(stretch.max()) + 1, n_cells + 2))
    np.add.at(count, (stretch, cell + 1), 1.0)
    is_filled = count > count.sum(axis=1, keepdims=True) / n_cells / 2.0
    widest, run = np.zeros(len(count)), np.zeros(len(count))
    for column in is_filled.T:
        run = np.where(column, run + 1.0, 0.0)
        widest = np.maximum(widest, run)
    return float(np.median(widest)) * ROW_CELL_M


def _grown(
    lonely: IsolatedPoints,
    free: BoolArray,
    plan: PlanLine,
    known: tuple[FloatArray, FloatArray],
    members: IntArray,
    widths: Widths,
    max_gap_m: float,
) -> IntArray:
    """Return the points of a wire far beyond its window, along its direction fitted to `known` stations and offsets."""
    slope, offset = np.polyfit(known[0], known[1], 1)
    line = plan.turned(float(offset), float(slope))
    near, s, o, z = lonely.slice(line, widths.slice_m, math.inf)
    unclaimed = free[near]
    member = np.zeros(len(near), dtype=bool)
    member[unclaimed] = tube.grow(
        s[unclaimed],
        o[unclaimed],
        z[unclaimed],
        np.isin(near[unclaimed], members),
        widths.gates,
        max_gap_m,
    )
    if not _thin(s, o, z, member, widths):
        return near[:0]
    grown: IntArray = near[member]
    return grown
