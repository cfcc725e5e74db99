"""Village streets: narrow, between walls, with low and flush kerbs, gutters, cobbles, tram rails, parking bays.

Separate from `draw`, which draws what all roads have: each kind of road has a file of its own.
"""

from __future__ import annotations

import numpy as np

from linework.simulation.roads.alignment import PiecewiseLinear, make_alignment
from linework.simulation.roads.draw_pieces import (
    MARGIN_M,
    dashed_marking,
    grade_profile,
    solid_marking,
    uniform,
    wear,
)
from linework.simulation.roads.draw_rural import gentle_bend
from linework.simulation.roads.draw_stains import road_stains
from linework.simulation.roads.road import Road, SideSection, make_stations
from linework.simulation.roads.scenario import Marking, RoadLayout, Stain, Symbol, Wall
from linework.simulation.scene.materials import Material


def draw_village(rng: np.random.Generator, length_m: float) -> RoadLayout:
    """Return a street of 4.5 to 7 m whose footways lie 1 to 3 cm above it, flush with it, or 5 to 12 cm above."""
    half, span = uniform(rng, 2.25, 3.5), (-MARGIN_M, length_m + MARGIN_M)
    s, k = gentle_bend(rng, length_m, (50.0, 300.0))
    alignment = make_alignment(
        *span, PiecewiseLinear(s, k), uniform(rng, 0.0, 2.0 * np.pi), grade_profile(rng, *span, 0.06)
    )
    crown = PiecewiseLinear.constant(-uniform(rng, 0.01, 0.025))
    sides = {sign: _footway(rng, half, span) for sign in (1, -1)}
    breaks = np.concatenate([s, sides[1].step_m.x, sides[-1].step_m.x])
    stations = make_stations(alignment, breaks, half_width_m=half)
    road = Road(alignment, sides[1], sides[-1], crown, crown, stations)
    stains, walls, symbols = road_stains(rng, half, span), [], []
    for sign in (1, -1):
        stains += _edge_stones(rng, sign * half, span)
        walls += _fronts(rng, sign * (half + float(sides[sign].land_d_m[1])), span)
    if rng.random() < 0.3:
        stains += _tram(rng, half, span)
    if rng.random() < 0.3:
        stains += _cobbles(rng, half, span)
    if rng.random() < 0.5:
        symbols += _bays(rng, half, length_m)
    if rng.random() < 0.4:
        symbols += _letters(rng, half, length_m)
    return RoadLayout(
        road=road,
        lanes=((-0.45 * half, 1), (0.45 * half, -1)),
        speed_mps=uniform(rng, 4.0, 8.0),
        markings=tuple(_lines(rng, half, span)),
        symbols=tuple(symbols),
        walls=tuple(walls),
        stains=tuple(stains),
    )


def _footway(rng: np.random.Generator, half: float, span: tuple[float, float]) -> SideSection:
    """Return a footway of 0.5 to 2 m: low (40 %), flush (15 %) or with an ordinary kerb, dropped at drives."""
    choice = rng.random()
    high = uniform(rng, 0.01, 0.03) if choice < 0.4 else uniform(rng, 0.05, 0.12)
    high = 0.0 if choice > 0.85 else high
    s, z = [span[0]], [high]
    at = span[0] + uniform(rng, 5.0, 20.0)
    while high >= 0.05 and at < span[1] - 8.0:
        end = at + uniform(rng, 3.0, 5.0)
        s += [at - 0.6, at, end, end + 0.6]
        z += [high, 0.02, 0.02, high]
        at = end + uniform(rng, 8.0, 30.0)
    wide = uniform(rng, 0.5, 2.0)
    d, land = (
        np.array([0.0, wide, wide + 8.0]),
        np.array([0.0, 0.02 * wide, 0.02 * wide + uniform(rng, -0.1, 0.3)]),
    )
    # A flush footway is another material beside the asphalt: an edge without a step
    form = "edge" if high == 0.0 else "kerb"
    step = PiecewiseLinear(np.array(s), np.array(z))
    return SideSection(half, form, step, d, land, (Material.FOOTWAY, Material.GRASS))


def _edge_stones(rng: np.random.Generator, q: float, span: tuple[float, float]) -> list[Stain]:
    """Return bright kerb stones (50 %), and a gutter of 0.15 to 0.5 m beside them (50 %), bright or dark."""
    sign, found = float(np.sign(q)), []
    if rng.random() < 0.5:
        a, b = sorted((q, q + sign * 0.15))
        found.append(
            Stain(
                start_m=span[0], end_m=span[1], right_m=a, left_m=b, shade=uniform(rng, 1.3, 2.2), soft_m=0.01
            )
        )
    if rng.random() < 0.5:
        a, b = sorted((q, q - sign * uniform(rng, 0.15, 0.5)))
        shade = uniform(rng, 1.3, 2.2) if rng.random() < 0.7 else uniform(rng, 0.5, 0.8)
        found.append(
            Stain(
                start_m=span[0], end_m=span[1], right_m=a, left_m=b, shade=shade, soft_m=0.01, role="gutter"
            )
        )
    return found


