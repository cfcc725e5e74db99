"""Edits that a page can send, as checked documents."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Literal

from pydantic import Field, StringConstraints

from linework.workbench.server.documents import Document

#: Limits on the lines of one edit, and on the vertices of one line: nobody selects or draws more.
MOST_LINES, MOST_VERTICES = 10_000, 10_000
#: Largest coordinate of any CRS in metres; places far from the survey are refused later, with their distance. [m]
_FURTHEST_M = 1e8

EditMetres = Annotated[float, Field(ge=-_FURTHEST_M, le=_FURTHEST_M, allow_inf_nan=False)]
PlanPosition = tuple[EditMetres, EditMetres]
SpacePosition = tuple[EditMetres, EditMetres, EditMetres]
Id = Annotated[str, StringConstraints(min_length=1, max_length=200)]
Ids = Annotated[list[Id], Field(min_length=1, max_length=MOST_LINES)]
Kind = Annotated[str, StringConstraints(min_length=1, max_length=40)]
LineNumber = Annotated[int, Field(ge=0, le=2**31)]


class ReviewLines(Document):
    """Accept or reject lines, or withdraw the decision."""

    action: Literal["accept", "reject", "restore"]
    ids: Ids


class DeleteLines(Document):
    """Delete lines from the layers; the history keeps them."""

    action: Literal["delete"]
    ids: Ids


class SplitLine(Document):
    """Cut a line at a place."""

    action: Literal["split"]
    id: Id
    at: PlanPosition


class JoinLines(Document):
    """Join two lines."""

    action: Literal["join"]
    ids: tuple[Id, Id]


class ReshapeLine(Document):
    """Smooth a line, or reverse its direction."""

    action: Literal["smooth", "reverse"]
    id: Id


class AddDashes(Document):
    """Add the dashes that lines lack, where the paint or the rhythm of the existing ones shows them."""

    action: Literal["dashes"]
    ids: Ids


class ChangeKind(Document):
    """Change the kind of lines."""

    action: Literal["kind"]
    ids: Ids
    kind: Kind


class SetAttribute(Document):
    """Set an attribute of lines."""

    action: Literal["set"]
    ids: Ids
    column: Kind
    value: Annotated[str, StringConstraints(max_length=2000)] | bool


class MoveVertex(Document):
    """Move a vertex; if the place has no height, that is measured in the points."""

    action: Literal["move"]
    id: Id
    vertex: LineNumber
    to: PlanPosition | SpacePosition


class InsertVertex(Document):
    """Insert a vertex after another; after -1: before the first."""

    action: Literal["insert"]
    id: Id
    after: Annotated[int, Field(ge=-1, le=2**31)]
    to: PlanPosition | SpacePosition


class RemoveVertex(Document):
    """Remove a vertex."""

    action: Literal["remove"]
    id: Id
    vertex: LineNumber


class TrimLine(Document):
    """Keep only the part of a line between two vertices."""

    action: Literal["trim"]
    id: Id
    first: LineNumber
    last: LineNumber


class DrawLine(Document):
    """Draw a new line, vertex by vertex."""

    action: Literal["draw"]
    kind: Kind
    xyz: Annotated[list[PlanPosition | SpacePosition], Field(min_length=2, max_length=MOST_VERTICES)]


class DrawBeside(Document):
    """Draw a line beside one: through one place, as long as that line; or from one place to another."""

    action: Literal["beside"]
    id: Id
    kind: Kind
    at: Annotated[list[PlanPosition], Field(min_length=1, max_length=2)]


class DrawWire(Document):
    """Draw a hanging wire through three places: at both poles, and one between."""

    action: Literal["wire"]
    xyz: Annotated[list[PlanPosition | SpacePosition], Field(min_length=3, max_length=3)]


class KeepTrace(Document):
    """Save a followed line from one of its vertices to another; `continues`: the line that it continues."""

    action: Literal["keep"]
    trace: Id
    first: LineNumber
    last: LineNumber
    continues: Id | None = None


class LinesBeside(Document):
    """Add the lines of a template beside a line."""

    action: Literal["template"]
    id: Id
    template: Kind


class AddWires(Document):
    """Add the wires that hang with a wire from pole to pole: those of its own conductor, or all beside it too."""

    action: Literal["wires"]
    id: Id
    which: Literal["own", "all"]


class AddPartner(Document):
    """Add the other rail or barrier of the median on which one stands."""

    action: Literal["partner"]
    id: Id


class DismissSuspect(Document):
    """Dismiss an item of the review queue."""

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
    | LinesBeside
    | AddWires
    | AddPartner
    | DismissSuspect,
    Field(discriminator="action"),
]


class ChangeOrder(Document):
    """An edit, and the revision of the lines that it is based on."""

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
