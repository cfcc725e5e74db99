"""Loops of the surface against slow, obvious twins, compiled and not."""

import numpy as np
import pytest

from linework.kernels.cells import nearest, regions, surface
from linework.surface.heights import middle_network


def image(seed, shape=(14, 17), holes=0.3):
    rng = np.random.default_rng(seed)
    height = np.cumsum(rng.normal(0, 0.15, shape), axis=1).astype(np.float32)
    height[rng.random(shape) < holes] = np.nan
    return rng, height


@pytest.mark.parametrize("seed", range(4))
def test_nearest_known_is_exact_and_ties_go_west_then_north(seed):
    rng = np.random.default_rng(seed)
    known = rng.random((19, 23)) < (0.02, 0.1, 0.5, 0.0)[seed]
    reach, margin = 5, 3
    cells = np.argwhere(known)
    for function in (nearest.nearest_known_squared, nearest.nearest_known_squared.py_func):
        index, square = function(known, reach, margin)
        assert index.shape == (13, 17)
        for (r, c), found in np.ndenumerate(index):
            away = np.sum((cells - [r + margin, c + margin]) ** 2, axis=1)
            order = np.lexsort((cells[:, 0], cells[:, 1], away))
            if len(order) and away[order[0]] <= reach**2:
                assert found == cells[order[0]] @ [23, 1]
                assert square[r, c] == away[order[0]]
            else:
                assert found == -1
                assert square[r, c] > reach**2


def grown(height, east, north, allowed, cell, max_step, level):
    """Regions grown from each cell in turn, as one would by hand."""
    labels, n = np.zeros(height.shape, int), 0
    for start in map(tuple, np.argwhere(allowed)):
        if labels[start]:
            continue
        n += 1
        labels[start] = n
        todo = [start]
        while todo:
            r, c = todo.pop()
            for dr, dc in ((1, 0), (-1, 0), (0, 1), (0, -1)):
                for reach in (1, 2):
                    to = r + dr * reach, c + dc * reach
                    if not (0 <= to[0] < height.shape[0] and 0 <= to[1] < height.shape[1]):
                        break
                    if np.isnan(height[to]):
                        continue
                    if allowed[to] and not labels[to]:
                        slope = 0.5 * dc * (east[r, c] + east[to]) - 0.5 * dr * (north[r, c] + north[to])
                        expected = 0.0 if level else slope * reach * cell
                        if abs(height[to] - height[r, c] - expected) <= max_step:
                            labels[to] = n
                            todo.append(to)
                    break
    return labels


@pytest.mark.parametrize("level", [True, False])
@pytest.mark.parametrize("seed", range(5))
def test_regions_are_those_that_grow_by_hand_the_edge_s_first(seed, level):
    rng, height = image(seed)
    east, north = rng.normal(0, 0.1, (2, *height.shape)).astype(np.float32)
    allowed = ~np.isnan(height) & (rng.random(height.shape) < 0.9)
    expected = grown(height, east, north, allowed, 0.5, 0.08, level)
    for function in (regions.label_regions, regions.label_regions.py_func):
        labels, n_border, first = function(height, east, north, allowed, 0.5, 0.08, level)
        assert np.array_equal(labels > 0, allowed)
        # The same parts, under other numbers
        pairs = np.unique(np.stack([labels[allowed], expected[allowed]]), axis=1)
        assert pairs.shape[1] == len(first) == expected.max()
        near_edge = labels.copy()
        near_edge[2:-2, 2:-2] = 0
        assert set(np.unique(near_edge)) - {0} == set(range(1, n_border + 1))
        for label, at in enumerate(first, start=1):
            assert at == np.flatnonzero(labels.ravel() == label)[0]


@pytest.mark.parametrize("seed", range(5))
def test_regions_linked_across_an_edge_are_those_of_the_whole(seed):
    _, height = image(seed, shape=(30, 12), holes=0.4)
    zero, allowed = np.zeros_like(height), ~np.isnan(height)
    whole, _, _ = regions.label_regions(height, zero, zero, allowed, 0.5, 0.2, True)
    halves = []
    for part in (np.s_[:, :6], np.s_[:, 6:]):
        values = np.ascontiguousarray(height[part])
        halves.append(
            (values, regions.label_regions(values, values, values, ~np.isnan(values), 0.5, 0.2, True)[0])
        )
    (a, left), (b, right) = halves
    strips = [np.ascontiguousarray(x) for x in (a[:, -2:], left[:, -2:], b[:, :2], right[:, :2])]
    slope = np.zeros((30, 2), np.float32)
    for function in (regions.links_across, regions.links_across.py_func):
        links = function(strips[0], slope, strips[1], strips[2], slope, strips[3], 0.5, 0.2)
        assert len(links) > 5
        parent = {("a", label): ("a", label) for label in np.unique(left)}
        parent |= {("b", label): ("b", label) for label in np.unique(right)}

        def root(node, parent=parent):
            return node if parent[node] == node else root(parent[node])

        for p, q in links:
            parent[root(("a", p))] = root(("b", q))
        joined = [
            root(("a" if c < 6 else "b", (left[r, c] if c < 6 else right[r, c - 6])))
            for r, c in np.argwhere(allowed)
        ]
        pairs = {(one, int(other)) for one, other in zip(joined, whole[allowed], strict=True)}
        assert len(pairs) == len({one for one, _ in pairs}) == len({other for _, other in pairs})


