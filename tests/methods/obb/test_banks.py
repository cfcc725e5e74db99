"""Kerbs and banks under few and noisy points, which do not tell stone from soil; and the kerbs of medians."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import linework
from linework.kernels.cells import floor
from linework.methods.obb.boundary_evidence import (
    DASHES_OF_ROAD,
    evidence_of,
    has_dashes_behind,
    is_joint_of_road,
    may_be_bank,
)
from linework.methods.tracking.boundary_lines import SmoothBoundary
from linework.methods.tracking.marking_lines import SmoothMarking
from linework.methods.tracking.neighbours import LineAxis
from linework.methods.tracking.smooth import SmoothLine
from linework.model.points import Points

ORIGIN = np.array([500_000.0, 5_600_000.0, 100.0])
LENGTH_M, HALF_M, NOISE_M = 80.0, 4.0, 0.018
#: Foot and height of the bank: of a verge, behind the pavement's edge. [m]
BANK_M, BANK_HIGH_M = 5.2, 0.10


def airborne_road(seed, *, kerb_m=0.0, bank_m=0.0, grass=1.0, per_m2=18):
    """A road of 8 m with 3 m beside it: a kerb, or a verge of another brightness with a bank along it."""
    rng = np.random.default_rng(seed)
    n = int(per_m2 * LENGTH_M * 2.0 * (HALF_M + 3.0))
    s, o = rng.uniform(0.0, LENGTH_M, n), rng.uniform(-HALF_M - 3.0, HALF_M + 3.0, n)
    z = kerb_m * (np.abs(o) > HALF_M) + bank_m * np.clip((np.abs(o) - BANK_M) / 0.2, 0.0, 1.0)
    z += rng.normal(0.0, NOISE_M, n) - 0.02 * np.minimum(np.abs(o), HALF_M)
    brightness = 2000.0 * np.where(np.abs(o) > HALF_M, grass, 1.0) * rng.lognormal(0.0, 0.10, n)
    xyz = np.column_stack([s, o, z]) + ORIGIN
    return Points(xyz, intensity=np.round(brightness).astype(np.float32), crs="EPSG:25832")


def metres_at(lines, offset_m, within_m=0.15):
    """Metres of lines within reach of an offset from the road's middle, on either side."""
    ends = np.delete(np.arange(len(lines.xyz) - 1), lines.offsets[1:-1] - 1)
    middle = 0.5 * (lines.xyz[ends] + lines.xyz[ends + 1]) - ORIGIN
    length = np.hypot(*(lines.xyz[ends + 1] - lines.xyz[ends])[:, :2].T)
    return float(length[np.abs(np.abs(middle[:, 1]) - offset_m) <= within_m].sum())


@pytest.mark.parametrize("per_m2", [10, 16, 60, 400])
def test_the_noise_of_the_smoothest_floor_is_that_of_the_scanner_however_many_points_it_has(per_m2):
    rng, side_m = np.random.default_rng(9901), 12.0
    n = int(per_m2 * side_m**2)
    xyz = np.column_stack([*rng.uniform(0.0, side_m, (2, n)), rng.normal(0.0, NOISE_M, n)])
    col, row = (np.floor(xyz[:, k] / floor.FINE_M).astype(np.int64) for k in range(2))
    cells = round(side_m / floor.FINE_M)
    span = np.array([0, 0, cells, cells])
    points, _, starts = floor.sort_by_cell(xyz, np.zeros(n, dtype=np.float32), np.zeros(3), col, row, span)
    facets = floor.facets_of(floor.cell_sums(points, starts, span), starts, span)
    smoothest = facets[facets[:, floor.FACET_N] > 0.0, floor.FACET_SMOOTHEST]
    assert np.median(smoothest) == pytest.approx(NOISE_M, rel=0.15)


@pytest.mark.parametrize("seed", [9902, 9903])
def test_a_kerb_is_found_among_few_and_noisy_points(seed):
    points = airborne_road(seed, kerb_m=0.07, per_m2=14)
    lines = linework.extract(points, kinds=("road_boundary",), adjust=False)
    assert metres_at(lines, HALF_M) >= 0.8 * 2.0 * LENGTH_M
    assert metres_at(lines, HALF_M, 20.0) - metres_at(lines, HALF_M) <= 2.0
    assert set(lines.form.tolist()) == {"kerb"}


