"""The end of a pavement beside an edge line, in one search area."""

import numpy as np
import pytest

from linework.kernels.boundaries.pavement_edges import (
    BY_BOTH,
    EDGE_COLUMNS,
    EDGE_CONTRAST,
    EDGE_V,
    best_split,
    sharpen_split,
    strip_beyond,
    stripe_in,
)
from linework.kernels.boundaries.profiles import (
    HALF_LENGTH_M,
    N_PROFILE_BINS,
    PROFILE_BIN_M,
    PROFILE_SUMS,
    bin_sums_across,
)

SUMS = np.zeros((N_PROFILE_BINS + 1, PROFILE_SUMS))
#: Distance of the search area's middle from the end of the pavement. [m]
MIDDLE_M = 0.25


def area(seed, *, paint_m=(0.17, 0.29), verge=8000.0, spread=0.25):
    """Points about a place on the pavement: asphalt, paint between two distances from its end, and a smooth verge."""
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(-0.8, 0.8, (2, 1600))
    v = y + MIDDLE_M
    bright = np.where(v < 0.0, verge, 2900.0) * rng.normal(1.0, np.where(v < 0.0, spread, 0.1))
    bright = np.where((v > paint_m[0]) & (v < paint_m[1]), 9000.0 * rng.normal(1.0, 0.12, len(v)), bright)
    height = rng.normal(0.0, 0.003, len(v)) + np.where(v < 0.0, 0.01 + 0.007 * rng.normal(size=len(v)), 0.0)
    return np.column_stack([x, y, height, bright, np.arange(len(v))])


def edge_of(work):
    """Return the distance of the edge that is found from the end of the pavement [m], or None."""
    first, edge = np.zeros(EDGE_COLUMNS), np.zeros(EDGE_COLUMNS)
    if not best_split(work, len(work), (0.0, 1.0), 1.0, BY_BOTH, SUMS, first):
        return None
    work = work + np.array([0.0, -first[EDGE_V], 0.0, 0.0, 0.0])
    if not sharpen_split(work, len(work), first, 1.0, BY_BOTH, SUMS, edge):
        return None
    return first[EDGE_V] + edge[EDGE_V] + MIDDLE_M


@pytest.mark.parametrize("seed", range(4))
def test_paint_with_a_strip_of_road_behind_it_is_not_the_edge(seed):
    found = edge_of(area(seed))
    assert found is None or abs(found) < 0.1
    # Without paint, brightness shows where the pavement ends
    assert abs(edge_of(area(seed, paint_m=(9.0, 9.0)))) < 0.02


@pytest.mark.parametrize("width_m", [0.12, 0.20])
@pytest.mark.parametrize("gap_m", [0.05, 0.10, 0.15, 0.25, 0.35])
def test_an_edge_line_is_not_the_end_of_a_pavement_beside_a_darker_verge(gap_m, width_m):
    found = [
        edge_of(area(seed, paint_m=(gap_m, gap_m + width_m), verge=2600.0, spread=0.15)) for seed in range(6)
    ]
    # With the paint counted, the edge would lie at its border, as far off as the gap is wide
    assert abs(np.median(found)) < 0.04


@pytest.mark.parametrize("verge", [3300.0, 4500.0, 8000.0])
@pytest.mark.parametrize("gap_m", [0.25, 0.35])
def test_a_bright_verge_begins_behind_the_strip_beside_an_edge_line(gap_m, verge):
    found = [edge_of(area(seed, paint_m=(gap_m, gap_m + 0.2), verge=verge, spread=0.15)) for seed in range(6)]
    assert abs(np.median(found)) < 0.02


def test_a_stripe_is_found_and_a_wide_verge_is_none():
    work = area(1, paint_m=(0.25, 0.37))
    bin_sums_across(work, len(work), 0.0, 1.0, HALF_LENGTH_M, PROFILE_BIN_M, SUMS)
    first, last = (
        PROFILE_BIN_M * (k - N_PROFILE_BINS // 2) + MIDDLE_M for k in stripe_in(SUMS, PROFILE_BIN_M)
    )
    assert first == pytest.approx(0.25, abs=0.05)
    assert last == pytest.approx(0.37, abs=0.05)
    work = area(1, paint_m=(9.0, 9.0))
    bin_sums_across(work, len(work), 0.0, 1.0, HALF_LENGTH_M, PROFILE_BIN_M, SUMS)
    assert stripe_in(SUMS, PROFILE_BIN_M) == (0, 0)


def test_a_strip_shows_although_the_axis_is_turned():
    a, work = np.radians(14.0), area(1)
    edge = np.zeros(EDGE_COLUMNS)
    edge[:2], edge[EDGE_V], edge[EDGE_CONTRAST] = (np.sin(a), np.cos(a)), 0.32 - MIDDLE_M, 2.0
    assert strip_beyond(work, len(work), edge, HALF_LENGTH_M, PROFILE_BIN_M, SUMS)
    bare = area(1, paint_m=(9.0, 9.0))
    assert not strip_beyond(bare, len(bare), edge, HALF_LENGTH_M, PROFILE_BIN_M, SUMS)