@pytest.mark.parametrize("holes", [0.0, 0.2, 0.8, 1.0])
def test_slopes_are_the_medians_of_the_differences_around(holes):
    rng, height = image(3, shape=(20, 26), holes=holes)
    wanted = ~np.isnan(height[3:-3, 3:-3]) & (rng.random((14, 20)) < 0.6)
    step_east, step_north = np.full((2, *height.shape), np.nan, dtype=np.float32)
    step_east[:, :-1] = height[:, 1:] - height[:, :-1]
    step_north[:-1] = height[:-1] - height[1:]
    for function in (surface.median_slopes, surface.median_slopes.py_func):
        found = function(height, wanted, 0.5, 2, middle_network(25))
        for slopes, steps in zip(found, (step_east, step_north), strict=True):
            assert np.array_equal(~np.isnan(slopes), wanted)
            for r, c in np.argwhere(wanted):
                around = steps[r + 1 : r + 6, c + 1 : c + 6]
                known = around[~np.isnan(around)]
                expected = np.median(known) / 0.5 if len(known) else 0.0
                assert slopes[r, c] == pytest.approx(expected, abs=1e-6)


def test_the_layer_of_a_cell_counts_its_lowest_point_and_forgets_the_order():
    rng = np.random.default_rng(2)
    xyz = rng.uniform([0, 0, 250.0], [2, 2, 250.3], (400, 3))
    found = []
    for order in (np.arange(400), rng.permutation(400)):
        cells, z, low, count = surface.lowest_supported(xyz[order], 0, 0, 4, 4, 0.5, 0.0, 0.15)
        found.append((low, count, *surface.lowest_layer(cells, z, low, 0.2)))
    for one, other in zip(*found, strict=True):
        assert np.array_equal(one, other)
    low, count, height, spread, number = found[0]
    inside = (xyz[:, 0] < 0.5) & (xyz[:, 1] >= 1.5)
    layer = np.sort(xyz[inside, 2])
    layer = layer[layer <= layer[0] + 0.2]
    assert count[0, 0] == inside.sum()
    assert number[0, 0] == len(layer)
    assert height[0, 0] == pytest.approx(layer.mean(), abs=1e-4)
    assert spread[0, 0] == pytest.approx(layer.std(), abs=1e-4)


def test_one_point_has_a_height_and_no_spread():
    cells, z, low, _ = surface.lowest_supported(np.array([[0.2, 0.2, 101.3]]), 0, 0, 1, 1, 0.5, 100.0, 0.15)
    height, spread, number = surface.lowest_layer(cells, z, low, 0.2)
    assert number[0, 0] == 1
    assert height[0, 0] == pytest.approx(1.3, abs=1e-6)
    assert np.isnan(spread[0, 0])


def test_softening_is_the_mean_around_where_all_of_it_is_known():
    rng = np.random.default_rng(5)
    values = rng.normal(0, 1, (9, 10)).astype(np.float32)
    values[0, 0] = np.nan
    square = np.full(values.shape, 16, np.int32)
    square[4, 4] = 0
    for function in (nearest.softened, nearest.softened.py_func):
        out = function(values, square, 1, 0.5, 2.0)
        assert out[0, 0] == values[1, 1]  # a neighbour is missing
        assert out[3, 3] == values[4, 4]  # nothing was carried
        assert out[2, 5] == pytest.approx(values[2:5, 5:8].mean(), abs=1e-6)


def test_the_road_gives_way_to_the_ground_between_one_and_two_times_the_reach():
    road = np.full((1, 5), 1.0, np.float32)
    road[0, 4] = np.nan
    ground = np.array([[3.0, 3.0, 3.0, np.nan, 3.0]], np.float32)
    square = np.array([[0, 400, 900, 1600, 9]], np.int32)
    far = np.array([[7.0]], np.float32)
    nearest.blend_into_ground(road, square, ground, far, np.zeros(1, int), np.zeros(5, int), 0.5, 10.0)
    assert road[0].tolist() == [1.0, 1.0, 2.0, 7.0, 3.0]
    assert ground[0].tolist() == [3.0, 3.0, 3.0, 7.0, 3.0]
