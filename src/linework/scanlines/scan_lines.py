"""Scan lines of laser points as a value: the line, position, direction and spacing of each point."""

from __future__ import annotations

from dataclasses import dataclass

from linework.arrays import Float32Array, FloatArray, Int32Array, IntArray


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
