"""Wires in the vertical slice of a seed line, each followed to its ends."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from linework.arrays import BoolArray, FloatArray, IntArray
from linework.kernels.cables import search as kernels
from linework.kernels.cables import tube
from linework.methods.cables.band import Widths
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


def follow_seed(
    lonely: IsolatedPoints, free: BoolArray, seed: Seed, *, widths: Widths, max_gap_m: float
) -> list[IntArray]:
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

    Returns
    -------
    list of index arrays
        Points of each wire, followed beyond the window. Other lines may be among them: they are tested later.
    """
    plan = PlanLine(seed.x, seed.y, seed.ux, seed.uy)
    near, s, o, z = lonely.slice(plan, widths.slice_m, seed.half_m * math.sqrt(2.0), free)
    left = free[near]
    wires: list[IntArray] = []
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
    return wires


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
