"""The road's axis: curvature and grade that change linearly, so straights, clothoids and arcs are exact."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from linework.arrays import AnyArray, FloatArray

#: Node spacing of the table of axis positions; between nodes Simpson's rule is exact to 1e-9 m at R = 18 m.
_NODE_M = 0.25


@dataclass(frozen=True, slots=True)
class PiecewiseLinear:
    """A value that changes linearly between nodes and is constant beyond them.

    >>> ramp = PiecewiseLinear(np.array([0.0, 2.0]), np.array([0.0, 1.0]))
    >>> float(ramp(1.0)), float(ramp.integral(2.0)), float(ramp.integral(3.0))
    (0.5, 1.0, 2.0)
    """

    x: FloatArray
    y: FloatArray

    @classmethod
    def constant(cls, value: float) -> PiecewiseLinear:
        """Return the same value everywhere."""
        return cls(np.array([0.0]), np.array([float(value)]))

    def __call__(self, x: AnyArray | float) -> FloatArray:
        """Return the value at `x`."""
        return np.asarray(np.interp(x, self.x, self.y), dtype=np.float64)

    def integral(self, x: AnyArray | float) -> FloatArray:
        """Return the integral from the first node to `x`, in closed form."""
        x = np.asarray(x, dtype=np.float64)
        area = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(self.x) * (self.y[1:] + self.y[:-1]))])
        i = np.clip(np.searchsorted(self.x, x, side="right") - 1, 0, len(self.x) - 1)
        return np.asarray(area[i] + 0.5 * (x - self.x[i]) * (self.y[i] + self(x)), dtype=np.float64)


@dataclass(frozen=True, slots=True)
class Alignment:
    """The axis in plan and height, in metres from a local origin; build it with `make_alignment`.

    Parameters
    ----------
    start_m, end_m
        First and last chainage of the modelled road.
    curvature
        [1/m] over chainage, positive to the left.
    heading_rad
        Direction at chainage 0, anticlockwise from east.
    grade
        [m/m] over chainage, positive uphill; its linear changes are parabolic vertical curves.
    nodes_m, nodes_xy
        Table of axis positions.
    level_m
        Height at chainage 0.
    """

    start_m: float
    end_m: float
    curvature: PiecewiseLinear
    heading_rad: float
    grade: PiecewiseLinear
    nodes_m: FloatArray
    nodes_xy: FloatArray
    level_m: float = 0.0

    def heading(self, chainage_m: AnyArray | float) -> FloatArray:
        """Return the axis direction, [rad], anticlockwise from east."""
        return np.asarray(
            self.heading_rad + self.curvature.integral(chainage_m) - self.curvature.integral(0.0)
        )

    def height(self, chainage_m: AnyArray | float) -> FloatArray:
        """Return the height of the axis over the local origin, in metres."""
        return np.asarray(self.level_m + self.grade.integral(chainage_m) - self.grade.integral(0.0))

    def position(self, chainage_m: AnyArray | float) -> FloatArray:
        """Return (..., 2) positions of the axis."""
        s = np.asarray(chainage_m, dtype=np.float64)
        i = np.clip(np.searchsorted(self.nodes_m, s, side="right") - 1, 0, len(self.nodes_m) - 1)
        return np.asarray(self.nodes_xy[i] + _simpson(self.heading, self.nodes_m[i], s))

    def locate(self, xy: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return chainage and offset (left positive) of (n, 2) positions: the foot on the nearest axis part."""
        s = self.nodes_m[cKDTree(self.nodes_xy).query(xy)[1]]
        for _ in range(4):  # Newton: the axis is smooth, four steps reach 1e-9 m
            heading = self.heading(s)
            d = xy - self.position(s)
            along = d[:, 0] * np.cos(heading) + d[:, 1] * np.sin(heading)
            across = d[:, 1] * np.cos(heading) - d[:, 0] * np.sin(heading)
            s = s + along / np.maximum(1.0 - self.curvature(s) * across, 0.2)
        heading, d = self.heading(s), xy - self.position(s)
        return s, np.asarray(d[:, 1] * np.cos(heading) - d[:, 0] * np.sin(heading))


def make_alignment(
    start_m: float, end_m: float, curvature: PiecewiseLinear, heading_rad: float, grade: PiecewiseLinear
) -> Alignment:
    """Integrate curvature to positions; chainage 0 is the local origin."""
    n = int(np.ceil((end_m - start_m) / _NODE_M)) + 1
    nodes = np.linspace(start_m, end_m, n)
    bare = Alignment(start_m, end_m, curvature, heading_rad, grade, np.zeros(1), np.zeros((1, 2)))
    steps = _simpson(bare.heading, nodes[:-1], nodes[1:])
    xy = np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])
    alignment = Alignment(start_m, end_m, curvature, heading_rad, grade, nodes, xy)
    origin = alignment.position(0.0)
    return Alignment(start_m, end_m, curvature, heading_rad, grade, nodes, xy - origin)


