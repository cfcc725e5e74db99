"""A road with pairs: what looks like a thing and is one, and what looks like it and is none.

Separate from the modules in `linework.simulation.roads`, whose roads are as roads are: here each thing stands alone on
a place of its own, so that what is found there has one cause.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from linework.simulation.roads.draw_country import country_road
from linework.simulation.roads.draw_pieces import arrow, dashed_marking, solid_marking, uniform, wear
from linework.simulation.roads.scenario import Lookalike, RoadLayout, Stain, Symbol

#: Length of a place, and how far what lies on it keeps from its ends and from the middle of its lane. [m]
PLACE_M, _FREE_M, _WIDE_M = 9.0, 0.5, 1.25

_Drawn = tuple[list[Symbol], list[Stain]]


def draw_lookalikes(rng: np.random.Generator, length_m: float) -> RoadLayout:
    """Return a country road; every place of 9 m of its lanes has one thing of `PAIRS`, or what only looks like it."""
    half = uniform(rng, 3.6, 4.2)
    road = country_road(rng, length_m, half)
    span = (road.alignment.start_m, road.alignment.end_m)
    width = uniform(rng, 0.10, 0.15)
    markings = [solid_marking(rng, sign * (half - 0.2), span, width, "edge") for sign in (1, -1)]
    markings.append(dashed_marking(rng, 0.0, span, width, "centre", (3.0, 6.0)))
    symbols: list[Symbol] = []
    stains: list[Stain] = []
    places: list[Lookalike] = []
    what = [(of, is_so) for of in PAIRS for is_so in (True, False)]
    order: list[int] = []
    for start in np.arange(0.0, length_m - PLACE_M + 1e-6, PLACE_M).tolist():
        for q in (-0.5 * half, 0.5 * half):
            order = order or rng.permutation(len(what)).tolist()
            of, is_so = what[order.pop()]
            paint, shades = PAIRS[of][0 if is_so else 1](rng, start + _FREE_M, q)
            symbols += paint
            stains += shades
            places.append(
                Lookalike(
                    of=of, is_so=is_so, has_line=bool(paint), start_m=start, end_m=start + PLACE_M,
                    right_m=q - _WIDE_M, left_m=q + _WIDE_M,
                )
            )  # fmt: skip
    return RoadLayout(
        road=road,
        lanes=((-0.5 * half, 1), (0.5 * half, -1)),
        speed_mps=uniform(rng, 6.0, 12.0),
        markings=tuple(markings),
        symbols=tuple(symbols),
        stains=tuple(stains),
        lookalikes=tuple(places),
    )


# The things: each takes the start of its place and the middle of its lane, and stays within 8 m of it and 1.25 m


def _paint(s: float, long: float, right: float, wide: float, worn: float, form: str = "other") -> Symbol:
    return Symbol(
        start_m=s, end_m=s + long, right_m=right, left_m=right + wide, wear=worn, form=form
    )  # fmt: skip


def _stain(s: float, long: float, right: float, wide: float, shade: float, soft: float = 0.02) -> Stain:
    return Stain(start_m=s, end_m=s + long, right_m=right, left_m=right + wide, shade=shade, soft_m=soft)


def _scraped(rng: np.random.Generator, paint: list[Symbol]) -> _Drawn:
    """Return what milling leaves of paint: its shape, darker or brighter than the road around."""
    shade = uniform(rng, 0.7, 0.9) if rng.random() < 0.5 else uniform(rng, 1.1, 1.3)
    return [], [
        Stain(
            start_m=one.start_m, end_m=one.end_m, right_m=one.right_m, left_m=one.left_m, shade=shade, soft_m=0.05
        )
        for one in paint
    ]  # fmt: skip


def _arrow(rng: np.random.Generator, s: float, q: float) -> _Drawn:
    return arrow(rng, s + 1.0, q), []


def _letters(rng: np.random.Generator, s: float, q: float) -> _Drawn:
    """Return three letters of 1.6 m, each a stroke along the road with three across."""
    worn, found = wear(rng), []
    for right in (q - 0.7, q - 0.2, q + 0.3):
        found.append(_paint(s + 2.0, 1.6, right, 0.1, worn))
        found += [
            replace(_paint(s + 2.0 + up, 0.15, right + 0.1, 0.2, worn), form="") for up in (0.0, 0.72, 1.45)
        ]
    return found, []


def _zebra(rng: np.random.Generator, s: float, q: float) -> _Drawn:
    worn = wear(rng)
    return [_paint(s + 2.0, 3.0, q + at, 0.5, worn, "zebra") for at in (-1.25, -0.25, 0.75)], []


def _bar(rng: np.random.Generator, s: float, q: float) -> _Drawn:
    return [_paint(s + 3.0, uniform(rng, 0.3, 0.5), q - 1.2, 2.4, wear(rng), "stop")], []


def _bright_band(rng: np.random.Generator, s: float, q: float) -> _Drawn:
    """Return a band of concrete across the lane: the frame of a drain or of a joint."""
    return [], [_stain(s + 3.0, uniform(rng, 0.3, 0.5), q - 1.2, 2.4, uniform(rng, 1.4, 2.0))]


def _line(rng: np.random.Generator, s: float, q: float) -> _Drawn:
    return [_paint(s, 8.0, q + uniform(rng, -1.0, 0.8), uniform(rng, 0.10, 0.15), wear(rng))], []


def _mortar(rng: np.random.Generator, s: float, q: float) -> _Drawn:
    """Return a joint along the lane filled with bright mortar, as wide as a line."""
    return [], [_stain(s, 8.0, q + uniform(rng, -1.0, 0.8), uniform(rng, 0.10, 0.15), uniform(rng, 1.3, 2.0))]


def _two_lines(rng: np.random.Generator, s: float, q: float) -> _Drawn:
    worn, wide = wear(rng), uniform(rng, 0.10, 0.12)
    return [_paint(s, 8.0, q + at, wide, worn) for at in (-wide - 0.07, 0.07)], []


def _two_joints(rng: np.random.Generator, s: float, q: float) -> _Drawn:
    """Return the bright slots of a drain along the lane."""
    shade, wide = uniform(rng, 1.3, 2.0), uniform(rng, 0.10, 0.12)
    return [], [_stain(s, 8.0, q + at, wide, shade) for at in (-wide - 0.07, 0.07)]


def _broad_strip(rng: np.random.Generator, s: float, q: float) -> _Drawn:
    """Return a bright strip of 0.6 to 1 m with soft edges, as between wheel tracks."""
    wide = uniform(rng, 0.6, 1.0)
    return [], [_stain(s, 8.0, q - 0.5 * wide, wide, uniform(rng, 1.2, 1.6), uniform(rng, 0.1, 0.3))]


def _broad_line(rng: np.random.Generator, s: float, q: float) -> _Drawn:
    """Return a painted line of 0.3 to 0.5 m, as beside bus lanes and ramps."""
    wide = uniform(rng, 0.3, 0.5)
    return [_paint(s, 8.0, q - 0.5 * wide, wide, wear(rng))], []


def _on_strip(drawn: Callable[[np.random.Generator, float, float], _Drawn]) -> Callable[..., _Drawn]:
    """Return what draws a thing, on a broad bright strip."""

    def both(rng: np.random.Generator, s: float, q: float) -> _Drawn:
        paint, shades = drawn(rng, s, q)
        right = (paint[0] if paint else shades[0]).right_m
        wide = uniform(rng, 0.5, 0.8)
        return paint, [_stain(s, 8.0, right - 0.4 * wide, wide, uniform(rng, 1.2, 1.5), 0.1), *shades]

    return both


def _tar(rng: np.random.Generator, s: float, q: float) -> _Drawn:
    return [], [_stain(s, 8.0, q, uniform(rng, 0.05, 0.12), uniform(rng, 0.3, 0.6))]


def _line_at_tar(rng: np.random.Generator, s: float, q: float) -> _Drawn:
    """Return a line along the edge of a tar seam."""
    _, dark = _tar(rng, s, q)
    return [_paint(s, 8.0, dark[0].left_m, 0.12, wear(rng))], dark


def _joints(rng: np.random.Generator, s: float, q: float) -> _Drawn:
    """Return a concrete plate with dark joints across."""
    plate = _stain(s, 8.0, q - 1.2, 2.4, uniform(rng, 1.3, 1.6))
    return [], [plate, *(_stain(s + at, 0.02, q - 1.2, 2.4, 0.4) for at in (1.5, 4.0, 6.5))]


def _thin_bars(rng: np.random.Generator, s: float, q: float) -> _Drawn:
    """Return thin bars across the lane, as parking bays have them."""
    worn = wear(rng)
    return [_paint(s + at, 0.12, q - 1.2, 2.4, worn) for at in (1.5, 4.0, 6.5)], []


def _tram_rails(rng: np.random.Generator, s: float, q: float) -> _Drawn:
    """Return rails 1.435 m apart: bright heads of 6 cm, dark grooves of 4 cm inside them."""
    shade, dark = uniform(rng, 1.5, 2.5), 0.4
    return [], [
        _stain(s, 8.0, q - 0.7775, 0.06, shade, 0.01), _stain(s, 8.0, q - 0.7175, 0.04, dark, 0.01),
        _stain(s, 8.0, q + 0.7175, 0.06, shade, 0.01), _stain(s, 8.0, q + 0.6775, 0.04, dark, 0.01),
    ]  # fmt: skip


def _track_of_lines(rng: np.random.Generator, s: float, q: float) -> _Drawn:
    """Return two lines as far apart as rails: a cycle lane."""
    worn = wear(rng)
    return [_paint(s, 8.0, q + at, 0.12, worn) for at in (-0.7775, 0.6575)], []


def _studs(rng: np.random.Generator, s: float, q: float) -> _Drawn:
    every = uniform(rng, 0.9, 1.5)
    return [], [_stain(s + at, 0.1, q - 0.05, 0.1, 5.0) for at in np.arange(0.5, 7.5, every)]


def _blocks(rng: np.random.Generator, s: float, q: float) -> _Drawn:
    """Return painted blocks of 0.5 m with gaps as long, as beside crossings for cycles."""
    worn = wear(rng)
    return [_paint(s + at, 0.5, q - 0.15, 0.3, worn) for at in np.arange(0.5, 7.5, 1.0)], []


def _steel_plate(rng: np.random.Generator, s: float, q: float) -> _Drawn:
    return [], [
        _stain(s + 2.0, uniform(rng, 1.5, 3.0), q - 0.9, uniform(rng, 1.2, 2.0), uniform(rng, 1.6, 2.6))
    ]


def _field(rng: np.random.Generator, s: float, q: float) -> _Drawn:
    """Return a painted field, as on the ramp of a speed table."""
    return [_paint(s + 2.0, uniform(rng, 1.5, 3.0), q - 0.6, 1.2, wear(rng))], []


def _cover(rng: np.random.Generator, s: float, q: float) -> _Drawn:
    frame = _stain(s + 3.0, 0.8, q - 0.4, 0.8, uniform(rng, 1.3, 2.0))
    return [], [frame, _stain(s + 3.1, 0.6, q - 0.3, 0.6, uniform(rng, 0.3, 0.6))]


def _small_square(rng: np.random.Generator, s: float, q: float) -> _Drawn:
    return [_paint(s + 3.0, 0.8, q - 0.35, 0.7, wear(rng))], []


def _wet(rng: np.random.Generator, s: float, q: float) -> _Drawn:
    return [], [_stain(s + 0.5, 7.0, q - 1.0, 2.0, uniform(rng, 0.3, 0.6), 0.4)]


def _line_in_the_wet(rng: np.random.Generator, s: float, q: float) -> _Drawn:
    return _line(rng, s, q)[0], _wet(rng, s, q)[1]


def _nothing(rng: np.random.Generator, s: float, q: float) -> _Drawn:
    del rng, s, q
    return [], []


def _faint(rng: np.random.Generator, s: float, q: float) -> _Drawn:
    """Return a line of which 60 to 70 % is gone."""
    return [_paint(s, 8.0, q, 0.12, uniform(rng, 0.6, 0.7))], []


def _scrape_of(drawn: Callable[[np.random.Generator, float, float], _Drawn]) -> Callable[..., _Drawn]:
    return lambda rng, s, q: _scraped(rng, drawn(rng, s, q)[0])


#: What a place looks like: what draws the thing itself, and what draws something else that looks like it.
PAIRS: dict[str, tuple[Callable[..., _Drawn], Callable[..., _Drawn]]] = {
    "bare asphalt": (_nothing, _faint),
    "line": (_line, _mortar),
    "two lines": (_two_lines, _two_joints),
    "broad strip": (_broad_strip, _broad_line),
    "line on a strip": (_on_strip(_line), _on_strip(_mortar)),
    "tar seam": (_tar, _line_at_tar),
    "joints of plates": (_joints, _thin_bars),
    "tram rails": (_tram_rails, _track_of_lines),
    "studs": (_studs, _blocks),
    "steel plate": (_steel_plate, _field),
    "manhole cover": (_cover, _small_square),
    "wet place": (_wet, _line_in_the_wet),
    "arrow": (_arrow, _scrape_of(_arrow)),
    "letters": (_letters, _scrape_of(_letters)),
    "zebra": (_zebra, _scrape_of(_zebra)),
    "stop line": (_bar, _bright_band),
}
