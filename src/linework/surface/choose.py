"""Selection of road and ground among the regions of all windows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from linework.arrays import AnyArray, BoolArray, IntArray, offsets_of
from linework.surface.cells import under_the_wheels
from linework.surface.regions import LabelTable, RegionFacts, connected_groups

#: Least area of a road in an area without path: larger than the roof of a lorry, or a few cells of a wire. [m2]
MIN_ROAD_M2 = 25.0
_NO_NODES = np.zeros(0, dtype=np.int64)


@dataclass(frozen=True, slots=True)
class RegionLink:
    """Labels (n, 2) of road and of ground that are connected across the edge of windows `a` and `b`."""

    a: int
    b: int
    road: AnyArray
    ground: AnyArray


class Choice:
    """Selection of the regions that are road and of those that are ground.

    Parameters
    ----------
    facts
        Regions of every window.
    links
        Connections between windows.
    cell_m
        Side of a cell. [m]

    Notes
    -----
    Roads are the regions under the path; in a recorded area without path the region with most points, if it is large
    enough. Ground is what is connected to a road. Where no region of the survey qualifies, the one with most points is
    taken.
    """

    def __init__(self, facts: Sequence[RegionFacts], links: Sequence[RegionLink], cell_m: float) -> None:
        roads, grounds = _Nodes([f.road for f in facts]), _Nodes([f.ground for f in facts])
        roads.unite([(link.a, link.b, link.road) for link in links])
        grounds.unite([(link.a, link.b, link.ground) for link in links])
        seeds = np.concatenate([_NO_NODES, *(roads.nodes(i, f.seeds) for i, f in enumerate(facts))])
        drops = np.concatenate([np.zeros((0, 2), np.float32), *(f.drops for f in facts)])
        roads.choose(seeds[under_the_wheels(drops)])
        least = MIN_ROAD_M2 / cell_m**2
        roads.choose(roads.largest(roads.island, apart_from=roads.island[roads.chosen], least=least))
        if not roads.chosen.any():
            roads.choose(roads.largest(np.zeros_like(roads.island)))
        for i, f in enumerate(facts):
            on = roads.chosen[roads.nodes(i, f.pairs[:, 0])]
            grounds.choose(grounds.nodes(i, f.pairs[on, 1]))
        if not grounds.chosen.any():
            grounds.choose(grounds.largest(np.zeros_like(grounds.island)))
        self._roads, self._grounds = roads, grounds
        self._more: dict[int, list[AnyArray]] = {}

    def road_labels(self, i: int) -> AnyArray:
        """Return the labels of window i that are road, (k,) int32."""
        return self._roads.chosen_labels(i)

    def ground_labels(self, i: int) -> AnyArray:
        """Return the labels of window i that are ground, (k,) int32."""
        return np.unique(np.concatenate([self._grounds.chosen_labels(i), *self._more.get(i, [])]))

    def add_ground(self, i: int, labels: AnyArray) -> None:
        """Add regions of window i, and those connected to them, to the ground; `labels` is (k,)."""
        listed = np.isin(labels, self._grounds.tables[i].labels)
        self._grounds.choose(self._grounds.nodes(i, labels[listed]))
        self._more.setdefault(i, []).append(labels[~listed].astype(np.int32))


class _Nodes:
    """The listed regions of all windows as the nodes of one graph."""

    def __init__(self, tables: Sequence[LabelTable]) -> None:
        self.tables = tables
        self.offsets = offsets_of([len(t.labels) for t in tables])
        self.island = np.concatenate([_NO_NODES, *(t.island for t in tables)])
        self.chosen: BoolArray = np.zeros(len(self.island), dtype=bool)
        self.group: AnyArray = np.arange(len(self.island))

    def nodes(self, i: int, labels: AnyArray) -> IntArray:
        """Return the nodes of listed labels of window i."""
        return np.asarray(self.offsets[i] + np.searchsorted(self.tables[i].labels, labels), dtype=np.int64)

    def unite(self, links: Sequence[tuple[int, int, AnyArray]]) -> None:
        """Compute the connected groups, given links between windows."""
        pairs = [np.stack([self.nodes(a, p[:, 0]), self.nodes(b, p[:, 1])], axis=-1) for a, b, p in links]
        self.group = connected_groups(len(self.island), np.concatenate([np.zeros((0, 2), np.int64), *pairs]))

    def choose(self, nodes: AnyArray) -> None:
        """Choose nodes and all nodes connected to them."""
        groups = np.zeros(len(self.group), dtype=bool)
        groups[self.group[nodes]] = True
        self.chosen |= groups[self.group]

    def largest(self, place: AnyArray, apart_from: AnyArray = _NO_NODES, least: float = 0.0) -> IntArray:
        """Return a node of the region with most points in each area, except for some areas.

        Ties go to the region that begins farther north, then west. Regions of fewer than `least` cells do not count.
        `place` is (n,): the area of each node.
        """
        if len(self.group) == 0:
            return _NO_NODES
        cells, points = np.zeros((2, len(self.group)), dtype=np.int64)
        first = np.full(len(self.group), np.iinfo(np.int64).max)
        np.add.at(cells, self.group, np.concatenate([t.cells for t in self.tables]))
        np.add.at(points, self.group, np.concatenate([t.points for t in self.tables]))
        np.minimum.at(first, self.group, np.concatenate([t.first for t in self.tables]))
        nodes = np.flatnonzero(~np.isin(place, apart_from) & (cells[self.group] >= least))
        group = self.group[nodes]
        order = np.lexsort((first[group], -points[group], place[nodes]))
        _, begin = np.unique(place[nodes][order], return_index=True)
        return nodes[order][begin]

    def chosen_labels(self, i: int) -> AnyArray:
        """Return the chosen labels of window i."""
        return np.asarray(self.tables[i].labels[self.chosen[self.offsets[i] : self.offsets[i + 1]]])
