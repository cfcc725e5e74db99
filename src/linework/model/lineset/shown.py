"""A set of lines as short text and as HTML with a small picture, for the console and for notebooks."""

from __future__ import annotations

import html
from typing import NamedTuple

import numpy as np

from linework.arrays import BoolArray, FloatArray
from linework.crs import describe_crs
from linework.errors import LineworkError
from linework.model.lines import CANDIDATE, LineSet

#: Kinds that are listed; the header, the CRS, the extent and the bridged share make twelve lines with them.
_MOST_KINDS = 8
#: Characters of a kind that are shown; the kinds of linework have up to 18.
_LONGEST_KIND = 40
#: Size of the picture [pixels]: beside a table in a notebook's column.
_WIDTH, _HEIGHT, _MARGIN = 420, 260, 8
#: Vertices in the picture: about 10 characters each, so that a notebook of many pictures stays small.
_MOST_VERTICES = 5000
#: Red, green, blue and width [mm] by kind, distinct for the colour-blind (Okabe and Ito).
LOOKS = {
    "lane_marking": ((240, 228, 66), 0.5),
    "lane_marking_dash": ((240, 228, 66), 0.9),
    "road_marking_other": ((230, 159, 0), 0.9),
    "road_boundary": ((213, 94, 0), 0.6),
    "kerb_top": ((204, 121, 167), 0.3),
    "edge_other": ((153, 102, 51), 0.3),
    "guardrail": ((0, 114, 178), 0.7),
    "barrier": ((86, 180, 233), 0.7),
    "fence": ((0, 158, 115), 0.4),
    "cable": ((20, 20, 20), 0.4),
    "pole": ((120, 70, 20), 0.8),
    CANDIDATE: ((150, 60, 150), 0.2),
}
#: Look of every other kind.
OTHER_LOOK = ((120, 120, 120), 0.4)
#: Light grey like concrete, on which yellow and black lines can both be told apart.
BACKGROUND = "#dcdcdc"


class KindRow(NamedTuple):
    """Number of lines of a kind, their length and the part of it that is bridged [m]."""

    kind: str
    n_lines: int
    length_m: float
    bridged_m: float


def kind_rows(lines: LineSet) -> list[KindRow]:
    """Return a row per kind, in the order of `LineSet.kinds`."""
    length_m, bridged_m = lines.length_m, lines.bridged_m
    rows = []
    for kind in lines.kinds:
        own = lines.kind == kind
        rows.append(KindRow(kind, int(own.sum()), float(length_m[own].sum()), float(bridged_m[own].sum())))
    return rows


def crs_name(crs: str) -> str:
    """Return the name of a CRS, or the beginning of its text where it is not known."""
    try:
        return describe_crs(crs)
    except (LineworkError, ValueError, RuntimeError):  # RuntimeError: the root of pyproj's errors
        return crs[:40]


def share_text(part: float, whole: float) -> str:
    """Return a share in per cent.

    >>> share_text(1.0, 8.0), share_text(0.0, 0.0)
    ('12.5 %', '0.0 %')
    """
    return f"{100 * part / whole if whole > 0 else 0.0:.1f} %"


def text_of(lines: LineSet) -> str:
    """Return at most twelve lines of text about the lines: `repr` of a LineSet."""
    rows = kind_rows(lines)
    total_m = sum(row.length_m for row in rows)
    texts = [f"LineSet: {counted(len(lines))}, {total_m:,.1f} m"]
    shown = rows if len(rows) <= _MOST_KINDS else rows[: _MOST_KINDS - 1]
    widths = [max(len(text) for text in column) for column in zip(*map(_cells, shown), strict=True)]
    for row in shown:
        kind, n, length = _cells(row)
        texts.append(f"  {kind:<{widths[0]}}  {n:>{widths[1]}}  {length:>{widths[2]}}")
    others = rows[len(shown) :]
    if others:
        n_others, size_m = sum(row.n_lines for row in others), sum(row.length_m for row in others)
        texts.append(f"  {len(others)} more kinds: {counted(n_others)}, {size_m:,.1f} m")
    texts.append(f"  crs: {crs_name(lines.crs)}")
    if len(lines.xyz):
        texts.append(f"  extent: {extent_text(lines)}")
        texts.append(f"  bridged: {share_text(sum(row.bridged_m for row in rows), total_m)} of the length")
    return "\n".join(texts)


def counted(n: int) -> str:
    """Return a number of lines in words.

    >>> counted(1), counted(1200)
    ('1 line', '1,200 lines')
    """
    return f"{n:,} line{'' if n == 1 else 's'}"


def _cells(row: KindRow) -> tuple[str, str, str]:
    return kind_text(row.kind), counted(row.n_lines), f"{row.length_m:,.1f} m"


def kind_text(kind: str) -> str:
    r"""Return a kind on one line, whatever characters a file of another program holds.

    >>> kind_text("cable"), kind_text(""), kind_text("a" + chr(10) + "b")
    ('cable', '(no kind)', 'a\\nb')
    """
    text = "".join(c if c.isprintable() else repr(c)[1:-1] for c in kind) or "(no kind)"
    return text if len(text) <= _LONGEST_KIND else text[: _LONGEST_KIND - 3] + "..."


def extent_text(lines: LineSet) -> str:
    """Return the extent in plan: east, north, and its size."""
    west, south, east, north = lines.bounds
    return f"east {west:.1f} to {east:.1f}, north {south:.1f} to {north:.1f} ({east - west:,.1f} x {north - south:,.1f} m)"


