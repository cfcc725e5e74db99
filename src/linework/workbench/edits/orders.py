"""What a page can ask to be done to lines, as documents that are checked at the door."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, StringConstraints

#: Nobody chooses more lines at once, or clicks more vertices.
MOST_LINES, MOST_VERTICES = 10_000, 10_000
#: No CRS in metres reaches further; what is too far from the survey is refused later, with its distance. [m]
_FURTHEST_M = 1e8

Metres = Annotated[float, Field(ge=-_FURTHEST_M, le=_FURTHEST_M, allow_inf_nan=False)]
Place = tuple[Metres, Metres]
Vertex = tuple[Metres, Metres, Metres]
Id = Annotated[str, StringConstraints(min_length=1, max_length=200)]
Ids = Annotated[list[Id], Field(min_length=1, max_length=MOST_LINES)]
Kind = Annotated[str, StringConstraints(min_length=1, max_length=40)]
Number = Annotated[int, Field(ge=0, le=2**31)]


class _Document(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Review(_Document):
    """Lines are right, wrong, or not judged after all."""

    action: Literal["accept", "reject", "restore"]
    ids: Ids


class Delete(_Document):
    """Lines go, and no record of them stays in the layers."""

    action: Literal["delete"]
    ids: Ids


class Split(_Document):
    """A line is cut at a place."""

    action: Literal["split"]
    id: Id
    at: Place


class Join(_Document):
    """Two lines are one."""

    action: Literal["join"]
    ids: tuple[Id, Id]


class Shape(_Document):
    """A line is made smoother, or runs the other way."""

    action: Literal["smooth", "reverse"]
    id: Id


class Dashes(_Document):
    """Lines get the dashes that they lack, where the paint along them or the rhythm of those there says."""

    action: Literal["dashes"]
    ids: Ids


class AsKind(_Document):
    """Lines are of another kind."""

    action: Literal["kind"]
    ids: Ids
    kind: Kind


class Set(_Document):
    """A word is said of lines."""

    action: Literal["set"]
    ids: Ids
    column: Kind
    value: Annotated[str, StringConstraints(max_length=2000)] | bool


class Move(_Document):
    """A vertex is elsewhere; of a place without height that is measured in the points."""

    action: Literal["move"]
    id: Id
    vertex: Number
    to: Place | Vertex


class Insert(_Document):
    """One more vertex; after -1: before the first."""

    action: Literal["insert"]
    id: Id
    after: Annotated[int, Field(ge=-1, le=2**31)]
    to: Place | Vertex


class Remove(_Document):
    """One vertex fewer."""

    action: Literal["remove"]
    id: Id
    vertex: Number


class Trim(_Document):
    """Only what is between two vertices stays."""

    action: Literal["trim"]
    id: Id
    first: Number
    last: Number


class Draw(_Document):
    """A new line, vertex by vertex."""

    action: Literal["draw"]
    kind: Kind
    xyz: Annotated[list[Place | Vertex], Field(min_length=2, max_length=MOST_VERTICES)]


class Beside(_Document):
    """A new line beside one: through a place, as long as that line; of two places: from one to the other."""

    action: Literal["beside"]
    id: Id
    kind: Kind
    at: Annotated[list[Place], Field(min_length=1, max_length=2)]


class Wire(_Document):
    """A hanging wire through three places: from pole to pole, and one between."""

    action: Literal["wire"]
    xyz: Annotated[list[Place | Vertex], Field(min_length=3, max_length=3)]


class Keep(_Document):
    """A followed line, from one of its vertices to another; `continues`: the line that it was followed on from."""

    action: Literal["keep"]
    trace: Id
    first: Number
    last: Number
    continues: Id | None = None


class Dismiss(_Document):
    """There is nothing to do about something in the queue."""

    action: Literal["dismiss"]
    key: Id


EditOrder = Annotated[
    Review
    | Delete
    | Split
    | Join
    | Shape
    | Dashes
    | AsKind
    | Set
    | Move
    | Insert
    | Remove
    | Trim
    | Draw
    | Beside
    | Wire
    | Keep
    | Dismiss,
    Field(discriminator="action"),
]


class ChangeOrder(_Document):
    """An edit, and the revision of the lines that the person saw."""

    revision: Annotated[int, Field(ge=0, le=2**53)]
    edit: EditOrder


def places_of(edit: EditOrder) -> Sequence[Place | Vertex]:
    """Return the places that an edit names, in its order."""
    if isinstance(edit, Split):
        return [edit.at]
    if isinstance(edit, Move | Insert):
        return [edit.to]
    if isinstance(edit, Beside):
        return edit.at
    return edit.xyz if isinstance(edit, Draw | Wire) else []
