"""What the page orders to be followed: documents FollowOrder of the page, checked."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from linework.errors import UsageError

#: Metres, in any CRS that has metres.
_Metres = Annotated[float, Field(ge=-1e8, le=1e8, allow_inf_nan=False)]
_Pixels = Annotated[float, Field(ge=-1e6, le=1e6, allow_inf_nan=False)]
Place = tuple[_Metres, _Metres]
End = Literal["start", "end"]


class _Order(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Continued(_Order):
    """A line of the drawing that goes on at one of its ends: it is joined when the followed one is kept."""

    id: str = Field(max_length=200)
    end: End


class Pick(_Order):
    """A place [m, world] on a line of a kind ("": any)."""

    type: Literal["pick"]
    at: Place
    kind: str = Field(default="", max_length=50)
    toward: Place | None = None
    continues: Continued | None = None


class PickImage(_Order):
    """A pixel (col, row) of an image as it was taken."""

    type: Literal["pick_image"]
    pair: int = Field(ge=0, le=10**9)
    side: Literal["left", "right"]
    at_px: tuple[_Pixels, _Pixels]
    kind: str = Field(default="", max_length=50)


class Bridge(_Order):
    """On beyond the gap at an end of a followed line."""

    type: Literal["bridge"]
    trace: str = Field(max_length=50)
    end: End


class Interrupt(_Order):
    """Stop at the next step, and give what there is."""

    type: Literal["interrupt"]


Order = Pick | PickImage | Bridge | Interrupt
_ORDERS: TypeAdapter[Order] = TypeAdapter(Annotated[Order, Field(discriminator="type")])


def order_of(text: str) -> Order:
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
