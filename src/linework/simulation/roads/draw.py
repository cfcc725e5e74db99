"""Everything a seed decides, drawn in one place per kind of road from stated ranges."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from numbers import Integral, Real

import numpy as np

from linework.errors import UsageError, argument, did_you_mean
from linework.simulation.roads.draw_country import (
    draw_country,
    draw_field,
    draw_forest,
    draw_rails,
    draw_roofs,
)
from linework.simulation.roads.draw_junction import (
    MOST_RING_M,
    draw_gore,
    draw_junction,
    draw_roundabout,
)
from linework.simulation.roads.draw_motorway import draw_motorway
from linework.simulation.roads.draw_rural import draw_bends, draw_straight
from linework.simulation.roads.draw_stains import older_paint, road_stains
from linework.simulation.roads.draw_urban import draw_urban
from linework.simulation.roads.draw_village import draw_village
from linework.simulation.roads.scenario import Pass, RoadLayout, Scenario, Sensor
from linework.simulation.scene.materials import Material
from linework.simulation.sensors.heads import Scanner

#: Whatever `mixed` draws from: every kind of road, and a forest.
_MIXED = (
    "straight",
    "bends",
    "urban",
    "motorway",
    "rural",
    "junction",
    "gore",
    "roundabout",
    "village",
    "forest",
)


def draw_mixed(rng: np.random.Generator, length_m: float) -> RoadLayout:
    """Return any road, or a forest, with stains and the paint of an older generation whatever its kind."""
    kinds = [kind for kind in _MIXED if kind != "roundabout" or length_m <= MOST_RING_M]
    layout = LAYOUTS[str(rng.choice(kinds))](rng, length_m)
    road = layout.road
    if road.surface != Material.ASPHALT:
        return layout
    half = min(road.left.width_m, road.right.width_m)
    span = (road.alignment.start_m, road.alignment.end_m)
    more = [*road_stains(rng, half, span), *older_paint(rng, layout.markings)]
    return replace(layout, stains=(*layout.stains, *more))


LAYOUTS: dict[str, Callable[[np.random.Generator, float], RoadLayout]] = {
    "straight": draw_straight,
    "bends": draw_bends,
    "urban": draw_urban,
    "motorway": draw_motorway,
    "rural": draw_country,
    "forest": draw_forest,
    "field": draw_field,
    "roofs": draw_roofs,
    "junction": draw_junction,
    "gore": draw_gore,
    "roundabout": draw_roundabout,
    "village": draw_village,
    "mixed": draw_mixed,
    "rails": draw_rails,
}
ROADS = tuple(LAYOUTS)
#: The roads that most figures of the documentation are about.
USUAL_ROADS = ROADS[:4]
#: Shortest drive that gives every kind of road room for a bend or a span.
MIN_LENGTH_M = 40.0
MAX_LENGTH_M = 5000.0
#: Scan lines per metre of road at most, over all scanners and passes: keeps a survey to what one van records.
_MAX_LINES_PER_M = 35.0
#: Scanners are turned up to 20,000 rays per turn (`_thinned`), which no larger number can exceed.
_MOST_POINTS_PER_M = 1e6


def draw_scenario(kind: str, seed: int, length_m: float, *, points_per_m: float | None = None) -> Scenario:
    """Return what `seed` decides about a road of this kind.

    Ranges: range noise 3 to 20 mm; scan lines 4 to 25 cm apart; 1 or 2 scanners; intensity of 8 or 16 bit;
    paint contrast 1.3 to 4; wear 0 to 70 %; intensity drift 0 to 40 %; stray points 0.01 to 0.1 %; pose error
    between passes up to 5 mm; crossfall to 6 %, grades to 12 %, radii down to 18 m.

    Raises
    ------
    UsageError
        Unknown kind, negative seed, a length or density out of range.
    """
    if kind not in LAYOUTS:
        problem = f"there is no road {kind!r}" + did_you_mean([str(kind)], ROADS)
        raise UsageError(problem, where=argument("road"), advice=f"choose one of {', '.join(ROADS)}")
    if not (_is_number(length_m) and MIN_LENGTH_M <= length_m <= MAX_LENGTH_M):
        raise UsageError(
            f"a road of {_shown(length_m)} m cannot be simulated",
            where=argument("length_m"),
            advice=f"choose {MIN_LENGTH_M:g} to {MAX_LENGTH_M:g} m",
        )
    if not isinstance(seed, Integral) or isinstance(seed, bool) or seed < 0:
        raise UsageError(
            f"the seed is {seed!r}", where=argument("seed"), advice="choose a whole number from 0"
        )
    if points_per_m is not None and not (
        _is_number(points_per_m) and 0.0 < points_per_m <= _MOST_POINTS_PER_M
    ):
        raise UsageError(
            f"{_shown(points_per_m)} points per metre",
            where=argument("points_per_m"),
            advice=f"choose more than 0, at most {_MOST_POINTS_PER_M:g}, or leave it out",
        )
    rng = np.random.default_rng([seed, ROADS.index(kind)])
    layout = LAYOUTS[kind](rng, length_m)
    passes = _passes(rng, layout)
    scanners = _scanners(rng, passes, layout.speed_mps)
    if points_per_m is not None:
        scanners = _thinned(scanners, passes, points_per_m)
    origin = (
        500_000.0 + float(np.round(rng.uniform(0, 40_000), 3)),
        5_800_000.0 + float(np.round(rng.uniform(0, 40_000), 3)),
        float(np.round(rng.uniform(20, 400), 3)),
    )
    return Scenario(
        kind=kind, seed=seed, length_m=length_m, origin_m=origin, layout=layout,
        scanners=scanners, sensor=_sensor(rng), passes=passes,
    )  # fmt: skip


def _is_number(value: object) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool)


def _shown(value: object) -> str:
    """Return a value as messages show it: a number without needless digits."""
    return f"{value:g}" if isinstance(value, Real) else repr(value)


def _passes(rng: np.random.Generator, layout: RoadLayout) -> tuple[Pass, ...]:
    n = 2 if rng.random() < 0.35 else 1
    start = 4.0e8 + float(np.floor(rng.uniform(0, 3.0e6)))
    passes = []
    for i in range(n):
        offset, direction = layout.lanes[i % len(layout.lanes)]
        # Half the 5 mm between two passes each; a single pass defines its own world
        error = rng.normal(size=3)
        error *= rng.uniform(0.0, 0.0025) / np.linalg.norm(error) if n > 1 else 0.0
        passes.append(
            Pass(
                q_m=offset,
                direction=direction,
                speed_mps=layout.speed_mps,
                wander_m=float(rng.uniform(0.05, 0.25)),
                pose_error_m=(float(error[0]), float(error[1]), float(error[2])),
                start_time_s=start + 400.0 * i,
            )
        )
    return tuple(passes)


def _scanners(rng: np.random.Generator, passes: tuple[Pass, ...], speed_mps: float) -> tuple[Scanner, ...]:
    n = int(rng.integers(1, 3))
    height = float(rng.uniform(2.0, 2.6))
    closest = max(0.045, n * len(passes) / _MAX_LINES_PER_M)
    spacing = float(np.exp(rng.uniform(np.log(closest), np.log(0.22))))
    rays = float(np.floor(np.exp(rng.uniform(np.log(600), np.log(1500)))) + rng.uniform(0.1, 0.9))
    turns = speed_mps / spacing
    if n == 1:
        # Leaning back enough that its beams pass behind the van on both sides
        yaw, pitch = rng.uniform(5.0, 18.0) * rng.choice([-1.0, 1.0]), rng.uniform(25.0, 40.0)
        return (_scanner(0.0, height, (float(yaw), float(pitch)), turns, rays),)
    # Crossing planes: where the van hides the road from one, the other sees it
    yaw, pitch = rng.uniform(25.0, 45.0), rng.uniform(5.0, 30.0)
    return (
        _scanner(0.35, height, (float(yaw), float(pitch)), turns, rays),
        _scanner(-0.35, height, (-float(yaw), float(pitch)), turns, rays),
    )


def _scanner(
    left_m: float, height_m: float, tilt_deg: tuple[float, float], turns_per_s: float, rays: float
) -> Scanner:
    return Scanner(
        position_m=(-1.05, left_m, height_m),
        yaw_deg=tilt_deg[0],
        pitch_deg=tilt_deg[1],
        turns_per_s=turns_per_s,
        rays_per_turn=rays,
    )


def _thinned(
    scanners: tuple[Scanner, ...], passes: tuple[Pass, ...], points_per_m: float
) -> tuple[Scanner, ...]:
    """Return the scanners with as many beams per turn as give the wanted density (about half come back)."""
    lines_per_m = len(scanners) * len(passes) * scanners[0].turns_per_s / passes[0].speed_mps
    rays = float(np.clip(points_per_m / (0.5 * lines_per_m), 100.0, 20_000.0))
    return tuple(replace(s, rays_per_turn=np.floor(rays) + s.rays_per_turn % 1.0) for s in scanners)


def _sensor(rng: np.random.Generator) -> Sensor:
    bits = 8 if rng.random() < 0.5 else 16
    return Sensor(
        range_noise_m=float(np.exp(rng.uniform(np.log(0.003), np.log(0.020)))),
        max_range_m=float(rng.uniform(60.0, 100.0)),
        intensity_bits=bits,
        contrast=float(rng.uniform(1.3, 4.0)),
        # Asphalt a few metres off: 25 to 50 of 255, or 4 to 12 thousand of 65535
        gain=float(rng.uniform(150.0, 300.0) if bits == 8 else rng.uniform(24_000.0, 70_000.0)),
        range_power=float(rng.uniform(0.0, 1.2)),
        incidence_power=float(rng.uniform(0.2, 0.8)),
        drift=float(rng.uniform(0.0, 0.4)),
        drift_period_s=float(rng.uniform(20.0, 120.0)),
        stray_share=float(10.0 ** rng.uniform(-4.0, -3.0)),
    )
