"""Laws of the guardrails: what does not change what is there does not change the lines."""

import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree
from tests.scenes import rail_scenes as made
from tests.scenes.effort import examples
from tests.scenes.rail_scenes import extract, rail_scene, straight

few = settings(
    max_examples=examples(15), deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow]
)
seeds = st.integers(0, 1000)
WITHIN_M = 0.02


def two_rails(seed):
    """Rails on both sides of a road of 36 m, one of them with a bush behind it."""
    rng = np.random.default_rng(seed)
    bush = made.hedge(rng, (14.0, 20.0), (5.06, 5.9), (0.0, 1.0))
    other = made.rail(rng, (2.0, 34.0), -4.5, faces=1, top_m=0.80)
    return rail_scene(rng, other, s=(2.0, 34.0), behind=[bush])


def farthest_m(lines, reference):
    """Largest distance of vertices from the reference's lines in plan [m]; its lines at every centimetre."""
    dense = []
    for i in range(len(reference)):
        v = reference[i].xyz
        s = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(v[:, :2], axis=0).T))])
        at = np.arange(0.0, s[-1], 0.01)
        dense.append(np.column_stack([np.interp(at, s, v[:, k]) for k in (0, 1)]))
    return cKDTree(np.concatenate(dense)).query(lines.xyz[:, :2])[0]


def assert_same(lines, reference):
    """As many lines, within 2 cm across but for their last metre, whose end may move by a scan line."""
    assert sorted(lines.kind.tolist()) == sorted(reference.kind.tolist())
    assert np.abs(np.sort(lines.length_m) - np.sort(reference.length_m)).max() < 1.5
    inner = [lines.take([i]) for i in range(len(lines))]
    for line in inner:
        distance = farthest_m(line, reference)
        assert distance[3:-3].max() < WITHIN_M


@few
@given(seeds, st.floats(0.0, 2 * np.pi))
def test_turning_the_scene_turns_the_lines(seed, angle_rad):
    suh = two_rails(seed)
    plain, turned = extract(straight(suh)), extract(straight(suh, angle_rad))
    assert len(plain) == 2
    cos, sin = np.cos(angle_rad), np.sin(angle_rad)
    back = turned.xyz @ np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    assert_same(turned.with_columns(xyz=back), plain)


@few
@given(seeds, seeds)
def test_the_order_of_the_points_does_not_matter(seed, order):
    xyz = straight(two_rails(seed), 0.4, (500_000.0, 5_800_000.0, 100.0))
    lines = extract(xyz)
    shuffled = extract(xyz[np.random.default_rng(order).permutation(len(xyz))])
    assert len(lines) == 2
    assert np.array_equal(lines.offsets, shuffled.offsets)
    assert np.abs(lines.xyz - shuffled.xyz).max() < 1e-9


@few
@given(seeds, seeds)
def test_stray_points_do_not_move_the_lines(seed, strays):
    xyz = straight(two_rails(seed), 0.2)
    low, high = xyz.min(axis=0), xyz.max(axis=0) + np.array([0.0, 0.0, 2.0])
    stray = np.random.default_rng(strays).uniform(low, high, (max(len(xyz) // 1000, 1), 3))
    lines = extract(xyz)
    assert len(lines) == 2
    assert_same(extract(np.concatenate([xyz, stray])), lines)


@few
@given(seeds, st.floats(-0.12, 0.12), st.floats(-0.06, 0.06))
def test_grade_and_crossfall_tilt_the_lines_with_the_road(seed, grade, crossfall):
    suh = two_rails(seed)
    xyz = straight(suh)
    xyz[:, 2] += grade * xyz[:, 0] + crossfall * xyz[:, 1]
    flat, tilted = extract(straight(suh)), extract(xyz)
    assert_same(tilted, flat)
    level = tilted.xyz[:, 2] - grade * tilted.xyz[:, 0] - crossfall * tilted.xyz[:, 1]
    expected = np.where(tilted.xyz[:, 1] > 0, made.TOP_M, 0.80)
    assert np.median(np.abs(level - expected)) < 0.02
