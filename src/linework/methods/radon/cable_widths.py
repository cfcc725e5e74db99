"""Lengths across a wire, all in proportion to one: the gate, which follows the noise of the survey."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from linework.arrays import FloatArray

#: Outer over inner radius of the ring about a wire that must be empty. Leaves fill it with 3 times as many
#: points as the tube, a wall with as many; the next wire, from 0.3 m, is beyond it, and still is where sags
#: differ and bring two wires as near as 0.15 m.
RING = 2.2


@dataclass(frozen=True, slots=True)
class Widths:
    """How far from a wire's axis points are looked at, and as what.

    Parameters
    ----------
    gate_m
        Widest gate across a wire: points beyond are not on it. 0.1 m holds four deviations of the noise of
        mobile scanners (20 mm, and 10 mm of the wire itself) and a third of the least distance of wires.
    """

    gate_m: float

    @property
    def tube_m(self) -> float:
        """Narrowest gate: a wire is up to 4 cm thick, a beam 2 cm wide, and hits lie anywhere on it."""
        return 0.5 * self.gate_m

    @property
    def gates(self) -> FloatArray:
        """For the kernels: narrowest and widest gate [m], and the ring's outer radius over the gate's."""
        return np.array([self.tube_m, self.gate_m, RING])

    @property
    def sigma_m(self) -> float:
        """Least deviation that outliers are judged by [m]: 4.7 of it are the tube."""
        return 0.1 * self.gate_m

    @property
    def round_m(self) -> float:
        """Deviation of a wire's points up to which their cross-section need not look round [m]."""
        return 0.3 * self.gate_m

    @property
    def side_m(self) -> float:
        """Pieces of one wire face each other, and wires meet at a support, within this [m]."""
        return 1.5 * self.gate_m

    @property
    def slice_m(self) -> float:
        """Half width of the slice through a seed line [m]: a cell, the angle's step, and a wire beside."""
        return 5.0 * self.gate_m

    @property
    def vote_m(self) -> float:
        """Height of a bin of votes in the slice [m]."""
        return 0.8 * self.gate_m

    @property
    def crowd_m(self) -> float:
        """Within this, a roof's edge or a ledge has its wall; a wire has at most other wires [m]."""
        return 6.0 * self.gate_m
