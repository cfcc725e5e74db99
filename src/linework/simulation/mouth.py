"""Mouths of side streets: the kerb turns into the side street on an arc, and the carriageway with it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from linework.arrays import FloatArray

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
