"""Junctions: T-junctions and crossings, lanes that begin and end, roundabouts.

Separate from `draw`, which draws what all roads have: each kind of road has a file of its own.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from linework.errors import UsageError, argument
from linework.simulation.roads.alignment import Mouth, PiecewiseLinear, make_alignment
from linework.simulation.roads.draw_pieces import (
    MARGIN_M,
    arrow,
    dashed_marking,
    grade_profile,
    solid_marking,
    uniform,
    wear,
)
from linework.simulation.roads.draw_rural import gentle_bend
from linework.simulation.roads.draw_stains import road_stains
from linework.simulation.roads.road import Road, SideSection, make_stations
from linework.simulation.roads.scenario import Island, Plant, RoadLayout, Symbol
from linework.simulation.scene.materials import Material

_LAND_M = 16.0
#: A ring of this length has a radius of 42 m: the largest roundabouts.
MOST_RING_M = 250.0


def draw_junction(rng: np.random.Generator, length_m: float) -> RoadLayout:
    """Return a road with a T-junction or a crossing, with kerbs or verges round its corners."""
    half, span = uniform(rng, 2.9, 3.8), (-MARGIN_M, length_m + MARGIN_M)
    wide, radius = uniform(rng, 5.0, 7.5), uniform(rng, 4.0, 9.0)
    at = uniform(rng, 0.4, 0.6) * length_m - 0.5 * wide
    mouth = Mouth(at, at + wide, radius)
    arms = (1, -1) if rng.random() < 0.5 else (int(rng.choice([-1, 1])),)
    form = "kerb" if rng.random() < 0.5 else "edge"
    sides = {sign: _side(rng, half, form, (mouth,) if sign in arms else ()) for sign in (1, -1)}
    road = _road(rng, length_m, sides, (250.0, 900.0))
    width = uniform(rng, 0.10, 0.15)
    markings = [
        solid_marking(rng, sign * (half - 0.4), (a, b), width, "edge")
        for sign in (1, -1)
        for a, b in (((span[0], mouth.span[0]), (mouth.span[1], span[1])) if sign in arms else (span,))
    ]
    if rng.random() < 0.4:
        markings = []
    near = 0.5 * (mouth.start_m + mouth.end_m) - uniform(rng, 12.0, 18.0)
    markings += [
        dashed_marking(rng, 0.0, (span[0], near), width, "centre", (3.0, 6.0)),
        solid_marking(rng, 0.0, (near, mouth.start_m), width, "centre"),
        dashed_marking(rng, 0.0, (mouth.end_m, span[1]), width, "centre", (3.0, 6.0)),
    ]
    symbols: list[Symbol] = []
    for sign in arms:
        symbols += _arm(rng, mouth, sign, half)
    if rng.random() < 0.5:
        symbols += arrow(rng, near + 2.0, -0.5 * half)
    return RoadLayout(
        road=road,
        lanes=((-0.5 * half, 1), (0.5 * half, -1)),
        speed_mps=uniform(rng, 6.0, 12.0),
        markings=tuple(markings),
        symbols=tuple(symbols),
        stains=tuple(road_stains(rng, half, span)),
    )


def _arm(rng: np.random.Generator, mouth: Mouth, sign: int, half: float) -> list[Symbol]:
    """Return the paint of a side street: a stop or give-way line, a centre line, a zebra crossing on some."""
    middle, worn = 0.5 * (mouth.start_m + mouth.end_m), wear(rng)
    # Right-hand traffic: who comes from the left arm (towards negative offsets) keeps to lower chainages
    lane = (mouth.start_m + 0.3, middle - 0.1) if sign > 0 else (middle + 0.1, mouth.end_m - 0.3)

    def across(near: float, far: float) -> tuple[float, float]:
        a, b = sorted((sign * (half + near), sign * (half + far)))
        return a, b

    found = []
    begin = uniform(rng, 0.4, 1.5)
    right, left = across(begin, begin + 0.5)
    if rng.random() < 0.5:
        found.append(
            Symbol(start_m=lane[0], end_m=lane[1], right_m=right, left_m=left, wear=worn, form="stop")
        )
    else:
        found += [
            Symbol(
                start_m=float(s), end_m=float(s) + 0.5, right_m=right, left_m=left, wear=worn, form="other"
            )
            for s in np.arange(lane[0], lane[1] - 0.4, 0.8)
        ]
    clear = begin + 0.6
    if rng.random() < 0.4:
        clear = mouth.radius_m + 4.5
        right, left = across(mouth.radius_m + 0.5, mouth.radius_m + 4.0)
        found += [
            Symbol(
                start_m=float(s), end_m=float(s) + 0.5, right_m=right, left_m=left, wear=worn, form="zebra"
            )
            for s in np.arange(mouth.start_m + 0.3, mouth.end_m - 0.7, 1.0)
        ]
    right, left = across(clear, _LAND_M - 0.5)
    line = Symbol(
        start_m=middle - 0.06, end_m=middle + 0.06, right_m=right, left_m=left, wear=worn, form="other",
        role="centre",
    )  # fmt: skip
    return [*found, line]


def _side(
    rng: np.random.Generator, half: float, form: str, mouths: tuple[Mouth, ...], reach_m: float = _LAND_M
) -> SideSection:
    """Return a kerb of 8 to 15 cm, dropped round half of the corners, or a verge 12 cm lower to 12 cm higher."""
    if form == "kerb":
        high, low = uniform(rng, 0.08, 0.15), uniform(rng, 0.02, 0.03)
        step = PiecewiseLinear.constant(high)
        if mouths and rng.random() < 0.5:
            s, z = [mouths[0].span[0] - 20.0], [high]
            for m in mouths:
                s += [m.span[0] - 1.0, m.span[0], m.span[1], m.span[1] + 1.0]
                z += [high, low, low, high]
            step = PiecewiseLinear(np.array(s), np.array(z))
        d, material = [0.0, uniform(rng, 1.5, 2.5), reach_m], (Material.FOOTWAY, Material.GRASS)
    else:
        size = uniform(rng, 0.05, 0.12)
        step = PiecewiseLinear.constant(size if rng.random() < 0.4 else -size)
        first = Material.SOIL if rng.random() < 0.3 else Material.GRASS
        d, material = [0.0, uniform(rng, 0.8, 1.6), reach_m], (first, Material.GRASS)
    return SideSection(half, form, step, np.array(d), np.zeros(3), material, mouths)


def _road(
    rng: np.random.Generator, length_m: float, sides: dict[int, SideSection], radii: tuple[float, float]
) -> Road:
    start, end = -MARGIN_M, length_m + MARGIN_M
    s, k = gentle_bend(rng, length_m, radii)
    grade = grade_profile(rng, start, end, 0.03)
    alignment = make_alignment(start, end, PiecewiseLinear(s, k), uniform(rng, 0.0, 2.0 * np.pi), grade)
    return _finished(rng, Road(alignment, sides[1], sides[-1], *(PiecewiseLinear.constant(0.0),) * 2, s))


def _finished(rng: np.random.Generator, road: Road) -> Road:
    """Return the road with its crossfall, and stations wherever something begins or ends."""
    crown = PiecewiseLinear.constant(-uniform(rng, 0.015, 0.03))
    breaks = [road.stations_m]
    for side in (road.left, road.right):
        breaks += [side.step_m.x, side.extra_m.x]
        breaks += [np.array([*m.span, m.start_m, m.end_m]) for m in side.mouths]
    widest = max(side.width_m + float(side.extra_m.y.max()) for side in (road.left, road.right))
    stations = make_stations(road.alignment, np.concatenate(breaks), half_width_m=widest)
    return replace(road, slope_left=crown, slope_right=crown, stations_m=stations)


def draw_gore(rng: np.random.Generator, length_m: float) -> RoadLayout:
    """Return two lanes of one direction, and a third that begins and is dropped behind hatching."""
    half, lane = uniform(rng, 3.9, 4.4), uniform(rng, 3.2, 3.6)
    span = (-MARGIN_M, length_m + MARGIN_M)
    taper = uniform(rng, 0.2, 0.3) * length_m
    begin = uniform(rng, 0.0, 0.15) * length_m
    s = np.round([begin, begin + taper, 0.9 * length_m - taper, 0.9 * length_m], 1)
    extra = PiecewiseLinear(s, np.array([0.0, lane, lane, 0.0]))
    sides = {1: _side(rng, half, "edge", ()), -1: replace(_side(rng, half, "edge", ()), extra_m=extra)}
    road = _road(rng, length_m, sides, (400.0, 1500.0))
    width, inside = uniform(rng, 0.12, 0.15), uniform(rng, 0.3, 0.5)
    out = replace(extra, y=-extra.y)
    right = solid_marking(rng, inside - half, span, width, "edge")
    wide_from, wide_to = float(s[1] - 0.3 * taper), float(s[2])
    markings = [
        solid_marking(rng, half - inside, span, width, "edge"),
        replace(right, shift_m=out),
        dashed_marking(rng, 0.0, span, width, "lane", (4.0, 8.0)),
        dashed_marking(rng, inside - half, (wide_from, wide_to), 0.25, "lane", (3.0, 3.0)),
        solid_marking(rng, inside - half, (wide_to, float(s[3]) - 4.0), 0.25, "lane"),
    ]
    worn = wear(rng)
    symbols = [
        Symbol(
            start_m=float(at), end_m=float(at) + 0.6, left_m=inside - half - 0.4,
            right_m=inside - half + 0.4 - float(extra(at + 0.6)), wear=worn, form="other",
        )
        for at in np.arange(s[2] + 0.3 * taper, s[3], 2.0)
        if extra(at + 0.6) > 1.3
    ]  # fmt: skip
    symbols += arrow(rng, wide_from + 4.0, inside - half - 0.5 * lane)
    return RoadLayout(
        road=road,
        lanes=((-0.5 * half, 1), (0.5 * half, 1)),
        speed_mps=uniform(rng, 12.0, 22.0),
        markings=tuple(markings),
        symbols=tuple(symbols),
        stains=tuple(road_stains(rng, half, span)),
        closed_m=((wide_to, span[1], -half - lane, inside - half),),
    )


def draw_roundabout(rng: np.random.Generator, length_m: float) -> RoadLayout:
    """Return a ring as long as the drive, with three to five arms and their splitter islands.

    Raises
    ------
    UsageError
        A ring of more than 250 m.
    """
    if length_m > MOST_RING_M:
        raise UsageError(
            f"a roundabout of {length_m:g} m is too large",
            where=argument("length_m"),
            advice=f"choose at most {MOST_RING_M:g} m",
        )
    start, end = -MARGIN_M, length_m + MARGIN_M
    radius, half = (end - start) / (2.0 * np.pi), uniform(rng, 2.6, 3.6)
    # The van drives anticlockwise, with the middle of the roundabout on its left
    alignment = make_alignment(
        start,
        end,
        PiecewiseLinear.constant(1.0 / radius),
        uniform(rng, 0.0, 6.3),
        PiecewiseLinear.constant(0.0),
    )
    n = 3 if length_m < 70.0 else int(rng.integers(3, 6))
    wide, turn = min(uniform(rng, 5.5, 7.0), 0.45 * length_m / n), min(uniform(rng, 3.0, 5.0), 0.1 * length_m)
    first = start + 0.5 * (end - start) / n - 0.5 * wide
    mouths = tuple(Mouth(at, at + wide, turn) for at in first + np.arange(n) * (end - start) / n)
    inner = _side(rng, half, "kerb", (), reach_m=0.84 * radius - half)
    form = "kerb" if rng.random() < 0.6 else "edge"
    sides = {1: inner, -1: _side(rng, half, form, mouths, reach_m=12.0)}
    bare = Road(alignment, sides[1], sides[-1], *(PiecewiseLinear.constant(0.0),) * 2, np.zeros(0))
    islands, symbols, markings = [], [], []
    width = uniform(rng, 0.10, 0.15)
    for m in mouths:
        middle = 0.5 * (m.start_m + m.end_m)
        near, far = -half - uniform(rng, 1.2, 1.8), -half - 9.0
        outline = ((middle - 0.7, near), (middle - 0.2, far), (middle + 0.2, far), (middle + 0.7, near))
        islands.append(Island(outline=outline, height_m=uniform(rng, 0.06, 0.14)))
        # Who enters comes from the right arm and keeps to its own right: higher chainages
        worn = wear(rng)
        symbols += [
            Symbol(
                start_m=float(s), end_m=float(s) + 0.5, right_m=-half - 0.7, left_m=-half - 0.2, wear=worn,
                form="other",
            )
            for s in np.arange(middle + 0.4, m.end_m - 0.5, 0.8)
        ]  # fmt: skip
    if rng.random() < 0.6:
        markings.append(solid_marking(rng, half - 0.35, (start, end), width, "edge"))
    for a, b in zip([start, *(m.span[1] for m in mouths)], [*(m.span[0] for m in mouths), end], strict=True):
        if b - a > 1.0:
            markings.append(solid_marking(rng, 0.35 - half, (a, b), width, "edge"))
    return RoadLayout(
        road=_finished(rng, bare),
        lanes=((0.0, 1),),
        speed_mps=uniform(rng, 5.0, 8.0),
        markings=tuple(markings),
        symbols=tuple(symbols),
        islands=tuple(islands),
        plants=(Plant(s_m=0.0, q_m=radius, radius_m=0.2 * radius, height_m=uniform(rng, 1.0, 3.0)),),
        stains=tuple(road_stains(rng, half, (start, end))),
    )
