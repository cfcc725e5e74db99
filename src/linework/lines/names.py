"""Ids of lines, made of kind and position alone, so that the same line extracted again has the same id."""

from __future__ import annotations

import hashlib
from collections.abc import Container

import numpy as np

from linework.arrays import FloatArray, IntArray, distance_along
from linework.model.lines import LineSet

#: Cell of a line's middle: wider than another pass or a changed setting moves it across, narrower than the distance
#: of neighbouring lines of one kind. [m]
ID_STEP_M = 1.0


def with_ids(lines: LineSet, taken: Container[str]) -> LineSet:
    """Return the lines with an id for those without one, unique among them and not in `taken`.

    >>> lines = with_ids(LineSet.from_lines([np.zeros((2, 3))] * 2, kind=["cable"] * 2), ())
    >>> len(set(lines.id.tolist())), lines.id[0] == with_ids(lines.take([0]).with_columns(id=[""]), ()).id[0]
    (2, True)
    """
    ids = lines.id.tolist()
    if all(ids):
        return lines
    places, own = cells_of_lines(lines), set(ids)
    for i in np.flatnonzero(lines.id == "").tolist():
        number = 1
        while (name := cell_id(str(lines.kind[i]), places[i], number)) in own or name in taken:
            number += 1
        ids[i] = name
        own.add(name)
    return lines.with_columns(id=np.array(ids, dtype=np.str_))


def cells_of_lines(lines: LineSet) -> IntArray:
    """Return the cell of each line's middle, (m, 3) int64, in steps of `ID_STEP_M`."""
    return np.floor(midpoints(lines) / ID_STEP_M).astype(np.int64)


def cell_id(kind: str, place: IntArray, number: int) -> str:
    """Return the id of a line of a kind in a cell (3,) int64; `number` distinguishes lines of one kind in one cell."""
    text = ":".join((kind, *map(str, place), str(number)))
    return f"{kind}-{hashlib.sha256(text.encode()).hexdigest()[:10]}"


def midpoints(lines: LineSet) -> FloatArray:
    """Return the midpoint along each line, (m, 3) [m, world]."""
    middles = np.zeros((len(lines), 3))
    for i in range(len(lines)):
        xyz = lines[i].xyz
        along = distance_along(xyz, in_space=True)
        middles[i] = [np.interp(along[-1] / 2, along, xyz[:, axis]) for axis in range(3)]
    return middles
