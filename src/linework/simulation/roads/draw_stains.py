"""What else is bright or dark on a road than paint: wheel tracks, patches, seams, joints, wet places, covers.

Separate from the modules that draw roads: any of them may call it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from linework.arrays import FloatArray
from linework.simulation.roads.draw_pieces import uniform
from linework.simulation.roads.scenario import Marking, Stain


def road_stains(rng: np.random.Generator, half_m: float, span: tuple[float, float]) -> list[Stain]:
    """Return stains of a carriageway from `-half_m` to `half_m`: each explanation on a third of the roads."""
    found: list[Stain] = []
    for draw in _EACH:
        if rng.random() < 0.33:
            found += draw(rng, half_m, span)
    return found


def _wheel_tracks(rng: np.random.Generator, half_m: float, span: tuple[float, float]) -> list[Stain]:
    """Return dark tracks of 0.5 to 0.9 m; what is left between them is a bright strip."""
    shade, width = uniform(rng, 0.65, 0.9), uniform(rng, 0.5, 0.9)
    return [
        Stain(
            start_m=span[0], end_m=span[1], right_m=q - 0.5 * width, left_m=q + 0.5 * width,
            shade=shade, soft_m=uniform(rng, 0.1, 0.4), of="wheel track",
        )
        for lane in (-0.5 * half_m, 0.5 * half_m)
        for q in (lane - 0.75, lane + 0.75)
    ]  # fmt: skip


def _patches(rng: np.random.Generator, half_m: float, span: tuple[float, float]) -> list[Stain]:
    found = []
    for _ in range(1 + int(rng.poisson((span[1] - span[0]) / 30.0))):
        s, q = uniform(rng, *span), uniform(rng, -half_m, half_m - 0.4)
        long, wide = uniform(rng, 0.6, 15.0), uniform(rng, 0.4, 2.5)
        found.append(
            Stain(
                start_m=s, end_m=min(s + long, span[1]), right_m=q, left_m=min(q + wide, half_m),
                shade=uniform(rng, 0.6, 1.5), of="patch",
            )
        )  # fmt: skip
    return found


def _tar_seams(rng: np.random.Generator, half_m: float, span: tuple[float, float]) -> list[Stain]:
    """Return a dark seam of 3 to 10 cm along the middle of the road or a lane, and one across every 20 to 60 m."""
    width, shade = uniform(rng, 0.03, 0.10), uniform(rng, 0.3, 0.7)
    q = uniform(rng, -0.8, 0.8) * half_m
    along = Stain(start_m=span[0], end_m=span[1], right_m=q, left_m=q + width, shade=shade, of="tar seam")
    at = np.arange(span[0], span[1], uniform(rng, 20.0, 60.0))
    return [along, *_across(half_m, at, width, shade, "tar seam")]


def _plates(rng: np.random.Generator, half_m: float, span: tuple[float, float]) -> list[Stain]:
    """Return concrete plates of 4 to 6 m: bright, with dark joints across and along the middle."""
    whole = Stain(
        start_m=span[0],
        end_m=span[1],
        right_m=-half_m,
        left_m=half_m,
        shade=uniform(rng, 1.3, 1.7),
        of="plate",
    )
    width, shade = uniform(rng, 0.01, 0.03), uniform(rng, 0.3, 0.6)
    middle = Stain(
        start_m=span[0], end_m=span[1], right_m=-0.5 * width, left_m=0.5 * width, shade=shade, of="joint"
    )
    every = uniform(rng, 4.0, 6.0)
    return [whole, middle, *_across(half_m, np.arange(span[0] + 1.0, span[1], every), width, shade, "joint")]


def _wet(rng: np.random.Generator, half_m: float, span: tuple[float, float]) -> list[Stain]:
    """Return dark places along an edge, or over the road, that dry from their rims."""
    found = []
    for _ in range(1 + int(rng.poisson((span[1] - span[0]) / 60.0))):
        s, sign = uniform(rng, *span), float(rng.choice([-1.0, 1.0]))
        inner = uniform(rng, -half_m, 0.8 * half_m)
        found.append(
            Stain(
                start_m=s, end_m=min(s + uniform(rng, 3.0, 25.0), span[1]),
                right_m=min(sign * inner, sign * half_m), left_m=max(sign * inner, sign * half_m),
                shade=uniform(rng, 0.25, 0.6), soft_m=uniform(rng, 0.2, 0.8), of="wet place",
            )
        )  # fmt: skip
    return found


def _covers(rng: np.random.Generator, half_m: float, span: tuple[float, float]) -> list[Stain]:
    """Return manhole covers in their frames every 15 to 50 m."""
    found = []
    q = uniform(rng, -0.7, 0.7) * half_m
    for s in np.arange(span[0] + uniform(rng, 1.0, 10.0), span[1] - 1.0, uniform(rng, 15.0, 50.0)):
        a, b = float(s), q + uniform(rng, -0.1, 0.1)
        found += [
            Stain(
                start_m=a, end_m=a + 0.8, right_m=b - 0.4, left_m=b + 0.4,
                shade=uniform(rng, 1.3, 2.0), of="cover",
            ),
            Stain(
                start_m=a + 0.1, end_m=a + 0.7, right_m=b - 0.3, left_m=b + 0.3,
                shade=uniform(rng, 0.3, 0.6), of="cover",
            ),
        ]  # fmt: skip
    return found


def _studs(rng: np.random.Generator, half_m: float, span: tuple[float, float]) -> list[Stain]:
    """Return bright studs of 10 cm every 6 to 18 m along a line: reflectors, no paint."""
    q = float(rng.choice([-0.9, 0.0, 0.9])) * half_m
    return [
        Stain(start_m=float(s), end_m=float(s) + 0.1, right_m=q - 0.05, left_m=q + 0.05, shade=5.0, of="stud")
        for s in np.arange(span[0] + 1.0, span[1] - 1.0, uniform(rng, 6.0, 18.0))
    ]


def _cycle_lane(rng: np.random.Generator, half_m: float, span: tuple[float, float]) -> list[Stain]:
    """Return a coloured lane of 1.2 to 1.6 m along one edge over a stretch: a step of brightness on either side."""
    sign, width = float(rng.choice([-1.0, 1.0])), uniform(rng, 1.2, 1.6)
    a, b = sorted((sign * half_m, sign * (half_m - width)))
    s = sorted(uniform(rng, *span) for _ in range(2))
    return [
        Stain(
            start_m=s[0], end_m=max(s[1], s[0] + 10.0), right_m=a, left_m=b,
            shade=uniform(rng, 1.2, 1.8), of="cycle lane",
        )
    ]  # fmt: skip


def _across(half_m: float, at: FloatArray, width_m: float, shade: float, of: str) -> list[Stain]:
    return [
        Stain(start_m=float(s), end_m=float(s) + width_m, right_m=-half_m, left_m=half_m, shade=shade, of=of)
        for s in at
    ]


_EACH: tuple[Callable[[np.random.Generator, float, tuple[float, float]], list[Stain]], ...] = (
    _wheel_tracks,
    _plates,
    _patches,
    _tar_seams,
    _wet,
    _covers,
    _studs,
    _cycle_lane,
)


def older_paint(rng: np.random.Generator, markings: Sequence[Marking]) -> list[Stain]:
    """Return what is left of older lines, 25 to 45 cm beside half of the solid ones: scraped, dark or faintly bright.

    It is no line any more, and has no truth.
    """
    found = []
    for m in markings:
        if m.pattern != "solid" or m.shift_m is not None or rng.random() < 0.5:
            continue
        q, at = m.q_m + float(rng.choice([-1.0, 1.0])) * uniform(rng, 0.25, 0.45), m.start_m
        while at < m.end_m - 1.0:
            end = min(at + uniform(rng, 0.5, 4.0), m.end_m)
            shade = uniform(rng, 0.7, 1.25)
            found.append(
                Stain(
                    start_m=at, end_m=end, right_m=q - 0.06, left_m=q + 0.06, shade=shade, of="scraped line"
                )
            )
            at = end + uniform(rng, 0.0, 1.5)
    return found
