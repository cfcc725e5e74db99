"""Roads under other roads, and through tunnels: places with two levels, or without a sky.

Separate from the modules in `linework.simulation.roads`, whose roads are the lowest and the highest thing to drive on.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from linework.simulation.roads.alignment import Alignment, PiecewiseLinear, make_alignment
from linework.simulation.roads.draw_country import country_markings, country_road
from linework.simulation.roads.draw_pieces import (
    MARGIN_M,
    dashed_marking,
    grade_profile,
    rail,
    solid_marking,
    uniform,
)
from linework.simulation.roads.draw_rural import gentle_bend
from linework.simulation.roads.road import Road, SideSection, make_stations
from linework.simulation.roads.scenario import Fence, Pole, RoadLayout, Tunnel
from linework.simulation.scene.materials import Material

#: Chainage in the middle of a road on a bridge: no other road is that long.
_OVER_FROM_M = 100_000.0


def draw_overpass(rng: np.random.Generator, length_m: float) -> RoadLayout:
    """Return a country road, and another that a bridge carries over it, 4.7 to 6 m up and 25 degrees askew at most."""
    half = uniform(rng, 2.6, 3.5)
    road = country_road(rng, length_m, half)
    span = (road.alignment.start_m, road.alignment.end_m)
    return RoadLayout(
        road=road,
        lanes=((-0.5 * half, 1), (0.5 * half, -1)),
        speed_mps=uniform(rng, 8.0, 14.0),
        markings=tuple(country_markings(rng, half, span)),
        over=(_road_over(rng, road, uniform(rng, 0.35, 0.65) * length_m),),
    )


def _road_over(rng: np.random.Generator, under: Road, at_m: float) -> RoadLayout:
    """Return a road of two lanes across another, with footways, rails at its kerbs and handrails at the edge."""
    half, footway = uniform(rng, 3.0, 4.0), uniform(rng, 1.2, 2.0)
    span = (_OVER_FROM_M - 22.0, _OVER_FROM_M + 22.0)
    flat = PiecewiseLinear.constant(0.0)
    askew = uniform(rng, -0.44, 0.44)
    heading = float(under.alignment.heading(at_m)) + 0.5 * np.pi + askew
    straight = make_alignment(*span, flat, heading, PiecewiseLinear.constant(uniform(rng, -0.03, 0.03)))
    # Above the highest place of what lies under it, the verges with their banks included
    s, q = np.meshgrid(at_m + np.linspace(-12.0, 12.0, 25), np.linspace(-half - 14.0, half + 14.0, 57))
    level = float(under.ground_height(s, q).max()) + uniform(rng, 4.7, 6.0) + 1.8
    alignment = _over(straight, under.place(at_m, 0.0, level))
    step, sides = PiecewiseLinear.constant(uniform(rng, 0.07, 0.15)), np.array([0.0, footway])
    side = SideSection(half, "kerb", step, sides, np.array([0.0, 0.02 * footway]), (Material.FOOTWAY,))
    crown = PiecewiseLinear.constant(-0.02)
    road = Road(
        alignment, side, side, crown, crown, make_stations(alignment, np.array(span), half_width_m=half)
    )
    width = uniform(rng, 0.10, 0.15)
    markings = [solid_marking(rng, sign * (half - 0.3), span, width, "edge") for sign in (1, -1)]
    rails = [rail(rng, sign * (half + 0.5), span, -sign) for sign in (1, -1)]
    return RoadLayout(
        road=road,
        lanes=((-0.5 * half, 1), (0.5 * half, -1)),
        speed_mps=10.0,
        markings=(*markings, dashed_marking(rng, 0.0, span, width, "centre", (3.0, 6.0))),
        rails=tuple(replace(r, flare_start_m=0.0, flare_end_m=0.0) for r in rails),
        fences=tuple(
            Fence(
                q_m=sign * (half + footway - 0.1), start_m=span[0], end_m=span[1], height_m=1.1, form="tubes"
            )
            for sign in (1, -1)
        ),
    )


def _over(straight: Alignment, place: np.ndarray) -> Alignment:
    """Return an alignment moved so that the middle of the bridge is at a place."""
    moved = place[:2] - straight.position(_OVER_FROM_M)
    level = float(place[2] - straight.height(_OVER_FROM_M))
    return replace(straight, nodes_xy=straight.nodes_xy + moved, level_m=level)


def draw_tunnel(rng: np.random.Generator, length_m: float) -> RoadLayout:
    """Return a road of two lanes through a tunnel over 40 to 70 % of the drive, kerbs and walkways along it."""
    half, walk = uniform(rng, 3.4, 4.0), uniform(rng, 0.8, 1.3)
    span = (-MARGIN_M, length_m + MARGIN_M)
    s, k = gentle_bend(rng, length_m, (200.0, 800.0))
    alignment = make_alignment(
        *span, PiecewiseLinear(s, k), uniform(rng, 0.0, 2.0 * np.pi), grade_profile(rng, *span, 0.04)
    )
    crown, step = PiecewiseLinear.constant(-0.02), PiecewiseLinear.constant(uniform(rng, 0.07, 0.15))
    d, z = np.array([0.0, walk + 0.2, walk + 10.0]), np.array([0.0, 0.02 * walk, uniform(rng, 0.5, 3.0)])
    side = SideSection(half, "kerb", step, d, z, (Material.FOOTWAY, Material.GRASS))
    road = Road(alignment, side, side, crown, crown, make_stations(alignment, s, half_width_m=half))
    start = uniform(rng, 0.1, 0.3) * length_m
    end = start + uniform(rng, 0.4, 0.7) * length_m
    width = uniform(rng, 0.10, 0.15)
    markings = [solid_marking(rng, sign * (half - 0.25), span, width, "edge") for sign in (1, -1)]
    centre = rng.random()
    if centre < 0.5:
        markings.append(dashed_marking(rng, 0.0, span, width, "centre", (3.0, 6.0)))
    else:
        markings.append(solid_marking(rng, 0.0, span, width, "centre"))
    signs = [
        Pole(s_m=at, q_m=sign * (half + 0.5), height_m=2.4, radius_m=0.04, has_sign=True)
        for at, sign in ((start - 3.0, -1.0), (end + 3.0, 1.0))
        if span[0] < at < span[1]
    ]
    return RoadLayout(
        road=road,
        lanes=((-0.5 * half, 1), (0.5 * half, -1)),
        speed_mps=uniform(rng, 10.0, 16.0),
        markings=tuple(markings),
        poles=tuple(signs),
        tunnels=(
            Tunnel(
                start_m=start, end_m=end, right_m=-half - walk, left_m=half + walk,
                wall_m=uniform(rng, 3.4, 4.2), rise_m=uniform(rng, 1.8, 3.0),
            ),
        ),
    )  # fmt: skip
