"""Steps with a part of their floor or top without points: shadows of kerbs, and what only looks like one."""

from __future__ import annotations

import numpy as np
import pytest

from linework.kernels.boundaries.kerbs.sides import EDGE_NEAR_BINS, edge_before_shadow, measure_seen_step
from linework.kernels.boundaries.kerbs.steps import (
    CLEAREST_COLUMNS,
    STEP_COLUMNS,
    STEP_FOOT,
    STEP_HEIGHT,
    STEP_N_FACE,
    STEP_SHADOW,
    STEP_SIGMA_H,
    STEP_TOP,
    best_step,
)
from linework.kernels.boundaries.profiles import N_PROFILE_BINS, PROFILE_SUMS

KERB_M, SCANNER_M = 0.12, 2.4


def place(seed, height_m, holes=(), *, seen_from_m, turn_deg=0.0):
    """Points within 0.8 m of a place of a road whose height over v is given, as a scanner sees it from beyond one side."""
    rng = np.random.default_rng(seed)
    v = np.arange(-1.0, 1.0, 0.002)
    way = v if seen_from_m < 0.0 else v[::-1]
    z = height_m(way)
    slope = np.abs(way - seen_from_m) / (SCANNER_M - z)
    rays = np.linspace(slope.min(), slope.max(), 40)[None, :] + rng.uniform(-0.01, 0.01, (40, 40))
    rays = rays[(rays > slope[0]) & (rays < slope.max())]
    horizon = np.maximum.accumulate(slope)
    at = np.clip(np.searchsorted(horizon, rays), 1, len(way) - 1)
    share = (rays - horizon[at - 1]) / np.maximum(horizon[at] - horizon[at - 1], 1e-12)
    v = way[at - 1] + share * (way[at] - way[at - 1])
    r = z[at - 1] + share * (z[at] - z[at - 1]) + rng.normal(0.0, 0.003, len(at))
    u = rng.uniform(-0.8, 0.8, len(at))
    kept = np.hypot(u, v) < 0.8
    for low, high in holes:
        kept &= (v < low) | (v > high)
    turn = np.deg2rad(turn_deg)
    x, y = u * np.cos(turn) - v * np.sin(turn), u * np.sin(turn) + v * np.cos(turn)
    return np.column_stack([x, y, r, np.ones(len(v))])[kept].copy()


def measured(work, turn_deg=0.0):
    """Return a measured step, (19,), from the direction in which its profile is clearest; None: there is none."""
    first, out = np.zeros(CLEAREST_COLUMNS), np.zeros(STEP_COLUMNS)
    turn = np.deg2rad(turn_deg)
    tried = np.zeros((26, 2))
    sums = np.zeros((N_PROFILE_BINS + 1, PROFILE_SUMS))
    frame = -np.sin(turn), np.cos(turn)
    if not best_step(work, len(work), frame, 1.0, 0.5, sums, tried, first):
        return None
    return out if measure_seen_step(work, len(work), first, 1.0, 0.5, out) else None


def kerb(v):
    """Road at positive v, and a footway."""
    return np.where(v < 0.0, KERB_M, 0.0)


@pytest.mark.parametrize("turn_deg", [0.0, 14.0])
def test_a_kerb_seen_from_above_lies_at_its_upper_edge(turn_deg):
    for seed in range(5):
        step = measured(place(seed, kerb, seen_from_m=-5.0, turn_deg=turn_deg), turn_deg)
        assert step is not None
        assert abs(step[STEP_TOP]) <= 0.03
        # 0.12 x 5 / 2.28 m of floor cannot be seen
        assert 0.16 <= step[STEP_SHADOW] <= 0.34


def test_what_is_missing_beside_a_kerb_that_is_seen_does_not_move_it():
    for holes in ([], [(0.1, 0.3)], [(0.2, 0.4)], [(-0.4, -0.2)]):
        step = measured(place(7, kerb, holes, seen_from_m=5.0))
        assert step is not None
        assert step[STEP_N_FACE] >= 4
        assert abs(step[STEP_FOOT]) <= 0.01
        assert step[STEP_SHADOW] == 0.0


