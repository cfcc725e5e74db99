"""Lines by chainage: positions, directions and short pieces, whatever the spacing of the vertices."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

import numpy as np

from linework.arrays import BoolArray, FloatArray, IntArray
from linework.errors import InputError
from linework.model.lines import STACKED_FORM, LineSet

#: Lines are compared in pieces no longer than this (docs/evaluation.md). [m]
COMPARED_PIECE_M = 0.1
#: Half the chord whose direction is taken as that of the line [m]: long against the noise of close vertices,
#: short against the sharpest kerb (at a radius of 0.5 m it turns 29 degrees over the half chord).
_HALF_CHORD_M = 0.25


@dataclass(frozen=True, slots=True)
class Chains:
    """Lines of one kind by chainage, in metres from a local origin.

    Parameters
    ----------
    lines
        The lines, unchanged.
    xyz
        (n, 3) [m, local]: vertices minus the origin. Heights may be NaN where only the plan is compared.
    axis_m
        (n,) [m]: position of each vertex on one axis that holds all lines one after another.
    start_m, length_m
        (m,) [m]: start of each line on that axis, and its length.
    n_dims
        3: lengths, distances and directions are taken in space (cables); 2: in plan.
    """

    lines: LineSet
    xyz: FloatArray
    axis_m: FloatArray
    start_m: FloatArray
    length_m: FloatArray
    n_dims: int

    @classmethod
    def of(cls, lines: LineSet, origin: FloatArray, n_dims: int) -> Chains:
        """Return the chains of `lines`.

        Parameters
        ----------
        origin
            (3,) [m, world].
        n_dims
            2: in plan; 3: in space.

        Raises
        ------
        InputError
            A coordinate that is needed is not finite.
        """
        xyz = lines.xyz - origin
        if not np.isfinite(xyz[:, :n_dims]).all():
            what = "cables need heights" if np.isfinite(xyz[:, :2]).all() else "coordinates are not finite"
            raise InputError(f"lines cannot be compared: {what}", advice="correct the file, or omit the kind")
        if len(xyz) == 0:
            none = np.zeros(0)
            return cls(lines, xyz, none, none, none, n_dims)
        step = np.concatenate([[0.0], np.linalg.norm(np.diff(xyz[:, :n_dims], axis=0), axis=1)])
        first = lines.offsets[:-1][np.diff(lines.offsets) > 0]
        step[first] = 1.0  # on the axis, lines are one metre apart
        axis_m = np.cumsum(step)
        last = np.maximum(lines.offsets[1:] - 1, 0)
        start_m = axis_m[np.minimum(lines.offsets[:-1], len(xyz) - 1)]
        length_m = np.where(np.diff(lines.offsets) > 0, axis_m[last] - start_m, 0.0)
        return cls(lines, xyz, axis_m, start_m, length_m, n_dims)

    def __len__(self) -> int:
        return len(self.lines)

    @property
    def is_stacked(self) -> BoolArray:
        """Return (m,) bool: one of several lines above one another."""
        return np.asarray(self.lines.form == STACKED_FORM)

    def at(self, line: IntArray, chainage_m: FloatArray) -> FloatArray:
        """Return (k, 3) positions [m, local] at chainages (k,) [m] of lines (k,); beyond an end: that end."""
        return np.stack([self.column_at(self.xyz[:, i], line, chainage_m) for i in range(3)], axis=1)

    def column_at(self, column: FloatArray, line: IntArray, chainage_m: FloatArray) -> FloatArray:
        """Return (k,) the values of a per-vertex column (n,), interpolated at chainages (k,) of lines (k,)."""
        if len(line) == 0:
            return np.zeros(0)
        inside = np.clip(chainage_m, 0.0, self.length_m[line])
        return np.interp(self.start_m[line] + inside, self.axis_m, column)

    def direction_at(self, line: IntArray, chainage_m: FloatArray) -> FloatArray:
        """Return (k, n_dims) unit directions; zeros where the chord has no length."""
        ahead = self.at(line, chainage_m + _HALF_CHORD_M)[:, : self.n_dims]
        behind = self.at(line, chainage_m - _HALF_CHORD_M)[:, : self.n_dims]
        return unit(ahead - behind)

    def observed_at(self, line: IntArray, chainage_m: FloatArray) -> BoolArray:
        """Return (k,) bool: the position is on a segment whose two ends were observed."""
        start, end = self._segment_at(line, chainage_m)
        return self.lines.observed[start] & self.lines.observed[end]

    def bridged_at(self, line: IntArray, chainage_m: FloatArray) -> BoolArray:
        """Return (k,) bool: the position is on a segment with an end that was not measured."""
        start, end = self._segment_at(line, chainage_m)
        return self.lines.bridged[start] | self.lines.bridged[end]

    def _segment_at(self, line: IntArray, chainage_m: FloatArray) -> tuple[IntArray, IntArray]:
        """Return (k,) int64 the first and last vertex of the segments at these positions."""
        place = np.clip(chainage_m, 0.0, self.length_m[line]) + self.start_m[line]
        segment = np.searchsorted(self.axis_m, place, side="right") - 1
        segment = np.clip(segment, self.lines.offsets[line], np.maximum(self.lines.offsets[line + 1] - 2, 0))
        return segment, np.minimum(segment + 1, len(self.xyz) - 1)

    def divided(self, spacing_m: float) -> tuple[IntArray, FloatArray, FloatArray]:
        """Divide every line into equal parts of at most `spacing_m`.

        Returns
        -------
        (k,) int64 line, (k,) chainage of the middle of the part [m], (k,) length of the part [m].

        Notes
        -----
        The parts depend only on the length of the line, not on its vertices or drawing direction.
        """
        # A length slightly above a whole number of parts, by rounding, is that number of parts
        n_parts = np.ceil(self.length_m / spacing_m - 1e-6).astype(np.int64)
        n_parts = np.where(self.length_m > 0, np.maximum(n_parts, 1), 0)
        line = np.repeat(np.arange(len(self), dtype=np.int64), n_parts)
        part_m = self.length_m[line] / n_parts[line]
        within = np.arange(len(line)) - np.repeat(np.cumsum(n_parts) - n_parts, n_parts)
        return line, (within + 0.5) * part_m, part_m


@dataclass(frozen=True, slots=True)
class LinePieces:
    """Lines cut into short pieces of equal length along each line.

    Parameters
    ----------
    line
        (k,) int64: the line of each piece.
    chainage_m, length_m
        (k,) [m]: chainage of its middle; its length.
    xyz
        (k, 3) [m, local]: its middle.
    direction
        (k, n_dims): unit direction.
    """

    line: IntArray
    chainage_m: FloatArray
    length_m: FloatArray
    xyz: FloatArray
    direction: FloatArray

    def __len__(self) -> int:
        return len(self.line)

    def take(self, chosen: BoolArray) -> LinePieces:
        """Return the chosen pieces."""
        return LinePieces(*(getattr(self, f.name)[chosen] for f in fields(self)))


def cut_into_pieces(chains: Chains, piece_m: float = COMPARED_PIECE_M) -> LinePieces:
    """Cut lines into pieces of at most `piece_m`.

    >>> lines = LineSet.from_lines([[[0, 0, 0], [1, 0, 0]]], kind=["guardrail"])
    >>> pieces = cut_into_pieces(Chains.of(lines, np.zeros(3), 2), 0.5)
    >>> pieces.xyz[:, 0].tolist(), pieces.length_m.tolist()
    ([0.25, 0.75], [0.5, 0.5])
    """
    line, chainage_m, length_m = chains.divided(piece_m)
    xyz = chains.at(line, chainage_m)
    return LinePieces(line, chainage_m, length_m, xyz, chains.direction_at(line, chainage_m))


@dataclass(frozen=True, slots=True)
class ChainSegments:
    """The segments of lines, with long ones divided so that a search by their middles finds them.

    Parameters
    ----------
    start, end
        (k, 3) [m, local]. The end of one segment equals the start of the next bit for bit: no gap between them.
    line
        (k,) int64: the line of each segment.
    start_m, end_m
        (k,) [m]: chainages of both ends.
    """

    start: FloatArray
    end: FloatArray
    line: IntArray
    start_m: FloatArray
    end_m: FloatArray

    def __len__(self) -> int:
        return len(self.line)


def cut_into_segments(chains: Chains, longest_m: float) -> ChainSegments:
    """Cut lines at their vertices, and segments longer than `longest_m` into equal parts."""
    owner = chains.lines.line_of_vertex
    k = np.flatnonzero(owner[:-1] == owner[1:]) if len(owner) else np.zeros(0, dtype=np.int64)
    size = chains.axis_m[k + 1] - chains.axis_m[k]
    k, size = k[size > 0], size[size > 0]
    n_parts = np.maximum(np.ceil(size / longest_m), 1).astype(np.int64)
    segment = np.repeat(np.arange(len(k)), n_parts)
    within = np.arange(len(segment)) - np.repeat(np.cumsum(n_parts) - n_parts, n_parts)
    low, high = within / n_parts[segment], (within + 1) / n_parts[segment]
    begin, step = chains.xyz[k[segment]], np.diff(chains.xyz, axis=0)[k[segment]]
    line = owner[k[segment]]
    base = chains.axis_m[k[segment]] - chains.start_m[line]
    return ChainSegments(
        start=begin + low[:, None] * step,
        end=np.where((high < 1)[:, None], begin + high[:, None] * step, chains.xyz[k[segment] + 1]),
        line=line,
        start_m=base + low * size[segment],
        end_m=base + high * size[segment],
    )


def unit(vectors: FloatArray) -> FloatArray:
    """Return vectors (k, d) scaled to length 1; zero stays zero.

    >>> unit(np.array([[3.0, 4.0], [0.0, 0.0]])).tolist()
    [[0.6, 0.8], [0.0, 0.0]]
    """
    size = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.asarray(np.divide(vectors, size, out=np.zeros_like(vectors), where=size > 0))


def same_direction(a: FloatArray, b: FloatArray, max_angle_deg: float) -> BoolArray:
    """Return (k,) bool: the undirected angle between unit vectors (k, d) is at most `max_angle_deg`.

    >>> east, north = np.array([[1.0, 0.0]]), np.array([[0.0, 1.0]])
    >>> bool(same_direction(east, -east, 20.0)[0]), bool(same_direction(east, north, 20.0)[0])
    (True, False)
    """
    # A microradian of slack: an angle equal to the limit passes, whatever the rounding
    cosine = np.abs(np.einsum("ij,ij->i", a, b))
    return np.asarray(cosine >= math.cos(math.radians(max_angle_deg) + 1e-6))
