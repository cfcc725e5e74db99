"""Country roads between verges that lie lower or higher, with broken edges, and land without any road.

Separate from `draw`, which draws what all roads have: each kind of road has a file of its own.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from linework.arrays import FloatArray
from linework.simulation.roads.alignment import PiecewiseLinear, make_alignment
from linework.simulation.roads.draw_pieces import (
    MARGIN_M,
    bushes_at,
    dashed_marking,
    delineators,
    grade_profile,
    pole_line,
    rail,
    solid_marking,
    uniform,
)
from linework.simulation.roads.draw_roadside import Roadside
from linework.simulation.roads.draw_rural import gentle_bend
from linework.simulation.roads.draw_stains import road_stains
from linework.simulation.roads.road import Road, SideSection, make_stations
from linework.simulation.roads.scenario import (
    RAIL_FORMS,
    Barrier,
    Cable,
    Fence,
    Hedge,
    House,
    Marking,
    Plant,
    Pole,
    RoadLayout,
    Wall,
)
from linework.simulation.scene.materials import Material

_LAND_M = 14.0


def draw_country(rng: np.random.Generator, length_m: float) -> RoadLayout:
    """Return a road of 4.8 to 7 m without kerbs; on each side the verge is 5 to 12 cm lower or higher, or level."""
    half = uniform(rng, 2.4, 3.5)
    road = country_road(rng, length_m, half)
    span = (road.alignment.start_m, road.alignment.end_m)
    markings = country_markings(rng, half, span)
    hedges: list[Hedge] = []
    plants: list[Plant] = []
    poles: list[Pole] = []
    for sign in (1, -1):
        poles += delineators(rng, sign * (half + uniform(rng, 0.7, 1.2)), span, [])
        hedges += _overgrown(rng, sign * half, span)
        plants += trees(rng, sign * (half + 5.0), (*span, 5.0), length_m / 25.0)
    cables: list[Cable] = []
    if rng.random() < 0.5:
        more, cables = pole_line(rng, float(rng.choice([-1.0, 1.0])) * (half + 4.5), *span)
        poles += more
    return RoadLayout(
        road=road,
        lanes=((-0.5 * half, 1), (0.5 * half, -1)),
        speed_mps=uniform(rng, 9.0, 16.0),
        markings=tuple(markings),
        hedges=tuple(hedges),
        plants=tuple(plants),
        poles=tuple(poles),
        cables=tuple(cables),
        stains=tuple(road_stains(rng, half, span)),
    )


def country_road(rng: np.random.Generator, length_m: float, half: float) -> Road:
    """Return a road with a gentle bend and a verge of its own on each side."""
    start, end = -MARGIN_M, length_m + MARGIN_M
    s, k = gentle_bend(rng, length_m, (90.0, 600.0))
    heading, grade = uniform(rng, 0.0, 2.0 * np.pi), grade_profile(rng, start, end, 0.06)
    alignment = make_alignment(start, end, PiecewiseLinear(s, k), heading, grade)
    crown = PiecewiseLinear.constant(-uniform(rng, 0.015, 0.03))
    left, right = (verge_side(rng, half, (start, end)) for _ in range(2))
    breaks = np.concatenate([s, left.extra_m.x, right.extra_m.x])
    return Road(alignment, left, right, crown, crown, make_stations(alignment, breaks, half_width_m=half))


def verge_side(rng: np.random.Generator, half: float, span: tuple[float, float]) -> SideSection:
    """Return a verge: 5 to 12 cm lower (45 %), as much higher (30 %) or within 2 cm; gravel, ditch or bank behind."""
    which = rng.random()
    step = uniform(rng, -0.12, -0.05) if which < 0.45 else uniform(rng, 0.05, 0.12)
    step = uniform(rng, -0.02, 0.02) if which > 0.75 else step
    shoulder = uniform(rng, 0.4, 1.6)
    d, z = [0.0, shoulder], [0.0, -0.03 * shoulder]
    land = rng.integers(0, 3)
    if land == 0:
        deep = uniform(rng, 0.3, 0.9)
        d += [shoulder + 1.0, shoulder + 1.5, shoulder + 2.8]
        z += [-deep, -deep, uniform(rng, -0.1, 0.4)]
    elif land == 1:
        d += [shoulder + 3.0]
        z += [uniform(rng, -1.5, 1.5)]
    d, z = [*d, _LAND_M], [*z, z[-1] + uniform(rng, -0.4, 0.4)]
    first = Material.SOIL if rng.random() < 0.45 else Material.GRASS
    material = (first, *(Material.GRASS,) * (len(d) - 2))
    side = SideSection(half, "edge", PiecewiseLinear.constant(step), np.array(d), np.array(z), material)
    return replace(side, extra_m=_broken(rng, span)) if rng.random() < 0.5 else side


def _broken(rng: np.random.Generator, span: tuple[float, float]) -> PiecewiseLinear:
    """Return a broken edge: straight between nodes 0.5 to 2 m apart, each up to 15 cm further out than the least."""
    s: FloatArray = np.round(span[0] + np.cumsum(rng.uniform(0.5, 2.0, int((span[1] - span[0]) / 0.5))), 4)
    s = s[s < span[1]]
    return PiecewiseLinear(s, uniform(rng, 0.03, 0.15) * rng.uniform(0.0, 1.0, len(s)))


def country_markings(rng: np.random.Generator, half: float, span: tuple[float, float]) -> list[Marking]:
    """Return no paint (20 %), edge lines only (25 %), a centre line only (20 %) or both; worn by 50 % or more on a third."""
    width, choice = uniform(rng, 0.10, 0.15), rng.random()
    edge = half - uniform(rng, 0.15, 0.40) - 0.5 * width
    found: list[Marking] = []
    if 0.20 <= choice < 0.45 or choice >= 0.65:
        found += [solid_marking(rng, sign * edge, span, width, "edge") for sign in (1, -1)]
    if choice >= 0.45:
        dash = ((3.0, 6.0), (4.0, 8.0), (3.0, 3.0))[int(rng.integers(0, 3))]
        found.append(dashed_marking(rng, 0.0, span, width, "centre", dash))
    if rng.random() < 0.33:
        found = [replace(m, wear=uniform(rng, 0.5, 0.7)) for m in found]
    return found


def _overgrown(rng: np.random.Generator, edge_q: float, span: tuple[float, float]) -> list[Hedge]:
    """Return grass and herbs of 15 to 50 cm beside the pavement, hanging over its edge here and there."""
    found, at, sign = [], span[0] + uniform(rng, 0.0, 30.0), float(np.sign(edge_q))
    while rng.random() < 0.85 and at < span[1] - 6.0:
        end, width = min(at + uniform(rng, 3.0, 20.0), span[1]), uniform(rng, 0.4, 0.9)
        q = edge_q + sign * (0.5 * width + uniform(rng, -0.1, 0.4))
        found.append(Hedge(q_m=q, start_m=at, end_m=end, width_m=width, height_m=uniform(rng, 0.15, 0.5)))
        at = end + uniform(rng, 5.0, 40.0)
    return found


def trees(rng: np.random.Generator, q_m: float, place: tuple[float, float, float], n: float) -> list[Plant]:
    """Return about `n` trees and bushes from `place` (start, end, width) outwards of `q_m`."""
    start, end, wide = place
    found = []
    for _ in range(int(rng.poisson(n))):
        is_bush = rng.random() < 0.3
        found.append(
            Plant(
                s_m=uniform(rng, start, end),
                q_m=q_m + float(np.sign(q_m)) * uniform(rng, 0.0, wide),
                radius_m=uniform(rng, 0.4, 0.9) if is_bush else uniform(rng, 1.0, 2.4),
                height_m=uniform(rng, 0.6, 1.6) if is_bush else uniform(rng, 5.0, 14.0),
                trunk_m=0.0 if is_bush else uniform(rng, 1.5, 4.0),
            )
        )
    return found


# Land without any road or wire: whatever is found there is false


def draw_forest(rng: np.random.Generator, length_m: float) -> RoadLayout:
    """Return a forest floor of soil with 4 to 9 trees and bushes per 100 m2."""
    road = _open_land(rng, length_m, Material.SOIL, 0.12)
    span = (road.alignment.start_m, road.alignment.end_m)
    n = (span[1] - span[0]) * 11.0 * uniform(rng, 0.04, 0.09)
    plants = [plant for sign in (1, -1) for plant in trees(rng, sign * 2.2, (*span, 11.0), n)]
    return RoadLayout(road=road, lanes=((0.0, 1),), speed_mps=uniform(rng, 2.0, 4.0), plants=tuple(plants))


def draw_field(rng: np.random.Generator, length_m: float) -> RoadLayout:
    """Return a field or a meadow: furrows or none, a hedge and single trees far off, a few stakes."""
    road = _open_land(rng, length_m, Material.GRASS if rng.random() < 0.5 else Material.SOIL, 0.06)
    if rng.random() < 0.6:
        furrow = (uniform(rng, 0.02, 0.05), 0.0, 2.0 * np.pi / uniform(rng, 3.0, 6.0), uniform(rng, 0.0, 6.0))
        road = replace(road, relief=(*road.relief, furrow))
    span = (road.alignment.start_m, road.alignment.end_m)
    hedges = [
        Hedge(q_m=sign * uniform(rng, 8.0, 12.0), start_m=span[0], end_m=span[1], width_m=1.2, height_m=1.6)
        for sign in (1, -1)
        if rng.random() < 0.4
    ]
    plants = [plant for sign in (1, -1) for plant in trees(rng, sign * 6.0, (*span, 6.0), length_m / 60.0)]
    stakes = [
        Pole(s_m=uniform(rng, *span), q_m=uniform(rng, 3.0, 12.0), height_m=1.5, radius_m=0.05)
        for _ in range(int(rng.poisson(3.0)))
    ]
    return RoadLayout(
        road=road, lanes=((0.0, 1),), speed_mps=uniform(rng, 2.0, 6.0),
        hedges=tuple(hedges), plants=tuple(plants), poles=tuple(stakes),
    )  # fmt: skip


def draw_roofs(rng: np.random.Generator, length_m: float) -> RoadLayout:
    """Return houses with gable, shed or flat roofs in gardens: ridges and eaves, and nothing to drive on."""
    road = _open_land(rng, length_m, Material.GRASS, 0.05)
    span = (road.alignment.start_m, road.alignment.end_m)
    houses = []
    for sign in (1, -1):
        at = span[0] + uniform(rng, 1.0, 8.0)
        while at < span[1] - 14.0:
            length, deep = uniform(rng, 7.0, 14.0), uniform(rng, 6.0, 8.0)
            houses.append(
                House(
                    s_m=at + 0.5 * length,
                    q_m=sign * (uniform(rng, 4.0, 5.0) + 0.5 * deep),
                    length_m=length,
                    width_m=deep,
                    eaves_m=uniform(rng, 2.6, 7.0),
                    rise_m=0.0 if rng.random() < 0.25 else uniform(rng, 1.0, 4.0),
                    is_shed=bool(rng.random() < 0.25),
                )
            )
            at += length + uniform(rng, 1.0, 10.0)
    plants = [plant for sign in (1, -1) for plant in trees(rng, sign * 3.0, (*span, 9.0), length_m / 15.0)]
    return RoadLayout(
        road=road, lanes=((0.0, 1),), speed_mps=uniform(rng, 3.0, 6.0),
        houses=tuple(houses), plants=tuple(plants),
    )  # fmt: skip


def _open_land(rng: np.random.Generator, length_m: float, surface: Material, rough_m: float) -> Road:
    """Return land with waves of 3 to 25 m, `rough_m` high, over grades of up to 8 %."""
    start, end = -MARGIN_M, length_m + MARGIN_M
    s, k = gentle_bend(rng, length_m, (60.0, 300.0))
    grade = grade_profile(rng, start, end, 0.08)
    alignment = make_alignment(start, end, PiecewiseLinear(s, k), uniform(rng, 0.0, 2.0 * np.pi), grade)
    waves = []
    for _ in range(6):
        length, way = float(np.exp(rng.uniform(np.log(3.0), np.log(25.0)))), uniform(rng, 0.0, 2.0 * np.pi)
        number = 2.0 * np.pi / length
        waves.append(
            (rough_m * uniform(rng, 0.3, 1.0) * np.sqrt(length / 10.0), number * np.cos(way), number * np.sin(way),
             uniform(rng, 0.0, 6.3))
        )  # fmt: skip
    tilt = PiecewiseLinear.constant(0.0)
    d, z = np.array([0.0, 1.5, _LAND_M]), np.array([0.0, uniform(rng, -0.1, 0.1), uniform(rng, -1.0, 1.0)])
    side = SideSection(2.0, "edge", PiecewiseLinear.constant(0.0), d, z, (surface, surface))
    stations = make_stations(alignment, s, half_width_m=2.0)
    return Road(alignment, side, side, tilt, tilt, stations, surface=surface, relief=tuple(waves))


def draw_rails(rng: np.random.Generator, length_m: float) -> RoadLayout:
    """Return a country road with rails of every form, concrete barriers and fences along both sides, one after another.

    Hedges, walls and bushes stand behind some of them, in their gaps or over them.
    """
    half = uniform(rng, 2.9, 3.6)
    road = country_road(rng, length_m, half)
    span = (road.alignment.start_m, road.alignment.end_m)
    side = Roadside()
    for sign in (1, -1):
        out = half + uniform(rng, 0.5, 1.0)
        at = span[0] + uniform(rng, 0.5, 4.0)
        for form in rng.permutation(_ROW):
            end = min(at + uniform(rng, 28.0, 50.0), span[1] - 1.0)
            if end - at < 12.0:
                break
            _stand(rng, side, str(form), sign * out, (at, end))
            at = end + uniform(rng, 4.0, 12.0)
        back = sign * (out + uniform(rng, 1.6, 2.5))
        where = uniform(rng, span[0], span[1] - 25.0)
        behind = (where, where + uniform(rng, 10.0, 24.0))
        if rng.random() < 0.6:
            side.hedges.append(
                Hedge(
                    q_m=back, start_m=behind[0], end_m=behind[1], width_m=uniform(rng, 0.6, 1.2),
                    height_m=uniform(rng, 0.7, 1.8),
                )
            )  # fmt: skip
        else:
            side.walls.append(
                Wall(q_m=back, start_m=behind[0], end_m=behind[1], height_m=uniform(rng, 0.6, 1.1))
            )
    return RoadLayout(
        road=road,
        lanes=((-0.5 * half, 1), (0.5 * half, -1)),
        speed_mps=uniform(rng, 9.0, 16.0),
        markings=tuple(country_markings(rng, half, span)),
        rails=tuple(side.rails),
        barriers=tuple(side.barriers),
        fences=tuple(side.fences),
        hedges=tuple(side.hedges),
        walls=tuple(side.walls),
        plants=tuple(bushes_at(rng, side.rails, 0.15)),
        stains=tuple(road_stains(rng, half, span)),
    )


#: What `draw_rails` sets up in a row.
_ROW = (*RAIL_FORMS, "new_jersey", "f_shape", "step", "mesh", "boards")


def _stand(
    rng: np.random.Generator, side: Roadside, form: str, q_m: float, span: tuple[float, float]
) -> None:
    """Add a rail, barrier or fence of a form, with its traffic towards the middle of the road."""
    sign = 1 if q_m > 0.0 else -1
    if form in RAIL_FORMS:
        one = rail(rng, q_m, span, -sign)
        side.rails.append(replace(one, form=form, **_size(rng, form)))
    elif form in ("mesh", "boards"):
        side.fences.append(
            Fence(q_m=q_m, start_m=span[0], end_m=span[1], height_m=uniform(rng, 0.9, 1.4), form=form)
        )
    else:
        top = uniform(rng, 0.15, 0.24)
        side.barriers.append(
            Barrier(
                q_m=q_m, start_m=span[0], end_m=span[1], height_m=uniform(rng, 0.80, 1.05),
                foot_width_m=top + uniform(rng, 0.36, 0.44), top_width_m=top, traffic=(-sign,), profile=form,
            )
        )  # fmt: skip


def _size(rng: np.random.Generator, form: str) -> dict[str, Any]:
    """Return the sizes of a rail of a form that differ from those of a W-beam.

    Thrie beam: 0.506 m high, top at 0.78 to 0.86 m (MASH: 31 and 34 inches). Box beam: steel tubes of 150 to 180 mm
    (MASH SGR03: 152 mm, top at 0.69 to 0.74 m; the German Kastenprofil 150 by 180 mm). Bridge rails of pipes: two or
    three, 76 to 150 mm thick, the highest at 0.8 to 1.1 m. Cable barriers: three or four ropes of 19 mm (MASH: 3 by 7),
    drawn as wide as a beam of a few centimetres still returns from them, the lowest at half a metre.
    """
    if form == "thrie_beam":
        return {"beam_height_m": 0.506, "depth_m": 0.083, "top_m": uniform(rng, 0.78, 0.86)}
    if form == "box_beam":
        size = uniform(rng, 0.150, 0.180)
        return {"beam_height_m": size, "depth_m": size, "top_m": uniform(rng, 0.66, 0.78)}
    if form == "tube":
        size, top = uniform(rng, 0.076, 0.150), uniform(rng, 0.80, 1.10)
        n, pitch = 3 if top > 0.98 else 2, uniform(rng, 0.28, 0.32)
        return {
            "beam_height_m": size, "depth_m": size, "top_m": top, "n_beams": n, "pitch_m": pitch,
            "flare_start_m": 0.0, "flare_end_m": 0.0, "dip_start_m": 0.0, "dip_end_m": 0.0,
        }  # fmt: skip
    if form == "cable_barrier":
        return {
            "beam_height_m": 0.030, "depth_m": 0.030, "top_m": uniform(rng, 0.72, 0.90),
            "n_beams": int(rng.integers(3, 5)), "pitch_m": uniform(rng, 0.09, 0.13),
            "post_every_m": uniform(rng, 2.0, 3.0), "post_behind_m": 0.0,
        }  # fmt: skip
    return {}
