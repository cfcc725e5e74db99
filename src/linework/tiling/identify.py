"""Names and order of lines: from kind and place alone, so that a re-run gives the same."""

from __future__ import annotations

import hashlib
from collections import Counter

import numpy as np

from linework.model.arrays import FloatArray
from linework.model.lines import KINDS, LineSet

#: A line's place is known to this step: wider than what another pass or a changed setting moves a line's
#: middle across it, narrower than the distance of neighbouring lines of one kind. [m]
PLACE_STEP_M = 1.0


def identify(lines: LineSet) -> LineSet:
    """Return the lines in their fixed order, each with an `id` made of its kind and place.

    Notes
    -----
    The order is: kind (as in `KINDS`), then place from west to east, south to north, low to high, then the
    exact vertices, so that it does not depend on the order in which tiles or methods were done. Two lines
    of one kind at one place (the two wires of a pair, both beams of a rail) are told apart by a number.

    Examples
    --------
    >>> a, b = np.zeros((2, 3)), np.full((2, 3), 5.0)
    >>> one = identify(LineSet.from_lines([a, b], kind=["cable", "guardrail"]))
    >>> two = identify(LineSet.from_lines([b, a], kind=["guardrail", "cable"]))
    >>> one.kind.tolist(), one.id.tolist() == two.id.tolist()
    (['guardrail', 'cable'], True)
    """
    middles = midpoints(lines)
    places = np.floor(middles / PLACE_STEP_M).astype(np.int64)
    keys = [_key(lines, places, i) for i in range(len(lines))]
    order = sorted(range(len(lines)), key=keys.__getitem__)
    seen: Counter[tuple[str, ...]] = Counter()
    ids = []
    for i in order:
        place = (str(lines.kind[i]), *map(str, places[i]))
        seen[place] += 1
        ids.append(_name(place, seen[place]))
    return lines.take(np.array(order, dtype=np.int64)).with_columns(id=np.array(ids, dtype=np.str_))


def midpoints(lines: LineSet) -> FloatArray:
    """Return the place half-way along each line: (m, 3), in metres, world."""
    middles = np.zeros((len(lines), 3))
    for i in range(len(lines)):
        xyz = lines.line(i)
        along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(xyz, axis=0), axis=1))])
        middles[i] = [np.interp(along[-1] / 2, along, xyz[:, axis]) for axis in range(3)]
    return middles


def _key(lines: LineSet, places: np.ndarray, i: int) -> tuple[int, list[int], bytes]:
    # Big-endian bytes of the vertices: any fixed order does where kind and place are the same
    exact = lines.line(i).astype(">f8").tobytes()
    kind = str(lines.kind[i])
    return (KINDS.index(kind) if kind in KINDS else len(KINDS)), places[i].tolist(), exact


def _name(place: tuple[str, ...], number: int) -> str:
    text = ":".join((*place, str(number)))
    return f"{place[0]}-{hashlib.sha256(text.encode()).hexdigest()[:10]}"
