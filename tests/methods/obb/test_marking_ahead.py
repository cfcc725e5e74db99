"""Stripes that go on where hardly a point is bright: found from the stripe before them, in every tile alike."""

from __future__ import annotations

import numpy as np
import pytest
from tests.scenes.paint_scenes import EAST_M, NORTH_M, Stripe, in_scene, level_surface, road_points, tile_of

from linework.arrays import FloatArray
from linework.methods.obb import marking
from linework.methods.obb.marking import MARKING_REACH_M, MarkingConfig, find_marking_boxes
from linework.model.boxes import BOX_COLUMNS, BoxForm, BoxSet
from linework.model.grid import Bounds
from linework.model.tile import TileData

#: Crisp paint, and what is left of it behind: twice the noise of a point.
CRISP, WORN = Stripe((0.2, 6.1), (6.0, 6.1)), Stripe((6.0, 6.1), (11.0, 6.1), 0.12, 1.4)


def road_with(*stripes: Stripe) -> TileData:
    return tile_of(*road_points(np.random.default_rng(4), stripes, per_m2=900.0, noise=0.2))


def sure_along(boxes: BoxSet) -> FloatArray:
    places = in_scene(boxes.take((boxes.form == BoxForm.STRIPE) & (boxes.score > 0.5)).centre)
    return np.asarray(np.sort(places[np.abs(places[:, 1] - 6.1) < 0.05, 0]))


def test_worn_paint_is_followed_from_the_crisp_paint_before_it(monkeypatch: pytest.MonkeyPatch) -> None:
    tile, surface = road_with(CRISP, WORN), level_surface()
    ahead = sure_along(find_marking_boxes(tile, surface, MarkingConfig()))
    monkeypatch.setattr(marking, "CELLS_AHEAD", 0)
    without = sure_along(find_marking_boxes(tile, surface, MarkingConfig()))
    assert np.diff(ahead).max() < 0.55 and ahead.max() > 10.5, "a box in every cell, to the end of the paint"
    assert np.diff(without).max() > 0.9
    assert len(ahead) >= len(without) + 2


def test_a_stripe_that_ends_is_followed_no_further() -> None:
    boxes = find_marking_boxes(road_with(CRISP), level_surface(), MarkingConfig())
    assert sure_along(boxes).max() < 6.0


@pytest.mark.parametrize("west_m", [1.5, 5.55, 6.05, 6.55, 7.05, 7.55, 8.05])
def test_a_tile_has_the_boxes_that_grow_into_it(west_m: float) -> None:
    whole = road_with(CRISP, Stripe(WORN.start, (10.0, 6.1), 0.12, 1.34))
    core = Bounds(EAST_M + west_m, NORTH_M + 4.0, EAST_M + west_m + 2.0, NORTH_M + 8.0)
    reach, xyz = core.grown(MARKING_REACH_M), whole.points.xyz
    held = (xyz[:, 0] >= reach.west) & (xyz[:, 0] < reach.east)
    held &= (xyz[:, 1] >= reach.south) & (xyz[:, 1] < reach.north)
    part = TileData("part", core, whole.points.take(held), origin=whole.origin)
    inside = [
        of_core(find_marking_boxes(tile, level_surface(), MarkingConfig()), core) for tile in (whole, part)
    ]
    assert len(inside[0])
    for column in ("centre", "u", *BOX_COLUMNS):
        assert getattr(inside[0], column).tobytes() == getattr(inside[1], column).tobytes(), column


def of_core(boxes: BoxSet, core: Bounds) -> BoxSet:
    x, y = (in_scene(boxes.centre) + np.array((EAST_M, NORTH_M))).T
    return boxes.take((x >= core.west) & (x < core.east) & (y >= core.south) & (y < core.north))
