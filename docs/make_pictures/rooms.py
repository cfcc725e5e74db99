"""Make the picture of docs/architecture.md from the imports: ``python docs/make_pictures/rooms.py``.

A room stands above all rooms that it imports. An arrow that others imply (a room imports b, b imports c) is left
out, so that the picture shows the direction and not every import.
"""

from __future__ import annotations

import ast
import sys
from pathlib import Path

DOCS = Path(__file__).parents[1]
PACKAGE = DOCS.parent / "src" / "linework"
PICTURE = DOCS / "pictures" / "rooms.svg"
#: Sizes of the picture. [pixels]
WIDTH, BOX_WIDTH, BOX_HEIGHT, ROW_HEIGHT, MARGIN = 860, 130, 34, 84, 20
#: Single modules beside the rooms, drawn in grey.
SINGLE_MODULES = ("arrays", "crs", "errors")


def imports_between_rooms() -> dict[str, set[str]]:
    """Return for each room the rooms that its modules import."""
    found: dict[str, set[str]] = {}
    for path in sorted(PACKAGE.rglob("*.py")):
        room = path.relative_to(PACKAGE).parts[0].removesuffix(".py")
        if room.startswith("__"):
            continue
        imports = found.setdefault(room, set())
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("linework."):
                imports.add(str(node.module).split(".")[1])
    return {room: imports - {room} for room, imports in found.items()}


def height_of(room: str, imports: dict[str, set[str]]) -> int:
    """Return the length of the longest chain of imports below a room."""
    return max((1 + height_of(lower, imports) for lower in imports[room]), default=0)


def all_below(room: str, imports: dict[str, set[str]]) -> set[str]:
    """Return every room that this one depends on, directly or not."""
    return imports[room].union(*(all_below(lower, imports) for lower in imports[room]))


def direct(imports: dict[str, set[str]]) -> list[tuple[str, str]]:
    """Return the imports (upper, lower) that no chain of other imports implies."""
    pairs = []
    for room, lower in sorted(imports.items()):
        implied = set().union(*(all_below(other, imports) for other in lower))
        pairs += [(room, other) for other in sorted(lower - implied)]
    return pairs


def picture() -> str:
    """Return the rooms in rows, the lowest at the bottom, with an arrow for each direct import, as SVG."""
    imports = imports_between_rooms()
    heights = {room: height_of(room, imports) for room in imports}
    top = max(heights.values())
    at: dict[str, tuple[float, float]] = {}
    for level in range(top + 1):
        row = sorted(room for room in imports if heights[room] == level)
        for i, room in enumerate(row):
            at[room] = (WIDTH * (i + 0.5) / len(row), MARGIN + BOX_HEIGHT / 2 + ROW_HEIGHT * (top - level))
    height = 2 * MARGIN + BOX_HEIGHT + ROW_HEIGHT * top
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" font-family="sans-serif">',
        "<title>The rooms of linework; arrows point from a room to the rooms it imports</title>",
        '<defs><marker id="tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7" orient="auto">'
        '<path d="M0 0 L8 4 L0 8 z" fill="#5b6b7f"/></marker></defs>',
        f'<rect width="{WIDTH}" height="{height}" fill="#ffffff"/>',
    ]
    for upper, lower in direct(imports):
        (x0, y0), (x1, y1) = at[upper], at[lower]
        y0, y1 = y0 + BOX_HEIGHT / 2, y1 - BOX_HEIGHT / 2
        bend = (y1 - y0) / 2
        lines.append(
            f'<path d="M{x0:.0f} {y0:.0f} C{x0:.0f} {y0 + bend:.0f} {x1:.0f} {y1 - bend:.0f} {x1:.0f} {y1:.0f}" '
            'fill="none" stroke="#5b6b7f" stroke-width="1.2" marker-end="url(#tip)"/>'
        )
    for room, (x, y) in sorted(at.items()):
        fill = "#f3f3f3" if room in SINGLE_MODULES else "#e3edf8"
        lines += [
            f'<rect x="{x - BOX_WIDTH / 2:.0f}" y="{y - BOX_HEIGHT / 2:.0f}" width="{BOX_WIDTH}" '
            f'height="{BOX_HEIGHT}" rx="5" fill="{fill}" stroke="#2b5fc4"/>',
            f'<text x="{x:.0f}" y="{y + 5:.0f}" font-size="15" text-anchor="middle" fill="#16202c">{room}</text>',
        ]
    return "\n".join([*lines, "</svg>", ""])


def run() -> int:
    """Write docs/pictures/rooms.svg."""
    PICTURE.write_text(picture(), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(run())
