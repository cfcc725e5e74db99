"""Pieces that all kinds of road draw: axis and grade, wear, wires on poles, gaps."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from linework.simulation.roads.alignment import PiecewiseLinear
from linework.simulation.roads.scenario import Cable, Marking, Plant, Pole, Rail, Symbol

#: The modelled road goes on this far before and behind the drive: what scanners see ahead.
MARGIN_M = 6.0


def uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """Return a float from the range."""
    return float(rng.uniform(low, high))


def grade_profile(rng: np.random.Generator, start_m: float, end_m: float, steepest: float) -> PiecewiseLinear:
    """Return grades of 40 to 120 m with parabolic vertical curves of 20 to 40 m between them."""
    s, g = [start_m], [uniform(rng, -steepest, steepest)]
    while s[-1] < end_m:
        flat, curve = uniform(rng, 40.0, 120.0), uniform(rng, 20.0, 40.0)
        s += [s[-1] + flat, s[-1] + flat + curve]
        g += [g[-1], uniform(rng, -steepest, steepest)]
    return PiecewiseLinear(np.array(s), np.array(g))


def wear(rng: np.random.Generator) -> float:
    """Return the share of a line's paint that is gone: 0 to 70 %, a third of the lines nearly new."""
    return uniform(rng, 0.0, 0.08) if rng.random() < 0.33 else uniform(rng, 0.0, 0.7)


def dashed_marking(
    rng: np.random.Generator,
    q_m: float,
    span: tuple[float, float],
    width_m: float,
    role: str,
    pattern: tuple[float, float],
) -> Marking:
    """Return a dashed line of the given dash and gap with a random phase."""
    dash, gap = pattern
    start = span[0] + uniform(rng, 0.0, dash + gap)
    return Marking(
        q_m=q_m,
        start_m=start,
        end_m=span[1],
        width_m=width_m,
        role=role,
        pattern="dashed",
        dash_m=dash,
        gap_m=gap,
        wear=wear(rng),
    )


def solid_marking(
    rng: np.random.Generator,
    q_m: float,
    span: tuple[float, float],
    width_m: float,
    role: str,
    *,
    double: bool = False,
) -> Marking:
    """Return a solid line."""
    return Marking(
        q_m=q_m, start_m=span[0], end_m=span[1], width_m=width_m, role=role, double=double, wear=wear(rng)
    )


def zebra(rng: np.random.Generator, at_m: float, half_m: float) -> list[Symbol]:
    """Return the bars of a zebra crossing, 0.5 m wide and apart, and a stop line before it."""
    long, worn = uniform(rng, 3.0, 4.0), wear(rng)
    bars = [
        Symbol(
            start_m=at_m, end_m=at_m + long, right_m=float(q), left_m=float(q) + 0.5, wear=worn, form="zebra"
        )
        for q in np.arange(-half_m + 0.25, half_m - 0.5, 1.0)
    ]
    stop = Symbol(
        start_m=at_m - 1.5, end_m=at_m - 1.0, right_m=-half_m + 0.3, left_m=-0.2, wear=wear(rng), form="stop"
    )
    return [*bars, stop]


def arrow(rng: np.random.Generator, at_m: float, q_m: float) -> list[Symbol]:
    """Return a straight-on arrow of 4 to 5 m: a shaft and a head in steps."""
    worn, end = wear(rng), at_m + uniform(rng, 2.5, 3.5)
    shaft = Symbol(start_m=at_m, end_m=end, right_m=q_m - 0.08, left_m=q_m + 0.08, wear=worn, form="arrow")
    head = [
        Symbol(
            start_m=end + 0.3 * i, end_m=end + 0.3 * (i + 1), right_m=q_m - half, left_m=q_m + half, wear=worn
        )
        for i, half in enumerate((0.42, 0.33, 0.24, 0.15, 0.06))
    ]
    return [shaft, *head]


def delineators(
    rng: np.random.Generator, q_m: float, span: tuple[float, float], rails: Sequence[Rail]
) -> list[Pole]:
    """Return marker posts of 1 m every 25 to 50 m, and a sign here and there, where there is no rail."""
    every = uniform(rng, 25.0, 50.0)
    clear = [
        float(s)
        for s in np.arange(span[0] + uniform(rng, 1.0, every), span[1], every)
        if not any(r.start_m - 1.0 < s < r.end_m + 1.0 for r in rails)
    ]
    posts = [Pole(s_m=s, q_m=q_m, height_m=1.0, radius_m=0.055) for s in clear]
    signs = [
        Pole(s_m=s + 3.0, q_m=1.15 * q_m, height_m=2.4, radius_m=0.04, has_sign=True)
        for s in clear
        if rng.random() < 0.25 and s + 4.0 < span[1]
    ]
    return posts + signs


def stretches(
    rng: np.random.Generator, start_m: float, end_m: float, gaps: int, gap_m: tuple[float, float]
) -> list[tuple[float, float]]:
    """Return `start_m` to `end_m` cut by up to `gaps` gaps; pieces under 8 m are left out."""
    cuts = sorted(uniform(rng, start_m, end_m) for _ in range(gaps))
    pieces, at = [], start_m
    for cut in cuts:
        pieces.append((at, cut))
        at = max(at, cut) + uniform(rng, *gap_m)
    pieces.append((at, end_m))
    return [(a, b) for a, b in pieces if b - a >= 8.0]