def html_of(lines: LineSet) -> str:
    """Return a small picture and a table per kind as HTML: `_repr_html_` of a LineSet."""
    rows = kind_rows(lines)
    total = KindRow("all", len(lines), sum(r.length_m for r in rows), sum(r.bridged_m for r in rows))
    cells = []
    for row in [*rows, total]:
        mark = "" if row is total else f"<span style='color:{colour_text(row.kind)}'>&#9632;</span> "
        cells.append(
            f"<tr><td style='text-align:left'>{mark}{html.escape(kind_text(row.kind))}</td><td>{row.n_lines:,}</td>"
            f"<td>{row.length_m:,.1f}</td><td>{share_text(row.bridged_m, row.length_m)}</td></tr>"
        )
    extent = f"<div>{html.escape(extent_text(lines))}</div>" if len(lines.xyz) else ""
    return (
        f"<div><div><b>LineSet</b>: {counted(len(lines))}, {html.escape(crs_name(lines.crs))}</div>{extent}"
        f"<div style='display:flex;flex-wrap:wrap;gap:1em;align-items:flex-start'>{svg_of(lines)}"
        "<table><thead><tr><th style='text-align:left'>kind</th><th>lines</th><th>length [m]</th><th>bridged</th></tr>"
        f"</thead><tbody>{''.join(cells)}</tbody></table></div></div>"
    )


def colour_text(kind: str) -> str:
    """Return the colour of a kind for HTML and matplotlib.

    >>> colour_text("guardrail")
    '#0072b2'
    """
    red, green, blue = LOOKS.get(kind, OTHER_LOOK)[0]
    return f"#{red:02x}{green:02x}{blue:02x}"


def svg_of(lines: LineSet) -> str:
    """Return a picture of the lines in plan, north up, as SVG; "" where nothing can be drawn.

    Of more than 5,000 vertices an even choice is drawn, the ends of each line always; of more lines than can have two
    vertices each, the longest ones.
    """
    drawn = lines.take(np.diff(lines.offsets) > 1)
    drawn = drawn.take(_finite(drawn))
    if len(drawn) == 0:
        return ""
    if 2 * len(drawn) > _MOST_VERTICES:
        longest = np.argsort(-drawn.length_m, kind="stable")[: _MOST_VERTICES // 2]
        drawn = drawn.take(np.sort(longest))
    west, south, east, north = drawn.bounds
    scale = min(
        (_WIDTH - 2 * _MARGIN) / max(east - west, 1e-9), (_HEIGHT - 2 * _MARGIN) / max(north - south, 1e-9)
    )
    left, top = (_WIDTH - scale * (east - west)) / 2, (_HEIGHT - scale * (north - south)) / 2
    paths = []
    for kind in drawn.kinds:
        own = drawn.take(drawn.kind == kind)
        pixels = np.column_stack(
            [left + scale * (own.xyz[:, 0] - west), top + scale * (north - own.xyz[:, 1])]
        )
        for dashed in (False, True):
            path = _path(pixels, own, dashed)
            if path:
                dash = " stroke-dasharray='4 3'" if dashed else ""
                paths.append(f"<path d='{path}' stroke='{colour_text(kind)}'{dash}/>")
    return (
        f"<svg xmlns='http://www.w3.org/2000/svg' width='{_WIDTH}' height='{_HEIGHT}' "
        f"viewBox='0 0 {_WIDTH} {_HEIGHT}' role='img' aria-label='Lines in plan' style='background:{BACKGROUND}'>"
        f"<g fill='none' stroke-width='1.5' stroke-linecap='round'>{''.join(paths)}</g></svg>"
    )


def _finite(lines: LineSet) -> BoolArray:
    """Return (m,) bool: which lines have only finite positions in plan."""
    bad = ~np.isfinite(lines.xyz[:, :2]).all(axis=1)
    found = np.ones(len(lines), dtype=bool)
    found[lines.line_of_vertex[bad]] = False
    return np.asarray(found)


def _path(pixels: FloatArray, lines: LineSet, dashed: bool) -> str:
    """Return the measured, or the bridged, stretches of lines as the data of an SVG path."""
    step = max(1, -(-len(pixels) // _MOST_VERTICES))
    parts = []
    for first, last in bridged_runs(lines) if dashed else measured_runs(lines):
        places = pixels[[*range(first, last, step), last]]
        parts.append("M" + " ".join(f"{x:.1f},{y:.1f}" for x, y in places.tolist()))
    return "".join(parts)


def measured_runs(lines: LineSet) -> list[tuple[int, int]]:
    """Return the first and last vertex of each stretch without a bridged segment."""
    return _runs(lines, bridged=False)


def bridged_runs(lines: LineSet) -> list[tuple[int, int]]:
    """Return the first and last vertex of each stretch of bridged segments (those with a bridged end)."""
    return _runs(lines, bridged=True)


def _runs(lines: LineSet, *, bridged: bool) -> list[tuple[int, int]]:
    if len(lines.xyz) < 2:
        return []
    inside = np.diff(lines.line_of_vertex) == 0
    wanted = inside & ((lines.bridged[:-1] | lines.bridged[1:]) == bridged)
    # A run ends where the next segment is not wanted, or belongs to another line
    starts = np.flatnonzero(wanted & ~np.concatenate([[False], wanted[:-1]]))
    ends = np.flatnonzero(wanted & ~np.concatenate([wanted[1:], [False]]))
    return list(zip(starts.tolist(), (ends + 1).tolist(), strict=True))
