"""Urban streets: kerbs, parked cars, footways, and house fronts with walls, hedges and fences.

Separate from `draw`, which draws what all roads have: each kind of road has a file of its own.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field, replace

import numpy as np

from linework.simulation.roads.alignment import Mouth, PiecewiseLinear, make_alignment
from linework.simulation.roads.draw_pieces import (
    MARGIN_M,
    arrow,
    crossing_wires,
    dashed_marking,
    grade_profile,
    pole_line,
    rail,
    solid_marking,
    uniform,
    zebra,
)
from linework.simulation.roads.draw_rural import gentle_bend
from linework.simulation.roads.road import Road, SideSection, make_stations
from linework.simulation.roads.scenario import (
    Cable,
    Car,
    Fence,
    Hedge,
    Marking,
    Plant,
    Pole,
    Rail,
    RoadLayout,
    Symbol,
    Wall,
)
from linework.simulation.scene.materials import Material


@dataclass(slots=True)
class _Street:
    """What stands along the street, filled side by side."""

    rails: list[Rail] = field(default_factory=list)
    fences: list[Fence] = field(default_factory=list)
    hedges: list[Hedge] = field(default_factory=list)
    walls: list[Wall] = field(default_factory=list)
    cars: list[Car] = field(default_factory=list)
    plants: list[Plant] = field(default_factory=list)
    poles: list[Pole] = field(default_factory=list)
    cables: list[Cable] = field(default_factory=list)


def draw_urban(rng: np.random.Generator, length_m: float) -> RoadLayout:
    """Return a street with 20 to 60 % of its kerbs parked up."""
    lane, parking = uniform(rng, 2.9, 3.5), uniform(rng, 2.0, 2.3)
    half, footway = lane + parking, uniform(rng, 1.7, 3.0)
    start, end = -MARGIN_M, length_m + MARGIN_M
    drops = {sign: _dropped(rng, start, end) for sign in (1, -1)}
    railed = 1 if rng.random() < 0.5 else -1
    mouths = {railed: (), -railed: _mouth(rng, length_m)}
    road = _road(rng, length_m, half, footway, (drops, mouths))
    street = _Street()
    parked = uniform(rng, 0.20, 0.60)
    for sign in (1, -1):
        rail_span = _rail_span(rng, start, end) if sign == railed else (end, end)
        if rail_span[1] > rail_span[0]:
            q = sign * (half + uniform(rng, 0.30, 0.60))
            street.rails.append(rail(rng, q, rail_span, -sign))
        elif rng.random() < 0.4:
            run = _rail_span(rng, *max(_clear(mouths[sign], start, end), key=lambda x: x[1] - x[0]))
            q = sign * (half + uniform(rng, 0.25, 0.45))
            height = uniform(rng, 0.8, 1.1)
            street.fences.append(
                Fence(q_m=q, start_m=run[0], end_m=run[1], height_m=height, form="tubes", post_every_m=2.0)
            )
        for run in _clear(mouths[sign], start, end):
            _park(rng, street, (sign * (half - 0.25), parked), run, rail_span)
            _fronts(rng, street, sign * (half + footway + 0.1), run)
            _lamps(rng, street, sign * (half + 0.55), run)
    # Poles on the side without side streets
    clear = _clear(mouths[-railed], start, end)
    _wires(rng, street, railed * (half + footway - 0.25), (start, end), clear)
    return RoadLayout(
        road=road,
        lanes=((-0.5 * lane, 1), (0.5 * lane, -1)),
        speed_mps=uniform(rng, 6.0, 10.0),
        markings=tuple(_markings(rng, lane, (start, end))),
        symbols=tuple(_symbols(rng, lane, length_m)),
        rails=tuple(street.rails),
        fences=tuple(street.fences),
        hedges=tuple(street.hedges),
        walls=tuple(street.walls),
        cars=tuple(street.cars),
        plants=tuple(street.plants),
        poles=tuple(street.poles),
        cables=tuple(street.cables),
    )


def _mouth(rng: np.random.Generator, length_m: float) -> tuple[Mouth, ...]:
    """Return a side street of 5 to 8 m with kerb returns of 3 to 8 m, on half of the longer roads."""
    if length_m < 80.0 or rng.random() < 0.5:
        return ()
    at = uniform(rng, 0.25, 0.75) * length_m
    return (Mouth(at, at + uniform(rng, 5.0, 8.0), uniform(rng, 3.0, 8.0)),)


def _clear(mouths: tuple[Mouth, ...], start: float, end: float) -> list[tuple[float, float]]:
    """Return the stretches between mouths."""
    cuts = [start, *(x for m in mouths for x in m.span), end]
    return list(itertools.pairwise(cuts))[::2]


def _dropped(rng: np.random.Generator, start: float, end: float) -> list[tuple[float, float]]:
    """Return where the kerb is dropped: drives of 3 to 6 m, every 15 to 40 m."""
    found, at = [], start + uniform(rng, 5.0, 25.0)
    while at < end - 10.0:
        run = uniform(rng, 3.0, 6.0)
        found.append((at, at + run))
        at += run + uniform(rng, 15.0, 40.0)
    return found


def _road(
    rng: np.random.Generator,
    length_m: float,
    half: float,
    footway: float,
    kerbs: tuple[dict[int, list[tuple[float, float]]], dict[int, tuple[Mouth, ...]]],
) -> Road:
    start, end = -MARGIN_M, length_m + MARGIN_M
    s, k = gentle_bend(rng, length_m, (60.0, 400.0))
    alignment = make_alignment(
        start,
        end,
        PiecewiseLinear(s, k),
        uniform(rng, 0.0, 2.0 * np.pi),
        grade_profile(rng, start, end, 0.06),
    )
    crown = PiecewiseLinear.constant(-uniform(rng, 0.015, 0.03))
    drops, mouths = kerbs
    sides = {}
    for sign in (1, -1):
        clear = _clear(mouths[sign], start, end)
        whole = [(a, b) for a, b in drops[sign] if any(c + 1.5 < a and b < d - 1.5 for c, d in clear)]
        sides[sign] = replace(_kerb_side(rng, half, footway, whole, start), mouths=mouths[sign])
    corners = [x for side in sides.values() for m in side.mouths for x in (*m.span, m.start_m, m.end_m)]
    breaks = np.concatenate([s, *(side.step_m.x for side in sides.values()), np.array(corners)])
    stations = make_stations(alignment, breaks, half_width_m=half)
    return Road(alignment, sides[1], sides[-1], crown, crown, stations)


def _kerb_side(
    rng: np.random.Generator, half: float, footway: float, drops: list[tuple[float, float]], start: float
) -> SideSection:
    height, low, ramp = uniform(rng, 0.08, 0.16), uniform(rng, 0.02, 0.03), uniform(rng, 0.5, 1.0)
    s, step = [start], [height]
    for a, b in drops:
        s += [a - ramp, a, b, b + ramp]
        step += [height, low, low, height]
    d = np.array([0.0, footway, footway + 0.3, footway + 12.0])
    z = np.array([0.0, 0.02 * footway, 0.02 * footway + 0.03, 0.02 * footway + uniform(rng, -0.2, 0.5)])
    material = (Material.FOOTWAY, Material.SOIL, Material.GRASS)
    return SideSection(half, "kerb", PiecewiseLinear(np.array(s), np.array(step)), d, z, material)


def _markings(rng: np.random.Generator, lane: float, span: tuple[float, float]) -> list[Marking]:
    width = uniform(rng, 0.10, 0.15)
    found = []
    if rng.random() < 0.75:
        found.append(
            dashed_marking(rng, 0.0, span, width, "centre", (3.0, 6.0) if rng.random() < 0.5 else (3.0, 3.0))
        )
    else:
        apart = 0.5 * (width + uniform(rng, 0.10, 0.18))
        found += [solid_marking(rng, sign * apart, span, width, "centre", double=True) for sign in (1, -1)]
    for sign in (1, -1):
        choice = rng.random()
        if choice < 0.5:
            found.append(solid_marking(rng, sign * lane, span, width, "edge"))
        elif choice < 0.7:
            found.append(dashed_marking(rng, sign * lane, span, width, "edge", (1.5, 1.5)))
    return found


def _symbols(rng: np.random.Generator, lane: float, length_m: float) -> list[Symbol]:
    """Return a zebra crossing and arrows, on half of the streets each."""
    found: list[Symbol] = []
    if rng.random() < 0.5:
        found += zebra(rng, uniform(rng, 0.1, 0.9) * length_m, lane)
    if rng.random() < 0.5:
        found += arrow(rng, uniform(rng, 0.1, 0.9) * length_m, -0.5 * lane)
    return found


def _rail_span(rng: np.random.Generator, start: float, end: float) -> tuple[float, float]:
    """Return where a rail guards the footway (a bank, a school): 18 to 60 m of the street."""
    run = min(uniform(rng, 18.0, 60.0), 0.6 * (end - start))
    a = uniform(rng, start + 2.0, end - run - 2.0)
    return (a, a + run)


def _park(
    rng: np.random.Generator,
    street: _Street,
    kerb: tuple[float, float],
    span: tuple[float, float],
    rail_span: tuple[float, float],
) -> None:
    """Add parked cars to `kerb` (their outer side, the share of the kerb they take); few beside the rail."""
    outer, share = kerb
    sign = float(np.sign(outer))
    at, taken = span[0] + uniform(rng, 0.0, 4.0), 0.0
    while at < span[1] - 6.0:
        length = uniform(rng, 3.7, 4.9)
        is_van, is_lorry = rng.random() < 0.12, rng.random() < 0.04
        length = uniform(rng, 6.5, 9.0) if is_lorry else length
        beside_rail = rail_span[0] - 1.0 < at + length and at < rail_span[1] + 1.0
        # A car takes its length and 1 m of kerb; what is behind the wanted share is caught up with
        chance = (0.3 if beside_rail else 1.0) * share + 0.06 * (share * (at - span[0]) - taken)
        if rng.random() < chance:
            taken += length + 1.0
            width = 2.3 if is_lorry else 2.0 if is_van else uniform(rng, 1.70, 1.90)
            tall = (2.8, 3.4) if is_lorry else (1.9, 2.4) if is_van else (1.4, 1.7)
            street.cars.append(
                Car(
                    s_m=at + 0.5 * length,
                    q_m=outer - sign * (0.5 * width + uniform(rng, 0.0, 0.15)),
                    length_m=length,
                    width_m=width,
                    height_m=uniform(rng, *tall),
                    is_lorry=is_lorry,
                    heading=int(-sign),
                )
            )
        at += length + uniform(rng, 0.6, 1.4)


def _fronts(rng: np.random.Generator, street: _Street, q: float, span: tuple[float, float]) -> None:
    """Add plot after plot: a wall, hedge or fence with the house behind it, or a house at the footway."""
    at, sign = span[0], float(np.sign(q))
    while at < span[1] - 8.0:
        end = min(at + uniform(rng, 10.0, 24.0), span[1])
        a, b = at + 0.5, end - uniform(rng, 0.5, 3.5)
        choice = rng.random()
        if choice < 0.22:
            street.walls.append(Wall(q_m=q, height_m=uniform(rng, 0.6, 1.1), start_m=a, end_m=b))
        elif choice < 0.47:
            width = uniform(rng, 0.6, 1.0)
            street.hedges.append(
                Hedge(
                    q_m=q + sign * (0.5 * width - 0.1),
                    width_m=width,
                    height_m=uniform(rng, 0.8, 1.9),
                    start_m=a,
                    end_m=b,
                )
            )
        elif choice < 0.68:
            street.fences.append(
                Fence(
                    q_m=q,
                    height_m=uniform(rng, 0.9, 1.8),
                    form=str(rng.choice(["mesh", "boards"])),
                    start_m=a,
                    end_m=b,
                )
            )
        if choice >= 0.82:
            street.walls.append(
                Wall(q_m=q, height_m=uniform(rng, 6.0, 12.0), is_facade=True, start_m=a, end_m=b)
            )
        elif rng.random() < 0.7:
            back = q + sign * uniform(rng, 3.5, 6.0)
            street.walls.append(
                Wall(q_m=back, height_m=uniform(rng, 5.0, 9.0), is_facade=True, start_m=a, end_m=b)
            )
        if 0.68 <= choice < 0.82 or rng.random() < 0.25:
            street.plants.append(
                Plant(
                    s_m=0.5 * (at + end),
                    q_m=q + sign * uniform(rng, 1.2, 2.5),
                    radius_m=uniform(rng, 0.8, 2.2),
                    height_m=uniform(rng, 3.5, 6.5),
                    trunk_m=uniform(rng, 1.5, 2.2),
                )
            )
        at = end


def _lamps(rng: np.random.Generator, street: _Street, q: float, span: tuple[float, float]) -> None:
    every = uniform(rng, 24.0, 36.0)
    for s in np.arange(span[0] + uniform(rng, 1.0, 20.0), span[1], every):
        if rng.random() < 0.6:
            street.poles.append(
                Pole(s_m=float(s), q_m=q, height_m=uniform(rng, 5.0, 8.0), radius_m=0.08, arm_m=1.2)
            )
        elif rng.random() < 0.6:
            street.poles.append(Pole(s_m=float(s), q_m=q, height_m=2.7, radius_m=0.04, has_sign=True))


def _wires(
    rng: np.random.Generator,
    street: _Street,
    q: float,
    span: tuple[float, float],
    clear: list[tuple[float, float]],
) -> None:
    """Add a pole line at `q` and wires across the street, whose far poles are clear of side streets."""
    along = rng.random() < 0.75
    if along:
        poles, cables = pole_line(rng, q, *span, over_road=True)
        street.poles += poles
        street.cables += cables
    if not along or rng.random() < 0.4:
        a, b = max(clear, key=lambda run: run[1] - run[0])
        at = uniform(rng, a + 8.0, b - 8.0)
        poles, cables = crossing_wires(rng, at, q, -q, uniform(rng, 6.0, 7.5))
        street.poles += poles
        street.cables += cables
