"""Messages about followed lines: orders from the page (its type FollowOrder), answers to it (FollowNews)."""

from __future__ import annotations

import json
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, TypeAdapter, ValidationError

from linework.arrays import FloatArray
from linework.errors import LineworkError, RefusedPickError, UsageError
from linework.methods.templates.template import LONGEST_NODE_NAME
from linework.model.lines import LineSet
from linework.workbench.following.traces import KeptTrace
from linework.workbench.server.documents import Document, line_documents
from linework.workbench.server.problems import status_and_message

#: Coordinates in any CRS in metres. [m]
_Metres = Annotated[float, Field(ge=-1e8, le=1e8, allow_inf_nan=False)]
#: Pixel coordinates in any image; the image itself sets the limit later. [pixels]
_Pixels = Annotated[float, Field(ge=-1e6, le=1e6, allow_inf_nan=False)]
PickedPosition = tuple[_Metres, _Metres]
LineEnd = Literal["start", "end"]


class ContinuedLine(Document):
    """A saved line that is continued at one of its ends: both are joined when the followed line is kept."""

    id: str = Field(max_length=200)
    end: LineEnd


class FollowPlace(Document):
    """Follow the line of a kind ("": any) at a place (east, north) [m, world], with a template beside it ("": none)."""

    type: Literal["pick"]
    at: PickedPosition
    kind: str = Field(default="", max_length=50)
    template: str = Field(default="", max_length=LONGEST_NODE_NAME)
    toward: PickedPosition | None = None
    continues: ContinuedLine | None = None


class FollowPixel(Document):
    """Follow the line at a pixel (column, row) of an image as it was taken."""

    type: Literal["pick_image"]
    pair: int = Field(ge=0, le=10**9)
    side: Literal["left", "right"]
    at_px: tuple[_Pixels, _Pixels]
    kind: str = Field(default="", max_length=50)


class FollowBridge(Document):
    """Follow a line on beyond the gap at one of its ends, with a template beside the whole ("": none)."""

    type: Literal["bridge"]
    trace: str = Field(max_length=50)
    end: LineEnd
    template: str = Field(default="", max_length=LONGEST_NODE_NAME)


class StopFollowing(Document):
    """Stop at the next step, and keep what there is."""

    type: Literal["interrupt"]


FollowOrder = FollowPlace | FollowPixel | FollowBridge | StopFollowing
_ORDERS: TypeAdapter[FollowOrder] = TypeAdapter(Annotated[FollowOrder, Field(discriminator="type")])


def order_of(text: str) -> FollowOrder:
    """Return the order of a message.

    Raises
    ------
    UsageError
        It is not valid; names the first problem.
    """
    try:
        return _ORDERS.validate_json(text)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        place = ".".join(str(part) for part in first["loc"])
        problem = f"{place}: {first['msg']}" if place else first["msg"]
        raise UsageError(f"invalid order to follow a line: {problem[:200]}", where="workbench") from None


# Answers to the page: its type FollowNews, as JSON


def area_message(corners: FloatArray) -> str:
    """Return the message with the square that a line has to cross: corners (4, 2) [m, world]."""
    return _text({"type": "area", "corners": np.round(corners, 3).tolist()})


def growth_message(trace_id: str, lines: LineSet) -> str:
    """Return the message with a line as far as it has been followed."""
    return _text({"type": "grown", "trace": trace_id, "lines": line_documents(lines)})


def sighting_message(trace_id: str, pair: int, left: FloatArray, right: FloatArray) -> str:
    """Return the message with a line's pixels (n, 2) in both images of a pair, as they were taken."""
    document = {"type": "seen", "trace": trace_id, "pair": pair}
    return _text(document | {"left": np.round(left, 1).tolist(), "right": np.round(right, 1).tolist()})


def stopped_message(trace_id: str, trace: KeptTrace, *, distance_m: float, is_interrupted: bool) -> str:
    """Return the message with a finished line, why it ends where it does, and what can be done there."""
    # Gaps are bridged in points only
    choices = [["continue"] if trace.in_images else choices_at(stop) for stop in trace.stops]
    return _text(
        {
            "type": "stopped",
            "trace": trace_id,
            "lines": line_documents(trace.shown),
            "unseen": list(trace.unseen),
            "left_out": trace.left_out,
            "stops": list(trace.stops),
            "choices": choices,
            "distance_m": round(distance_m, 3),
            "interrupted": is_interrupted,
        }
    )


def choices_at(stop: str) -> list[str]:
    """Return what can be done at an end, by the reason why the line ends there.

    >>> choices_at("the points end there"), choices_at("no lane marking continues")
    (['bridge', 'continue'], ['continue'])
    """
    # Here and not above: the server reads orders, and does not need the methods
    from linework.methods.obb.trace import TraceStop

    if stop == TraceStop.RING:
        return []
    goes_on = stop in (TraceStop.FADED, TraceStop.END_OF_DATA, TraceStop.INTERRUPTED)
    return ["bridge", "continue"] if goes_on else ["continue"]


def refusal_message(error: LineworkError, *, in_image: bool = False) -> str:
    """Return the message that refuses an order: why, what to do, and the nearest place where it works."""
    document: dict[str, Any] = {"type": "refused", "works": None, "works_px": None}
    if isinstance(error, RefusedPickError):
        document |= {"reason": error.reason, "advice": error.advice}
        document["works_px" if in_image else "works"] = None if error.works is None else list(error.works)
    else:
        document |= {"reason": status_and_message(error)[1], "advice": ""}
    return _text(document)


def _text(document: dict[str, Any]) -> str:
    return json.dumps(document, allow_nan=False, separators=(",", ":"))
