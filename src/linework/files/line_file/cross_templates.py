"""Templates of cross-sections as a table beside the lines: CSV, a row for each node."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from linework.editing.edits.attributes import choices_for
from linework.errors import InputError
from linework.files.input import read_input_text
from linework.files.logs.tables import finite_number, header_cells, read_text_table
from linework.files.logs.text import text_lines
from linework.methods.templates.template import (
    FARTHEST_NODE_M,
    HIGHEST_NODE_M,
    LONGEST_NODE_NAME,
    MOST_NODES,
    MOST_TEMPLATES,
    NODE_EDGES,
    CrossTemplate,
    TemplateNode,
)
from linework.model.lines import KINDS

_COLUMNS = ("template", "node", "edge", "across_m", "up_m", "kind", "role")
#: Largest table: a hundred templates of twenty nodes with long names. [bytes]
_LONGEST_TABLE = 1 << 19
#: Characters that a table keeps for itself.
_NOT_IN_NAMES = ',;"\t'
#: Numbers as spreadsheets write them: Python reads 1_0 as ten.
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?", re.ASCII | re.IGNORECASE)


def read_cross_templates(path: Path) -> tuple[CrossTemplate, ...]:
    """Return the templates of a table, in the order of their first rows.

    Raises
    ------
    InputError
        The file cannot be read, a column is missing or unknown, or a row is wrong; the message names its line.
    """
    read_input_text(path, max_bytes=_LONGEST_TABLE, advice="keep one row for each node")
    table = read_text_table(path, _COLUMNS)
    _refuse_unknown_columns(path)
    if table.bad_lines:
        raise _wrong(table.bad_lines[0], "other cells than the header", path)
    found: dict[str, list[TemplateNode]] = {}
    rows = zip(*(table.columns[name] for name in _COLUMNS), strict=True)
    for number, cells in zip(table.line_numbers, rows, strict=True):
        row = dict(zip(_COLUMNS, cells, strict=True))
        node = _node(row, number, path)
        nodes = found.setdefault(_name(row["template"], number, path), [])
        if node.name in [other.name for other in nodes]:
            raise _wrong(number, f"the node {node.name} is there twice", path)
        nodes.append(node)
    if len(found) > MOST_TEMPLATES or any(len(nodes) > MOST_NODES for nodes in found.values()):
        raise InputError(
            "has too many rows", where=path, advice=f"up to {MOST_TEMPLATES} templates of {MOST_NODES} nodes"
        )
    return tuple(CrossTemplate(name, tuple(nodes)) for name, nodes in found.items())


def text_of_templates(templates: Sequence[CrossTemplate]) -> str:
    """Return templates as a table, as `read_cross_templates` reads it.

    >>> print(text_of_templates([CrossTemplate("kerb", (TemplateNode("top", "top", 0.02, 0.12, "kerb_top"),))]))
    template,node,edge,across_m,up_m,kind,role
    kerb,top,top,0.020,0.120,kerb_top,
    <BLANKLINE>
    """
    rows = [
        (one.name, node.name, node.edge, f"{node.across_m:.3f}", f"{node.up_m:.3f}", node.kind, node.role)
        for one in templates
        for node in one.nodes
    ]
    return "".join(",".join(row) + "\n" for row in [_COLUMNS, *rows])


def _node(row: Mapping[str, str], line: int, where: Path) -> TemplateNode:
    across_m, up_m = (_metres(row, column, line, where) for column in ("across_m", "up_m"))
    if abs(across_m) > FARTHEST_NODE_M or abs(up_m) > HIGHEST_NODE_M:
        raise _wrong(line, f"a node is at most {FARTHEST_NODE_M:g} m from its line", where)
    edge, kind = (row[column] for column in ("edge", "kind"))
    if edge not in NODE_EDGES:
        raise _wrong(line, f"the edge is one of {', '.join(NODE_EDGES)}", where)
    if kind not in KINDS:
        raise _wrong(line, f"the kind is one of {', '.join(KINDS)}", where)
    role, roles = row["role"].strip(), choices_for("role", kind)
    if role and not roles:
        raise _wrong(line, f"{kind} has no role", where)
    if role and role not in roles:
        raise _wrong(line, f"the role of {kind} is one of {', '.join(roles)}, or empty", where)
    return TemplateNode(_name(row["node"], line, where), edge, across_m, up_m, kind, role)


def _metres(row: Mapping[str, str], column: str, line: int, where: Path) -> float:
    text = row[column].strip()
    value = finite_number(text) if _NUMBER.fullmatch(text) else None
    if value is None:
        raise _wrong(line, f"{column} is a number in metres", where)
    return value


def _refuse_unknown_columns(path: Path) -> None:
    """Refuse a table with more columns than ours, or one twice: they would be lost when the page saves a template."""
    _, cells = header_cells(text_lines(path)[0][1])
    left = list(cells)
    for column in _COLUMNS:
        left.remove(column)
    if left:
        raise InputError(
            f"unknown column {left[0][:LONGEST_NODE_NAME]!r}", where=path,
            advice=f"the columns are {', '.join(_COLUMNS)}",
        )  # fmt: skip


def _name(text: str, line: int, where: Path) -> str:
    name = text.strip()
    is_plain = name.isprintable() and not any(c in _NOT_IN_NAMES for c in name)
    if not 0 < len(name) <= LONGEST_NODE_NAME or not is_plain:
        raise _wrong(
            line, f"a name has 1 to {LONGEST_NODE_NAME} characters, without commas and quotes", where
        )
    return name


def _wrong(line: int, problem: str, where: Path) -> InputError:
    return InputError(f"line {line}: {problem}", where=where, advice="correct the row")
