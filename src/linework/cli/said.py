"""What commands print: the one place that texts pass, where names of files, layers, kinds and columns are escaped.

Separate from `failures`, because what a command found is printed here, too. A test holds every command to it: nothing else writes to the standard streams, but for progress and tables, which pass
`linework.errors.printable` too.
"""

from __future__ import annotations

import json
from typing import Any

import typer

from linework.errors import printable


def say(*lines: str, to_stderr: bool = False) -> None:
    """Print lines; what a terminal would take for a command is escaped in them, a line end too."""
    for line in lines:
        typer.echo(printable(line), err=to_stderr)


def say_json(document: Any, *, indent: int | None = 1) -> None:
    """Print a JSON document on stdout: ASCII alone, so that a terminal gets it as it is.

    Raises
    ------
    ValueError
        It holds NaN or an infinity, which are not JSON.
    """
    # The one control character that JSON leaves as it is
    typer.echo(json.dumps(document, indent=indent, allow_nan=False).replace("\x7f", "\\u007f"))