def _simpson(heading: object, a: AnyArray, b: AnyArray) -> FloatArray:
    """Integrate (cos, sin) of the heading from a to b by one Simpson step."""
    assert callable(heading)
    first, middle, last = heading(a), heading(0.5 * (a + b)), heading(b)
    step = (np.asarray(b) - a) / 6.0
    return np.stack(
        [
            step * (np.cos(first) + 4.0 * np.cos(middle) + np.cos(last)),
            step * (np.sin(first) + 4.0 * np.sin(middle) + np.sin(last)),
        ],
        axis=-1,
    )


# Mouths of side streets: the kerb turns into the side street on an arc, and the carriageway with it

#: Chords of a quarter turn; at 8 m radius they leave the arc by 0.6 mm.
_ARC_CHORDS = 64


@dataclass(frozen=True, slots=True)
class Mouth:
    """A side street between kerbs at chainages `start_m` and `end_m`, with kerb returns of `radius_m`."""

    start_m: float
    end_m: float
    radius_m: float

    @property
    def span(self) -> tuple[float, float]:
        """From where to where the kerb of the through street is not straight."""
        return self.start_m - self.radius_m, self.end_m + self.radius_m


def widening(mouths: Sequence[Mouth], s: FloatArray, reach_m: float) -> FloatArray:
    """Return how far the carriageway reaches beyond its straight edge at chainages `s`.

    >>> widening([Mouth(10.0, 16.0, 5.0)], np.array([4.0, 7.0, 12.0]), 14.0).tolist()
    [0.0, 0.41742430504416017, 14.0]
    """
    wide = np.zeros(np.shape(s))
    for m in mouths:
        wide = np.where((s >= m.start_m) & (s <= m.end_m), reach_m, wide)
        for before in (m.start_m - s, s - m.end_m):
            run = m.radius_m - before
            on_arc = (before > 0.0) & (run > 0.0)
            arc = m.radius_m - np.sqrt(np.maximum(m.radius_m**2 - np.where(on_arc, run, 0.0) ** 2, 0.0))
            wide = np.where(on_arc, arc, wide)
    return wide


def kerb_paths(
    mouths: Sequence[Mouth],
    span: tuple[float, float],
    reach_m: float,
    straight: Callable[[float, float], FloatArray],
    leg_step_m: float,
) -> list[FloatArray]:
    """Return the (n, 2) chainages and widenings along each kerb between mouths, side street legs included.

    Parameters
    ----------
    span
        Start and end of the road.
    reach_m
        How far side streets are modelled.
    straight
        Gives the chainages of a straight stretch between two.
    leg_step_m
        Spacing of nodes along the side street.
    """
    ordered = sorted(mouths, key=lambda m: m.start_m)
    paths = []
    for before, after in zip([None, *ordered], [*ordered, None], strict=True):
        a = before.span[1] if before else span[0]
        b = after.span[0] if after else span[1]
        s = straight(a, b)
        nodes = [np.stack([s, np.zeros(len(s))], axis=1)]
        if before:
            nodes.insert(0, _return(before.end_m, 1, before.radius_m, (reach_m, leg_step_m))[::-1])
        if after:
            nodes.append(_return(after.start_m, -1, after.radius_m, (reach_m, leg_step_m)))
        paths.append(np.concatenate(nodes))
    return paths


def mouth_path(mouth: Mouth, reach_m: float, straight: Callable[[float, float], FloatArray]) -> FloatArray:
    """Return the (n, 2) chainages and widenings across a mouth, from one kerb return to the other."""
    leg = (reach_m, reach_m)
    s = straight(mouth.start_m, mouth.end_m)
    first = _return(mouth.start_m, -1, mouth.radius_m, leg)
    last = _return(mouth.end_m, 1, mouth.radius_m, leg)[::-1]
    ends = np.array([[mouth.span[0], 0.0], [mouth.span[1], 0.0]])
    across = np.stack([s, np.full(len(s), reach_m)], axis=1)
    return np.concatenate([ends[:1], first, across, last, ends[1:]])


def _return(at_m: float, outward: int, radius_m: float, leg: tuple[float, float]) -> FloatArray:
    """Return a kerb return and the leg after it, from the straight kerb (exclusive) into the side street."""
    reach_m, step_m = leg
    turn = np.linspace(0.0, 0.5 * np.pi, _ARC_CHORDS + 1)[1:]
    arc = np.stack(
        [at_m + outward * radius_m * (1.0 - np.sin(turn)), radius_m * (1.0 - np.cos(turn))], axis=1
    )
    n = max(int(np.ceil((reach_m - radius_m) / step_m)), 1)
    along = np.linspace(radius_m, reach_m, n + 1)[1:]
    return np.concatenate([arc, np.stack([np.full(n, at_m), along], axis=1)])
