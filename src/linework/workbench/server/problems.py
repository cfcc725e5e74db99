"""Errors as the page gets them: a status, and one line without paths of this machine.

Workers word errors for the page, too: `answers`, which needs the server's packages, stands apart.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from http import HTTPStatus
from pathlib import Path
from types import MappingProxyType
from typing import Any

from linework.errors import (
    AbsentError,
    ConfigError,
    CrsError,
    InputError,
    LineworkError,
    MachineError,
    MissingPackageError,
    OutputExistsError,
    OwnCodeError,
    PartialError,
    RefusedPickError,
    StaleError,
    UnknownKindError,
    UsageError,
)

#: HTTP status of each error.
STATUS_OF: Mapping[type[LineworkError], int] = MappingProxyType(
    {
        UsageError: 400,
        ConfigError: 400,
        UnknownKindError: 400,
        AbsentError: 404,
        OutputExistsError: 409,
        StaleError: 412,
        InputError: 422,
        RefusedPickError: 422,
        CrsError: 422,
        PartialError: 422,
        OwnCodeError: 422,
        MachineError: 503,
        MissingPackageError: 503,
    }
)
#: Status of errors that the table does not list.
_OTHER_STATUS = 400

#: Errors that every route may answer with, for OpenAPI: ``responses=PROBLEMS``.
PROBLEMS: dict[int | str, dict[str, Any]] = {
    status: {
        "description": HTTPStatus(status).phrase,
        "content": {
            "application/json": {
                "schema": {
                    "type": "object",
                    "required": ["problem", "status"],
                    "properties": {"problem": {"type": "string"}, "status": {"type": "integer"}},
                }
            }
        },
    }
    for status in (400, 401, 403, 404, 405, 408, 409, 412, 413, 415, 422, 429, 503)
}

#: Answer to a fault of ours: the details are in the log, which the page does not get.
FAULT = "a fault of linework, not of your data; the log is saved, the terminal says where"

#: A path of this machine: two or more names after a slash that begins a word. Its last name is kept.
_PATH = re.compile(r"(?<![\w.:/<])/(?:[^\s/:'\"]+/)+([^\s/:'\"]+)")


def problem_document(line: str, status: int) -> dict[str, Any]:
    """Return the body of an answer that reports a problem.

    >>> problem_document("/data/a/b.laz: empty file. Copy it again.", 422)
    {'problem': 'b.laz: empty file. Copy it again.', 'status': 422}
    """
    return {"problem": hide_paths(line), "status": status}


def status_and_message(error: LineworkError) -> tuple[int, str]:
    """Return the HTTP status and the one-line message of an error."""
    status = next((STATUS_OF[kind] for kind in type(error).__mro__ if kind in STATUS_OF), _OTHER_STATUS)
    where = error.where.name if isinstance(error.where, Path) else error.where
    named = LineworkError(error.problem, where=where, advice=error.advice)
    return status, hide_paths(named.line(_page_words))


def _page_words(name: str, value: str | int | bool | None) -> str:
    """Return a parameter as the page's users read it: its name, and a value that it could have."""
    words = name.replace("_", " ")
    return words if value is None or value is True else f"{words} {value}"


def hide_paths(text: str) -> str:
    r"""Return a text on one line, with each path of this machine replaced by its last name.

    >>> hide_paths("tile 3: /home/me/my data/a.laz\nis cut off")
    'tile 3: my data/a.laz is cut off'
    """
    line = " ".join(text.split())
    return _PATH.sub(r"\1", line)
