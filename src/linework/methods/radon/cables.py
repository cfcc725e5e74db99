"""Overhead cables: thin, alone in their column, straight in plan, hanging as catenaries between supports."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from linework.methods.radon.cable_band import Band, cable_band
from linework.methods.radon.cable_fit import Surroundings, Wire, fit_wire, split_at_kink, surroundings
from linework.methods.radon.cable_follow import LEAST_OCCUPIED, LEAST_SEEN_M, MOST_RINGED, follow_seed
from linework.methods.radon.cable_lines import lines_of_wires
from linework.methods.radon.cable_seeds import find_cable_seeds
from linework.methods.radon.cable_spans import end_at_supports, join_pieces, without_tails
from linework.model.arrays import Float32Array, FloatArray, IntArray
from linework.model.lines import LineSet
from linework.model.settings import setting

#: A catenary and a line have five unknowns; eight points leave three to judge them by.
LEAST_POINTS = 8
#: Points of a wire scatter by its radius and the range noise, together no more than this [m]; more only
#: (airborne scanners) if they do so alike in height and across, within this ratio.
THIN_M, ROUND_RATIO = 0.03, 2.5
#: Other points than wires within 0.6 m in at most this share of a wire's metres: a wire may pass through a
#: crown, an edge has its wall or roof all along.
MOST_CROWDED = 0.6


@dataclass(frozen=True, slots=True, kw_only=True)
class CableConfig:
    """Settings of the cable search."""

    low_m: float = setting(4.0, unit="m", low=1.0, high=50.0, reason="above ground: traffic ends at 4 m")
    cell_m: float = setting(
        0.20, unit="m", low=0.05, high=1.0, reason="cell of the plan image, as in the paper"
    )
    window_m: float = setting(
        24.0, unit="m", low=8.0, high=100.0, reason="wires are straight over a span of 25 m and more"
    )
    gate_m: float = setting(
        0.10, unit="m", low=0.02, high=0.14, reason="widest gate across a wire; wires part from 0.3 m"
    )
    max_gap_m: float = setting(
        6.0, unit="m", low=1.0, high=50.0, reason="followed over stretches without a point"
    )
    min_length_m: float = setting(
        8.0, unit="m", low=2.0, high=100.0, reason="lamp arms and branches are shorter"
    )
    spacing_m: float = setting(1.0, unit="m", low=0.1, high=10.0, reason="distance of vertices along a wire")


def find_cables(
    xyz: FloatArray, time_s: FloatArray | None, height_m: Float32Array, config: CableConfig
) -> LineSet:
    """Return the wires above a tile, one line per wire and span.

    Parameters
    ----------
    xyz
        (n, 3) float64 [m, world]: all points of the tile.
    time_s
        (n,) float64 [s], or None.
    height_m
        (n,) float32 [m] above the road or ground; NaN where not known.

    Returns
    -------
    LineSet
        Kind "cable", with sigmas, bridged stretches, clearance and confidence.

    Notes
    -----
    Does not depend on the order of the points.

    References
    ----------
    Manandhar and Shibasaki (2002): "by changing these threshold values other linear features (like cables)
    can also be identified, though they need further analysis". The further analysis is ours.
    """
    # The height band, and in it the points that are alone in their column
    band = cable_band(xyz, height_m, config.low_m)
    if band is None:
        return LineSet.empty()
    # Peaks of Radon transforms of the plan image, each followed in its vertical slice
    wires = _found_wires(band, config)
    # One catenary per wire and span, ends at the supports
    wires = without_tails(band, join_pieces(band, wires, config.gate_m))
    wires = end_at_supports(band, [w for w in wires if w.length_m >= config.min_length_m])
    # What is still alone now that all wires are known, and hangs
    wires, around = _free_hanging(band, wires)
    return lines_of_wires(band, wires, around, time_s, config.spacing_m)


def _found_wires(band: Band, config: CableConfig) -> list[Wire]:
    lonely = np.flatnonzero(band.lonely)
    xyz = np.ascontiguousarray(band.xyz[lonely])
    free = np.ones(len(xyz), dtype=bool)
    wires: list[Wire] = []
    for seed in find_cable_seeds(xyz[:, :2], window_m=config.window_m, cell_m=config.cell_m):
        for points in follow_seed(xyz, free, seed, gate_m=config.gate_m, max_gap_m=config.max_gap_m):
            for wire in _pieces(band, lonely[points], config):
                if _is_thin(band, wire):
                    wires.append(wire)
                    mine = np.searchsorted(lonely, wire.members)
                    mine = mine[(mine < len(lonely))]
                    free[mine[np.isin(lonely[mine], wire.members)]] = False
    return wires


def _pieces(band: Band, points: IntArray, config: CableConfig) -> list[Wire]:
    """Return the wires that a followed line consists of: it may run past supports."""
    wire = fit_wire(band, points, config.gate_m)
    if wire is None or wire.length_m < LEAST_SEEN_M:
        return []
    parts = split_at_kink(band, wire, 3.0)
    if parts is None:
        return [wire]
    return [piece for part in parts for piece in _pieces(band, part, config)]


def _is_thin(band: Band, wire: Wire) -> bool:
    around = surroundings(band, wire, np.zeros(len(band.xyz), dtype=bool))
    return (
        around.n_points >= LEAST_POINTS
        and around.occupied >= LEAST_OCCUPIED
        and around.ringed <= MOST_RINGED
        and _is_round(wire)
    )


def _is_round(wire: Wire) -> bool:
    """Whether the points scatter alike across the wire and in height: on a plate's edge they do not."""
    small, large = sorted((wire.sigma_o_m, wire.fit.sigma_m))
    return large <= max(THIN_M, ROUND_RATIO * small)


def _free_hanging(band: Band, wires: list[Wire]) -> tuple[list[Wire], list[Surroundings]]:
    """Return the wires that are not crowded, and what lies around each."""
    of_wire = np.zeros(len(band.xyz), dtype=bool)
    for wire in wires:
        of_wire[wire.members] = True
    kept = [(w, surroundings(band, w, of_wire)) for w in wires]
    kept = [(w, a) for w, a in kept if a.crowded <= MOST_CROWDED]
    return [w for w, _ in kept], [a for _, a in kept]
