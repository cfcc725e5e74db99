"""Scan lines of laser points as a value: the line, position, direction and spacing of each point."""

from __future__ import annotations

from dataclasses import dataclass

from linework.arrays import BoolArray, Float32Array, FloatArray, Int32Array, IntArray

#: Kinds of scanners: a mirror that turns one beam (on a van, or at rest), beams that spin together, an aircraft's strips,
#: and points from which no scan lines can be recovered.
PROFILE, SPINNING, AIRBORNE, UNORDERED = "profile", "spinning", "airborne", "none"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ScanLines:
    """Scan lines of laser points, and how they were recovered.

    Parameters
    ----------
    kind
        Of the scanner: "profile", "spinning", "airborne", or "none" where lines cannot be recovered: then direction and
        spacings are those of the pattern of the points, and there are no lines.
    how
        What the points showed of their scanner, a sentence each.
    line
        (n,) int32: number of each point's scan line, from 0; -1: of none.
    rank
        (n,) int32: number of the point within its line, from 0, by time; -1: of none.
    position_m
        (n,) float32 [m]: distance along the line, in space, from its first point; NaN: of none.
    direction
        (n, 2) float32: unit vector in plan of the line at the point, forwards in time; where there is no line, of
        either sign. NaN: unknown.
    spacing_along_m
        (n,) float32 [m]: distance to the nearer neighbour in the line; NaN: unknown.
    spacing_across_m
        (n,) float32 [m]: distance from the next line of the same scanner, across the line; NaN: unknown.
    beam
        (n,) int32: number of the laser; -1: unknown.
    order, start
        (k,) and (m + 1,) int64: the points of the lines, one line after another, each in its order, and where each of the
        m lines begins in `order`.
    line_time_s
        (m,) float64 [s]: time of the first point of each line; NaN: unknown.
    line_source, line_head, line_beam
        (m,) int32: source (flight strip, drive, file), head of the scanner, and laser of each line; -1: unknown.
    """

    kind: str
    how: tuple[str, ...]
    line: Int32Array
    rank: Int32Array
    position_m: Float32Array
    direction: Float32Array
    spacing_along_m: Float32Array
    spacing_across_m: Float32Array
    beam: Int32Array
    order: IntArray
    start: IntArray
    line_time_s: FloatArray
    line_source: Int32Array
    line_head: Int32Array
    line_beam: Int32Array

    def __len__(self) -> int:
        return len(self.line)

    def __repr__(self) -> str:
        return f"ScanLines(n={len(self):,}, kind {self.kind!r}, {self.n_lines:,} lines)"

    @property
    def n_lines(self) -> int:
        """How many lines there are."""
        return len(self.start) - 1

    def points_of(self, line: int) -> IntArray:
        """Return the points of a line, in its order."""
        return self.order[self.start[line] : self.start[line + 1]]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ScannerTiming:
    """What is to be known of a scanner to give each point its line: the same for every tile of a survey.

    Parameters
    ----------
    kind
        As in `ScanLines`.
    how
        What the points showed, a sentence each.
    source, head
        (d,) int32: source and head of each device, -1 where points have no such field.
    pulse_s
        (d,) float64 [s]: time between two pulses.
    turn_s
        (d,) float64 [s]: time between the beginnings of two lines; NaN: unknown, or the spot moves to and fro.
    is_merged
        (d,) bool: the device is several heads in one stream, told apart by tracking only.
    cut_start, cut_s
        (d + 1,) int64 and (c,) float64 [s]: when the lines of each device begin.
    leap_m
        Farthest that two successive points of a line are apart without a gap. [m]
    half_chord_m
        Directions are measured over this distance to either side. [m]
    ring_m
        (b,) float64 [m]: mean distance of the points of each laser of a spinning scanner from the middle of its turns;
        empty for others.
    spacing_m
        Mean spacing of the points in plan, for points without lines. [m]
    used
        The columns of the points that tell their devices and lasers apart.
    """

    kind: str
    how: tuple[str, ...]
    source: Int32Array
    head: Int32Array
    pulse_s: FloatArray
    turn_s: FloatArray
    is_merged: BoolArray
    cut_start: IntArray
    cut_s: FloatArray
    leap_m: float
    half_chord_m: float
    ring_m: FloatArray
    spacing_m: float
    used: tuple[str, ...]

    def cuts(self, device: int) -> FloatArray:
        """Return when the lines of a device begin [s]."""
        return self.cut_s[self.cut_start[device] : self.cut_start[device + 1]]
