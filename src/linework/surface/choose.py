"""Selection of road and ground among the regions of all windows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from linework.arrays import AnyArray, BoolArray, Float32Array, IntArray, offsets_of
from linework.model.ground import PAVED_SPREAD
from linework.surface.cells import under_the_wheels
from linework.surface.regions import (
    MIN_ROAD_M2,
    SPREAD_UNIT_M,
    LabelTable,
    RegionFacts,
    connected_groups,
    is_bare,
)

#: Points per cell of a road beside the road with most points: as many flight strips overlap at most. Fields far from a
#: van have less. [ratio]
_LEAST_DENSITY = 0.25
_NO_NODES = np.zeros(0, dtype=np.int64)
_NO_PAIRS = np.zeros((0, 2), dtype=np.int64)
_NO_CONTACTS = np.zeros((0, 3), dtype=np.int64)
#: Greatest share of a region's cells in contact with a road: behind a lorry, or where a barrier ends, two carriageways
#: touch at some places; ground along the road touches it once in each row of cells, which is 1 in 40 (2.5 %) where it is
#: 20 m wide, and more where it is narrower.
_FEW_CONTACTS = 0.02


@dataclass(frozen=True, slots=True)
class RegionLink:
    """Labels (n, 2) of road and of ground that are connected across the edge of windows `a` and `b`.

    And roads that touch there: (n, 3), with the number of places.
    """

    a: int
    b: int
    road: AnyArray
    ground: AnyArray
    touching: AnyArray


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
    Roads are the regions under the path, and other carriageways: large regions on ground, as even as the road under the
    path, that do not lie along it or along another one chosen before (a footway does); in a recorded area without path all smooth regions of bare earth that are large
    enough, but of two that touch, at a kerb, the one with more points, and none that is seen
    much less densely than the one with most points. Ground is the regions of bare earth, and what roads lie on. Where no region of the
    survey qualifies, the one with most points is ground.
    """

    def __init__(self, facts: Sequence[RegionFacts], links: Sequence[RegionLink], cell_m: float) -> None:
        roads, grounds = _Nodes([f.road for f in facts], cell_m), _Nodes([f.ground for f in facts], cell_m)
        roads.unite([(link.a, link.b, link.road) for link in links])
        grounds.unite([(link.a, link.b, link.ground) for link in links])
        seeds = np.concatenate([_NO_NODES, *(roads.nodes(i, f.seeds) for i, f in enumerate(facts))])
        drops = np.concatenate([np.zeros((0, 2), np.float32), *(f.drops for f in facts)])
        under = under_the_wheels(drops)
        roads.choose(seeds[under])
        with_path = np.isin(roads.island, roads.island[roads.chosen])
        grounds.choose(np.flatnonzero(grounds.are_bare()))
        # A dam's crest is ground as its banks are: so a road is where it lies on ground, bare by itself or not
        on_ground = np.zeros(len(roads.group), dtype=np.int64)
        for i, f in enumerate(facts):
            on = grounds.chosen[grounds.nodes(i, f.pairs[:, 1])]
            np.add.at(on_ground, roads.group[roads.nodes(i, f.pairs[on, 0])], f.pairs[on, 2])
        cells = roads.sums("cells")
        is_road = (2 * on_ground >= cells) & (cells * cell_m**2 >= MIN_ROAD_M2)
        touching = [roads.contacts(i, i, f.touching) for i, f in enumerate(facts)]
        touching += [roads.contacts(link.a, link.b, link.touching) for link in links]
        contacts = np.concatenate([_NO_CONTACTS, *touching])
        spreads = np.concatenate([np.zeros(0, np.float32), *(f.spreads for f in facts)])
        is_even = _are_even(roads.sums("scatter"), cells, spreads[under])
        roads.choose_beside(is_road[roads.group] & is_even[roads.group] & with_path, contacts)
        roads.choose_apart(is_road[roads.group] & ~with_path, contacts[:, :2])
        for i, f in enumerate(facts):
            on = roads.chosen[roads.nodes(i, f.pairs[:, 0])]
            grounds.choose(grounds.nodes(i, f.pairs[on, 1]))
        if not grounds.chosen.any() and not any(len(f.bare) for f in facts):
            grounds.choose(grounds.most_points())
        self._roads, self._grounds, self._inside = roads, grounds, [f.bare for f in facts]

    def road_labels(self, i: int) -> AnyArray:
        """Return the labels of window i that are road, (k,) int32."""
        return self._roads.chosen_labels(i)

    def ground_labels(self, i: int) -> AnyArray:
        """Return the labels of window i that are ground, (k,) int32."""
        return np.union1d(self._grounds.chosen_labels(i), self._inside[i])


