"""What a page can ask to be done to lines, as documents that are checked at the door."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, StringConstraints

#: Nobody chooses more lines at once, or clicks more vertices.
MOST_LINES, MOST_VERTICES = 10_000, 10_000
#: No CRS in metres reaches further; what is too far from the survey is refused later, with its distance. [m]
_FURTHEST_M = 1e8

EditMetres = Annotated[float, Field(ge=-_FURTHEST_M, le=_FURTHEST_M, allow_inf_nan=False)]
PlanPosition = tuple[EditMetres, EditMetres]
SpacePosition = tuple[EditMetres, EditMetres, EditMetres]
Id = Annotated[str, StringConstraints(min_length=1, max_length=200)]
Ids = Annotated[list[Id], Field(min_length=1, max_length=MOST_LINES)]
Kind = Annotated[str, StringConstraints(min_length=1, max_length=40)]
LineNumber = Annotated[int, Field(ge=0, le=2**31)]


class _Document(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class ReviewLines(_Document):
    """Lines are right, wrong, or not judged after all."""

    action: Literal["accept", "reject", "restore"]
    ids: Ids


class DeleteLines(_Document):
    """Lines go, and no record of them stays in the layers."""

    action: Literal["delete"]
    ids: Ids


class SplitLine(_Document):
    """A line is cut at a place."""

    action: Literal["split"]
    id: Id
    at: PlanPosition


class JoinLines(_Document):
    """Two lines are one."""

    action: Literal["join"]
    ids: tuple[Id, Id]


class ReshapeLine(_Document):
    """A line is made smoother, or runs the other way."""

    action: Literal["smooth", "reverse"]
    id: Id


class AddDashes(_Document):
    """Lines get the dashes that they lack, where the paint along them or the rhythm of those there says."""

    action: Literal["dashes"]
    ids: Ids


class ChangeKind(_Document):
    """Lines are of another kind."""

    action: Literal["kind"]
    ids: Ids
    kind: Kind


class SetAttribute(_Document):
    """A word is said of lines."""

    action: Literal["set"]
    ids: Ids
    column: Kind
    value: Annotated[str, StringConstraints(max_length=2000)] | bool


class MoveVertex(_Document):
    """A vertex is elsewhere; of a place without height that is measured in the points."""

    action: Literal["move"]
    id: Id
    vertex: LineNumber
    to: PlanPosition | SpacePosition


class InsertVertex(_Document):
    """One more vertex; after -1: before the first."""

    action: Literal["insert"]
    id: Id
    after: Annotated[int, Field(ge=-1, le=2**31)]
    to: PlanPosition | SpacePosition


class RemoveVertex(_Document):
    """One vertex fewer."""

    action: Literal["remove"]
    id: Id
    vertex: LineNumber


class TrimLine(_Document):
    """Only what is between two vertices stays."""

    action: Literal["trim"]
    id: Id
    first: LineNumber
    last: LineNumber


class DrawLine(_Document):
    """A new line, vertex by vertex."""

    action: Literal["draw"]
    kind: Kind
    xyz: Annotated[list[PlanPosition | SpacePosition], Field(min_length=2, max_length=MOST_VERTICES)]


class DrawBeside(_Document):
    """A new line beside one: through a place, as long as that line; of two places: from one to the other."""

    action: Literal["beside"]
    id: Id
    kind: Kind
    at: Annotated[list[PlanPosition], Field(min_length=1, max_length=2)]


class DrawWire(_Document):
    """A hanging wire through three places: from pole to pole, and one between."""

    action: Literal["wire"]
    xyz: Annotated[list[PlanPosition | SpacePosition], Field(min_length=3, max_length=3)]


class KeepTrace(_Document):
    """A followed line, from one of its vertices to another; `continues`: the line that it was followed on from."""

    action: Literal["keep"]
    trace: Id
    first: LineNumber
    last: LineNumber
    continues: Id | None = None


class DismissSuspect(_Document):
    """There is nothing to do about something in the queue."""

    action: Literal["dismiss"]
    key: Id


EditOrder = Annotated[
    ReviewLines
    | DeleteLines
    | SplitLine
    | JoinLines
    | ReshapeLine
    | AddDashes
    | ChangeKind
    | SetAttribute
    | MoveVertex
    | InsertVertex
    | RemoveVertex
    | TrimLine
    | DrawLine
    | DrawBeside
    | DrawWire
    | KeepTrace
    | DismissSuspect,
    Field(discriminator="action"),
]


class ChangeOrder(_Document):
    """An edit, and the revision of the lines that the person saw."""

    revision: Annotated[int, Field(ge=0, le=2**53)]
    edit: EditOrder


def positions_of(edit: EditOrder) -> Sequence[PlanPosition | SpacePosition]:
    """Return the places that an edit names, in its order."""
    if isinstance(edit, SplitLine):
        return [edit.at]
    if isinstance(edit, MoveVertex | InsertVertex):
        return [edit.to]
    if isinstance(edit, DrawBeside):
        return edit.at
    return edit.xyz if isinstance(edit, DrawLine | DrawWire) else []
