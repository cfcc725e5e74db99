"""Which regions are other carriageways, by how they touch."""

from __future__ import annotations

import numpy as np

from linework.surface.choose import Choice, RegionLink
from linework.surface.regions import LabelTable, RegionFacts


def table(cells, points):
    n = len(cells)
    return LabelTable(
        n, np.arange(1, n + 1, dtype=np.int32), np.array(cells), np.array(points), np.array(cells),
        np.array(cells) * 500, np.arange(n), np.zeros(n, dtype=np.int32),
    )  # fmt: skip


def facts_of(cells, points, touching, under):
    """Regions on one ground, of which one lies under the path."""
    return RegionFacts(
        road=table(cells, points),
        ground=table([sum(cells)], [sum(points)]),
        bare=np.zeros(0, dtype=np.int32),
        pairs=np.array([[k + 1, 1, cells[k]] for k in range(len(cells))], dtype=np.int32),
        touching=np.array(touching, dtype=np.int32).reshape(-1, 3),
        seeds=np.array([under], dtype=np.int32),
        drops=np.zeros((1, 2), dtype=np.float32),
        spreads=np.array([0.005], dtype=np.float32),
    )


def chosen(cells, points, touching):
    """Labels of road; the first region lies under the path."""
    return Choice([facts_of(cells, points, touching, 1)], [], 0.5).road_labels(0).tolist()


def test_a_footway_along_the_other_carriageway_is_not_one():
    assert chosen([4000, 4000, 1000], [400_000, 100_000, 10_000], [[2, 3, 300]]) == [1, 2]


def test_a_large_square_behind_the_other_carriageway_does_not_drive_it_out():
    assert chosen([4000, 4000, 20_000], [400_000, 100_000, 150_000], [[2, 3, 600]]) == [1, 2]


def test_what_touches_at_a_few_places_is_one():
    assert chosen([4000, 4000], [400_000, 100_000], [[1, 2, 40]]) == [1, 2]
    assert chosen([4000, 4000], [400_000, 100_000], [[1, 2, 400]]) == [1]


def test_a_road_that_goes_on_in_another_window_leaves_the_others_as_they_are():
    parts = [
        facts_of([2000], [200_000], [], under=1),
        facts_of([2000, 4000, 500], [200_000, 100_000, 5_000], [[1, 2, 60], [2, 3, 150]], under=1),
    ]
    pair = np.array([[1, 1]], dtype=np.int32)
    link = RegionLink(0, 1, road=pair, ground=pair, touching=np.zeros((0, 3), dtype=np.int32))
    choice = Choice(parts, [link], 0.5)
    assert choice.road_labels(0).tolist() == [1]
    assert choice.road_labels(1).tolist() == [1, 2]
