"""From a seed line in plan to the wires in its vertical slice, each followed as far as it hangs."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from linework.kernels import cables as kernels
from linework.methods.radon.cable_seeds import Seed
from linework.model.arrays import BoolArray, FloatArray, IntArray

#: Half width [m] of the slice through a seed line: a cell, the angle's half step at the window's end, and
#: half the distance of wires that share a seed.
SLICE_M = 0.5
#: A slice's cells [m]: one vote per half metre of wire, however many points hit it.
ALONG_M, UP_M, ACROSS_M = 0.5, 0.1, 0.2
#: Slopes and curvatures that the slice is searched for. Half a step
#: moves the end of a 24 m window by 6 cm;
#: 0.02 per m is a wire of 30 m that sags 2.2 m; a 15 m drop line to a house may rise by a third.
SLOPES = np.arange(-35, 36) * 0.01
CURVATURES = np.array([0.0, 0.0015, 0.004, 0.008, 0.014, 0.022])
VOTE_BIN_M = 0.08
#: A curve in the slice needs this many votes, half metres of wire, ...
LEAST_VOTES = 7
#: ... over this length [m], to be looked at further, ...
LEAST_SEEN_M = 5.0
#: ... and a slice is given up after this many curves in a row that are no wires: leaves make no end of them.
MOST_FAILURES = 3
#: Least gate across a wire [m]: it has a thickness of its own, 1 to 3 cm, and hits lie anywhere on it.
LEAST_TUBE_M = 0.025
#: Around a wire out to here there is nothing, not even the next wire (from 0.3 m), less its noise. [m]
RING_M = 0.22
#: A wire has points in this share of its metres at least, ...
LEAST_OCCUPIED = 0.35
#: ... and in this share of them at most the ring about it holds more than a third as many as the wire.
MOST_RINGED = 0.3


@dataclass(frozen=True, slots=True)
class Plan:
    """A line in plan: stations s along (ux, uy) from (x, y), offsets o to the left of it. [m]."""

    x: float
    y: float
    ux: float
    uy: float

    def stations(self, xy: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return (n,) stations and (n,) offsets [m] of (n, 2) points."""
        dx, dy = xy[:, 0] - self.x, xy[:, 1] - self.y
        return dx * self.ux + dy * self.uy, dy * self.ux - dx * self.uy

    def places(self, station_m: FloatArray) -> FloatArray:
        """Return (n, 2) places [m] of (n,) stations."""
        return np.stack([self.x + station_m * self.ux, self.y + station_m * self.uy], axis=-1)

    def turned(self, offset_m: float, slope: float) -> Plan:
        """Return the line o = offset + slope * s of this one's stations, with its own unit direction."""
        stretch = math.hypot(1.0, slope)
        return Plan(
            self.x - self.uy * offset_m,
            self.y + self.ux * offset_m,
            (self.ux - self.uy * slope) / stretch,
            (self.uy + self.ux * slope) / stretch,
        )


def follow_seed(
    xyz: FloatArray, free: BoolArray, seed: Seed, *, gate_m: float, max_gap_m: float
) -> list[IntArray]:
    """Return the points of each wire that passes through the slice of a seed line.

    Parameters
    ----------
    xyz
        (n, 3) float64 [m]: lonely points.
    free
        (n,) bool: not yet part of a wire.
    gate_m
        Widest gate across a wire.
    max_gap_m
        A wire is followed over stretches this long without a point.

    Returns
    -------
    list of index arrays
        Points of each wire, as followed beyond the window. What is no wire stays in it: the tests follow.
    """
    plan = Plan(seed.x, seed.y, seed.ux, seed.uy)
    near, s, o, z = _slice(xyz, plan, (-seed.half_m * math.sqrt(2.0), seed.half_m * math.sqrt(2.0)))
    left = free[near]
    gates = np.array([LEAST_TUBE_M, gate_m])
    wires: list[IntArray] = []
    failed = 0
    while failed < MOST_FAILURES and np.count_nonzero(left) >= LEAST_VOTES:
        curve = _best_curve(s, o, z, left)
        if curve is None:
            break
        member = kernels.settle(s, o, z, left, curve, gate_m)
        failed += 1
        left &= ~member
        if not np.any(member):
            break
        if _thin(s, o, z, member, gates, LEAST_SEEN_M):
            grown = _grown(xyz, free, plan, (s[member], o[member]), near[member], gates, max_gap_m)
            if len(grown):
                failed = 0
                left &= ~np.isin(near, grown)
                wires.append(grown)
    return wires


def _slice(
    xyz: FloatArray, plan: Plan, between: tuple[float, float]
) -> tuple[IntArray, FloatArray, FloatArray, FloatArray]:
    """Return the points about a line in plan, by station: their numbers, stations, offsets and heights."""
    s, o = plan.stations(xyz[:, :2])
    near = np.flatnonzero((np.abs(o) <= SLICE_M) & (s >= between[0]) & (s <= between[1]))
    near = near[np.lexsort((xyz[near, 2], o[near], s[near]))]
    return near, s[near], o[near], xyz[near, 2]


def _best_curve(
    s: FloatArray, o: FloatArray, z: FloatArray, left: BoolArray
) -> tuple[float, float, float] | None:
    """Return the curve that has most votes in the slice, or None where none has enough."""
    chosen = np.flatnonzero(left)
    cell = (
        np.floor(s[chosen] / ALONG_M) * 1e8
        + np.floor(z[chosen] / UP_M) * 1e3
        + np.floor(o[chosen] / ACROSS_M)
    )
    _, first = np.unique(cell, return_index=True)
    voters = chosen[first]
    votes, z0, slope, curvature = kernels.slice_peak(s[voters], z[voters], SLOPES, CURVATURES, VOTE_BIN_M)
    return (z0, slope, curvature) if votes >= LEAST_VOTES else None


def _thin(
    s: FloatArray, o: FloatArray, z: FloatArray, member: BoolArray, gates: FloatArray, least_m: float
) -> bool:
    length, occupied, ringed = kernels.thinness(s, o, z, member, gates, RING_M)
    return bool(length >= least_m and occupied >= LEAST_OCCUPIED and ringed <= MOST_RINGED)


def _grown(
    xyz: FloatArray,
    free: BoolArray,
    plan: Plan,
    known: tuple[FloatArray, FloatArray],
    members: IntArray,
    gates: FloatArray,
    max_gap_m: float,
) -> IntArray:
    """Return the points of the wire far beyond its window: its direction is better known now."""
    slope, offset = np.polyfit(known[0], known[1], 1)
    line = plan.turned(float(offset), float(slope))
    near, s, o, z = _slice(xyz, line, (-math.inf, math.inf))
    unclaimed = free[near]
    member = np.zeros(len(near), dtype=bool)
    member[unclaimed] = kernels.grow(
        s[unclaimed], o[unclaimed], z[unclaimed], np.isin(near[unclaimed], members), gates, max_gap_m
    )
    if not _thin(s, o, z, member, gates, LEAST_SEEN_M):
        return near[:0]
    grown: IntArray = near[member]
    return grown
