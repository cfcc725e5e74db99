"""Rural roads: straight ones, and ones that wind with radii down to 18 m."""

from __future__ import annotations

import numpy as np

from linework.arrays import FloatArray
from linework.simulation.roads.alignment import Alignment, PiecewiseLinear, make_alignment
from linework.simulation.roads.draw_pieces import (
    MARGIN_M,
    dashed_marking,
    grade_profile,
    solid_marking,
    uniform,
)
from linework.simulation.roads.draw_roadside import Bend, draw_roadside
from linework.simulation.roads.road import Road, SideSection, make_stations
from linework.simulation.roads.scenario import Bridge, Car, Marking, RoadLayout
from linework.simulation.scene.materials import Material

_LAND_M = 14.0


def draw_straight(rng: np.random.Generator, length_m: float) -> RoadLayout:
    """Return a straight two-lane road, with rails on stretches of it."""
    return _rural(rng, length_m, [], steepest=0.06, speed_mps=uniform(rng, 11.0, 18.0))


def draw_bends(rng: np.random.Generator, length_m: float) -> RoadLayout:
    """Return a winding two-lane road: at least one bend of 18 to 30 m radius, grades to 12 %, crossfall to 6 %."""
    for _ in range(200):
        bends = _bends(rng, length_m)
        alignment = _alignment(rng, length_m, bends, 0.0)
        if _keeps_apart(alignment):
            return _rural(rng, length_m, bends, steepest=0.12, speed_mps=uniform(rng, 6.0, 10.0))
    return _rural(rng, length_m, bends[:1], steepest=0.12, speed_mps=8.0)


def _bends(rng: np.random.Generator, length_m: float) -> list[Bend]:
    bends: list[Bend] = []
    s, heading = uniform(rng, 8.0, 20.0), 0.0
    turn = 1 if rng.random() < 0.5 else -1
    while True:
        is_tight = not bends or rng.random() < 0.35
        radius = uniform(rng, 18.0, 30.0) if is_tight else float(np.exp(rng.uniform(np.log(30), np.log(150))))
        clothoid = uniform(rng, 0.4, 0.9) * min(radius, 40.0)
        angle = uniform(rng, 0.7, 1.6) if is_tight else uniform(rng, 0.3, 0.9)
        # A clothoid of length c turns by c / (2 r) at either end
        arc = max(angle * radius - clothoid, 5.0)
        bend = Bend(s, s + clothoid, s + clothoid + arc, s + 2.0 * clothoid + arc, radius, turn)
        if bend.end_m > length_m + 25.0 and bends:
            return bends
        bends.append(bend)
        heading += turn * (arc + clothoid) / radius
        # Turn back towards the main direction more often than not, so that the road goes somewhere
        turn = -int(np.sign(heading)) if rng.random() < 0.8 else turn
        if abs(heading + turn) > 1.9:
            turn = -turn
        s = bend.end_m + uniform(rng, 2.0, 35.0)


def _alignment(rng: np.random.Generator, length_m: float, bends: list[Bend], steepest: float) -> Alignment:
    s, k = [-MARGIN_M], [0.0]
    for b in bends:
        s += [b.start_m, b.arc_start_m, b.arc_end_m, b.end_m]
        k += [0.0, b.turn / b.radius_m, b.turn / b.radius_m, 0.0]
    start, end = -MARGIN_M, length_m + MARGIN_M
    grade = grade_profile(rng, start, end, steepest) if steepest > 0.0 else PiecewiseLinear.constant(0.0)
    heading = uniform(rng, 0.0, 2.0 * np.pi) if steepest > 0.0 else 0.0
    return make_alignment(start, end, PiecewiseLinear(np.array(s), np.array(k)), heading, grade)


def _keeps_apart(alignment: Alignment) -> bool:
    """Return whether parts of the road that are far apart along it keep 40 m apart in plan."""
    s = np.arange(alignment.start_m, alignment.end_m, 4.0)
    xy = alignment.position(s)
    distance = np.linalg.norm(xy[:, None] - xy[None], axis=2)
    far = np.abs(s[:, None] - s[None]) > 90.0
    return not np.any(far & (distance < 40.0))


def _rural(
    rng: np.random.Generator, length_m: float, bends: list[Bend], *, steepest: float, speed_mps: float
) -> RoadLayout:
    alignment = _alignment(rng, length_m, bends, steepest)
    half = uniform(rng, 2.9, 3.9)
    road = _road(rng, alignment, bends, half)
    span = (alignment.start_m, alignment.end_m)
    side = draw_roadside(rng, road, bends, span)
    return RoadLayout(
        road=road,
        lanes=((-0.5 * half, 1), (0.5 * half, -1)),
        speed_mps=speed_mps,
        markings=tuple(_markings(rng, half, span, winding=bool(bends))),
        rails=tuple(side.rails),
        hedges=tuple(side.hedges),
        walls=tuple(side.walls),
        fences=tuple(side.fences),
        barriers=tuple(side.barriers),
        plants=tuple(side.plants),
        poles=tuple(side.poles),
        cables=tuple(side.cables),
        cars=tuple(_cars(rng, half, length_m)),
        bridges=_bridges(rng, length_m, bends),
    )


