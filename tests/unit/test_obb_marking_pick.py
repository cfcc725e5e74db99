"""The paint at a picked place, and the reasons for none."""

from __future__ import annotations

import numpy as np
import pytest
from tests.paint_scenes import EAST_M, NORTH_M, Stripe, in_scene, level_surface, road_points, tile_of

from linework.methods.obb.marking import MarkingConfig
from linework.methods.obb.marking_pick import MarkingFound, marking_box_at
from linework.model.arrays import FloatArray
from linework.model.boxes import BoxSet

LINES = [Stripe((1.0, 4.0), (11.0, 4.0)), Stripe((1.0, 4.5), (11.0, 4.5))]


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(20)


def pick(xyz: FloatArray, intensity: FloatArray | None, x: float, y: float) -> tuple[BoxSet, MarkingFound]:
    return marking_box_at(tile_of(xyz, intensity), level_surface(), EAST_M + x, NORTH_M + y, MarkingConfig())


def test_a_pick_finds_the_nearest_line(rng: np.random.Generator) -> None:
    xyz, intensity = road_points(rng, LINES)
    for y, line in ((3.75, 0), (4.1, 0), (4.38, 1), (4.75, 1)):
        box, why = pick(xyz, intensity, 6.2, y)
        assert why == MarkingFound.FOUND and len(box) == 1
        assert np.abs(LINES[line].across(in_scene(box.centre))).max() < 0.01


def test_a_pick_on_bare_road_says_that_nothing_is_there(rng: np.random.Generator) -> None:
    xyz, intensity = road_points(rng, LINES)
    for x, y in ((6.2, 6.5), (3.0, 9.0), (8.1, 1.5)):
        box, why = pick(xyz, intensity, x, y)
        assert why == MarkingFound.NO_STRIPE and len(box) == 0


def test_a_pick_beside_the_data_says_so(rng: np.random.Generator) -> None:
    xyz, intensity = road_points(rng, LINES)
    assert pick(xyz, intensity, 30.0, 4.0)[1] == MarkingFound.TOO_FEW_POINTS
    near = np.hypot(*(xyz[:, :2] - [6.0, 4.0]).T) > 3.5
    assert pick(xyz[near], intensity[near], 6.0, 4.0)[1] == MarkingFound.TOO_FEW_POINTS


def test_points_without_intensities_have_no_paint(rng: np.random.Generator) -> None:
    xyz, intensity = road_points(rng, LINES)
    assert pick(xyz, None, 6.0, 4.0)[1] == MarkingFound.NO_BRIGHT
    assert pick(xyz, np.zeros_like(intensity), 6.0, 4.0)[1] == MarkingFound.NO_BRIGHT
