"""Names and order of lines: from kind and place alone, so that a re-run gives the same."""

from __future__ import annotations

from collections import Counter

import numpy as np

from linework.lines.names import place_name, places_of
from linework.model.lines import KINDS, LineSet


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
    places = places_of(lines)
    keys = [_key(lines, places, i) for i in range(len(lines))]
    order = sorted(range(len(lines)), key=keys.__getitem__)
    seen: Counter[tuple[str, ...]] = Counter()
    ids = []
    for i in order:
        place = (str(lines.kind[i]), *map(str, places[i]))
        seen[place] += 1
        ids.append(place_name(place[0], places[i], seen[place]))
    return lines.take(np.array(order, dtype=np.int64)).with_columns(id=np.array(ids, dtype=np.str_))


def _key(lines: LineSet, places: np.ndarray, i: int) -> tuple[int, list[int], bytes]:
    # Big-endian bytes of the vertices: any fixed order does where kind and place are the same
    exact = lines.line(i).astype(">f8").tobytes()
    kind = str(lines.kind[i])
    return (KINDS.index(kind) if kind in KINDS else len(KINDS)), places[i].tolist(), exact
