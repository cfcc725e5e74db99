"""Boxes on paint do not depend on how the survey is cut into tiles, nor on the order of its points."""

from __future__ import annotations

import dataclasses

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.scenes.effort import examples
from tests.scenes.paint_scenes import EAST_M, NORTH_M, Stripe, level_surface, road_points, tile_of

from linework.methods.obb.marking import MARKING_REACH_M, MarkingConfig, find_marking_boxes
from linework.model.boxes import BOX_COLUMNS, BoxSet
from linework.model.grid import Bounds
from linework.model.ground import Ground
from linework.model.points import Points
from linework.model.tile import TileData

SIZE_M = 24.0
PAINT = [
    Stripe((1.0, 2.0), (23.0, 9.0)),
    Stripe((1.0, 12.0), (23.0, 12.0), 0.15, 1.5),
    Stripe((5.0, 1.0), (6.0, 23.0), 0.3, 3.0),
    Stripe((14.0, 14.0), (18.0, 14.0), 0.5),
]


def survey() -> TileData:
    rng = np.random.default_rng(7)
    dense = road_points(rng, PAINT, size_m=SIZE_M, per_m2=60.0)
    # Denser in the south; two passes, one of them darker
    xyz, intensity = dense[0], dense[1]
    keep = (xyz[:, 1] < 15.0) | (rng.random(len(xyz)) < 0.4)
    xyz, intensity = xyz[keep], intensity[keep]
    second = rng.random(len(xyz)) < 0.5
    intensity = np.floor(np.where(second, 0.5, 1.0) * intensity)
    order = np.lexsort((xyz[:, 0], xyz[:, 1]))
    return tile_of(xyz[order], intensity[order], np.where(second, 50.0, 10.0)[order])


WHOLE, SURFACE = survey(), level_surface(SIZE_M)
BOXES = find_marking_boxes(WHOLE, SURFACE, MarkingConfig())


def same_bytes(a: BoxSet, b: BoxSet) -> bool:
    return all(getattr(a, n).tobytes() == getattr(b, n).tobytes() for n in ("centre", "u", *BOX_COLUMNS))


def inside(boxes: BoxSet, bounds: Bounds) -> BoxSet:
    world = boxes.centre[:, :2] + np.array(WHOLE.origin[:2] if WHOLE.origin else (0.0, 0.0))
    x, y = world.T
    return boxes.take((x >= bounds.west) & (x < bounds.east) & (y >= bounds.south) & (y < bounds.north))


def part_of_surface(bounds: Bounds) -> Ground:
    g = SURFACE.grid
    c0, c1 = int((bounds.west - g.east_m) // 0.5), int(-(-(bounds.east - g.east_m) // 0.5))
    r0, r1 = int((g.north_m - bounds.north) // 0.5), int(-(-(g.north_m - bounds.south) // 0.5))
    r0, c0 = max(r0, 0), max(c0, 0)
    part = slice(r0, r1), slice(c0, c1)
    road = SURFACE.road_m[part]
    grid = dataclasses.replace(
        g,
        east_m=g.east_m + 0.5 * c0,
        north_m=g.north_m - 0.5 * r0,
        n_rows=road.shape[0],
        n_cols=road.shape[1],
    )
    return Ground(grid, 0.0, road, road, SURFACE.is_road[part], SURFACE.is_road[part])


def tile_over(core: Bounds) -> tuple[TileData, Ground]:
    extent = core.grown(MARKING_REACH_M)
    x, y = WHOLE.points.xyz[:, 0], WHOLE.points.xyz[:, 1]
    held = (x >= extent.west) & (x < extent.east) & (y >= extent.south) & (y < extent.north)
    tile = TileData("part", core, WHOLE.points.take(held), origin=WHOLE.origin)
    return tile, part_of_surface(extent.grown(1.0))


def test_there_is_something_to_compare() -> None:
    assert len(BOXES) > 120 and len(set(BOXES.form.tolist())) == 2


@settings(max_examples=examples(12), deadline=None)
@given(st.integers(0, 30), st.integers(0, 30), st.integers(4, 30), st.integers(4, 30))
def test_boxes_are_the_same_in_every_tile(west: int, south: int, width: int, height: int) -> None:
    core = Bounds(
        EAST_M + 0.5 * west,
        NORTH_M + 0.5 * south,
        EAST_M + 0.5 * (west + width),
        NORTH_M + 0.5 * (south + height),
    )
    boxes = find_marking_boxes(*tile_over(core), MarkingConfig())
    assert same_bytes(inside(boxes, core), inside(BOXES, core))


@settings(max_examples=examples(5), deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_the_order_of_the_file_does_not_matter(seed: int) -> None:
    # The store gives points in canonical order: sorted again, they are the same points
    mixed = np.random.default_rng(seed).permutation(len(WHOLE.points))
    xyz = WHOLE.points.xyz[mixed]
    points = WHOLE.points.take(mixed[np.lexsort((xyz[:, 0], xyz[:, 1]))])
    boxes = find_marking_boxes(dataclasses.replace(WHOLE, points=points), SURFACE, MarkingConfig())
    assert same_bytes(boxes, BOXES)


@settings(max_examples=examples(5), deadline=None)
@given(st.floats(1e-3, 1e3))
def test_the_unit_of_intensity_does_not_matter(factor: float) -> None:
    points = WHOLE.points
    assert points.intensity is not None
    scaled = Points(
        points.xyz, intensity=(points.intensity * factor).astype(np.float32), time_s=points.time_s
    )
    boxes = find_marking_boxes(dataclasses.replace(WHOLE, points=scaled), SURFACE, MarkingConfig())
    assert len(boxes) == len(BOXES)
    np.testing.assert_allclose(boxes.centre, BOXES.centre, atol=1e-3)
