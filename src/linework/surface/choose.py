"""Choose road and ground among the regions of all windows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from linework.model.arrays import AnyArray, BoolArray, IntArray
from linework.surface.islands import united
from linework.surface.path import under_the_wheels
from linework.surface.regions import LabelTable, RegionFacts

_NO_NODES = np.zeros(0, dtype=np.int64)


@dataclass(frozen=True, slots=True)
class Link:
    """Labels (n, 2) of road and of ground that are connected across the edge of windows `a` and `b`."""

    a: int
    b: int
    road: AnyArray
    ground: AnyArray


class Choice:
    """Which regions are road and which are ground.

    Parameters
    ----------
    facts
        Of every window.
    links
        Between them.

    Notes
    -----
    Roads are the regions under the path; in a recorded place where no path leads through, the one with most
    points: what the van drove on. Ground is what is connected to a road; where nothing is smooth enough to
    be a road, the region with most points.
    """

    def __init__(self, facts: Sequence[RegionFacts], links: Sequence[Link]) -> None:
        roads, grounds = _Nodes([f.road for f in facts]), _Nodes([f.ground for f in facts])
        roads.unite([(link.a, link.b, link.road) for link in links])
        grounds.unite([(link.a, link.b, link.ground) for link in links])
        seeds = np.concatenate([_NO_NODES, *(roads.nodes(i, f.seeds) for i, f in enumerate(facts))])
        drops = np.concatenate([np.zeros((0, 2), np.float32), *(f.drops for f in facts)])
        roads.choose(seeds[under_the_wheels(drops)])
        roads.choose(roads.largest(apart_from=roads.island[roads.chosen]))
        for i, f in enumerate(facts):
            on = roads.chosen[roads.nodes(i, f.pairs[:, 0])]
            grounds.choose(grounds.nodes(i, f.pairs[on, 1]))
        grounds.choose(grounds.largest(apart_from=grounds.island[grounds.chosen]))
        self._roads, self._grounds = roads, grounds
        self._more: dict[int, list[AnyArray]] = {}

    def road_labels(self, i: int) -> AnyArray:
        """Return the labels of window i that are road."""
        return self._roads.chosen_labels(i)

    def ground_labels(self, i: int) -> AnyArray:
        """Return the labels of window i that are ground."""
        return np.unique(np.concatenate([self._grounds.chosen_labels(i), *self._more.get(i, [])]))

    def add_ground(self, i: int, labels: AnyArray) -> None:
        """Take regions of window i, and what is connected to them, for ground too."""
        listed = np.isin(labels, self._grounds.tables[i].labels)
        self._grounds.choose(self._grounds.nodes(i, labels[listed]))
        self._more.setdefault(i, []).append(labels[~listed].astype(np.int32))


class _Nodes:
    """The listed regions of all windows as the nodes of one graph."""

    def __init__(self, tables: Sequence[LabelTable]) -> None:
        self.tables = tables
        self.offsets = np.cumsum([0, *(len(t.labels) for t in tables)]).astype(np.int64)
        self.island = np.concatenate([_NO_NODES, *(t.island for t in tables)])
        self.chosen: BoolArray = np.zeros(len(self.island), dtype=bool)
        self.group: AnyArray = np.arange(len(self.island))

    def nodes(self, i: int, labels: AnyArray) -> IntArray:
        """Return the nodes of listed labels of window i."""
        return np.asarray(self.offsets[i] + np.searchsorted(self.tables[i].labels, labels), dtype=np.int64)

    def unite(self, links: Sequence[tuple[int, int, AnyArray]]) -> None:
        """Find what is connected."""
        pairs = [np.stack([self.nodes(a, p[:, 0]), self.nodes(b, p[:, 1])], axis=-1) for a, b, p in links]
        self.group = united(len(self.island), np.concatenate([np.zeros((0, 2), np.int64), *pairs]))

    def choose(self, nodes: AnyArray) -> None:
        """Choose nodes and all that is connected to them."""
        groups = np.zeros(len(self.group), dtype=bool)
        groups[self.group[nodes]] = True
        self.chosen |= groups[self.group]

    def largest(self, apart_from: AnyArray) -> IntArray:
        """Return a node of the region with most points of each island, but for some islands.

        Of several that have as many, the northernmost, then westernmost, begins first.
        """
        open_ = ~np.isin(self.island, apart_from)
        if not open_.any():
            return _NO_NODES
        points = np.zeros(len(self.group), dtype=np.int64)
        first = np.full(len(self.group), np.iinfo(np.int64).max)
        np.add.at(points, self.group, np.concatenate([t.points for t in self.tables]))
        np.minimum.at(first, self.group, np.concatenate([t.first for t in self.tables]))
        nodes = np.flatnonzero(open_)
        group = self.group[nodes]
        order = np.lexsort((first[group], -points[group], self.island[nodes]))
        _, begin = np.unique(self.island[nodes][order], return_index=True)
        return nodes[order][begin]

    def chosen_labels(self, i: int) -> AnyArray:
        """Return the chosen labels of window i."""
        return np.asarray(self.tables[i].labels[self.chosen[self.offsets[i] : self.offsets[i + 1]]])
