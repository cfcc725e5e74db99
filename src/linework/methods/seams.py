"""Lines across the seams of tiles: cut at the edge of a core, and joined with the lines of the next core."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from linework.arrays import AnyArray, BoolArray, FloatArray
from linework.lines.names import midpoints
from linework.model.grid import Bounds
from linework.model.lines import LINE_COLUMNS, POLE, VERTEX_COLUMNS, LineSet

#: What a joined line is, where its parts differ: what most of its length is.
_BY_LENGTH = ("role", "pattern", "form")
#: Numbers that hold for one form only: a mean over a W-beam and a thrie beam is neither's.
_OF_FORM = ("lower_m", "n_beams")
#: Kinds that are never cut: a span of wire is shorter than any buffer, and belongs to the core that holds its middle.
UNCUT_AT_SEAMS = ("cable", POLE)
#: Least length of a line that ends at a seam without a continuation: shorter pieces are rounding. [m]
MIN_PIECE_M = 0.05
#: Ends within this distance are joined in any direction: tiles with the same points cut a line at the same place, to
#: rounding. [m]
MEET_M = 0.001
#: Cuts within this distance of the straight line through their neighbours leave no vertex. [m]
STRAIGHT_CUT_M = 0.0001
#: Greatest distance of two ends that are joined: two tiles have the same points around a seam, and find nearly the
#: same line. [m]
MAX_SEAM_STEP_M = 0.15
#: Greatest difference of the directions of two ends that are joined. [deg]
MAX_TURN_DEG = 20.0
#: Length over which the direction of an end is measured. [m]
_TANGENT_M = 1.0
#: Cut ends within this distance of the edge of a core are put on it exactly: interpolation rounds. [m]
_ON_EDGE_M = 1e-6
#: Least length that is divided by: two vertices at one place have no direction. [m]
_LEAST_M = 1e-9


def of_core(lines: LineSet, core: Bounds, *, is_whole: bool) -> LineSet:
    """Return the lines of a tile that belong to its core; all of them, uncut, if the tile is the whole survey."""
    return lines if is_whole else inside_core(lines, core)


def across_seams(lines: LineSet, cores: Sequence[Bounds]) -> LineSet:
    """Return the lines of all tiles joined at the seams between their cores; one core has no seam."""
    return join_seams(lines, cores) if len(cores) > 1 else lines


def inside_core(lines: LineSet, core: Bounds) -> LineSet:
    """Return the parts of lines inside a core; lines that are never cut are whole, if their middle is inside.

    A cut end lies exactly on the core's edge.

    >>> line = np.array([[0.0, 0.0, 0.0], [10.0, 0.0, 1.0]])
    >>> inside_core(LineSet.from_lines([line], kind=["guardrail"]), Bounds(-5, -5, 4, 5)).xyz.tolist()
    [[0.0, 0.0, 0.0], [4.0, 0.0, 0.4]]
    """
    middles = midpoints(lines)
    is_whole = np.isin(lines.kind, UNCUT_AT_SEAMS)
    owner, pieces = [], []
    for i in range(len(lines)):
        xyz = lines[i].xyz
        if is_whole[i]:
            intervals = [(0.0, len(xyz) - 1.0)] if _holds(core, middles[i]) else []
        else:
            intervals = _intervals_inside(xyz, core)
        for interval in intervals:
            # However short: its continuation beyond the seam may be long
            owner.append(i)
            pieces.append(_piece(lines, i, interval, core))
    return _assembled(lines, owner, pieces)


def join_seams(lines: LineSet, cores: Sequence[Bounds]) -> LineSet:
    """Return the lines, those that meet at the edge of a core joined into one.

    Two ends are joined if both lie on an edge, are less than `MAX_SEAM_STEP_M` apart and lead on in the same
    direction (or are at one place: shards are too short for a direction); of several the closest. Shards
    without a continuation are dropped.
    """
    ends, tangents = _ends(lines)
    on_edge = np.isin(ends[:, 0], [x for c in cores for x in (c.west, c.east)])
    on_edge |= np.isin(ends[:, 1], [y for c in cores for y in (c.south, c.north)])
    is_shard = (lines.length_m < MIN_PIECE_M) & on_edge.reshape(-1, 2).any(axis=1)
    partner = _partners(lines.kind, ends, tangents, np.flatnonzero(on_edge))
    chains = _chains(len(lines), partner)
    pieces = [
        _joined([_turned(_vertices(lines, i), is_turned=turned) for i, turned in chain]) for chain in chains
    ]
    owner = [[i for i, _ in chain] for chain in chains]
    long_enough = [len(m) > 1 or not is_shard[m[0]] for m in owner]
    pieces = [piece for piece, kept in zip(pieces, long_enough, strict=True) if kept]
    owner = [members for members, kept in zip(owner, long_enough, strict=True) if kept]
    joined = _assembled(lines, [members[0] for members in owner], pieces)
    return joined.with_columns(**_merged_columns(lines, owner)) if len(joined) else joined


def _holds(core: Bounds, place: FloatArray) -> bool:
    return bool(core.west <= place[0] < core.east and core.south <= place[1] < core.north)


def _intervals_inside(xyz: FloatArray, core: Bounds) -> list[tuple[float, float]]:
    """Return the stretches of a line inside a core, as fractional vertex numbers (Liang and Barsky 1984)."""
    enter, leave = np.zeros(len(xyz) - 1), np.ones(len(xyz) - 1)
    for axis, low, high in ((0, core.west, core.east), (1, core.south, core.north)):
        place, step = xyz[:-1, axis], np.diff(xyz[:, axis])
        with np.errstate(divide="ignore", invalid="ignore"):
            a, b = (low - place) / step, (high - place) / step
        level = step == 0
        inside = (place >= low) & (place < high)
        enter = np.maximum(enter, np.where(level, np.where(inside, 0.0, 2.0), np.minimum(a, b)))
        leave = np.minimum(leave, np.where(level, np.where(inside, 1.0, -1.0), np.maximum(a, b)))
    found: list[tuple[float, float]] = []
    for i in np.flatnonzero(enter < leave).tolist():
        start, end = i + float(enter[i]), i + float(leave[i])
        if found and found[-1][1] == start:
            found[-1] = (found[-1][0], end)
        else:
            found.append((start, end))
    return found


def _piece(lines: LineSet, i: int, interval: tuple[float, float], core: Bounds) -> dict[str, AnyArray]:
    """Return the vertices of line i between two fractional vertex numbers, with all their columns."""
    start, end = interval
    at = np.array([start, *range(math.floor(start) + 1, math.ceil(end)), end])
    number = np.arange(lines.offsets[i + 1] - lines.offsets[i])
    whole = _vertices(lines, i)
    piece: dict[str, AnyArray] = {
        "xyz": np.stack([np.interp(at, number, whole["xyz"][:, axis]) for axis in range(3)], axis=1)
    }
    for axis, edges in ((0, (core.west, core.east)), (1, (core.south, core.north))):
        for edge in edges:
            values = piece["xyz"][[0, -1], axis]
            piece["xyz"][[0, -1], axis] = np.where(np.abs(values - edge) < _ON_EDGE_M, edge, values)
    for name in VERTEX_COLUMNS:
        values = whole[name]
        if values.dtype == np.bool_:
            # A cut stretch stays bridged if an end of it was; observed only if both were
            both = values[np.floor(at).astype(int)], values[np.ceil(at).astype(int)]
            piece[name] = both[0] | both[1] if name == "bridged" else both[0] & both[1]
        else:
            piece[name] = np.interp(at, number, values)
    return piece


def _vertices(lines: LineSet, i: int) -> dict[str, AnyArray]:
    part = slice(lines.offsets[i], lines.offsets[i + 1])
    return {"xyz": lines.xyz[part]} | {name: getattr(lines, name)[part] for name in VERTEX_COLUMNS}


def _turned(vertices: dict[str, AnyArray], *, is_turned: bool) -> dict[str, AnyArray]:
    return {name: values[::-1] for name, values in vertices.items()} if is_turned else vertices


def _joined(parts: Sequence[dict[str, AnyArray]]) -> dict[str, AnyArray]:
    """Return the vertices of parts that follow each other.

    Two ends that meet become one, half-way; none where the line runs straight through.
    """
    columns = {name: [part[name][min(k, 1) :] for k, part in enumerate(parts)] for name in parts[0]}
    joined = {name: np.concatenate(arrays) for name, arrays in columns.items()}
    last = np.cumsum([len(array) for array in columns["xyz"]])[:-1] - 1
    for at, before, after in zip(last, parts, parts[1:], strict=False):
        joined["xyz"][at] = 0.5 * (before["xyz"][-1] + after["xyz"][0])
    kept = _without_straight(joined["xyz"], last.tolist())
    return {name: values[kept] for name, values in joined.items()}


def _without_straight(xyz: FloatArray, cuts: Sequence[int]) -> BoolArray:
    """Return which vertices stay: all but the cuts on the straight line between the vertices before and after."""
    kept = np.ones(len(xyz), dtype=bool)
    for at in cuts:
        before, after = at - 1, at + 1
        while before >= 0 and not kept[before]:
            before -= 1
        while after in cuts:
            after += 1
        if before < 0 or after >= len(xyz):
            continue
        chord, step = xyz[after] - xyz[before], xyz[at] - xyz[before]
        share = float(np.clip(step @ chord / max(float(chord @ chord), _LEAST_M**2), 0.0, 1.0))
        kept[at] = float(np.linalg.norm(step - share * chord)) > STRAIGHT_CUT_M
    return kept


def _assembled(lines: LineSet, owner: Sequence[int], pieces: Sequence[dict[str, AnyArray]]) -> LineSet:
    """Return the pieces as lines, each with the columns of the line that it comes from."""
    if not pieces:
        return LineSet.empty(lines.crs)
    columns = {name: np.concatenate([piece[name] for piece in pieces]) for name in VERTEX_COLUMNS}
    columns |= {name: getattr(lines, name)[list(owner)] for name in LINE_COLUMNS}
    return LineSet.from_lines([piece["xyz"] for piece in pieces], crs=lines.crs, **columns)


def _ends(lines: LineSet) -> tuple[FloatArray, FloatArray]:
    """Return the ends of all lines (2 m, 3), first and last in turn, and the directions from them inwards."""
    ends, tangents = np.zeros((2 * len(lines), 3)), np.zeros((2 * len(lines), 2))
    for i in range(len(lines)):
        for side, xyz in enumerate((lines[i].xyz, lines[i].xyz[::-1])):
            away = np.hypot(*(xyz[:, :2] - xyz[0, :2]).T)
            inner = int(np.argmax(away >= min(_TANGENT_M, float(away.max()))))
            ends[2 * i + side] = xyz[0]
            tangents[2 * i + side] = (xyz[inner, :2] - xyz[0, :2]) / max(float(away[inner]), _LEAST_M)
    return ends, tangents


def _partners(kind: AnyArray, ends: FloatArray, tangents: FloatArray, edge: AnyArray) -> dict[int, int]:
    """Return the end that each end continues in, both ways; the closest pairs are taken first."""
    pairs = []
    for n, a in enumerate(edge.tolist()):
        others = edge[n + 1 :]
        apart = np.linalg.norm(ends[others] - ends[a], axis=1)
        goes_on = tangents[others] @ tangents[a] <= -math.cos(math.radians(MAX_TURN_DEG))
        fits = (
            ((apart < MEET_M) | ((apart < MAX_SEAM_STEP_M) & goes_on))
            & (kind[others // 2] == kind[a // 2])
            & (others // 2 != a // 2)
        )
        pairs += [(float(apart[k]), a, int(others[k])) for k in np.flatnonzero(fits)]
    partner: dict[int, int] = {}
    for _, a, b in sorted(pairs):
        if a not in partner and b not in partner:
            partner[a], partner[b] = b, a
    return partner


def _chains(n_lines: int, partner: dict[int, int]) -> list[list[tuple[int, bool]]]:
    """Return the lines in order along each chain, with whether each is turned; a ring starts anywhere."""
    chains, done = [], set()
    # Ends without partner first: only rings are left for the second round
    starts = [e for e in range(2 * n_lines) if e not in partner] + list(range(2 * n_lines))
    for start in starts:
        chain: list[tuple[int, bool]] = []
        end: int | None = start
        while end is not None and end // 2 not in done:
            done.add(end // 2)
            chain.append((end // 2, end % 2 == 1))
            end = partner.get(end ^ 1)
        if chain:
            chains.append(chain)
    return chains


def _merged_columns(lines: LineSet, owner: Sequence[Sequence[int]]) -> dict[str, AnyArray]:
    """Return the columns of joined lines: means and majorities by length, the least clearance, the whole time span.

    The height of the lower edge and the number of beams come from the parts of the form that the whole has.
    """
    merged: dict[str, AnyArray] = {}
    weights = np.maximum(lines.length_m, _LEAST_M)
    members = [np.array(m) for m in owner]
    for name in _BY_LENGTH:
        column = getattr(lines, name)
        merged[name] = np.array([_most(column[m], weights[m]) for m in members], dtype=np.str_)
    of_form = [m[lines.form[m] == form] for m, form in zip(members, merged["form"], strict=True)]
    for name in LINE_COLUMNS:
        column = getattr(lines, name)
        if column.dtype == np.bool_:
            merged[name] = np.array([np.average(column[m], weights=weights[m]) > 0.5 for m in members])
        elif column.dtype == np.float64:
            parts = of_form if name in _OF_FORM else members
            merged[name] = np.array([_merged(name, column[m], weights[m]) for m in parts])
    return merged


def _most(values: AnyArray, weights: FloatArray) -> Any:
    """Return the value with the largest sum of weights; of equal ones (to a micrometre) the first in their order."""
    each, place = np.unique(values, return_inverse=True)
    return each[np.argmax(np.round(np.bincount(place, weights=weights), 6))]


def _merged(name: str, values: FloatArray, weights: FloatArray) -> float:
    known = ~np.isnan(values)
    if len(values) == 1 or not known.any():
        return float(values[0])
    if name in ("clearance_m", "time_start_s"):
        return float(values[known].min())
    if name == "time_end_s":
        return float(values[known].max())
    if name == "n_beams":
        # A number of things has no mean
        return float(_most(values[known], weights[known]))
    return float(np.average(values[known], weights=weights[known]))
