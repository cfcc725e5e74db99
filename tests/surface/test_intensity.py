"""Normalised intensity on a made-up road: asphalt is 1 wherever the scanner was, the better the more is known."""

from __future__ import annotations

import numpy as np
import pytest

from linework.kernels.cells import intensity as kernels
from linework.model.grid import Grid
from linework.model.ground import Ground
from linework.model.points import Points
from linework.model.trajectory import Trajectory
from linework.surface.intensity import (
    Tier,
    fit_views,
    full_scale,
    local_level,
    normalised_intensity,
    path_at_scanner,
    scanner_track,
    share_of_counts,
    view_of,
)

ORIGIN = np.array([500_000.0, 5_800_000.0, 100.0])
LENGTH_M, SPEED, MOUNT_M = 60.0, 10.0, 2.2


def flat_surface() -> Ground:
    grid = Grid(ORIGIN[0] - 10.0, ORIGIN[1] + 12.0, 0.5, 0.5, 48, 160)
    zero, yes = np.zeros(grid.shape, np.float32), np.ones(grid.shape, bool)
    return Ground(grid, ORIGIN[2], zero, zero, yes, yes)


def path(behind_m: float = 0.0) -> Trajectory:
    t = np.arange(0.0, LENGTH_M / SPEED + 0.05, 0.1)
    xyz = ORIGIN + np.column_stack([SPEED * t + behind_m, np.zeros(len(t)), np.zeros(len(t))])
    return Trajectory(t, xyz)


def drive(seed: int = 3) -> tuple[Points, np.ndarray, np.ndarray]:
    """Points of a profile scanner over a road 12 m wide; which are paint, and which asphalt."""
    rng = np.random.default_rng(seed)
    n = 200_000
    t = np.sort(rng.uniform(0.0, LENGTH_M / SPEED, n))
    across = MOUNT_M * np.tan(rng.uniform(-1.35, 1.35, n))
    keep = np.abs(across) < 9.0
    t, across = t[keep], across[keep]
    xyz = ORIGIN + np.column_stack([SPEED * t, across, rng.normal(0, 0.004, len(t))])
    reach = np.hypot(across, MOUNT_M)
    paint = (np.abs(across - 1.75) < 0.06) | (np.abs(across + 5.0) < 0.06)
    verge = np.abs(across) > 6.0
    drift = 1.0 + 0.3 * np.sin(2.0 * np.pi * t / 6.0)
    value = 8000.0 * np.where(verge, 3.0, np.where(paint, 2.2, 1.0)) / reach * (MOUNT_M / reach) ** 0.5
    value *= drift * (1.0 + 0.1 * rng.normal(size=len(t)))
    return (
        Points(xyz, intensity=np.clip(value, 1, 65535).astype(np.float32), time_s=t),
        paint,
        ~paint & ~verge,
    )


POINTS, PAINT, ASPHALT = drive()
SURFACE = flat_surface()


def spread(value: np.ndarray) -> float:
    low, middle, high = np.percentile(value[ASPHALT], [16, 50, 84])
    return float((high - low) / middle / 2.0)


def f1(value: np.ndarray, threshold: float) -> float:
    on_road = PAINT | ASPHALT
    found, true = (value > threshold) & on_road, PAINT
    return 2.0 * float((found & true).sum()) / float(found.sum() + true.sum())


def test_asphalt_spreads_less_the_more_is_known() -> None:
    known, tier = normalised_intensity(POINTS, SURFACE, path())
    assert tier is Tier.TRAJECTORY
    estimated, tier = normalised_intensity(POINTS, SURFACE)
    assert tier is Tier.TRACK
    local, tier = normalised_intensity(Points(POINTS.xyz, intensity=POINTS.intensity), SURFACE)
    assert tier is Tier.LOCAL
    spreads = [spread(v) for v in (known, estimated, local, POINTS.intensity)]
    assert spreads[0] <= 1.02 * spreads[1] and spreads[1] < spreads[2] < spreads[3]
    assert spreads[0] < 0.12  # the texture alone has 0.10
    assert np.median(known[ASPHALT]) == pytest.approx(1.0, abs=0.05)


def test_a_threshold_finds_more_paint() -> None:
    best = max(f1(POINTS.intensity, t) for t in np.percentile(POINTS.intensity, np.arange(50, 100)))
    for points, trajectory in (
        (POINTS, path()),
        (POINTS, None),
        (Points(POINTS.xyz, intensity=POINTS.intensity), None),
    ):
        assert f1(normalised_intensity(points, SURFACE, trajectory)[0], 1.5) > best + 0.05


def test_the_order_of_the_points_does_not_matter() -> None:
    order = np.random.default_rng(1).permutation(len(POINTS))
    for trajectory in (path(), None):
        straight = normalised_intensity(POINTS, SURFACE, trajectory)[0]
        mixed = normalised_intensity(POINTS.take(order), SURFACE, trajectory)[0]
        assert np.array_equal(straight[order], mixed)


def test_counts_of_parts_add_up() -> None:
    reach, cosine = view_of(POINTS, path(), SURFACE)
    chosen = np.ones(len(POINTS), bool)
    part = np.arange(len(POINTS)) % 3 == 0
    whole = kernels.count_views(POINTS.intensity, reach, cosine, chosen)
    parts = [kernels.count_views(POINTS.intensity, reach, cosine, p) for p in (part, ~part)]
    assert whole.sum() > 0 and np.array_equal(whole, parts[0] + parts[1])


