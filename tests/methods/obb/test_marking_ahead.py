"""Stripes that go on where hardly a point is bright: found from the stripe before them, in every tile alike."""

from __future__ import annotations

import numpy as np
import pytest
from tests.scenes.paint_scenes import EAST_M, NORTH_M, Stripe, in_scene, level_surface, road_points, tile_of

from linework.arrays import FloatArray
from linework.kernels.paint.stripes import STRIPE_HALF_V, STRIPE_UX, STRIPE_UY, STRIPE_X, STRIPE_Y
from linework.kernels.paint.stripes_ahead import SCALES_AHEAD, t_ahead
from linework.methods.obb import marking
from linework.methods.obb.kerbs_and_edges import local_origin_of
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


def test_paint_that_is_measured_along_its_line_counts_once() -> None:
    """The first look's box on the same paint in the same cell goes; what lies beside, across or elsewhere stays."""
    places = [(0.20, 0.25, 0.0), (0.30, 0.26, 0.05), (0.25, 0.40, 0.0), (0.25, 0.25, 1.57), (0.75, 0.25, 0.0)]
    found, lattice = np.zeros((len(places), 24)), (0.5, 0, 0, 4, 4)
    for row, (x, y, turn) in zip(found, places, strict=True):
        row[[STRIPE_X, STRIPE_Y, STRIPE_UX, STRIPE_UY]] = x, y, np.cos(turn), np.sin(turn)
    grown = np.concatenate([found[[2]], found[[0]]])
    assert marking._measured_again(found, grown[1:], lattice).tolist() == [True, True, False, False, False]
    assert marking._measured_again(found, grown, lattice).tolist() == [True, True, True, False, False]
    assert not marking._measured_again(found, found[:0], lattice).any()


def test_the_mean_ahead_tells_paint_from_bare_road() -> None:
    """Against noise: near zero on bare road, clear on worn paint, none where there are too few points."""
    for stripes, low, high in (((CRISP,), -4.0, 4.0), ((CRISP, WORN), 6.0, np.inf)):
        tile = road_with(*stripes)
        surface = level_surface()
        paint = marking.PaintPoints.of(tile.points, surface, local_origin_of(tile), MarkingConfig(), None)
        found = find_marking_boxes(road_with(CRISP), surface, MarkingConfig())
        last = found.take([int(np.argmax(in_scene(found.centre)[:, 0]))])
        row = np.zeros(24)
        row[[STRIPE_X, STRIPE_Y]] = last.centre[0, :2]
        row[[STRIPE_UX, STRIPE_UY, STRIPE_HALF_V]] = 1.0, 0.0, 0.06
        assert low < t_ahead(paint.rows, paint.starts, paint.lattice, row, 1.0, 1.0) < high
        row[STRIPE_Y] += 1000.0
        assert np.isnan(t_ahead(paint.rows, paint.starts, paint.lattice, row, 1.0, 1.0))


def test_sparse_points_are_compared_over_longer_windows() -> None:
    """15 points a square metre, as from the air: a metre of paint has too few, four metres have enough."""
    rng, surface, row = np.random.default_rng(5), level_surface(), np.zeros(24)
    for width, low, high in ((0.3, 4.0, np.inf), (0.001, -4.0, 4.0)):
        tile = tile_of(*road_points(rng, [Stripe((0.2, 6.1), (11.8, 6.1), width)], per_m2=15.0))
        paint = marking.PaintPoints.of(tile.points, surface, local_origin_of(tile), MarkingConfig(), None)
        row[[STRIPE_X, STRIPE_Y]] = np.add((3.0, 6.1), (EAST_M, NORTH_M)) - local_origin_of(tile)[:2]
        row[[STRIPE_UX, STRIPE_UY, STRIPE_HALF_V]] = 1.0, 0.0, 0.15
        t = [t_ahead(paint.rows, paint.starts, paint.lattice, row, 1.0, scale) for scale in SCALES_AHEAD]
        assert np.isnan(t[0]) and low < t[-1] < high


@pytest.mark.parametrize("west_m", [1.5, 5.55, 6.05, 6.55, 7.05, 7.55, 8.05])
@pytest.mark.parametrize("is_sparse", [False, True])
def test_a_tile_has_the_boxes_that_grow_into_it(west_m: float, is_sparse: bool) -> None:
    whole = road_with(CRISP, Stripe(WORN.start, (10.0, 6.1), 0.12, 1.34))
    if is_sparse:
        # Across the cells: 10 degrees from their rows
        stripes = Stripe((0.2, 5.1), (5.0, 5.95), 0.3, 1.6), Stripe((5.0, 5.95), (11.0, 7.0), 0.3, 1.35)
        whole = tile_of(*road_points(np.random.default_rng(6), stripes, per_m2=30.0))
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
