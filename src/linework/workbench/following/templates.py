"""The survey's templates of cross-sections, kept beside the lines, and their routes."""

from __future__ import annotations

import asyncio
import tempfile
import threading
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

from fastapi import APIRouter, Query
from pydantic import Field

from linework.errors import InputError
from linework.files.line_file.cross_templates import read_cross_templates, text_of_templates
from linework.files.output.publish import publish
from linework.methods.templates.template import (
    FARTHEST_NODE_M,
    LONGEST_NODE_NAME,
    MOST_NODES,
    MOST_TEMPLATES,
    CrossTemplate,
    TemplateNode,
    template_named,
)
from linework.workbench.server.app_state import AppState, CurrentState
from linework.workbench.server.documents import Document

template_router = APIRouter(prefix="/api")
_Name = Annotated[str, Field(min_length=1, max_length=LONGEST_NODE_NAME)]
_Metres = Annotated[float, Field(ge=-FARTHEST_NODE_M, le=FARTHEST_NODE_M, allow_inf_nan=False)]


class NodeDocument(Document):
    """A node of a template: see `linework.methods.templates.template.TemplateNode`."""

    name: _Name
    edge: _Name
    across_m: _Metres
    up_m: _Metres
    kind: _Name
    role: Annotated[str, Field(max_length=LONGEST_NODE_NAME)] = ""


class TemplateDocument(Document):
    """A template as the page shows and sends it."""

    name: _Name
    nodes: Annotated[list[NodeDocument], Field(min_length=1, max_length=MOST_NODES)]


class TemplateList(Document):
    """All templates of the survey."""

    templates: Annotated[list[TemplateDocument], Field(max_length=MOST_TEMPLATES)]


def templates_path(lines: Path) -> Path:
    """Return where the templates of a line file are kept: beside it.

    >>> templates_path(Path("drive/lines.gpkg")).as_posix()
    'drive/lines.templates.csv'
    """
    return lines.with_suffix(".templates.csv")


def survey_templates(path: Path) -> tuple[CrossTemplate, ...]:
    """Return the templates in a file; none where there is no file.

    Raises
    ------
    InputError
        It is a link, or a row is wrong.
    """
    if path.is_symlink():
        # The page gets nothing that lies elsewhere
        raise InputError("is a link", where=path, advice="put the table itself there")
    if not path.exists():
        return ()
    return read_cross_templates(path)


def template_of_survey(app_state: AppState, name: str) -> CrossTemplate | None:
    """Return the survey's template with a name; None for "".

    Raises
    ------
    UsageError
        There is none.
    """
    return template_named(survey_templates(templates_path(app_state.line_file.path)), name) if name else None


@template_router.get("/templates")
async def get_templates(app_state: CurrentState) -> TemplateList:
    """Return the survey's templates."""
    path = templates_path(app_state.line_file.path)
    return _documents(await asyncio.to_thread(survey_templates, path))


@template_router.put("/templates")
async def save_template(order: TemplateDocument, app_state: CurrentState) -> TemplateList:
    """Save a template under its name among those of the file; with a fault it is refused, and the file stays."""
    path = templates_path(app_state.line_file.path)
    made = CrossTemplate(order.name.strip(), tuple(TemplateNode(**node.model_dump()) for node in order.nodes))
    return _documents(await asyncio.to_thread(_changed, path, made.name, made))


@template_router.delete("/templates")
async def remove_template(
    name: Annotated[str, Query(min_length=1, max_length=LONGEST_NODE_NAME)], app_state: CurrentState
) -> TemplateList:
    """Remove the template with a name, if the file has one; the others stay."""
    path = templates_path(app_state.line_file.path)
    return _documents(await asyncio.to_thread(_changed, path, name, None))


#: Held while the file is read, changed and written: two pages may save at once.
_CHANGING = threading.Lock()


def _changed(path: Path, name: str, made: CrossTemplate | None) -> tuple[CrossTemplate, ...]:
    """Replace, add or (None) remove the template with a name in what the file says now: others may have edited it."""
    with _CHANGING:
        found = {one.name: one for one in survey_templates(path)}
        if made is not None:
            found[name] = made
        elif name not in found:
            return tuple(found.values())
        else:
            del found[name]
        # Read again, which checks kinds, edges and names
        return _save(text_of_templates(list(found.values())), path)


def _save(text: str, path: Path) -> tuple[CrossTemplate, ...]:
    def write(part: Path) -> None:
        part.write_text(text, encoding="utf-8", newline="")

    def check(part: Path) -> None:
        read_cross_templates(part)

    with tempfile.TemporaryDirectory() as folder:
        # With a fault, its message names no part file
        tried = Path(folder) / path.name
        write(tried)
        check(tried)
    publish(path, write, check, overwrite=True)
    return survey_templates(path)


def _documents(templates: Sequence[CrossTemplate]) -> TemplateList:
    return TemplateList(
        templates=[
            TemplateDocument(name=one.name, nodes=[NodeDocument(**asdict(node)) for node in one.nodes])
            for one in templates
        ]
    )
