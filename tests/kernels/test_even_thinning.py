"""Points thinned evenly: as many as are wanted, everywhere, and always the same."""

from __future__ import annotations

import numpy as np

from linework.kernels.cells.even_thinning import evenly_thinned, sampling_keys


def test_never_more_than_wanted_and_not_far_fewer():
    rng = np.random.default_rng(0)
    xyz = rng.normal(0.0, (30.0, 10.0, 0.1), (40_000, 3)).astype(np.float32)
    for most in (1, 10, 500, 20_000, 40_000, 10**6):
        kept = evenly_thinned(xyz, most)
        assert len(kept) <= most
        assert len(kept) >= 0.5 * min(most, len(xyz))
        assert len(np.unique(kept)) == len(kept)


def test_dense_places_are_thinned_first():
    rng = np.random.default_rng(1)
    dense = rng.uniform(0.0, 5.0, (50_000, 3)) * [1, 1, 0]
    sparse = rng.uniform(0.0, 5.0, (300, 3)) * [1, 1, 0] + [20.0, 0.0, 0.0]
    xyz = rng.permutation(np.concatenate([dense, sparse])).astype(np.float32)
    kept = xyz[evenly_thinned(xyz, 2000)]
    # 300 of 50,300 by lot would be 12
    assert (kept[:, 0] > 10.0).sum() > 200


def test_lots_depend_on_the_point_alone():
    rng = np.random.default_rng(2)
    x, y, z = rng.uniform(0.0, 64.0, (3, 5000)).astype(np.float32)
    bright = rng.integers(0, 65536, 5000).astype(np.uint16)
    order = rng.permutation(5000)
    drawn = sampling_keys(x, y, z, bright, 7)
    np.testing.assert_array_equal(sampling_keys(x[order], y[order], z[order], bright[order], 7), drawn[order])
    assert len(np.unique(drawn)) == 5000
    assert abs(np.mean(drawn / 2.0**64) - 0.5) < 0.03
    assert not np.array_equal(sampling_keys(x, y, z, bright, 8), drawn)
