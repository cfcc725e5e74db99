"""The lines of a drawing in memory, by their ids: a change costs what it changes, not what there is."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from linework.model.lines import LineSet


class HeldLines:
    """Lines by id.

    Notes
    -----
    A line is held as (set, index). A new set comes with every change; they are made one when all lines are asked for.
    """

    def __init__(self, lines: LineSet) -> None:
        self._crs = lines.crs
        self._all: LineSet | None = None
        self._hold(lines)

    def _hold(self, lines: LineSet) -> None:
        self._all = lines
        self._sets = [lines]
        self._places = {name: (0, i) for i, name in enumerate(lines.id.tolist())}

    def __contains__(self, name: object) -> bool:
        return name in self._places

    def __iter__(self) -> Iterator[str]:
        return iter(self._places)

    @property
    def all(self) -> LineSet:
        """All lines, in the order in which they came."""
        if self._all is None:
            self._hold(self.of(self._places))
        assert self._all is not None
        return self._all

    def of(self, ids: Iterable[str]) -> LineSet:
        """Return the lines of these ids, in this order."""
        places = [self._places[name] for name in ids]
        parts: list[LineSet] = []
        begun = 0
        for end in range(1, len(places) + 1):
            if end == len(places) or places[end][0] != places[begun][0]:
                parts.append(self._sets[places[begun][0]].take([i for _, i in places[begun:end]]))
                begun = end
        return LineSet.concatenate(parts) if parts else LineSet.empty(self._crs)

    def replace(self, gone: Sequence[str], came: LineSet) -> None:
        """Take lines out and put others in, at the end."""
        for name in gone:
            del self._places[name]
        self._sets.append(came)
        number = len(self._sets) - 1
        self._places |= {name: (number, i) for i, name in enumerate(came.id.tolist())}
        self._all = None
