"""Print tables on stdout: as wide as the terminal, or as wide as they need to be in a file."""

from __future__ import annotations

import sys
from collections.abc import Iterable

from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from linework.evaluation.table_texts import TextTable

#: Without a terminal a table may have this many characters in a row.
PLAIN_WIDTH = 160


def print_tables(tables: Iterable[TextTable]) -> None:
    """Print tables one after another."""
    console = Console(file=sys.stdout, width=None if sys.stdout.isatty() else PLAIN_WIDTH, highlight=False)
    for table in tables:
        shown = Table(
            title=Text(table.title), caption=Text(table.note) if table.note else None, box=box.SIMPLE_HEAD,
            title_justify="left", caption_justify="left", pad_edge=False,
        )  # fmt: skip
        for i, name in enumerate(table.columns):
            shown.add_column(Text(name), justify="left" if i == 0 else "right", no_wrap=i == 0)
        for row in table.rows:
            shown.add_row(*(Text(value) for value in row))
        console.print(shown)