def test_views_agree_with_interpolation() -> None:
    slope = np.array([0.06, -0.03])
    rng = np.random.default_rng(5)
    xyz = np.column_stack([rng.uniform(0, 60, 500), rng.uniform(-9, 9, 500), np.zeros(500)])
    xyz[:, 2] = xyz[:, :2] @ slope
    time_s = rng.uniform(-1.0, 7.0, 500)
    rows, cols = np.indices(SURFACE.grid.shape)
    heights = (0.5 * cols - 9.75) * slope[0] + (11.75 - 0.5 * rows) * slope[1]
    tilted = Ground(
        SURFACE.grid,
        ORIGIN[2],
        heights.astype(np.float32),
        SURFACE.ground_m,
        SURFACE.is_road,
        SURFACE.is_ground,
    )
    way = path()
    reach, cosine = view_of(Points(xyz + ORIGIN, intensity=None, time_s=time_s), way, tilted, mount_m=2.5)
    at = np.stack([np.interp(time_s, way.time_s, c) for c in way.xyz.T], axis=1) + np.array([0.0, 0.0, 2.5])
    beam = at - (xyz + ORIGIN)
    normal = np.array([-slope[0], -slope[1], 1.0]) / np.sqrt(1.0 + slope @ slope)
    known = (time_s >= 0.0) & (time_s <= way.time_s[-1])
    assert np.array_equal(np.isnan(reach), ~known)
    np.testing.assert_allclose(reach[known], np.linalg.norm(beam, axis=1)[known], rtol=1e-5)
    twin = np.abs(beam @ normal) / np.linalg.norm(beam, axis=1)
    np.testing.assert_allclose(cosine[known], twin[known], atol=1e-3)


def test_points_beyond_the_paths_times_are_normalised_by_their_place() -> None:
    way = path()
    half = Trajectory(way.time_s[:30], way.xyz[:30])
    value, tier = normalised_intensity(POINTS, SURFACE, half)
    assert tier is Tier.TRAJECTORY and np.isfinite(value).all()
    late = POINTS.time_s > 3.5
    assert np.median(value[late & ASPHALT]) == pytest.approx(1.0, abs=0.1)


def test_the_level_is_that_of_asphalt_and_not_of_the_verge() -> None:
    reach, cosine = view_of(POINTS, path(), SURFACE)
    counts = kernels.count_views(POINTS.intensity, reach, cosine, np.ones(len(POINTS), bool))
    level = fit_views(counts).of(reach, cosine)
    near, far = ASPHALT & (reach < 3.0), (reach > 8.0)
    # To the power 1.5 in all
    ratio = np.median(level[near] * reach[near] ** 1.5) / np.median(level[far] * reach[far] ** 1.5)
    assert ratio == pytest.approx(1.0, abs=0.2)


def test_the_track_is_under_the_scanner() -> None:
    track = scanner_track(POINTS)
    assert track is not None
    t = np.linspace(0.5, 5.5, 50)
    x, y = (np.interp(t, track.time_s, track.xyz[:, k]) - ORIGIN[k] for k in (0, 1))
    assert np.abs(x - SPEED * t).max() < 0.5 and np.abs(y).max() < 0.3
    # Where the scanner looks down is told to centimetres by a whole path
    way = path_at_scanner(path(behind_m=1.8), track)
    off = way.xyz - path().xyz
    assert np.abs(np.median(off, axis=0)).max() < 0.05


def test_no_track_without_times_or_from_few_points() -> None:
    assert scanner_track(Points(POINTS.xyz)) is None
    assert scanner_track(POINTS.take(slice(0, 20))) is None
    assert np.array_equal(path_at_scanner(path(), None).xyz, path().xyz)
    far = Trajectory(path().time_s, path().xyz + np.array([0.0, 30.0, 0.0]))
    assert np.array_equal(path_at_scanner(path(), far).xyz, path().xyz)  # not believed


def test_what_is_recorded_at_full_scale_takes_no_part_in_a_level() -> None:
    scaled = np.minimum(np.floor(POINTS.intensity / 20.0), 255.0).astype(np.float32)
    assert full_scale(scaled) == 255.0 and full_scale(POINTS.intensity) == 65535.0
    saturated = scaled == 255.0
    assert saturated.any()
    value, _ = normalised_intensity(
        Points(POINTS.xyz, intensity=scaled, time_s=POINTS.time_s), SURFACE, path()
    )
    assert np.median(value[ASPHALT]) == pytest.approx(1.0, abs=0.05)


def test_blocks_with_few_points_take_the_nearest_level() -> None:
    xyz = np.array([[0.5, 0.5, 0.0]] * 50 + [[9.5, 0.5, 0.0]] * 3)
    value = np.array([10.0] * 50 + [90.0] * 3, dtype=np.float32)
    level = local_level(xyz, value, np.ones(53, bool), 2.0, 0.5)
    np.testing.assert_allclose(level, 10.0, rtol=0.05)
    assert np.isnan(local_level(xyz, value, np.zeros(53, bool), 2.0, 0.5)).all()


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_percentiles_from_counts(share: float) -> None:
    value = np.random.default_rng(2).lognormal(5.0, 0.5, 4000)
    counts = np.bincount([kernels.bin_of(v) for v in value], minlength=kernels.N_INTENSITY_BINS)
    assert share_of_counts(counts, share) == pytest.approx(np.quantile(value, share), rel=0.02)


def test_nothing_to_normalise() -> None:
    with pytest.raises(ValueError, match="the points have none"):
        normalised_intensity(Points(POINTS.xyz), SURFACE)
    with pytest.raises(ValueError, match="the points have none"):
        view_of(Points(POINTS.xyz), path(), SURFACE)
    empty = POINTS.take(slice(0, 0))
    assert len(normalised_intensity(empty, SURFACE, path())[0]) == 0
