"""Rails with two beams on a post, and walls as low as a rail."""

from __future__ import annotations

import numpy as np
import pytest
from tests.scenes.rail_scenes import beam, extract, posts, rail, scene, sheet

#: Middles of two beams on one post: the upper one ends 0.42 m above the lower one.
LOWER_M, UPPER_M = 0.72, 1.14


def lid(rng, u, top_m, thick_m):
    """The level top of a wall, seen from above."""
    n = 36 * 60
    return np.column_stack(
        [rng.uniform(2.0, 38.0, n), u + rng.uniform(0.0, thick_m, n), top_m + rng.normal(0, 0.005, n)]
    )


@pytest.mark.parametrize("seed", [9971, 9972, 9973])
def test_two_beams_one_above_the_other_are_one_rail_with_two(seed):
    rng = np.random.default_rng(seed)
    two = [beam(rng, (2.0, 38.0), 5.0, top_m=top) for top in (LOWER_M, UPPER_M)]
    (line,) = extract(scene(rng, *two, posts(rng, (2.0, 38.0), 5.09, UPPER_M)))
    assert (line.kind, line.form, line.n_beams) == ("guardrail", "w_beam", 2.0)
    assert np.median(line.xyz[:, 2]) == pytest.approx(UPPER_M, abs=0.03)
    assert np.ptp(line.xyz[:, 0]) > 34.0


@pytest.mark.parametrize("seed", [9974, 9975])
def test_two_flat_boards_of_the_height_of_beams_are_no_guardrail(seed):
    rng = np.random.default_rng(seed)
    two = [
        sheet(rng, (2.0, 38.0), lambda h: 5.0 + 0 * h, (top - 0.31, top), 150) for top in (LOWER_M, UPPER_M)
    ]
    assert len(extract(scene(rng, *two))) == 0


@pytest.mark.parametrize("seed", [9976, 9978])
@pytest.mark.parametrize("top_m", [0.45, 0.55])
def test_a_wall_as_low_as_a_rail_is_none(top_m, seed):
    rng, thick_m = np.random.default_rng(seed), 0.25
    face = sheet(rng, (2.0, 38.0), lambda h: 5.0 + 0 * h, (0.0, top_m), 250)
    behind = sheet(rng, (2.0, 38.0), lambda h: 5.0 + thick_m + 0 * h, (0.1, 0.2), 20)
    found = extract(scene(rng, face, lid(rng, 5.0, top_m, thick_m), behind))
    assert [line.kind for line in found] == []


def test_twigs_behind_the_top_of_a_rail_leave_it():
    rng = np.random.default_rng(9977)
    n = 1500
    twigs = np.column_stack([rng.uniform(2.0, 38.0, n), rng.uniform(5.1, 5.4, n), rng.uniform(0.5, 0.75, n)])
    (line,) = extract(scene(rng, rail(rng), twigs))
    assert line.kind == "guardrail"
    assert line.confidence > 0.5
