"""Distances between paint along a road: over how many metres they are kept, whatever the length of the road."""

import tracemalloc

import numpy as np

from linework.lines.within_lanes import PaintDistances, PaintRow, patches_within_lanes

LANE_M = (2.2, 4.4)


def rows_of(n_stations, seed=1):
    """Two lines 3.5 m apart, and paint between them at changing distances from both, some of it bridged."""
    rng = np.random.default_rng(seed)
    rows = []
    for _ in range(n_stations):
        lines = [(0, rng.normal(0.0, 0.02)), (1, 3.5 + rng.normal(0.0, 0.02))]
        lines += [(2, rng.uniform(0.6, 2.9))] if rng.random() < 0.6 else []
        lines = sorted(lines, key=lambda line: line[1])
        rows.append([PaintRow(i, at_m, bool(rng.random() < 0.2), i == 0) for i, at_m in lines])
    return rows


def kept_slowly_m(rows, k, distance_m):
    """Stations within 50 m at which two lines that were measured have the distance, to 6 cm."""
    found = 0
    for here in rows[max(k - 50, 0) : k + 51]:
        offsets = [row.offset_m for row in here if not row.bridged]
        apart = [b - a for i, a in enumerate(offsets) for b in offsets[i + 1 :]]
        found += any(distance_m - 0.06 <= one < distance_m + 0.06 for one in apart)
    return float(found)


def most_memory_of_a_question(n_stations):
    paint = PaintDistances(rows_of(n_stations))
    tracemalloc.start()
    try:
        paint.kept_m(n_stations // 2, 3.5)
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_a_distance_is_kept_over_the_stations_within_reach():
    rows = rows_of(180)
    paint = PaintDistances(rows)
    for k in (0, 1, 49, 50, 51, 90, 128, 129, 130, 179):
        for distance_m in (0.7, 1.3, 2.8, 3.44, 3.5, 3.56, 5.0):
            assert paint.kept_m(k, distance_m) == kept_slowly_m(rows, k, distance_m)


def test_what_a_question_costs_does_not_depend_on_the_length_of_the_road():
    """Only what is within reach is looked at."""
    assert most_memory_of_a_question(8000) <= 1.5 * most_memory_of_a_question(400)


def test_patches_are_found_between_the_lines_and_nowhere_without_paint():
    rows = rows_of(120)
    between = [k for k, here in enumerate(rows) if any(row.line == 2 for row in here)]
    found = patches_within_lanes(PaintDistances(rows), LANE_M)
    assert sum(found[k] == {2} for k in between) > 0.9 * len(between)
    assert patches_within_lanes(PaintDistances([]), LANE_M) == []
    assert patches_within_lanes(PaintDistances([[], []]), LANE_M) == [frozenset(), frozenset()]