class _Nodes:
    """The listed regions of all windows as the nodes of one graph."""

    def __init__(self, tables: Sequence[LabelTable], cell_m: float) -> None:
        self.tables, self._cell_m = tables, cell_m
        self.offsets = offsets_of([len(t.labels) for t in tables])
        self.island = np.concatenate([_NO_NODES, *(t.island for t in tables)])
        self.chosen: BoolArray = np.zeros(len(self.island), dtype=bool)
        self.group: AnyArray = np.arange(len(self.island))

    def nodes(self, i: int, labels: AnyArray) -> IntArray:
        """Return the nodes of listed labels of window i."""
        return np.asarray(self.offsets[i] + np.searchsorted(self.tables[i].labels, labels), dtype=np.int64)

    def pairs(self, a: int, b: int, labels: AnyArray) -> IntArray:
        """Return the nodes of pairs of listed labels (n, 2) of windows a and b."""
        return np.stack([self.nodes(a, labels[:, 0]), self.nodes(b, labels[:, 1])], axis=-1)

    def contacts(self, a: int, b: int, touching: AnyArray) -> IntArray:
        """Return the nodes of pairs of listed labels of windows a and b, with the number of places (n, 3)."""
        return np.column_stack([self.pairs(a, b, touching[:, :2]), touching[:, 2]]).astype(np.int64)

    def unite(self, links: Sequence[tuple[int, int, AnyArray]]) -> None:
        """Compute the connected groups, given links between windows."""
        pairs = [self.pairs(*link) for link in links]
        self.group = connected_groups(len(self.island), np.concatenate([_NO_PAIRS, *pairs]))

    def choose(self, nodes: AnyArray) -> None:
        """Choose nodes and all nodes connected to them."""
        groups = np.zeros(len(self.group), dtype=bool)
        groups[self.group[nodes]] = True
        self.chosen |= groups[self.group]

    def are_bare(self) -> BoolArray:
        """Return which nodes belong to groups of bare earth, (n,) bool."""
        return is_bare(self.sums("bare"), self.sums("cells"), self._cell_m)[self.group]

    def choose_beside(self, wanted: BoolArray, contacts: IntArray) -> None:
        """Choose the groups of wanted nodes (n,), those with most points per cell first: they are nearer to the scanner.

        None that touches those chosen before, by contacts (k, 3), at more than a few places: a footway lies along the other
        carriageway as it does along the one driven on.
        """
        places: dict[int, dict[int, int]] = {}
        for a, b, n in np.column_stack([self.group[contacts[:, :2]], contacts[:, 2]]).tolist():
            for one, other in ((a, b), (b, a)):
                beside = places.setdefault(one, {})
                beside[other] = beside.get(other, 0) + n
        cells, nodes = self.sums("cells"), self._by_points()
        density = self.sums("points") / np.maximum(cells, 1)
        nodes = nodes[np.argsort(-density[self.group[nodes]], kind="stable")]
        taken = set(self.group[self.chosen].tolist())
        for node in nodes[wanted[nodes] & ~self.chosen[nodes]].tolist():
            group = int(self.group[node])
            touched = sum(
                n for other, n in places.get(group, {}).items() if other in taken and other != group
            )
            if touched <= _FEW_CONTACTS * cells[group]:
                taken.add(group)
        self.chosen |= np.isin(self.group, list(taken))

    def choose_apart(self, wanted: BoolArray, touching: IntArray) -> None:
        """Choose the groups of wanted nodes (n,), those with most points first.

        None that touches a chosen one, or that is seen much less densely than the first chosen one of its island.
        """
        beside: dict[int, set[int]] = {}
        for a, b in np.unique(self.group[touching], axis=0).tolist():
            beside.setdefault(a, set()).add(b)
            beside.setdefault(b, set()).add(a)
        density = self.sums("points") / np.maximum(self.sums("cells"), 1)
        least: dict[int, float] = {}
        taken: set[int] = set()
        nodes = self._by_points()
        for node in nodes[wanted[nodes]].tolist():
            group, island = int(self.group[node]), int(self.island[node])
            first = least.setdefault(island, _LEAST_DENSITY * float(density[group]))
            if group not in taken and density[group] >= first and not taken & beside.get(group, set()):
                taken.add(group)
        self.chosen |= np.isin(self.group, list(taken))

    def most_points(self) -> IntArray:
        """Return a node of the group with most points, (1,); none without nodes."""
        return self._by_points()[:1]

    def _by_points(self) -> IntArray:
        """Return all nodes, those of groups with most points first; of equals the one that begins farther north, then west."""
        first = np.full(len(self.group), np.iinfo(np.int64).max)
        np.minimum.at(first, self.group, np.concatenate([_NO_NODES, *(t.first for t in self.tables)]))
        points = self.sums("points")
        return np.lexsort((first[self.group], -points[self.group]))

    def sums(self, name: str) -> IntArray:
        """Return the sum of a column of the tables over each group, (n,) int64: groups count up to the number of nodes."""
        total = np.zeros(len(self.group), dtype=np.int64)
        np.add.at(total, self.group, np.concatenate([_NO_NODES, *(getattr(t, name) for t in self.tables)]))
        return total

    def chosen_labels(self, i: int) -> AnyArray:
        """Return the chosen labels of window i."""
        return np.asarray(self.tables[i].labels[self.chosen[self.offsets[i] : self.offsets[i + 1]]])


def _are_even(scatter: IntArray, cells: IntArray, under: Float32Array) -> BoolArray:
    """Return which groups (n,) are as even as the road, by the sum of the spreads of their cells.

    Parameters
    ----------
    under
        Spreads of cells under the path. [m]
    """
    if len(under) == 0:
        return np.zeros(len(cells), dtype=bool)
    limit = PAVED_SPREAD * float(np.median(under)) / SPREAD_UNIT_M
    return np.asarray(scatter <= limit * cells)
