"""Which scene has an explanation as the truth, and which as the trap: the table in docs/simulation.md.

An explanation says what a bright stripe, a step of height, a long thin thing in the air or a smooth piece of ground is.
Where it is the truth, it is right; where it is the trap, what looks like it is something else, and to believe it
loses a line or invents one. `signs_of` tells from a scenario which of both it contains.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from linework.simulation.roads.road import SideSection
from linework.simulation.roads.scenario import RoadLayout, Scenario
from linework.simulation.scene.materials import Material


@dataclass(frozen=True, slots=True)
class Example:
    """A kind of road on which some seed has a `sign` of `signs_of`, and what is there in words."""

    road: str
    sign: str
    words: str


@dataclass(frozen=True, slots=True)
class Explanation:
    """An explanation, the scene where it is right, and the scene where it misleads."""

    name: str
    truth: Example
    trap: Example


def _pair(name: str, truth: str, trap: str) -> Explanation:
    return Explanation(
        name, Example("lookalikes", name, truth), Example("lookalikes", f"not {name}", trap)
    )  # fmt: skip


#: Every explanation; the first are those of `PAIRS`.
EXPLANATIONS: tuple[Explanation, ...] = (
    _pair("bare asphalt", "nothing there", "a line of which 60 to 70 % is gone"),
    _pair("line", "a painted line", "a joint filled with bright mortar"),
    _pair("two lines", "a double line", "the two slots of a drain"),
    _pair("broad strip", "the strip between wheel tracks", "a painted line of 0.3 to 0.5 m"),
    _pair("line on a strip", "a line on a bright strip", "a bright joint on a bright strip"),
    _pair("tar seam", "a tar seam", "a line along a tar seam"),
    _pair("joints of plates", "dark joints of a concrete plate", "thin painted bars, as far apart"),
    _pair("tram rails", "two rails", "two lines as far apart as rails"),
    _pair("studs", "studs", "painted blocks of 0.5 m"),
    _pair("steel plate", "a steel plate", "a painted field"),
    _pair("manhole cover", "a cover in its frame", "a painted square"),
    _pair("wet place", "a wet place", "a line through a wet place"),
    _pair("arrow", "a painted arrow", "an arrow that was scraped off"),
    _pair("letters", "painted letters", "letters that were scraped off"),
    _pair("zebra", "painted bars", "bars that were scraped off"),
    _pair("stop line", "a painted bar", "a band of concrete"),
    Explanation(
        "older line",
        Example("repainted", "older line", "worn white lines beside the new ones"),
        Example("mixed", "scraped line", "what milling left of a line"),
    ),
    Explanation(
        "temporary line",
        Example("repainted", "temporary line", "yellow lines that leave the white ones"),
        Example("gore", "shifting line", "a white line that follows a lane's edge"),
    ),
    Explanation(
        "kerb stones",
        Example("village", "kerb stone", "bright stones at the edge, no paint"),
        Example("village", "line at the edge", "an edge line beside the kerb"),
    ),
    Explanation(
        "gutter",
        Example("village", "gutter", "a bright or dark gutter"),
        Example("straight", "line at the edge", "an edge line 15 to 40 cm from the edge"),
    ),
    Explanation(
        "edge of another pavement",
        Example("rural", "flush edge", "a verge within 2 cm of the pavement"),
        Example("rural", "cycle lane", "a coloured lane on the pavement"),
    ),
    Explanation(
        "kerb up to a footway",
        Example("urban", "kerb", "a kerb"),
        Example("village", "wall", "the foot of a wall behind the footway"),
    ),
    Explanation(
        "low kerb",
        Example("village", "low kerb", "a footway 1 to 3 cm above the street"),
        Example("rural", "patch", "a patch: another brightness, no step"),
    ),
    Explanation(
        "drop to a lower verge",
        Example("rural", "low verge", "a verge 5 to 12 cm lower"),
        Example("rural", "ditch", "the rim of a ditch beyond the verge"),
    ),
    Explanation(
        "rise to a higher verge",
        Example("rural", "high verge", "a verge 5 to 12 cm higher"),
        Example("rural", "overgrown", "herbs that hang over the edge"),
    ),
    Explanation(
        "island",
        Example("roundabout", "island", "a splitter island"),
        Example("urban", "car", "a parked car: a hole in the ground"),
    ),
    Explanation(
        "guardrail",
        Example("bends", "guardrail", "W-beams"),
        Example("urban", "handrail", "handrails, fences and walls as high"),
    ),
    Explanation(
        "concrete barrier",
        Example("motorway", "barrier", "a barrier in the median"),
        Example("motorway", "wall", "a noise wall"),
    ),
    Explanation(
        "cable",
        Example("bends", "cable", "wires between poles"),
        Example("motorway", "gantry", "straight chords of a gantry"),
    ),
    Explanation(
        "long edge up in the air",
        Example("roofs", "roof", "eaves and ridges, no wire"),
        Example("straight", "cable", "wires as high as roofs"),
    ),
    Explanation(
        "road over the road",
        Example("overpass", "road above", "two roads, each with its lines"),
        Example("motorway", "bridge", "a bridge without a road on it"),
    ),
    Explanation(
        "walls on both sides and a roof",
        Example("tunnel", "tunnel", "a tunnel: walls, vault, no sky"),
        Example("village", "wall", "house fronts under the sky"),
    ),
    Explanation(
        "road",
        Example("rural", "asphalt", "a pavement"),
        Example("field", "open land", "smooth land that nobody drives on"),
    ),
)


def signs_of(scenario: Scenario) -> frozenset[str]:
    """Return what a scenario contains, in the words of `EXPLANATIONS`."""
    return frozenset(_signs(scenario.layout))


def _signs(layout: RoadLayout) -> Iterator[str]:
    yield from (one.of if one.is_so else f"not {one.of}" for one in layout.lookalikes)
    yield from (stain.of for stain in layout.stains if stain.of)
    yield "asphalt" if layout.road.surface == Material.ASPHALT else "open land"
    yield from (sign for sign, has in _HAS.items() if getattr(layout, has))
    for side in (layout.road.left, layout.road.right) if layout.road.surface == Material.ASPHALT else ():
        yield from _signs_of_side(side)
        for m in layout.markings:
            if m.role == "edge" and side.width_m - abs(m.q_m) < 0.75:
                yield "line at the edge"
    yield from (f"{m.generation} line" for m in layout.markings if m.generation)
    if any(m.shift_m is not None and not m.generation for m in layout.markings):
        yield "shifting line"
    if any(fence.form == "tubes" for fence in layout.fences):
        yield "handrail"
    if any(hedge.height_m < 0.55 for hedge in layout.hedges):
        yield "overgrown"


#: Signs that are there if a group of `RoadLayout` is not empty.
_HAS = {
    "wall": "walls", "island": "islands", "car": "cars", "guardrail": "rails", "barrier": "barriers",
    "cable": "cables", "gantry": "gantries", "roof": "houses", "road above": "over", "bridge": "bridges",
    "tunnel": "tunnels",
}  # fmt: skip


def _signs_of_side(side: SideSection) -> Iterator[str]:
    step = float(np.median(side.step_m.y))
    if side.form == "kerb":
        yield "low kerb" if step <= 0.03 else "kerb"
    else:
        yield "low verge" if step < -0.05 else "high verge" if step > 0.05 else "flush edge"
        # Lower than a step within 3 m: the bottom of a ditch
        near = side.land_z_m[side.land_d_m <= side.land_d_m[1] + 1.6]
        if near.min() < -0.25:
            yield "ditch"


def explanations_table() -> str:
    """Return the table as Markdown."""
    rows = [
        "| explanation | where it is the truth | where it is the trap |",
        "|---|---|---|",
        *(
            f"| {one.name} | {one.truth.words} (`{one.truth.road}`) | {one.trap.words} (`{one.trap.road}`) |"
            for one in EXPLANATIONS
        ),
    ]
    return "\n".join(rows) + "\n"
