"""Fences on small scenes made by hand: found from their upper edge, whatever their height."""

import numpy as np
import pytest
from tests.scenes import rail_scenes as made
from tests.scenes.rail_scenes import RADON, extract, prepare, scene, straight

from linework.methods.radon.method import Radon
from linework.methods.radon.seeds import find_seed_lines, split_into_segments
from linework.methods.rails.circles import find_starts

FENCES = Radon(RADON, kinds=("fence",))


def mesh(rng, top_m, s=(2.0, 38.0), u=5.0):
    """A fence of wire: a third of the rays return from it."""
    return made.sheet(rng, s, lambda h: u + 0 * h, (0.05, top_m), per_m=100 * top_m)


def lid(rng, top_m, s=(2.0, 38.0), u=(5.0, 5.25)):
    n = round(120 * (s[1] - s[0]))
    return np.column_stack([rng.uniform(*s, n), rng.uniform(*u, n), rng.normal(top_m, made.NOISE_M, n)])


@pytest.mark.parametrize("top_m", [0.95, 1.2, 1.45, 1.65])
@pytest.mark.parametrize("seed", [1, 2])
def test_a_fence_of_mesh_is_found_whatever_its_height(top_m, seed):
    rng = np.random.default_rng(seed)
    lines = extract(straight(scene(rng, mesh(rng, top_m)), 0.2), FENCES)
    assert [*zip(lines.kind, lines.form, strict=True)] == [("fence", "mesh")]
    assert lines.length_m[0] == pytest.approx(36.0, abs=1.5)
    assert lines.height_m[0] == pytest.approx(top_m, abs=0.04)
    u = lines.xyz[:, 1] * np.cos(0.2) - lines.xyz[:, 0] * np.sin(0.2)
    assert np.abs(u - 5.0).max() < 0.03


def test_a_fence_behind_which_nothing_is_seen_is_less_sure():
    rng = np.random.default_rng(3)
    fence = mesh(rng, 1.2)
    open_ = extract(straight(scene(rng, fence)), FENCES)
    closed = extract(straight(scene(rng, fence, screen=(5.0, (-9.0, 1.2)))), FENCES)
    assert open_.confidence[0] > 0.9
    assert closed.confidence[0] == pytest.approx(0.6, abs=0.05)


@pytest.mark.parametrize("top_m", [1.2, 3.0])
def test_a_wall_is_no_fence(top_m):
    rng = np.random.default_rng(4)
    wall = [made.wall(rng, top_m=top_m), *([lid(rng, top_m)] if top_m < 2.0 else [])]
    lines = extract(straight(scene(rng, *wall, screen=(5.0, (-9.0, top_m)))), FENCES)
    assert len(lines) == 0


def test_what_is_lower_than_a_sheet_and_stands_on_the_ground_gives_no_start():
    """What is seen below its edge is the ground, not a sheet that goes on."""
    rng = np.random.default_rng(5)
    p = prepare(straight(scene(rng, made.sheet(rng, (2.0, 38.0), lambda h: 5.0 + 0 * h, (0.0, 0.5), 80))))
    segments = split_into_segments(find_seed_lines(p.binary, RADON.seeds), p.binary, RADON.seeds)
    assert len(segments) > 0
    assert len(find_starts(segments, p.bins, RADON.circles)) == 0
