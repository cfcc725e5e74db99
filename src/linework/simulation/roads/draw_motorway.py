"""Motorways: two carriageways, a guarded median, shoulders, gentle bends.

Separate from `draw`, which draws what all roads have: each kind of road has a file of its own.
"""

from __future__ import annotations

import numpy as np

from linework.simulation.roads.alignment import PiecewiseLinear, make_alignment
from linework.simulation.roads.draw_pieces import (
    MARGIN_M,
    bushes_at,
    crossing_wires,
    dashed_marking,
    double_rail,
    grade_profile,
    rail,
    solid_marking,
    stretches,
    uniform,
)
from linework.simulation.roads.draw_rural import gentle_bend
from linework.simulation.roads.road import Road, SideSection, make_stations
from linework.simulation.roads.scenario import (
    Barrier,
    Bridge,
    Cable,
    Car,
    Gantry,
    Hedge,
    Marking,
    Pole,
    Rail,
    RoadLayout,
    Wall,
)
from linework.simulation.scene.materials import Material


def draw_motorway(rng: np.random.Generator, length_m: float) -> RoadLayout:
    """Return a motorway; the van drives the right carriageway."""
    lane, n_lanes = uniform(rng, 3.5, 3.75), int(rng.integers(2, 4))
    strip, shoulder, median = uniform(rng, 0.6, 1.0), uniform(rng, 2.3, 3.0), uniform(rng, 2.6, 4.0)
    width = strip + n_lanes * lane + shoulder
    half = 0.5 * width
    road = _road(rng, length_m, half, median, width)
    span = (road.alignment.start_m, road.alignment.end_m)
    first = half - strip  # offset of the leftmost lane's left edge
    centres = [first - lane * (i + 0.5) for i in range(n_lanes)]
    rails, barriers = _median(rng, half, median, span)
    outer = -half - uniform(rng, 0.5, 1.0)
    run = stretches(rng, span[0], span[1], int(rng.integers(0, 3)), (6.0, 25.0))
    rails += [rail(rng, outer, piece, 1) for piece in run]
    walls, hedges = _noise_walls(rng, half, span)
    poles, cables = _wires(rng, half, median + width, length_m)
    return RoadLayout(
        road=road,
        lanes=((centres[-1], 1), (centres[-2], 1)),
        speed_mps=uniform(rng, 18.0, 25.0),
        markings=tuple(_markings(rng, (half, median, width), (first, lane, n_lanes), span)),
        rails=tuple(rails),
        barriers=tuple(barriers),
        walls=tuple(walls),
        hedges=tuple(hedges),
        plants=tuple(bushes_at(rng, rails, 0.3)),
        poles=tuple(poles),
        cables=tuple(cables),
        cars=tuple(_traffic(rng, half, (median, width), centres[0], length_m)),
        bridges=_bridges(rng, length_m),
        gantries=_gantries(rng, half, median, length_m),
        far_edges_m=(half + median, half + median + width),
    )


def _road(rng: np.random.Generator, length_m: float, half: float, median: float, width: float) -> Road:
    start, end = -MARGIN_M, length_m + MARGIN_M
    s, k = gentle_bend(rng, length_m, (500.0, 2500.0))
    alignment = make_alignment(
        start,
        end,
        PiecewiseLinear(s, k),
        uniform(rng, 0.0, 2.0 * np.pi),
        grade_profile(rng, start, end, 0.04),
    )
    fall = 0.025
    step = uniform(rng, -0.05, -0.01)
    # The other carriageway mirrors this one: it falls away from the median
    d = np.array(
        [
            0.0,
            median - 0.02,
            median,
            median + width,
            median + width + 0.02,
            median + width + 2.0,
            median + width + 8.0,
        ]
    )
    z = np.array(
        [0.0, 0.0, -step, -step - fall * width, -fall * width, -fall * width - 0.1, -fall * width - 1.2]
    )
    grass, soil, asphalt = Material.GRASS, Material.SOIL, Material.ASPHALT
    left = SideSection(
        half, "edge", PiecewiseLinear.constant(step), d, z, (grass, soil, asphalt, grass, grass, grass)
    )
    bank = uniform(rng, -2.0, 1.5)
    right = SideSection(
        half,
        "edge",
        PiecewiseLinear.constant(step),
        np.array([0.0, 1.6, 6.0, 18.0]),
        np.array([0.0, -0.09, bank, bank + 0.2]),
        (grass,) * 3,
    )
    stations = make_stations(alignment, s, half_width_m=half)
    return Road(
        alignment, left, right, PiecewiseLinear.constant(fall), PiecewiseLinear.constant(-fall), stations
    )