@pytest.mark.parametrize("seed", [9904, 9905])
def test_a_bank_of_a_verge_does_not_end_a_road_whose_edge_shows(seed):
    points = airborne_road(seed, bank_m=BANK_HIGH_M, grass=1.6)
    lines = linework.extract(points, kinds=("road_boundary",), adjust=False)
    assert metres_at(lines, HALF_M) >= 0.8 * 2.0 * LENGTH_M
    assert metres_at(lines, BANK_M, 0.5) <= 4.0


def smooth(length_m, offset_m):
    """A line along y = offset, west to east."""
    t = np.arange(0.0, length_m + 0.5)
    xyz = np.column_stack([t, np.full(len(t), offset_m), np.zeros(len(t))])
    normal = np.tile([0.0, 1.0], (len(t), 1))
    small = np.full(len(t), 0.01)
    return SmoothLine(t, xyz, normal, small, small, np.arange(len(t)))


def kerb(rougher):
    n = len(rougher)
    return SmoothBoundary(
        smooth(40.0, 0.0), smooth(40.0, 0.0), np.arange(n), "kerb", np.full(41, 0.1), 0.9, (0.0, 1.0),
        np.full(n, 0.8), np.full(n, np.nan), np.asarray(rougher), 1.0,
    )  # fmt: skip


def test_a_kerb_whose_boxes_do_not_tell_stone_from_soil_is_weighed():
    stone, unknown = kerb([1.0, 1.1, np.nan]), kerb([1.0, np.nan, np.nan])
    assert not may_be_bank(stone)
    assert evidence_of(stone) == np.inf
    assert may_be_bank(unknown)
    assert 0.0 < evidence_of(unknown) < np.inf
    assert evidence_of(replace(unknown, scores=np.full(3, 0.9))) > evidence_of(unknown)
    assert not may_be_bank(replace(unknown, form="edge"))


def dashes(n, offset_m):
    at = 9.0 * np.arange(n)
    return SmoothMarking(
        smooth(9.0 * n, offset_m), np.arange(n), np.column_stack([at, at + 3.0]), None,
        np.column_stack([at, at + 3.0]), 0.12, 0.9, (0.0, 1.0),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("n", "offset_m", "expected"),
    [
        (DASHES_OF_ROAD, -7.0, True),
        (DASHES_OF_ROAD - 1, -7.0, False),
        (DASHES_OF_ROAD, -2.0, False),
        (DASHES_OF_ROAD, 7.0, False),
    ],
    ids=["behind", "too few", "close behind", "in front"],
)
def test_a_kerb_with_dashes_behind_it_is_that_of_a_median(n, offset_m, expected):
    found, edge = dashes(n, offset_m), smooth(40.0, 0.0)
    axes = [LineAxis.of(line.t_m, line.xyz) for line in (edge, found.line)]
    assert has_dashes_behind(axes[:1], [found], axes[1:]).tolist() == [expected]


@pytest.mark.parametrize(
    ("dashes_m", "edge_m", "is_turned", "form", "expected"),
    [
        (-0.1, -2.7, False, "edge", True),
        (-2.2, -5.5, False, "edge", True),
        (-0.1, -2.7, False, "kerb", False),
        # Dashes of another lane, in front, or of another carriageway
        (-3.5, -5.5, False, "edge", False),
        (0.1, -2.7, False, "edge", False),
        (-2.0, -1.0, True, "edge", False),
        (-0.1, 2.7, False, "edge", False),
    ],
)
def test_a_joint_of_the_asphalt_has_dashes_and_the_other_edge_behind_it(
    dashes_m, edge_m, is_turned, form, expected
):
    """A lane was paved anew: its joint lies beside the line in the middle of the road."""
    found = dashes(DASHES_OF_ROAD, dashes_m)
    joint, edge = (smooth(50.0, y) for y in (0.0, edge_m))
    axes = [LineAxis.of(line.t_m, line.xyz) for line in (joint, edge, found.line)]
    if is_turned:
        axes[1] = LineAxis.of(edge.t_m, edge.xyz[::-1])
    is_kerb = np.array([form == "kerb", False])
    assert is_joint_of_road(axes[:2], is_kerb, [found], axes[2:])[0] == expected
