"""Stations beside each other, against the same in numpy."""

from __future__ import annotations

import numpy as np
import pytest

from linework.kernels.tracking.beside import stations_beside


@pytest.mark.parametrize("seed", range(10))
def test_stations_of_other_lines_within_reach_and_direction_are_beside(seed: int) -> None:
    rng = np.random.default_rng(seed)
    xy, angle = rng.uniform(0.0, 12.0, (60, 2)), rng.uniform(-0.6, 0.6, 60) + np.pi * rng.integers(0, 2, 60)
    normal, owner = np.column_stack([np.cos(angle), np.sin(angle)]), rng.integers(0, 5, 60)
    pairs = np.column_stack(np.triu_indices(60, 1)).astype(np.int64)
    found, how = stations_beside(pairs, owner, xy, normal, (1.5, 6.0, 0.866))

    a, b = np.concatenate([pairs, pairs[:, ::-1]]).T
    step = xy[b] - xy[a]
    across, facing = np.sum(step * normal[a], axis=1), np.sum(normal[a] * normal[b], axis=1)
    along = np.abs(step[:, 0] * normal[a, 1] - step[:, 1] * normal[a, 0])
    beside = (owner[a] != owner[b]) & (along <= 1.5) & (np.abs(across) <= 6.0) & (np.abs(facing) > 0.866)
    assert np.array_equal(found, np.column_stack([a, b])[beside])
    assert np.array_equal(how, np.column_stack([across, facing])[beside])
    assert 0 < len(found) < len(a)