def rail(rng: np.random.Generator, q_m: float, span: tuple[float, float], faces: int) -> Rail:
    """Return a W-beam with drawn size, posts and ends; a third of the ends dip to the ground, a quarter flare."""
    long_enough = span[1] - span[0] > 24.0
    dips = [uniform(rng, 4.0, 9.0) if long_enough and rng.random() < 0.35 else 0.0 for _ in range(2)]
    flares = [uniform(rng, 0.2, 0.7) if long_enough and rng.random() < 0.25 else 0.0 for _ in range(2)]
    return Rail(
        q_m=q_m,
        faces=faces,
        start_m=span[0],
        end_m=span[1],
        top_m=uniform(rng, 0.60, 0.85),
        beam_height_m=uniform(rng, 0.30, 0.32),
        depth_m=uniform(rng, 0.075, 0.085),
        post_every_m=float(rng.choice([1.33, 2.0, 4.0])),
        post_behind_m=float(rng.choice([0.0, 0.10, 0.20])),
        dip_start_m=dips[0],
        dip_end_m=dips[1],
        flare_start_m=flares[0],
        flare_end_m=flares[1],
    )


def double_rail(rng: np.random.Generator, q_m: float, span: tuple[float, float]) -> list[Rail]:
    """Return two beams back to back, with posts between them."""
    apart = uniform(rng, 0.28, 0.70)
    one = rail(rng, 0.0, span, 1)
    shared = {
        name: getattr(one, name)
        for name in (
            "start_m",
            "end_m",
            "top_m",
            "beam_height_m",
            "depth_m",
            "post_every_m",
            "dip_start_m",
            "dip_end_m",
        )
    }
    behind = 0.5 * apart - one.depth_m * 0.5 - 0.055
    left = Rail(q_m=q_m + 0.5 * apart, faces=1, post_behind_m=max(behind, 0.0), **shared)
    return [left, Rail(q_m=q_m - 0.5 * apart, faces=-1, has_posts=False, **shared)]


def pole_line(
    rng: np.random.Generator, q_m: float, start_m: float, end_m: float, *, over_road: bool = False
) -> tuple[list[Pole], list[Cable]]:
    """Return a line of poles along the road with 2 to 4 wires, one above another or side by side.

    With `over_road` no wire is on the far side of the poles, where houses may stand.
    """
    height = uniform(rng, 6.0, 9.5)
    n_spans = max(1, int(np.round((end_m - start_m) / uniform(rng, 32.0, 55.0))))
    at = np.linspace(start_m + 1.0, end_m - 1.0, n_spans + 1)
    places = [(float(s), q_m + uniform(rng, -0.3, 0.3)) for s in at]
    name = f"along-{q_m:.3f}-{start_m:.3f}"
    poles = [Pole(s_m=s, q_m=q, height_m=height + 0.3, radius_m=0.12, network=name) for s, q in places]
    fixings = _fixings(rng, height)
    if over_road:
        furthest = max(out for out, _ in fixings)
        fixings = [(-np.sign(q_m) * (furthest - out + 0.16), up) for out, up in fixings]
    sag = uniform(rng, 0.010, 0.022)
    width, wire = uniform(rng, 0.025, 0.045), uniform(rng, 0.008, 0.025)
    cables = [
        Cable(
            start=(a[0], a[1] + out, up),
            end=(b[0], b[1] + out, up),
            sag_m=sag * (b[0] - a[0]) * uniform(rng, 0.96, 1.04),
            wire_m=wire,
            seen_width_m=width,
            network=name,
            circuit=name,
            span=f"{name}-{number}",
        )
        for number, (a, b) in enumerate(itertools.pairwise(places))
        for out, up in fixings
    ]
    return poles, cables


def _fixings(rng: np.random.Generator, height_m: float) -> list[tuple[float, float]]:
    """Return (sideways, height) of the wires on a pole."""
    n = int(rng.integers(2, 5))
    if rng.random() < 0.6:
        apart = uniform(rng, 0.30, 0.60)
        return [(0.16, height_m - i * apart) for i in range(n)]
    apart = uniform(rng, 0.40, 0.90)
    return [(apart * (i - 0.5 * (n - 1)), height_m) for i in range(n)]


def crossing_wires(
    rng: np.random.Generator, s_m: float, q_left_m: float, q_right_m: float, height_m: float
) -> tuple[list[Pole], list[Cable]]:
    """Return a span of 2 or 3 wires across the road, askew."""
    askew = uniform(rng, -6.0, 6.0)
    a, b = (s_m - askew, q_left_m), (s_m + askew, q_right_m)
    name = f"across-{s_m:.3f}"
    poles = [Pole(s_m=s, q_m=q, height_m=height_m + 0.3, radius_m=0.12, network=name) for s, q in (a, b)]
    span = float(np.hypot(2.0 * askew, q_left_m - q_right_m))
    apart, sag = uniform(rng, 0.30, 0.60), span * uniform(rng, 0.010, 0.022)
    cables = [
        Cable(start=(*a, height_m - i * apart), end=(*b, height_m - i * apart), sag_m=sag,
              network=name, circuit=name, span=name)
        for i in range(int(rng.integers(2, 4)))
    ]  # fmt: skip
    return poles, cables


def bushes_at(rng: np.random.Generator, rails: Sequence[Rail], share: float) -> list[Plant]:
    """Return bushes that touch or hang over some of the rails."""
    return [
        Plant(
            s_m=uniform(rng, one.start_m, one.end_m),
            q_m=one.q_m - one.faces * uniform(rng, 0.15, 0.7),
            radius_m=uniform(rng, 0.3, 0.7),
            height_m=uniform(rng, 0.6, 1.5),
        )
        for one in rails
        for _ in range(int(rng.poisson(share * (one.end_m - one.start_m) / 20.0)))
    ]
