"""Roads on which older paint still shows beside or under the new, each with its own truth.

Separate from `linework.simulation.roads.draw_stains`, whose remains of older paint are no lines any more.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from linework.simulation.roads.alignment import PiecewiseLinear
from linework.simulation.roads.draw_country import country_road
from linework.simulation.roads.draw_pieces import dashed_marking, solid_marking, uniform
from linework.simulation.roads.draw_stains import older_paint
from linework.simulation.roads.scenario import Marking, RoadLayout


def draw_repainted(rng: np.random.Generator, length_m: float) -> RoadLayout:
    """Return a country road with white lines that are not in force, under new ones: yellow for works, or white.

    Yellow lines begin on the white ones and lead 0.4 to 0.7 m to one side. New white lines lie 15 to 50 cm beside the
    older ones, which are worn by 50 to 70 %; older ones still are scraped off, and have no truth.
    """
    half = uniform(rng, 3.4, 4.2)
    road = country_road(rng, length_m, half)
    span, width = (road.alignment.start_m, road.alignment.end_m), uniform(rng, 0.10, 0.15)
    white = [solid_marking(rng, sign * (half - 0.9), span, width, "edge") for sign in (1, -1)]
    white.append(dashed_marking(rng, 0.0, span, width, "centre", (3.0, 6.0)))
    if rng.random() < 0.5:
        # At least a third of the road has the yellow lines aside of the white ones
        start = uniform(rng, 0.1, 0.3) * length_m
        lead = uniform(rng, 0.15, 0.3) * length_m
        aside = float(rng.choice([-1.0, 1.0])) * uniform(rng, 0.4, 0.7)
        shift = PiecewiseLinear(np.array([start, start + lead]), np.array([0.0, aside]))
        new = [
            solid_marking(rng, m.q_m, (start, span[1]), width, m.role)
            if m.pattern == "solid"
            else dashed_marking(rng, m.q_m, (start, span[1]), width, m.role, (3.0, 3.0))
            for m in white
        ]
        force = [
            replace(m, shift_m=shift, generation="temporary", wear=min(m.wear, 0.1)) for m in new
        ]  # fmt: skip
        older = [replace(m, generation="older") for m in white]
    else:
        force = [replace(m, wear=min(m.wear, 0.3)) for m in white]
        older = [_beside(rng, m) for m in white]
    return RoadLayout(
        road=road,
        lanes=((-0.5 * half, 1), (0.5 * half, -1)),
        speed_mps=uniform(rng, 8.0, 14.0),
        markings=(*force, *older),
        stains=tuple(older_paint(rng, older)),
    )


def _beside(rng: np.random.Generator, line: Marking) -> Marking:
    aside = float(rng.choice([-1.0, 1.0])) * uniform(rng, 0.15 + line.width_m, 0.5)
    start = line.start_m + uniform(rng, 0.0, line.dash_m + line.gap_m)
    return replace(
        line, q_m=line.q_m + aside, start_m=start, wear=uniform(rng, 0.5, 0.7), generation="older"
    )  # fmt: skip
