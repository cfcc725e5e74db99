"""What hangs free: of the wires that were found, those that sag or are taut with nothing else along them.

Separate from `find`, which follows wires: this is how wires are told from edges of roofs, decks, beams and walls.
"""

from __future__ import annotations

import numpy as np

from linework.methods.cables.band import CableBand
from linework.methods.cables.fit import FittedWire, WireSurroundings, among, surroundings

#: Largest share of a short wire's metres with points of other objects within 0.6 m: a wire may pass through a crown, an
#: edge has its wall or roof all along [1]. Length from which a wire that sags need not pass this test [m].
MOST_CROWDED, LONG_WIRE_M = 0.6, 16.0
#: Largest share of metres with points in the ring, where the points scatter like those of a beam.
MOST_RINGED_THICK = 0.3
#: Curvature of the tautest wire, a = H / w of 3 km: steel at a fifth of its strength, copper and aluminium less [1/m].
#: Straighter lines must be thin, with other points in at most this share of their metres (contact wires) [1].
TAUTEST_PER_M, MOST_CROWDED_TAUT = 1.0 / 3000.0, 0.1
#: Largest turn of a wire from end to end, eight times its sag over its length: 0.5 is a slack drop line with 6 % (main
#: lines have 1 to 3 %). Largest slope at its ends: that of a drop line from a pole to a low eave.
MOST_TURN, STEEPEST = 0.5, 0.45
#: Largest scatter of a taut wire, in gates: the chord of a truss is 6 cm and more.
THIN_GATES = 0.2
#: Length below which the sag cannot be told from noise; such pieces are kept only beside longer wires. [m]
SHORT_WIRE_M = 8.0
#: Without times, points of a single sweep lie in a plane within this [m]: the line may be the edge or the face of anything,
#: must sag, and nothing may be near it except what it hangs on.
ONE_SWEEP_M = 0.002
#: A contact wire lies at most so far below the wire that carries it, and so far to a side [m]: 1.4 to 1.8 m on open line,
#: less in streets; staggered by 0.4 m (EN 50119, EN 50367). Least share of its length below carrying wires.
MOST_BELOW_M, MOST_ASIDE_M, LEAST_CARRIED = 2.2, 0.6, 0.5
#: Scatter of a contact wire over that of the wire that carries it: the same scanner measured both.
_LIKE_SCATTER = 2.0
#: Distance of the places at which the wire above is looked for. [m]
_EVERY_M = 1.0
#: Curvature of a wire that sags, in its standard deviations.
_SAG_SIGMAS = 3.0


def is_sagging(wire: FittedWire) -> bool:
    """Return whether the curvature is significant, and larger than that of the tautest wire."""
    return wire.fit.curve.curvature_per_m > max(_SAG_SIGMAS * wire.fit.curvature_sigma_per_m, TAUTEST_PER_M)


def free_hanging(
    band: CableBand, wires: list[FittedWire], pieces: list[FittedWire], *, times_order: bool
) -> tuple[list[FittedWire], list[WireSurroundings]]:
    """Return the wires that hang free, and the surroundings of each.

    Points of other wires do not count as surroundings, except those of straight ones: a scanner that drives past a
    far wall leaves a stack of straight lines on it. A contact wire is straight, but hangs from a wire that sags.
    """
    n_given, wires = len(wires), [w for w in wires if _is_gentle(w)]
    above = [_carriers(wire, wires) for wire in wires]
    carrying = {i for carriers in above for i in carriers}
    of_wire = np.zeros(len(band.xyz), dtype=bool)
    for wire in pieces:
        of_wire[wire.members] |= is_sagging(wire) or wire.length_m < SHORT_WIRE_M
    for wire in [w for w, carriers in zip(wires, above, strict=True) if carriers]:
        of_wire[wire.members] = True
    kept = list[tuple[FittedWire, WireSurroundings]]()
    for i, wire in enumerate(wires):
        around = surroundings(band, wire, of_wire)
        in_pair = (i in carrying or bool(above[i])) and _is_clear(wire, around)
        if in_pair or _hangs(wire, around, not times_order and _is_flat(wire)):
            kept.append((wire, around))
    remaining = [w for w, _ in kept]
    # What was fitted together with a wire and is none is beside it
    if len(remaining) < n_given and any(len(w.others) for w in remaining):
        return free_hanging(band, among(remaining, band), pieces, times_order=times_order)
    return remaining, [a for _, a in kept]


