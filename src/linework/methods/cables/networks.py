"""Wires followed from pole to pole: which hang together, which run on side by side, which are of one span."""

from __future__ import annotations

import math

import numpy as np
from scipy.spatial import cKDTree

from linework.arrays import AnyArray, FloatArray, IntArray
from linework.lines.names import cell_id, cells_of_lines, midpoints
from linework.methods.cables.supports import groups_of_pairs, hanging
from linework.model.lines import POLE, LineSet

#: Largest distance in space of the ends of wires that continue each other: those of a wire meet within a gate, the next
#: fixing is 0.3 m away, and insulators of both sides may part them. [m]
CONTINUES_M = 1.0
#: A turn by a radian counts as much as this distance: a line that goes on straight is preferred to a branch. [m]
TURN_M = 1.0


def with_networks(lines: LineSet) -> LineSet:
    """Return the lines, cables with their `network`, `circuit` and `span`, and poles with their `network`.

    Notes
    -----
    Names are made of the place of the first wire, from west to east, as ids of lines are: they do not depend on tiles or on
    the order of the lines. Wires continue each other one to one, the nearest and straightest first; what branches off is
    another circuit of the same network. A wire or pole at no finite place has none.
    """
    wires = np.flatnonzero(lines.kind == "cable")
    first, last = lines.offsets[wires], lines.offsets[wires + 1] - 1
    ends = np.stack([lines.xyz[first], lines.xyz[last]], axis=1)
    is_placed = np.isfinite(ends).all(axis=(1, 2)) & np.isfinite(midpoints(lines.take(wires))).all(axis=1)
    wires, ends = wires[is_placed], ends[is_placed]
    if len(wires) == 0:
        return lines
    hung = hanging(ends)
    m = len(wires)
    same_span = _chained(hung.span)
    on_support = [(a // 2, b // 2) for a, b in _chained(hung.support.reshape(-1))]
    network = groups_of_pairs(m, [*same_span, *on_support])
    circuit = groups_of_pairs(m, [*same_span, *_continued(ends, hung.support, hung.span)])
    cells = cells_of_lines(lines.take(wires))
    order = np.lexsort((*midpoints(lines.take(wires)).T[::-1], *cells.T[::-1]))
    columns = {"network": network, "circuit": circuit, "span": hung.span}
    named = {name: _names(name, groups, cells, order) for name, groups in columns.items()}
    values: dict[str, AnyArray] = {}
    for name, texts in named.items():
        column = np.full(len(lines), "", dtype=object)
        column[wires] = texts
        values[name] = column
    poles = np.flatnonzero(lines.kind == POLE)
    poles = poles[np.isfinite(lines.xyz[lines.offsets[poles]]).all(axis=1)]
    if len(poles):
        nearest = cKDTree(ends[:, :, :2].reshape(-1, 2)).query(lines.xyz[lines.offsets[poles], :2])[1]
        values["network"][poles] = named["network"][np.asarray(nearest) // 2]
    return lines.with_columns(**{name: column.astype(np.str_) for name, column in values.items()})


def conductors(wires: LineSet) -> IntArray:
    """Return the number of the conductor of each wire, (m,): wires that continue each other from pole to pole share it.

    wires: cables, all at finite places.
    """
    if len(wires) == 0:
        return np.zeros(0, dtype=np.int64)
    ends = np.stack([wires.xyz[wires.offsets[:-1]], wires.xyz[wires.offsets[1:] - 1]], axis=1)
    hung = hanging(ends)
    return groups_of_pairs(len(wires), _continued(ends, hung.support, hung.span))


def _chained(groups: IntArray) -> list[tuple[int, int]]:
    """Return pairs that chain the members of each group."""
    order = np.argsort(groups, kind="stable")
    same = np.diff(groups[order]) == 0
    return list(zip(order[:-1][same].tolist(), order[1:][same].tolist(), strict=True))


def _continued(ends: FloatArray, support: IntArray, span: IntArray) -> list[tuple[int, int]]:
    """Return the pairs of wires (m, 2, 3) that continue each other over a support."""
    places, at = ends.reshape(-1, 3), support.reshape(-1)
    out = ends[:, ::-1, :2] - ends[:, :, :2]
    away = out.reshape(-1, 2) / np.maximum(np.hypot(*out.reshape(-1, 2).T), 1e-9)[:, None]
    pairs = []
    for a, b in sorted(cKDTree(places).query_pairs(CONTINUES_M)):
        if at[a] == at[b] and span[a // 2] != span[b // 2]:
            turn = math.acos(float(np.clip(-away[a] @ away[b], -1.0, 1.0)))
            cost = float(np.linalg.norm(places[a] - places[b])) + TURN_M * turn
            # Ties are broken by place, not by number
            pairs.append((round(cost, 3), *sorted((tuple(places[a]), tuple(places[b]))), a, b))
    taken: set[int] = set()
    found = []
    for *_, a, b in sorted(pairs):
        if a not in taken and b not in taken:
            taken |= {a, b}
            found.append((a // 2, b // 2))
    return found


def _names(kind: str, groups: IntArray, cells: IntArray, order: IntArray) -> AnyArray:
    """Return the name (m,) of each wire's group, made of the cell (m, 3) of its first wire in an order."""
    names: dict[int, str] = {}
    taken: set[str] = set()
    for i in order.tolist():
        if int(groups[i]) in names:
            continue
        number = 1
        while (name := cell_id(kind, cells[i], number)) in taken:
            number += 1
        names[int(groups[i])] = name
        taken.add(name)
    return np.array([names[g] for g in groups.tolist()], dtype=object)
