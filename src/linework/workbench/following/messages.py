"""What the page orders to be followed: documents FollowOrder of the page, checked."""

from __future__ import annotations

import json
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from linework.arrays import FloatArray
from linework.errors import LineworkError, UsageError
from linework.methods.obb.trace import TraceStop
from linework.model.lines import LineSet
from linework.tracing.trace import RefusedPickError
from linework.workbench.following.traces import KeptTrace
from linework.workbench.server.documents import line_documents
from linework.workbench.server.problems import status_and_message

#: Metres, in any CRS that has metres.
_Metres = Annotated[float, Field(ge=-1e8, le=1e8, allow_inf_nan=False)]
_Pixels = Annotated[float, Field(ge=-1e6, le=1e6, allow_inf_nan=False)]
PickedPosition = tuple[_Metres, _Metres]
LineEnd = Literal["start", "end"]


class _Order(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class ContinuedLine(_Order):
    """A line of the drawing that goes on at one of its ends: it is joined when the followed one is kept."""

    id: str = Field(max_length=200)
    end: LineEnd


class FollowPlace(_Order):
    """A place [m, world] on a line of a kind ("": any)."""

    type: Literal["pick"]
    at: PickedPosition
    kind: str = Field(default="", max_length=50)
    toward: PickedPosition | None = None
    continues: ContinuedLine | None = None


class FollowPixel(_Order):
    """A pixel (col, row) of an image as it was taken."""

    type: Literal["pick_image"]
    pair: int = Field(ge=0, le=10**9)
    side: Literal["left", "right"]
    at_px: tuple[_Pixels, _Pixels]
    kind: str = Field(default="", max_length=50)


class FollowBridge(_Order):
    """On beyond the gap at an end of a followed line."""

    type: Literal["bridge"]
    trace: str = Field(max_length=50)
    end: LineEnd


class StopFollowing(_Order):
    """Stop at the next step, and give what there is."""

    type: Literal["interrupt"]


FollowOrder = FollowPlace | FollowPixel | FollowBridge | StopFollowing
_ORDERS: TypeAdapter[FollowOrder] = TypeAdapter(Annotated[FollowOrder, Field(discriminator="type")])


def order_of(text: str) -> FollowOrder:
    """Return an order.

    Raises
    ------
    UsageError
        It makes no sense: what is first wrong with it.
    """
    try:
        return _ORDERS.validate_json(text)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        place = ".".join(str(part) for part in first["loc"])
        problem = f"{place}: {first['msg']}" if place else first["msg"]
        raise UsageError(f"no order to follow a line: {problem[:200]}", where="workbench") from None


# What the page is told of a line that is followed: documents FollowNews of the page, as JSON

#: What can be done where a line ends: look for it beyond, or pick a place further on, which continues it.
_CHOICES = {
    TraceStop.FADED: ["bridge", "continue"],
    TraceStop.END_OF_DATA: ["bridge", "continue"],
    TraceStop.INTERRUPTED: ["bridge", "continue"],
    TraceStop.RING: [],
}


def area_message(corners: FloatArray) -> str:
    """Say where a line has to pass: corners (4, 2) [m, world]."""
    return _text({"type": "area", "corners": np.round(corners, 3).tolist()})


def growth_message(trace_id: str, lines: LineSet) -> str:
    """Say how far a line has grown."""
    return _text({"type": "grown", "trace": trace_id, "lines": line_documents(lines)})


def sighting_message(trace_id: str, pair: int, left: FloatArray, right: FloatArray) -> str:
    """Say where a pair shows a line: pixels (n, 2) in its images as they were taken."""
    document = {"type": "seen", "trace": trace_id, "pair": pair}
    return _text(document | {"left": np.round(left, 1).tolist(), "right": np.round(right, 1).tolist()})


def stopped_message(trace_id: str, trace: KeptTrace, *, distance_m: float, is_interrupted: bool) -> str:
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


def refusal_message(error: LineworkError, *, in_image: bool = False) -> str:
    """Say why nothing is followed, what to do, and where it works instead."""
    document: dict[str, Any] = {"type": "refused", "works": None, "works_px": None}
    if isinstance(error, RefusedPickError):
        document |= {"reason": error.reason, "advice": error.advice}
        document["works_px" if in_image else "works"] = None if error.works is None else list(error.works)
    else:
        document |= {"reason": status_and_message(error)[1], "advice": ""}
    return _text(document)


def _text(document: dict[str, Any]) -> str:
    return json.dumps(document, allow_nan=False, separators=(",", ":"))
