"""Catenary of a hanging wire over one span, and its least-squares fit.

A wire of weight w per metre under the horizontal tension H hangs as z = z0 + a (cosh((s - s0) / a) - 1)
with a = H / w. A taut wire has a huge `a` and a lowest point s0 far outside the span, so that form cannot
be fitted to it. With the height z_c and the slope m at a reference station s_c, and the curvature k = 1 / a,

    z(s) = z_c + m sinh(k u) / k + sqrt(1 + m^2) (cosh(k u) - 1) / k,    u = s - s_c

is the same curve (m = sinh((s_c - s0) / a)) and turns into the straight line z_c + m u as k goes to 0.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from linework.arrays import FloatArray
from linework.kernels.cables import catenary as kernels

#: Gauss-Newton steps at most: the problem is nearly linear and gains three digits per step.
_MAX_STEPS = 8


@dataclass(frozen=True, slots=True)
class Catenary:
    """A hanging wire in its vertical plane.

    Parameters
    ----------
    station_m
        Reference station s_c along the wire in plan. [m]
    height_m
        Height z_c there. [m]
    slope
        Slope m there, rise over run.
    curvature_per_m
        k = 1 / a = w / H, positive where the wire hangs. [1/m]

    Notes
    -----
    >>> wire = Catenary.from_lowest(20.0, 6.0, 250.0)
    >>> round(float(wire.height_at(np.array([40.0]))[0]), 4)
    6.8004
    """

    station_m: float
    height_m: float
    slope: float
    curvature_per_m: float

    @classmethod
    def from_lowest(cls, station_m: float, height_m: float, parameter_m: float) -> Catenary:
        """Build the catenary with its lowest point there and a = H / w = `parameter_m`."""
        return cls(station_m, height_m, 0.0, 1.0 / parameter_m)

    def height_at(self, station_m: FloatArray) -> FloatArray:
        """Return the heights (n,) of the wire at (n,) stations [m]."""
        heights: FloatArray = kernels.wire_heights(
            np.ascontiguousarray(station_m, dtype=np.float64), self.numbers
        )
        return heights

    def height_of(self, station_m: float) -> float:
        """Return the height of the wire at one station [m]."""
        height: float = kernels.wire_height(station_m, self.numbers)
        return height

    @property
    def numbers(self) -> kernels.WireCurve:
        """The curve as the kernels take it."""
        return kernels.WireCurve(self.station_m, self.height_m, self.slope, self.curvature_per_m)

    def slope_at(self, station_m: FloatArray) -> FloatArray:
        """Return the slopes dz/ds (n,) of the wire at (n,) stations [m]."""
        u = (np.asarray(station_m, dtype=np.float64) - self.station_m) * self.curvature_per_m
        return self.slope * np.cosh(u) + math.hypot(1.0, self.slope) * np.sinh(u)


@dataclass(frozen=True, slots=True)
class CatenaryFit:
    """A fitted wire and its precision.

    Parameters
    ----------
    curve
        The wire.
    cofactor
        (3, 3) inverse normal matrix of (z_c, m, k); times the variance of a height, their covariance.
    sigma_m
        Standard deviation of one height about the curve, from the weighted residuals. [m]
    """

    curve: Catenary
    cofactor: FloatArray
    sigma_m: float

    def height_sigma_at(self, station_m: FloatArray) -> FloatArray:
        """Return the standard deviations (n,) of the height of the curve at (n,) stations [m]."""
        columns = _derivatives(self.curve, np.asarray(station_m, dtype=np.float64))
        variance = np.einsum("ni,ij,nj->n", columns, self.cofactor, columns)
        sigma: FloatArray = self.sigma_m * np.sqrt(np.maximum(variance, 0.0))
        return sigma

    @property
    def curvature_sigma_per_m(self) -> float:
        """Standard deviation of the curvature k. [1/m]."""
        return self.sigma_m * math.sqrt(max(float(self.cofactor[2, 2]), 0.0))


def fit_catenary(
    station_m: FloatArray, height_m: FloatArray, weights: FloatArray | None = None, *, straight: bool = False
) -> CatenaryFit:
    """Fit a catenary to heights along a wire by weighted least squares.

    Parameters
    ----------
    station_m, height_m
        (n,) stations along the wire in plan and heights there. [m]
    weights
        (n,) weights; None: equal. For a robust fit call again with weights from the residuals.
    straight
        Hold the curvature at 0, for wires so short or taut that it cannot be told from 0.

    Returns
    -------
    CatenaryFit
        `sigma_m` is 0 where there are no more points than unknowns.

    Raises
    ------
    ValueError
        Fewer points (of positive weight) than unknowns.

    Notes
    -----
    Gauss-Newton from the least-squares parabola; the stations are centred and scaled to their extent, so
    that the normal equations stay well conditioned on any span.
    """
    s, z = (np.ascontiguousarray(a, dtype=np.float64) for a in (station_m, height_m))
    w = np.ones_like(s) if weights is None else np.ascontiguousarray(weights, dtype=np.float64)
    n_unknowns = 2 if straight else 3
    used = int(np.count_nonzero(w > 0))
    if used < n_unknowns:
        raise ValueError(f"{used} points, a catenary needs at least {n_unknowns}")
    numbers, cofactor, square = kernels.fit(s, z, w, n_unknowns, _MAX_STEPS)
    sigma = math.sqrt(square * used / max(used - n_unknowns, 1))
    return CatenaryFit(Catenary(*numbers), cofactor, sigma)


def meeting_stations(left: Catenary, right: Catenary, low_m: float, high_m: float) -> FloatArray:
    """Return the stations (k,) in [low_m, high_m] where two wires have the same height, in rising order [m].

    Two neighbouring spans meet at their support; the roots are those of the parabolas that osculate both
    catenaries in the middle of the interval, polished by Newton steps on the catenaries themselves.
    """
    middle = (low_m + high_m) / 2.0
    at = np.array([middle])
    gap = float((left.height_at(at) - right.height_at(at))[0])
    tilt = float((left.slope_at(at) - right.slope_at(at))[0])
    bend = (left.curvature_per_m - right.curvature_per_m) / 2.0
    roots = np.roots([bend, tilt, gap] if abs(bend) > 1e-12 else [tilt, gap])
    stations = np.clip(roots[np.isreal(roots)].real + middle, low_m - 1.0, high_m + 1.0)
    for _ in range(4):
        difference = left.height_at(stations) - right.height_at(stations)
        rate = left.slope_at(stations) - right.slope_at(stations)
        step = np.where(np.abs(rate) > 1e-9, difference / np.where(rate == 0, 1.0, rate), 0.0)
        stations = np.clip(stations - step, low_m - 1.0, high_m + 1.0)
    meet = np.abs(left.height_at(stations) - right.height_at(stations)) < 1e-6
    return np.unique(stations[meet & (stations >= low_m) & (stations <= high_m)].round(9))


def _derivatives(curve: Catenary, station_m: FloatArray) -> FloatArray:
    """Return the derivatives (n, 3) of the height by z_c, m and k at (n,) stations [m]."""
    stations = (station_m - curve.station_m).tolist()
    rows = [kernels.derivatives(u, curve.slope, curve.curvature_per_m) for u in stations]
    return np.array(rows, dtype=np.float64).reshape(-1, 3)
