"""What the page is told of a line that is followed: documents FollowNews of the page, as JSON."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from linework.arrays import FloatArray
from linework.errors import LineworkError
from linework.methods.obb.trace import Stop
from linework.model.lines import LineSet
from linework.tiling.refused_picks import RefusedPickError
from linework.workbench.following_kept import KeptTrace
from linework.workbench.problems import problem_of
from linework.workbench.wire import line_documents

#: What can be done where a line ends: look for it beyond, or pick a place further on, which continues it.
_CHOICES = {
    Stop.FADED: ["bridge", "continue"],
    Stop.END_OF_DATA: ["bridge", "continue"],
    Stop.INTERRUPTED: ["bridge", "continue"],
    Stop.RING: [],
}


def area_text(corners: FloatArray) -> str:
    """Say where a line has to pass: corners (4, 2) [m, world]."""
    return _text({"type": "area", "corners": np.round(corners, 3).tolist()})


def grown_text(trace_id: str, lines: LineSet) -> str:
    """Say how far a line has grown."""
    return _text({"type": "grown", "trace": trace_id, "lines": line_documents(lines)})


def seen_text(trace_id: str, pair: int, left: FloatArray, right: FloatArray) -> str:
    """Say where a pair shows a line: pixels (n, 2) in its images as they were taken."""
    document = {"type": "seen", "trace": trace_id, "pair": pair}
    return _text(document | {"left": np.round(left, 1).tolist(), "right": np.round(right, 1).tolist()})


def stopped_text(trace_id: str, trace: KeptTrace, *, distance_m: float, is_interrupted: bool) -> str:
    """Say that a line is whole, why it ends where it does, and what can be done there."""
    # Beyond a gap a line is looked for in points
    choices = [["continue"] if trace.in_images else choices_at(stop) for stop in trace.stops]
    return _text(
        {
            "type": "stopped",
            "trace": trace_id,
            "lines": line_documents(trace.lines),
            "stops": list(trace.stops),
            "choices": choices,
            "distance_m": round(distance_m, 3),
            "interrupted": is_interrupted,
        }
    )


def choices_at(stop: str) -> list[str]:
    """Return what can be done at an end, by why it is one.

    >>> choices_at("the data ends there"), choices_at("no lane_marking goes on")
    (['bridge', 'continue'], ['continue'])
    """
    return next((choices for known, choices in _CHOICES.items() if str(known) == stop), ["continue"])


def refused_text(error: LineworkError, *, in_image: bool = False) -> str:
    """Say why nothing is followed, what to do, and where it works instead."""
    document: dict[str, Any] = {"type": "refused", "works": None, "works_px": None}
    if isinstance(error, RefusedPickError):
        document |= {"reason": error.reason, "advice": error.advice}
        document["works_px" if in_image else "works"] = None if error.works is None else list(error.works)
    else:
        document |= {"reason": problem_of(error)[1], "advice": ""}
    return _text(document)


def _text(document: dict[str, Any]) -> str:
    return json.dumps(document, allow_nan=False, separators=(",", ":"))