def test_the_near_edge_of_a_narrow_stone_stays_where_it_is():
    step = measured(place(8, lambda v: np.where((v < 0.0) & (v > -0.25), KERB_M, 0.0), seen_from_m=4.0))
    assert step is not None
    assert abs(step[STEP_FOOT]) <= 0.02
    assert step[STEP_SHADOW] == 0.0


def test_lines_of_a_scanner_along_a_kerb_leave_no_shadow():
    rng = np.random.default_rng(9)
    u, v = rng.uniform(-0.8, 0.8, (2, 1600))
    # Seen from straight above, by lines 0.2 m apart
    on_line = (np.hypot(u, v) < 0.8) & (np.mod(v - 0.1, 0.2) < 0.06)
    work = np.column_stack([u, v, kerb(v) + rng.normal(0.0, 0.003, len(v)), np.ones(len(v))])[on_line].copy()
    step = measured(work)
    assert step is None or step[STEP_SHADOW] == 0.0


def test_the_height_over_a_hidden_foot_is_as_sure_as_it_says():
    steps = [measured(place(seed, kerb, seen_from_m=-6.0)) for seed in range(20, 60)]
    known = np.array([step for step in steps if step is not None])
    assert len(known) >= 30
    ratio = (known[:, STEP_HEIGHT] - KERB_M) / known[:, STEP_SIGMA_H]
    assert 0.5 <= np.sqrt(np.mean(ratio**2)) <= 1.5


def edge_found(work, v_m, turn_deg=0.0):
    """Return v [m], the direction [degrees] and sigma [m] of the edge of a pavement that was found at v_m, turned by turn_deg."""
    turn = np.deg2rad(turn_deg)
    vx, vy, v, sigma = edge_before_shadow(
        work, len(work), (-np.sin(turn), np.cos(turn)), v_m, (1.0, 0.5), EDGE_NEAR_BINS
    )
    return v, np.rad2deg(np.arctan2(-vx, vy)), sigma


def test_an_edge_lies_where_the_shadow_of_the_pavement_begins():
    # A verge 0.10 m lower, and 0.10 x 5 / 2.4 = 0.21 m of it hidden
    seen = [place(seed, lambda v: np.where(v < 0.0, -0.10, 0.0), seen_from_m=5.0) for seed in range(8)]
    for turn_deg, v_m in (
        (0.0, -0.10),
        (15.0, -0.10),
        (-15.0, -0.10),
        (0.0, 0.0),
        (0.0, -0.18),
        (0.0, -0.20),
    ):
        v, direction, sigma = np.transpose([edge_found(work, v_m, turn_deg) for work in seen])
        assert np.all(sigma > 0.0)
        assert np.all(np.abs(v) <= 0.03)
        assert np.all(np.abs(direction) <= 7.0)
        assert np.sqrt(np.mean((v / sigma) ** 2)) < 1.5


def test_a_pavement_as_high_as_its_verge_has_no_shadow():
    found = [
        edge_found(place(seed, np.zeros_like, seen_from_m=5.0), v)[2]
        for seed in range(20)
        for v in (-0.1, 0.1)
    ]
    assert np.count_nonzero(found) <= 2


def test_gaps_between_rows_of_points_are_no_shadow():
    rng = np.random.default_rng(4)
    v = np.repeat(np.arange(-0.7, 0.71, 0.2), 60)
    work = np.column_stack(
        [rng.uniform(-0.8, 0.8, len(v)), v, rng.normal(0.0, 0.003, len(v)), np.ones(len(v))]
    )
    work[:, 1] += rng.normal(0.0, 0.01, len(v))
    assert edge_found(work, 0.0)[2] == edge_found(work, -0.1)[2] == 0.0


@pytest.mark.parametrize("v_m", [0.0, -0.02])
def test_where_points_end_there_is_no_shadow(v_m):
    for seed in range(8):
        rng = np.random.default_rng(seed)
        u, v = rng.uniform(-0.8, 0.8, 1000), rng.uniform(0.0, 0.8, 1000)
        work = np.column_stack([u, v, rng.normal(0.0, 0.003, 1000), np.ones(1000)])
        assert edge_found(work, v_m)[2] == 0.0