def _markings(
    rng: np.random.Generator,
    section: tuple[float, float, float],
    lanes: tuple[float, float, int],
    span: tuple[float, float],
) -> list[Marking]:
    half, median, width = section
    first, lane, n = lanes
    edge, thin = uniform(rng, 0.15, 0.30), uniform(rng, 0.12, 0.15)
    offsets = [first - i * lane for i in range(n + 1)]
    mirror = 2.0 * half + median  # the other carriageway's offset is mirror - q
    found = []
    for q_all in (offsets, [mirror - q for q in offsets]):
        for i, q in enumerate(q_all):
            if i in (0, n):
                found.append(solid_marking(rng, q, span, edge, "edge"))
            else:
                found.append(dashed_marking(rng, q, span, thin, "lane", (6.0, 12.0)))
    assert width > 0.0
    return found


def _median(
    rng: np.random.Generator, half: float, median: float, span: tuple[float, float]
) -> tuple[list[Rail], list[Barrier]]:
    """Return what stands between the carriageways: a double-sided rail, two rails, or concrete."""
    middle = half + 0.5 * median
    choice = rng.random()
    if choice < 0.45:
        pieces = stretches(rng, span[0], span[1], int(rng.integers(0, 2)), (4.0, 10.0))
        return [one for piece in pieces for one in double_rail(rng, middle, piece)], []
    if choice < 0.70:
        off = uniform(rng, 0.5, 0.8)
        return [rail(rng, half + off, span, -1), rail(rng, half + median - off, span, 1)], []
    top = uniform(rng, 0.15, 0.24)
    one = Barrier(
        q_m=middle,
        start_m=span[0],
        end_m=span[1],
        height_m=uniform(rng, 0.80, 1.05),
        foot_width_m=top + uniform(rng, 0.36, 0.44),
        top_width_m=top,
        traffic=(1, -1),
        profile="step" if rng.random() < 0.5 else "new_jersey",
    )
    return [], [one]


def _noise_walls(
    rng: np.random.Generator, half: float, span: tuple[float, float]
) -> tuple[list[Wall], list[Hedge]]:
    if rng.random() < 0.35:
        a = uniform(rng, span[0], span[1] - 20.0)
        b = uniform(rng, a + 15.0, span[1])
        return [
            Wall(q_m=-half - uniform(rng, 2.2, 4.0), start_m=a, end_m=b, height_m=uniform(rng, 2.0, 3.5))
        ], []
    a = uniform(rng, span[0], span[1] - 20.0)
    b = uniform(rng, a + 15.0, span[1])
    hedge = Hedge(
        q_m=-half - uniform(rng, 1.9, 3.5),
        start_m=a,
        end_m=b,
        width_m=uniform(rng, 0.8, 1.4),
        height_m=uniform(rng, 0.9, 2.2),
    )
    return [], [hedge]


def _wires(
    rng: np.random.Generator, half: float, far: float, length_m: float
) -> tuple[list[Pole], list[Cable]]:
    """Return one or two spans across both carriageways, most of the time."""
    poles: list[Pole] = []
    cables: list[Cable] = []
    for _ in range(int(rng.choice([0, 1, 2], p=[0.15, 0.5, 0.35]))):
        at = uniform(rng, 15.0, length_m - 15.0)
        p, c = crossing_wires(
            rng, at, half + far + 5.0, -half - uniform(rng, 6.0, 14.0), uniform(rng, 8.0, 12.0)
        )
        poles += p
        cables += c
    return poles, cables


def _traffic(
    rng: np.random.Generator, half: float, section: tuple[float, float], left_lane: float, length_m: float
) -> list[Car]:
    median, width = section
    cars = []
    for _ in range(int(rng.poisson(length_m / 80.0))):
        oncoming = rng.random() < 0.7
        lorry = bool(rng.random() < 0.3)
        length = uniform(rng, 9.0, 13.0) if lorry else uniform(rng, 4.0, 4.9)
        q = half + median + uniform(rng, 0.35, 0.5) * width if oncoming else left_lane
        cars.append(
            Car(
                s_m=uniform(rng, 5.0, length_m - 5.0),
                q_m=q,
                length_m=length,
                width_m=2.5 if lorry else 1.85,
                height_m=3.8 if lorry else uniform(rng, 1.4, 1.8),
                heading=-1 if oncoming else 1,
                is_lorry=lorry,
                stretch=uniform(rng, 0.4, 0.6) if oncoming else uniform(rng, 1.5, 3.0),
                only_pass=int(rng.integers(0, 2)),
            )
        )
    return cars


def _gantries(rng: np.random.Generator, half: float, median: float, length_m: float) -> tuple[Gantry, ...]:
    if rng.random() > 0.35:
        return ()
    at = uniform(rng, 10.0, length_m - 10.0)
    reach = uniform(rng, 1.8, 2.5)
    return (
        Gantry(s_m=at, right_m=-half - reach, left_m=half + 0.5 * median, clearance_m=uniform(rng, 5.0, 6.0)),
    )


def _bridges(rng: np.random.Generator, length_m: float) -> tuple[Bridge, ...]:
    if rng.random() > 0.3 or length_m < 80.0:
        return ()
    at = uniform(rng, 0.3 * length_m, 0.7 * length_m)
    return (Bridge(s_m=at, width_m=uniform(rng, 6.0, 12.0), clearance_m=uniform(rng, 4.8, 6.0)),)