def _road(rng: np.random.Generator, alignment: Alignment, bends: list[Bend], half: float) -> Road:
    crown = -uniform(rng, 0.015, 0.03)
    s, left, right = [alignment.start_m], [crown], [crown]
    for b in bends:
        tilt = float(np.clip(1.2 / np.sqrt(b.radius_m) * 0.3, 0.025, 0.06))
        s += [b.start_m, b.arc_start_m, b.arc_end_m, b.end_m]
        left += [crown, -b.turn * tilt, -b.turn * tilt, crown]
        right += [crown, b.turn * tilt, b.turn * tilt, crown]
    stations = make_stations(alignment, np.array(s), half_width_m=half)
    return Road(
        alignment,
        _verge(rng, half),
        _verge(rng, half),
        PiecewiseLinear(np.array(s), np.array(left)),
        PiecewiseLinear(np.array(s), np.array(right)),
        stations,
    )


def _verge(rng: np.random.Generator, half: float) -> SideSection:
    """Return a verge: a shoulder, then an embankment, a cutting or level land."""
    shoulder, kind = uniform(rng, 1.3, 2.0), rng.integers(0, 3)
    if kind == 0:
        d, z = [0.0, shoulder, shoulder + 3.0, _LAND_M], [0.0, -0.08, -1.1, -1.4]
    elif kind == 1:
        ditch = shoulder + uniform(rng, 1.0, 1.6)
        d, z = [0.0, shoulder, ditch, ditch + 0.5, ditch + 4.0, _LAND_M], [0.0, -0.08, -0.45, -0.45, 1.3, 1.8]
    else:
        d, z = [0.0, shoulder, _LAND_M], [0.0, -0.06, uniform(rng, -0.5, 0.5)]
    step = PiecewiseLinear.constant(uniform(rng, -0.06, 0.04))
    return SideSection(half, "edge", step, np.array(d), np.array(z), (Material.GRASS,) * (len(d) - 1))


def _markings(
    rng: np.random.Generator, half: float, span: tuple[float, float], *, winding: bool
) -> list[Marking]:
    width = uniform(rng, 0.10, 0.15)
    edge = half - uniform(rng, 0.15, 0.40) - 0.5 * width
    found = [solid_marking(rng, sign * edge, span, width, "edge") for sign in (1, -1) if rng.random() < 0.9]
    dash = ((3.0, 6.0), (4.0, 8.0), (3.0, 3.0))[int(rng.integers(0, 3))]
    choice = rng.random() + (0.2 if winding else 0.0)
    if choice < 0.6:
        found.append(dashed_marking(rng, 0.0, span, width, "centre", dash))
    elif choice < 0.8:
        found.append(solid_marking(rng, 0.0, span, width, "centre"))
    else:
        apart = 0.5 * (width + uniform(rng, 0.10, 0.18))
        found += [solid_marking(rng, sign * apart, span, width, "centre", double=True) for sign in (1, -1)]
    return found


def _cars(rng: np.random.Generator, half: float, length_m: float) -> list[Car]:
    n = int(rng.poisson(length_m / 250.0))
    return [
        Car(
            s_m=uniform(rng, 10.0, length_m - 10.0),
            q_m=0.5 * half,
            length_m=uniform(rng, 3.9, 4.8),
            width_m=1.8,
            height_m=uniform(rng, 1.4, 1.7),
            heading=-1,
            stretch=uniform(rng, 0.4, 0.7),
            only_pass=0,
        )
        for _ in range(n)
    ]


def _bridges(rng: np.random.Generator, length_m: float, bends: list[Bend]) -> tuple[Bridge, ...]:
    if bends or length_m < 80.0 or rng.random() > 0.25:
        return ()
    at = uniform(rng, 0.3 * length_m, 0.7 * length_m)
    return (Bridge(s_m=at, width_m=uniform(rng, 4.0, 9.0), clearance_m=uniform(rng, 4.7, 5.6)),)


def gentle_bend(rng: np.random.Generator, length_m: float, radius: tuple[float, float]) -> FloatArray:
    """Return one bend's nodes (chainage, curvature) somewhere on the road, with clothoids."""
    r, turn = uniform(rng, *radius), 1.0 if rng.random() < 0.5 else -1.0
    start = uniform(rng, 0.0, 0.3 * length_m)
    c = min(0.25 * length_m, 0.3 * r)
    end = uniform(rng, 0.7, 1.0) * length_m
    s = [start, start + c, max(end - c, start + c + 1.0), max(end, start + 2.0 * c + 1.0)]
    return np.array([s, [0.0, turn / r, turn / r, 0.0]])
