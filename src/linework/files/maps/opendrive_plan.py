"""Reference lines of OpenDRIVE: lines, arcs, spirals and cubics, evaluated.

Separate from `opendrive_read`, whose roads are evaluated with it: here is the geometry of the plan alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple
from xml.etree.ElementTree import Element

import numpy as np

from linework.arrays import FloatArray
from linework.files.maps.xml_text import plain_tag

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(24)


class _Piece(NamedTuple):
    """A piece of a reference line: start, place and heading there, length, type, and its numbers."""

    s: float
    x: float
    y: float
    heading: float
    length: float
    kind: str
    numbers: tuple[float, ...]


class RoadPlan(NamedTuple):
    """The pieces of a reference line in order."""

    pieces: tuple[_Piece, ...]

    def at(self, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return positions (n, 2) [m] and headings (n,) [rad] at distances (n,) [m]."""
        starts = np.array([piece.s for piece in self.pieces])
        which = (np.searchsorted(starts, s + 1e-9, side="right") - 1).clip(min=0)
        xy, heading = np.zeros((len(s), 2)), np.zeros(len(s))
        for i in np.unique(which):
            rows = which == i
            xy[rows], heading[rows] = _evaluated(self.pieces[i], s[rows] - starts[i])
        return xy, heading


def road_plan(elements: Sequence[Element]) -> RoadPlan:
    """Return the reference line of `geometry` elements.

    Raises
    ------
    ValueError
        No piece, or one of an unknown type.
    """
    pieces = []
    for e in elements:
        values = [float(e.get(name, "nan")) for name in ("s", "x", "y", "hdg", "length")]
        if not np.isfinite(values).all():
            raise ValueError("a geometry without finite s, x, y, hdg and length")
        kinds = [child for child in e if plain_tag(child) in _NUMBERS]
        if not kinds:
            raise ValueError("a geometry of an unknown type")
        kind = plain_tag(kinds[0])
        numbers = [float(kinds[0].get(name, "0")) for name in _NUMBERS[kind]]
        if kind == "paramPoly3":
            numbers.append(0.0 if kinds[0].get("pRange") == "arcLength" else 1.0)
        s, x, y, heading, length = values
        pieces.append(_Piece(s, x, y, heading, length, kind, tuple(numbers)))
    if not pieces:
        raise ValueError("no reference line")
    return RoadPlan(tuple(sorted(pieces, key=lambda piece: piece.s)))


_NUMBERS = {
    "line": (),
    "arc": ("curvature",),
    "spiral": ("curvStart", "curvEnd"),
    "poly3": ("a", "b", "c", "d"),
    "paramPoly3": ("aU", "bU", "cU", "dU", "aV", "bV", "cV", "dV"),
}


def _evaluated(piece: _Piece, d: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return positions and headings of a piece at distances from its start."""
    numbers = piece.numbers
    if piece.kind == "paramPoly3":
        p = d / max(piece.length, 1e-12) if numbers[8] else d
        u, v, du, dv = _cubics(numbers, p)
    elif piece.kind == "poly3":
        u, (v, dv) = d, _cubic_value(numbers, d)
        du = np.ones(len(d))
    else:
        first = numbers[0] if numbers else 0.0
        last = numbers[1] if len(numbers) > 1 else first
        change = (last - first) / max(piece.length, 1e-12)
        # The heading is a square of the distance; positions are its integral
        inner = d[:, None] * (_NODES + 1) / 2
        turn = inner * (first + change * inner / 2)
        u, v = ((f(turn) * _WEIGHTS).sum(axis=1) * d / 2 for f in (np.cos, np.sin))
        end = d * (first + change * d / 2)
        du, dv = np.cos(end), np.sin(end)
    c, s = np.cos(piece.heading), np.sin(piece.heading)
    xy = np.column_stack([piece.x + c * u - s * v, piece.y + s * u + c * v])
    return xy, np.asarray(piece.heading + np.arctan2(dv, du))


def _cubic_value(a: Sequence[float], p: FloatArray) -> tuple[FloatArray, FloatArray]:
    return a[0] + p * (a[1] + p * (a[2] + p * a[3])), a[1] + p * (2 * a[2] + p * 3 * a[3])


def _cubics(numbers: Sequence[float], p: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    u, du = _cubic_value(numbers[:4], p)
    v, dv = _cubic_value(numbers[4:8], p)
    return u, v, du, dv
