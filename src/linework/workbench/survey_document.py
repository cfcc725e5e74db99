"""What the page is told of the survey before anything else."""

from __future__ import annotations

from typing import Any

from linework.files.styles import colour_of
from linework.lines.edited_words import CHOICES
from linework.model.lines import KINDS
from linework.workbench.bench import Bench
from linework.workbench.opening import SurveyFacts
from linework.workbench.problems import without_paths
from linework.workbench.tiles import IMAGES, Lattice

#: Kinds as the trade calls them.
_TITLES = {
    "lane_marking": "Lane marking",
    "lane_marking_dash": "Dash",
    "road_marking_other": "Other marking",
    "road_boundary": "Road boundary",
    "kerb_top": "Kerb top",
    "guardrail": "Guardrail",
    "barrier": "Barrier",
    "fence": "Fence",
    "cable": "Cable",
}
#: Kinds that a place can be picked on: in points, and in images.
_PICKED = ("lane_marking", "road_boundary", "guardrail", "barrier", "cable")
_PICKED_IN_IMAGES = ("lane_marking", "road_boundary")


def survey_document(bench: Bench, *, busy: str) -> dict[str, Any]:
    """Return the survey as `Survey` of the page's types says it."""
    facts, drawing = bench.facts, bench.drawing
    return {
        "name": facts.name,
        "crs": facts.crs_name,
        "bounds": list(facts.bounds),
        "middle": list(facts.middle),
        "heights": list(facts.heights),
        "n_points": facts.n_points,
        "n_pairs": facts.n_pairs,
        "path": [list(place) for place in facts.path],
        "warnings": [without_paths(warning) for warning in facts.warnings],
        "lines_file": drawing.path.name,
        "who": bench.who,
        "kinds": [_kind(kind) for kind in KINDS],
        "choices": {column: list(words) for column, words in CHOICES.items()},
        "images": [dict(zip(("name", "title", "unit"), image, strict=True)) for image in _images(facts)],
        "tiles": Lattice.of(facts.bounds).document(),
        "revision": drawing.revision,
        "busy": busy,
    }


def _images(facts: SurveyFacts) -> tuple[tuple[str, str, str], ...]:
    """Return what the plan view can show: images are made of points."""
    return IMAGES if facts.n_points else ()


def _kind(kind: str) -> dict[str, Any]:
    red, green, blue = colour_of(kind)
    return {
        "kind": kind,
        "title": _TITLES[kind],
        "colour": f"#{red:02x}{green:02x}{blue:02x}",
        "picked": kind in _PICKED,
        "picked_in_images": kind in _PICKED_IN_IMAGES,
    }
