"""Which regions are other carriageways, by how they touch."""

from __future__ import annotations

import numpy as np

from linework.surface.choose import Choice
from linework.surface.regions import LabelTable, RegionFacts


def table(cells, points):
    n = len(cells)
    return LabelTable(
        n, np.arange(1, n + 1, dtype=np.int32), np.array(cells), np.array(points), np.array(cells),
        np.array(cells) * 500, np.arange(n), np.zeros(n, dtype=np.int32),
    )  # fmt: skip


def chosen(cells, points, touching):
    """Labels of road; the first region lies under the path, all on one ground."""
    pairs = np.array([[k + 1, 1, cells[k]] for k in range(len(cells))], dtype=np.int32)
    facts = RegionFacts(
        road=table(cells, points),
        ground=table([sum(cells)], [sum(points)]),
        bare=np.zeros(0, dtype=np.int32),
        pairs=pairs,
        touching=np.array(touching, dtype=np.int32).reshape(-1, 3),
        seeds=np.array([1], dtype=np.int32),
        drops=np.zeros((1, 2), dtype=np.float32),
        spreads=np.array([0.005], dtype=np.float32),
    )
    return Choice([facts], [], 0.5).road_labels(0).tolist()


def test_a_footway_along_the_other_carriageway_is_not_one():
    assert chosen([4000, 4000, 1000], [400_000, 100_000, 10_000], [[2, 3, 300]]) == [1, 2]


def test_a_large_square_behind_the_other_carriageway_does_not_drive_it_out():
    assert chosen([4000, 4000, 20_000], [400_000, 100_000, 150_000], [[2, 3, 600]]) == [1, 2]


def test_what_touches_at_a_few_places_is_one():
    assert chosen([4000, 4000], [400_000, 100_000], [[1, 2, 40]]) == [1, 2]
    assert chosen([4000, 4000], [400_000, 100_000], [[1, 2, 400]]) == [1]