def _carriers(wire: FittedWire, wires: list[FittedWire]) -> list[int]:
    """Return the numbers of the wires that carry a straight one: they sag above it, over most of its length."""
    if is_sagging(wire) or wire.length_m < SHORT_WIRE_M:
        return []
    stations = np.arange(wire.low_m, wire.high_m, _EVERY_M)
    places = wire.at(stations)
    carried = np.zeros(len(stations), dtype=bool)
    carriers = []
    for i, other in enumerate(wires):
        if not _may_meet(wire, other) or not is_sagging(other):
            continue
        if _scatter_m(wire) > _LIKE_SCATTER * _scatter_m(other):
            continue
        s, o, dz = other.residuals(places)
        is_below = (np.abs(o) <= MOST_ASIDE_M) & (-dz > 0.0) & (-dz <= MOST_BELOW_M)
        is_below &= (s >= other.low_m) & (s <= other.high_m)
        if float(is_below.sum()) * _EVERY_M >= LEAST_CARRIED * min(wire.length_m, other.length_m):
            carried |= is_below
            carriers.append(i)
    return carriers if carried.mean() >= LEAST_CARRIED else []


def _may_meet(wire: FittedWire, other: FittedWire) -> bool:
    """Return whether two wires are near enough in plan for one to hang from the other."""
    middles = [w.plan.places(np.array([(w.low_m + w.high_m) / 2.0]))[0] for w in (wire, other)]
    reach_m = (wire.length_m + other.length_m) / 2.0 + MOST_ASIDE_M
    return bool(np.hypot(*(middles[1] - middles[0])) <= reach_m)


def _scatter_m(wire: FittedWire) -> float:
    """Return the standard deviation of the points of a wire across or in height, the larger one [m]."""
    return max(wire.sigma_o_m, wire.fit.sigma_m)


def _is_flat(wire: FittedWire) -> bool:
    """Return whether all points lie in a plane, as those of one sweep do."""
    return min(wire.sigma_o_m, wire.fit.sigma_m) < ONE_SWEEP_M


def _is_gentle(wire: FittedWire) -> bool:
    """Return whether sag and slope are those of a wire; leaves and rows of points on walls make any curve."""
    ends = wire.fit.curve.slope_at(np.array([wire.low_m, wire.high_m]))
    turn = wire.fit.curve.curvature_per_m * wire.length_m
    return bool(turn <= MOST_TURN and np.abs(ends).max() <= STEEPEST)


def _is_clear(wire: FittedWire, around: WireSurroundings) -> bool:
    """Return whether the ring about it is empty, or its points scatter no farther than those of a wire."""
    return around.ringed <= MOST_RINGED_THICK or _scatter_m(wire) <= wire.widths.round_m


def _hangs(wire: FittedWire, around: WireSurroundings, one_sweep: bool) -> bool:
    """Return whether it sags, or is thin and isolated enough to be taut: edges of buildings are straight."""
    does_sag, is_short = is_sagging(wire), wire.length_m < SHORT_WIRE_M
    if one_sweep:
        return does_sag and around.taken == 0
    in_company = around.crowded <= MOST_CROWDED and _is_clear(wire, around)
    is_alone = around.crowded + around.ringed <= MOST_CROWDED_TAUT
    is_thin = _scatter_m(wire) <= THIN_GATES * wire.widths.gate_m
    return ((does_sag or is_short) and (in_company or wire.length_m >= LONG_WIRE_M)) or (is_alone and is_thin)
