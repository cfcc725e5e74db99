"""Overhead cables: thin, isolated in their column, straight in plan, hanging as catenaries between supports."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from linework.arrays import AnyArray, Float32Array, FloatArray, IntArray
from linework.methods.cables.band import BELOW_M, COLUMN_REACH_M, CableBand, Widths, cable_band
from linework.methods.cables.bundles import bundled_wires, tell_apart
from linework.methods.cables.fit import (
    FittedWire,
    among,
    fit_exact_catenary,
    fit_members,
    fit_wire,
    settle_wire,
    split_at_kink,
    surroundings,
)
from linework.methods.cables.follow import (
    LEAST_OCCUPIED,
    LEAST_SEEN_M,
    MOST_RINGED,
    IsolatedPoints,
    follow_seed,
    is_in_rows,
)
from linework.methods.cables.hanging import free_hanging, is_sagging
from linework.methods.cables.lines import confidence, lines_of_wires
from linework.methods.cables.poles import find_poles
from linework.methods.cables.seeds import find_cable_seeds
from linework.methods.cables.spans import end_at_supports, join_pieces, without_mixtures, without_tails
from linework.methods.radon.peaks import PeakFinder
from linework.model.lines import LineSet
from linework.model.settings import Settings, setting
from linework.model.tile import ScannerTiming, local_origin
from linework.scanlines.crossings import LEAST_CROSSINGS, crossings_in_time

#: Fewest points of a wire: a catenary and a line have five unknowns, which leaves three degrees of freedom.
LEAST_WIRE_POINTS = 8
#: Largest ratio of the scatter of a wire's points in height and across, where it is wide.
ROUND_RATIO = 2.5
#: Largest deviation of the metres of a wire from its catenary beyond their scatter, in gates: poses of two passes differ
#: by 5 mm, and hits wander over the width of the wire; a curve laid across a bundle deviates more.
WAVY_GATES = 0.2
#: And in the scatter of its points: strips of an airborne survey differ by about half of it.
WAVY_SIGMAS = 0.5
#: Wires of a lower confidence are more likely rows of leaves and of eaves. Fitted on 2026-11-23, on simulated towns,
#: villages and forests (seeds 13, 14, 40 to 48, five scanners): of 10 wires below it 8 are on no wire, and 2 are 0.4 to
#: 0.6 m beside one; above it 2 of 41 are on no wire. Of two airborne corridors of power lines 1 of 83 lines is below it.
LEAST_CONFIDENCE = 0.35
#: Least share of the metres of a row that have points: at two a metre, 1 - exp(-2) of them, less what is hidden.
LEAST_ROW_OCCUPIED = 0.7
#: Least evenness of the points along a wire: points concentrated in a few metres are an object that the line passes.
LEAST_EVEN = 0.2
#: Quantile of the heights of a wire's points that must be in the band.
_HEIGHT_QUANTILE = 0.9
#: Distance of a kink from the ends of a piece. [m]
_KINK_M = 3.0


@dataclass(frozen=True, slots=True, kw_only=True)
class CableConfig(Settings):
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


def least_height_m(config: CableConfig) -> float:
    """Return the height above ground of the lowest points that the search uses [m]; lower ones may be missing.

    >>> least_height_m(CableConfig())
    2.0
    """
    return config.low_m - BELOW_M - COLUMN_REACH_M


def find_cables(
    xyz: FloatArray,
    time_s: FloatArray | None,
    height_m: Float32Array,
    config: CableConfig,
    origin: tuple[float, float, float] | None = None,
    finder: PeakFinder | None = None,
    *,
    laser: AnyArray | None = None,
    scanner: ScannerTiming | None = None,
) -> LineSet:
    """Return the wires above a tile, one line per wire and span.

    Parameters
    ----------
    xyz
        (n, 3) points of the tile, in any order. [m, world]
    time_s
        (n,) times of the points that order them [s], or None.
    height_m
        (n,) float32 above the road or ground; NaN where unknown. [m]
    origin
        Shared by all tiles of a survey, whole multiples of 1200 m [m, world]; None: from the points.
    finder
        Own function that finds the peaks of Radon images; None: `linework.methods.radon.peaks.find_peaks`.
    laser, scanner
        (n,) number of the laser that measured each point, and what is known of the scanner; None: unknown.

    Returns
    -------
    LineSet
        Kind "cable", with sigmas, bridged stretches, clearance and confidence; and kind "pole", what stands where they end.

    References
    ----------
    Manandhar and Shibasaki (2002): "by changing these threshold values other linear features (like cables)
    can also be identified, though they need further analysis". The further analysis is ours.
    """
    # Points of the height band, and which of them are isolated in their column
    if len(xyz) == 0:
        return LineSet.empty()
    shared = np.array(origin or local_origin(*xyz.min(axis=0).tolist()))
    band = cable_band(xyz, height_m, config.low_m, shared)
    if band is None:
        return LineSet.empty()
    # Peaks of Radon transforms of the plan image, each followed in its vertical slice
    widths = Widths(config.gate_m)
    wires, crowded = _found_wires(band, config, widths, finder)
    wires = tell_apart(band, wires)
    wires += _thin_ones(band, bundled_wires(band, wires, crowded), wires, config.low_m)
    # One catenary per wire and span, ends at the supports
    pieces, wires = _spans(band, wires, config)
    # Keep what is isolated, now that all wires are known, and hangs
    wires, around = free_hanging(band, wires, pieces, times_order=time_s is not None)
    # Evidence is counted by the scan lines that cross a wire
    crossings = [_crossings(band, wire, time_s, laser, scanner) for wire in wires]
    sure = [confidence(w, a, n) for w, a, n in zip(wires, around, crossings, strict=True)]
    kept = [
        i
        for i, n in enumerate(crossings)
        if (n is None or n >= LEAST_CROSSINGS) and sure[i] >= LEAST_CONFIDENCE
    ]
    wires, sure = [wires[i] for i in kept], [sure[i] for i in kept]
    lines = lines_of_wires(band, wires, sure, time_s, config.spacing_m)
    # What stands where they end
    of_wire = np.zeros(len(band.xyz), dtype=bool)
    for wire in pieces:
        of_wire[wire.members] = True
    return LineSet.concatenate([lines, find_poles(band, lines, of_wire)])


def _crossings(
    band: CableBand,
    wire: FittedWire,
    time_s: FloatArray | None,
    laser: AnyArray | None,
    scanner: ScannerTiming | None,
) -> float | None:
    """Return the effective number of scan lines that drew a wire; None where points have no times that tell."""
    if time_s is None:
        return None
    points = band.index[wire.members]
    n = crossings_in_time(
        time_s[points], band.xyz[wire.members], None if laser is None else laser[points], scanner
    )
    return None if math.isnan(n) else n


def _found_wires(
    band: CableBand, config: CableConfig, widths: Widths, finder: PeakFinder | None
) -> tuple[list[FittedWire], list[FittedWire]]:
    """Return the thin pieces of wire about all seed lines, the strongest seed first; and those with others beside them."""
    lonely = np.flatnonzero(band.lonely)
    lonely = lonely[np.lexsort(band.xyz[lonely].T)]  # independent of the order of the points
    xyz = np.ascontiguousarray(band.xyz[lonely])
    index, free = IsolatedPoints.of(xyz), np.ones(len(xyz), dtype=bool)
    number = np.full(len(band.xyz), -1)
    number[lonely] = np.arange(len(lonely))
    wires, crowded = list[FittedWire](), list[FittedWire]()
    seeds = find_cable_seeds(xyz[:, :2], window_m=config.window_m, cell_m=config.cell_m, finder=finder)
    for seed in seeds:
        followed = follow_seed(index, free, seed, widths=widths, max_gap_m=config.max_gap_m)
        for points in followed.wires:
            for piece in _pieces(band, lonely[points], widths):
                if _is_thin(band, piece, config.low_m):
                    wires.append(piece)
                    mine = number[piece.members]
                    free[mine[mine >= 0]] = False
                elif _may_be_bundle(band, piece):
                    crowded.append(piece)
        crowded += [fit_members(band, lonely[points], widths) for points in followed.crowded]
    return wires, crowded


def _may_be_bundle(band: CableBand, piece: FittedWire) -> bool:
    """Return whether all that is about a piece is in narrow rows beside or above it."""
    plan = piece.plan
    line = np.array([plan.x, plan.y, plan.ux, plan.uy, piece.low_m, piece.high_m])
    s, o, dz = piece.residuals(band.xyz[band.near(line, piece.widths.crowd_m)])
    return is_in_rows(s, o, dz, piece.widths)


def _pieces(band: CableBand, points: IntArray, widths: Widths) -> list[FittedWire]:
    """Return the wires of a followed line, which may run past supports; `points` (k,) int64."""
    wire = fit_wire(band, points, widths)
    if wire is None or wire.length_m < LEAST_SEEN_M:
        return []
    parts = split_at_kink(band, wire, _KINK_M)
    if parts is None:
        return [wire]
    return [piece for part in parts for piece in _pieces(band, part, widths)]


def _spans(
    band: CableBand, wires: list[FittedWire], config: CableConfig
) -> tuple[list[FittedWire], list[FittedWire]]:
    """Return all pieces of wire, and one wire per span, ended at its supports."""
    whole = [settle_wire(band, w) for w in without_mixtures(band, join_pieces(band, wires))]
    pieces = [fit_exact_catenary(band, w) for w in without_tails(band, whole)]
    return pieces, end_at_supports(band, pieces, config.min_length_m)


def _thin_ones(
    band: CableBand, bundled: list[FittedWire], wires: list[FittedWire], low_m: float
) -> list[FittedWire]:
    """Return the wires of bundles that are thin when what was taken for a wire and is none counts as beside them.

    The wires that were found before (`wires`) are none of what is beside them.
    """
    kept = [w for w in bundled if _is_thin(band, w, low_m, of_bundle=True)]
    if len(kept) == len(bundled):
        return kept
    n = len(kept)
    return _thin_ones(band, among(kept + wires, band)[:n], wires, low_m)


def _is_thin(band: CableBand, wire: FittedWire, low_m: float, *, of_bundle: bool = False) -> bool:
    """Return whether a piece has the points, height, occupancy and surroundings of a wire.

    Wires of a bundle (`of_bundle`) that lie too near each other make a flat one, as the edge of a plate is, which sags;
    and each is as dense as its row was.
    """
    around = surroundings(band, wire, np.zeros(len(band.xyz), dtype=bool))
    scatter = max(wire.sigma_o_m, wire.fit.sigma_m)
    return (
        around.n_points >= LEAST_WIRE_POINTS
        and float(np.quantile(band.height_m[wire.members], _HEIGHT_QUANTILE)) >= low_m
        and around.occupied >= (LEAST_ROW_OCCUPIED if of_bundle else LEAST_OCCUPIED)
        and around.ringed <= MOST_RINGED
        and around.even >= LEAST_EVEN
        and around.wavy_m <= max(WAVY_GATES * wire.widths.gate_m, WAVY_SIGMAS * scatter)
        and (_is_round(wire) or (of_bundle and is_sagging(wire)))
    )


def _is_round(wire: FittedWire) -> bool:
    """Return whether the points scatter alike across the wire and in height, unlike those of the edge of a plate."""
    small, large = sorted((wire.sigma_o_m, wire.fit.sigma_m))
    return large <= max(wire.widths.round_m, ROUND_RATIO * small)