def _fronts(rng: np.random.Generator, q: float, span: tuple[float, float]) -> list[Wall]:
    """Return house fronts and walls at the back of the footway, with gaps."""
    found, at = [], span[0]
    while at < span[1] - 5.0:
        end = min(at + uniform(rng, 5.0, 16.0), span[1])
        if rng.random() < 0.85:
            is_house = rng.random() < 0.6
            height = uniform(rng, 4.0, 9.0) if is_house else uniform(rng, 0.5, 2.2)
            found.append(Wall(q_m=q, start_m=at + 0.1, end_m=end, height_m=height, is_facade=is_house))
        at = end + (uniform(rng, 1.0, 5.0) if rng.random() < 0.4 else 0.0)
    return found


def _tram(rng: np.random.Generator, half: float, span: tuple[float, float]) -> list[Stain]:
    """Return a pair of tram rails, 1.435 m apart: bright heads of 6 cm with a dark groove of 4 cm inside."""
    middle, shade, found = uniform(rng, -0.4, 0.4) * half, uniform(rng, 1.5, 2.5), []
    for sign in (-1.0, 1.0):
        inner = middle + sign * 0.7175
        for a, b, value in ((inner, inner + sign * 0.06, shade), (inner - sign * 0.04, inner, 0.4)):
            right, left = sorted((a, b))
            found.append(
                Stain(start_m=span[0], end_m=span[1], right_m=right, left_m=left, shade=value, soft_m=0.01)
            )
    return found


def _cobbles(rng: np.random.Generator, half: float, span: tuple[float, float]) -> list[Stain]:
    """Return courses of bright stones across a stretch of the street, 12 to 20 cm from joint to joint."""
    start = uniform(rng, *span)
    end = min(start + uniform(rng, 8.0, 25.0), span[1])
    every, shade = uniform(rng, 0.12, 0.20), uniform(rng, 1.2, 1.8)
    return [
        Stain(
            start_m=float(s), end_m=float(s) + every - 0.02, right_m=-half, left_m=half,
            shade=shade * uniform(rng, 0.9, 1.1), soft_m=0.01,
        )
        for s in np.arange(start, end, every)
    ]  # fmt: skip


def _lines(rng: np.random.Generator, half: float, span: tuple[float, float]) -> list[Marking]:
    """Return a centre line, edge lines, both or (35 %) nothing."""
    width, choice = uniform(rng, 0.08, 0.13), rng.random()
    found = []
    if 0.35 < choice < 0.75:
        found.append(dashed_marking(rng, 0.0, span, width, "centre", (3.0, 3.0)))
    if choice > 0.6:
        found += [solid_marking(rng, sign * (half - 0.7), span, width, "edge") for sign in (1, -1)]
    return found


def _bays(rng: np.random.Generator, half: float, length_m: float) -> list[Symbol]:
    """Return parking bays of 5.5 m along one side: bars of 1.7 m across."""
    sign, worn = float(rng.choice([-1.0, 1.0])), wear(rng)
    first = uniform(rng, 0.0, 0.4) * length_m
    right, left = sorted((sign * (half - 0.1), sign * (half - 1.8)))
    return [
        Symbol(start_m=float(s), end_m=float(s) + 0.1, right_m=right, left_m=left, wear=worn, form="other")
        for s in first + 5.5 * np.arange(1 + int(rng.integers(2, 7)))
        if s < length_m
    ]


def _letters(rng: np.random.Generator, half: float, length_m: float) -> list[Symbol]:
    """Return tall letters of a bus stop: upright strokes of 1.6 m, each with strokes across."""
    at, q, worn = uniform(rng, 0.2, 0.8) * length_m, -0.8 * half, wear(rng)
    found = []
    for i in range(3):
        right = q + 0.45 * i
        found.append(
            Symbol(start_m=at, end_m=at + 1.6, right_m=right, left_m=right + 0.1, wear=worn, form="other")
        )
        found += [
            Symbol(start_m=at + up, end_m=at + up + 0.15, right_m=right + 0.1, left_m=right + 0.3, wear=worn)
            for up in (0.0, 0.72, 1.45)
        ]
    return found
