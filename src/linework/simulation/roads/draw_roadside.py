"""What stands beside a rural road: rails, barriers, hedges, fences, walls, trees, wires on poles.

Separate from `draw_rural`, which draws the road itself: this draws what stands beside it, once the road is known.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from linework.simulation.roads.draw_pieces import (
    bushes_at,
    crossing_wires,
    delineators,
    pole_line,
    rail,
    stretches,
    uniform,
)
from linework.simulation.roads.road import Road
from linework.simulation.roads.scenario import Barrier, Cable, Fence, Hedge, Plant, Pole, Rail, Wall


@dataclass(frozen=True, slots=True)
class Bend:
    """A bend: clothoid in, arc, clothoid out; `turn` +1 is to the left."""

    start_m: float
    arc_start_m: float
    arc_end_m: float
    end_m: float
    radius_m: float
    turn: int


@dataclass(slots=True)
class Roadside:
    """What stands beside the road, filled side by side."""

    rails: list[Rail] = field(default_factory=list)
    hedges: list[Hedge] = field(default_factory=list)
    walls: list[Wall] = field(default_factory=list)
    fences: list[Fence] = field(default_factory=list)
    barriers: list[Barrier] = field(default_factory=list)
    plants: list[Plant] = field(default_factory=list)
    poles: list[Pole] = field(default_factory=list)
    cables: list[Cable] = field(default_factory=list)


def draw_roadside(
    rng: np.random.Generator, road: Road, bends: list[Bend], span: tuple[float, float]
) -> Roadside:
    """Return what stands on both sides; one of them has a rail for sure."""
    side = Roadside()
    sure = 1 if rng.random() < 0.5 else -1
    for sign in (1, -1):
        q = sign * (road.side(sign).width_m + uniform(rng, 0.45, 1.1))
        pieces = _rail_spans(rng, bends, span, sign, sure=sign == sure)
        rails = [rail(rng, q, piece, -sign) for piece in pieces]
        side.rails += rails
        _behind(rng, road, side, rails, sign)
        if not rails and rng.random() < 0.4:
            _concrete(rng, road, side, span, sign)
        elif rng.random() < 0.6:
            side.poles += delineators(rng, sign * (road.side(sign).width_m + 0.6), span, rails)
        _away_from(rng, road, side, span, sign)
    side.plants += bushes_at(rng, side.rails, 0.5)
    _wires(rng, road, side, span)
    return side


def _rail_spans(
    rng: np.random.Generator, bends: list[Bend], span: tuple[float, float], sign: int, *, sure: bool
) -> list[tuple[float, float]]:
    """Return where this side has rails: through bends on their outside, else on stretches; at least once if `sure`."""
    found: list[tuple[float, float]] = []
    for b in bends:
        if rng.random() < (0.85 if b.turn != sign else 0.30):
            run = (b.start_m - uniform(rng, 0.0, 12.0), b.end_m + uniform(rng, 0.0, 12.0))
            found.append((max(run[0], span[0] + 1.0), min(run[1], span[1] - 1.0)))
    if not bends and (sure or rng.random() < 0.5):
        length = span[1] - span[0]
        run_m = length * uniform(rng, 0.4, 1.0)
        start = span[0] + uniform(rng, 0.0, length - run_m)
        found += stretches(rng, start, start + run_m, int(rng.integers(0, 3)), (4.0, 14.0))
    if sure and not found:
        start = uniform(rng, span[0] + 5.0, span[0] + 0.4 * (span[1] - span[0]))
        found.append((start, min(start + 60.0, span[1] - 2.0)))
    joined: list[tuple[float, float]] = []
    for a, b_m in sorted(found):
        if joined and a - joined[-1][1] < 4.0:
            joined[-1] = (joined[-1][0], max(b_m, joined[-1][1]))
        elif b_m - a >= 8.0:
            joined.append((a, b_m))
    return joined


def _behind(rng: np.random.Generator, road: Road, side: Roadside, rails: list[Rail], sign: int) -> None:
    """Add hedges that touch the rails from behind, for some of them."""
    for one in rails:
        if rng.random() < 0.35:
            a = uniform(rng, one.start_m, 0.5 * (one.start_m + one.end_m))
            b = uniform(rng, a + 4.0, max(one.end_m, a + 5.0))
            width = uniform(rng, 0.6, 1.2)
            q = one.q_m + sign * (0.5 * width + uniform(rng, 0.0, 0.4))
            b = min(b, road.alignment.end_m - 1.0)
            side.hedges.append(
                Hedge(q_m=q, start_m=a, end_m=b, width_m=width, height_m=uniform(rng, 0.7, 1.8))
            )


def _concrete(
    rng: np.random.Generator, road: Road, side: Roadside, span: tuple[float, float], sign: int
) -> None:
    """Add a stretch of concrete barrier."""
    run = uniform(rng, 0.3, 0.8) * (span[1] - span[0])
    start = uniform(rng, span[0] + 1.0, span[1] - run)
    top = uniform(rng, 0.15, 0.24)
    foot = top + uniform(rng, 0.36, 0.44)
    side.barriers.append(
        Barrier(
            q_m=sign * (road.side(sign).width_m + uniform(rng, 0.2, 0.7) + 0.5 * foot),
            start_m=start,
            end_m=start + run - 1.0,
            height_m=uniform(rng, 0.80, 1.05),
            foot_width_m=foot,
            top_width_m=top,
            traffic=(-sign,),
            profile="step" if rng.random() < 0.5 else "new_jersey",
        )
    )


def _away_from(
    rng: np.random.Generator, road: Road, side: Roadside, span: tuple[float, float], sign: int
) -> None:
    """Add hedges, walls, fences and trees further out."""
    width = road.side(sign).width_m
    at = span[0] + uniform(rng, 0.0, 20.0)
    while at < span[1] - 12.0:
        run = uniform(rng, 10.0, 40.0)
        end, q = min(at + run, span[1] - 1.0), sign * (width + uniform(rng, 2.4, 4.5))
        choice = rng.random()
        if choice < 0.25:
            side.hedges.append(
                Hedge(
                    q_m=q,
                    start_m=at,
                    end_m=end,
                    width_m=uniform(rng, 0.7, 1.4),
                    height_m=uniform(rng, 0.8, 2.0),
                )
            )
        elif choice < 0.33:
            side.walls.append(Wall(q_m=q, start_m=at, end_m=end, height_m=uniform(rng, 0.6, 1.1)))
        elif choice < 0.48:
            side.fences.append(
                Fence(
                    q_m=q,
                    start_m=at,
                    end_m=end,
                    height_m=uniform(rng, 0.9, 1.4),
                    form=str(rng.choice(["mesh", "boards"])),
                )
            )
        elif choice < 0.70:
            out = sign * (width + uniform(rng, 4.0, 9.0))
            side.plants.append(
                Plant(
                    s_m=at,
                    q_m=out,
                    radius_m=uniform(rng, 1.2, 3.0),
                    height_m=uniform(rng, 4.5, 8.0),
                    trunk_m=uniform(rng, 1.6, 2.6),
                )
            )
        at = end + uniform(rng, 4.0, 25.0)


def _wires(rng: np.random.Generator, road: Road, side: Roadside, span: tuple[float, float]) -> None:
    sign = 1 if rng.random() < 0.5 else -1
    along = rng.random() < 0.85
    if along:
        q = sign * (road.side(sign).width_m + uniform(rng, 2.5, 6.0))
        poles, cables = pole_line(rng, q, *span)
        side.poles += poles
        side.cables += cables
    if not along or rng.random() < 0.3:
        at = uniform(rng, span[0] + 15.0, span[1] - 15.0)
        reach = road.left.width_m + uniform(rng, 7.0, 10.0)
        poles, cables = crossing_wires(
            rng, at, reach, -reach, uniform(rng, 6.5, 9.0) + (2.0 if along else 0.0)
        )
        side.poles += poles
        side.cables += cables
