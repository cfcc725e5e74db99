"""Smooth curves through lines, parametrised by their own length: reference lines of roads.

Separate from `lane_sections`, which follows them: a curve knows nothing of lanes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from linework.arrays import FloatArray, distance_along

#: Distance of the places to which the curve is fitted. [m]
_STEP_M = 0.5
#: Longest and shortest piece; a piece is halved until its length and its parameter agree. [m]
_PIECES_M = (20.0, 2.5)
#: What the length of a piece may differ from its range of the parameter: a reader may use either. [m]
_AGREES_M = 2e-4


@dataclass(frozen=True, slots=True)
class ReferenceCurve:
    """A curve in plan made of cubic pieces.

    Parameters
    ----------
    starts_m
        (k + 1,) parameter at the start of each piece, and at the end. [m]
    polynomial
        Positions (2,) as a function of the parameter. [m, world]
    """

    starts_m: FloatArray
    polynomial: Any

    @property
    def length_m(self) -> float:
        """Length of the curve [m]."""
        return float(self.starts_m[-1])

    def places(self, at_m: FloatArray) -> FloatArray:
        """Return positions (n, 2) at parameters (n,) [m]."""
        return np.asarray(self.polynomial(at_m), dtype=np.float64)

    def ahead(self, at_m: FloatArray) -> FloatArray:
        """Return unit tangents (n, 2) at parameters (n,) [m]."""
        way = np.asarray(self.polynomial.derivative()(at_m), dtype=np.float64)
        return np.asarray(way / np.linalg.norm(way, axis=1, keepdims=True))

    def nearest(self, xy: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the parameter (n,) of the perpendicular to each place (n, 2), and the offset to the left (n,) [m]."""
        at = np.arange(0.0, self.length_m + 1.0, 1.0).clip(max=self.length_m)
        grid = self.places(at)
        # One place at a time: a road has some thousand places, a line some hundred
        s = np.array([at[np.argmin(np.hypot(*(grid - place).T))] for place in xy]).reshape(-1)
        for _ in range(8):
            inside = s.clip(0.0, self.length_m)
            shift = xy - self.places(inside)
            s = inside + np.einsum("ij,ij->i", shift, self.ahead(inside))
        inside = s.clip(0.0, self.length_m)
        ahead = self.ahead(inside)
        shift = xy - self.places(inside)
        return s, ahead[:, 0] * shift[:, 1] - ahead[:, 1] * shift[:, 0]


def reference_curve(xy: FloatArray) -> ReferenceCurve:
    """Return a smooth curve along a line.

    Parameters
    ----------
    xy
        (n, 2) vertices of the line, at least 5 m long. [m, world]

    Examples
    --------
    >>> angle = np.linspace(0.0, 0.5, 60)
    >>> curve = reference_curve(100.0 * np.column_stack([np.sin(angle), 1 - np.cos(angle)]))
    >>> round(curve.length_m, 2), bool(np.abs(np.hypot(*(curve.places(np.arange(50.0)) - [0, 100]).T) - 100).max() < 0.01)
    (50.0, True)
    """
    along = distance_along(xy)
    n = max(int(along[-1] / _STEP_M), 12)
    at = np.linspace(0.0, along[-1], n + 1)
    places = np.stack([np.interp(at, along, coordinate) for coordinate in xy.T], axis=1)
    piece_m = _PIECES_M[0]
    while True:
        curve = _fitted(places, at, piece_m)
        lengths = _lengths(curve, curve.starts_m)
        if piece_m <= _PIECES_M[1] or np.abs(np.diff(lengths) - np.diff(curve.starts_m)).max() < _AGREES_M:
            return curve
        piece_m /= 2


def _fitted(places: FloatArray, at: FloatArray, piece_m: float) -> ReferenceCurve:
    """Return the curve of least squares; its parameter is made its own length by fitting again."""
    curve = _spline(places, at, piece_m)
    for _ in range(4):
        # The lengths of the curve up to each place are the better parameters
        at = _lengths(curve, np.minimum(at, curve.length_m))
        curve = _spline(places, at, piece_m)
    return curve


def _spline(places: FloatArray, at: FloatArray, piece_m: float) -> ReferenceCurve:
    from scipy.interpolate import PPoly, make_lsq_spline  # slow to import, and lanes are made on request

    n = max(round(float(at[-1]) / piece_m), 1)
    starts = np.linspace(0.0, float(at[-1]), n + 1)
    knots = np.concatenate([np.zeros(3), starts, np.full(3, at[-1])])
    spline = make_lsq_spline(at, places, knots, k=3)
    begin = starts[:-1]
    powers = [
        spline.derivative(3)(begin) / 6,
        spline.derivative(2)(begin) / 2,
        spline.derivative(1)(begin),
        spline(begin),
    ]
    return ReferenceCurve(starts, PPoly(np.stack(powers), starts))


def _lengths(curve: ReferenceCurve, at: FloatArray) -> FloatArray:
    """Return the length of the curve from its start to parameters (n,), by Gauss's rule of 4 points in each step."""
    node, weight = np.polynomial.legendre.leggauss(4)
    half, middle = np.diff(at) / 2, (at[:-1] + at[1:]) / 2
    speed = curve.polynomial.derivative()((middle[:, None] + half[:, None] * node).ravel())
    steps = (np.linalg.norm(speed, axis=1).reshape(-1, 4) * weight).sum(axis=1) * half
    return distance_along(
        np.column_stack([np.concatenate([[0.0], np.add.accumulate(steps)]), np.zeros(len(at))])
    )
