"""Boundary boxes do not depend on how the survey is cut into tiles."""

from __future__ import annotations

import dataclasses

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.scenes.effort import examples

from linework.methods.obb.kerbs_and_edges import BOUNDARY_REACH_M, BoundaryConfig, find_boundary_boxes
from linework.methods.obb.marking import MarkingConfig, find_marking_boxes
from linework.methods.obb.method import BOX_REACH_M
from linework.model.boxes import BOX_COLUMNS, BoxForm, BoxSet
from linework.model.grid import Bounds
from linework.model.ground import Ground
from linework.model.points import Points
from linework.model.tile import TileData
from linework.surface.road import RoadConfig, find_ground

ORIGIN = (499_200.0, 5_400_000.0, 0.0)
WEST, SOUTH, SIZE_M = 499_230.0, 5_400_030.0, 24.0


def survey() -> Points:
    """A carriageway between a kerb in the north and grass in the south, a little askew; two densities."""
    rng = np.random.default_rng(5)
    x, y = rng.uniform(0, SIZE_M, (2, 60_000))
    keep = (x < 14.0) | (rng.random(len(x)) < 0.25)
    x, y = x[keep], y[keep]
    v = y - 0.2 * x
    kerb = 0.12 * np.clip((v - 13.0) / 0.02, 0, 1)
    grass = np.where(v < 5.0, 0.03 * np.abs(rng.normal(size=len(x))), 0.0)
    z = 30.0 + 0.02 * x + kerb + grass + rng.normal(0, 0.004, len(x))
    intensity = np.where(v < 5.0, 900, 400) * rng.uniform(0.8, 1.2, len(x))
    time_s = 100.0 + x
    order = np.lexsort((x, y))
    xyz = np.column_stack([WEST + x, SOUTH + y, z])
    return Points(xyz[order], intensity=intensity[order].astype(np.float32), time_s=time_s[order])


POINTS = survey()
SURFACE = find_ground(POINTS, None, RoadConfig())
WHOLE = TileData("whole", POINTS.bounds, POINTS, origin=ORIGIN)
BOXES = find_boundary_boxes(WHOLE, SURFACE, BoundaryConfig())


def same_bytes(a: BoxSet, b: BoxSet) -> bool:
    return all(getattr(a, n).tobytes() == getattr(b, n).tobytes() for n in ("centre", "u", *BOX_COLUMNS))


def inside(boxes: BoxSet, b: Bounds) -> BoxSet:
    x, y = (boxes.centre[:, :2] + np.array(ORIGIN[:2])).T
    return boxes.take((x >= b.west) & (x < b.east) & (y >= b.south) & (y < b.north))


def part_of_surface(whole: Ground, b: Bounds) -> Ground:
    g = whole.grid
    c0, c1 = max(int((b.west - g.east_m) // 0.5), 0), int(-(-(b.east - g.east_m) // 0.5))
    r0, r1 = max(int((g.north_m - b.north) // 0.5), 0), int(-(-(g.north_m - b.south) // 0.5))
    part = slice(r0, r1), slice(c0, c1)
    grid = dataclasses.replace(
        g,
        east_m=g.east_m + 0.5 * c0,
        north_m=g.north_m - 0.5 * r0,
        n_rows=whole.road_m[part].shape[0],
        n_cols=whole.road_m[part].shape[1],
    )
    columns = (whole.road_m, whole.ground_m, whole.is_road, whole.is_ground)
    return Ground(grid, whole.z0_m, *(column[part] for column in columns))


def tile_over(
    core: Bounds, points: Points = POINTS, surface: Ground = SURFACE, reach_m: float = BOUNDARY_REACH_M
) -> tuple[TileData, Ground]:
    extent = core.grown(reach_m)
    x, y = points.xyz[:, 0], points.xyz[:, 1]
    held = (x >= extent.west) & (x < extent.east) & (y >= extent.south) & (y < extent.north)
    return TileData("part", core, points.take(held), origin=ORIGIN), part_of_surface(
        surface, extent.grown(2.0)
    )


def test_the_scene_has_both_forms():
    assert np.count_nonzero(BOXES.form == BoxForm.KERB) > 30
    assert np.count_nonzero(BOXES.form == BoxForm.EDGE) > 30


@settings(max_examples=examples(25), deadline=None)
@given(st.floats(0.0, 18.0), st.floats(0.0, 18.0), st.floats(1.0, 8.0), st.floats(1.0, 8.0))
def test_boxes_are_the_same_to_the_last_bit_in_every_tile(west, south, width, height):
    core = Bounds(WEST + west, SOUTH + south, WEST + west + width, SOUTH + south + height)
    tile, surface = tile_over(core)
    part = find_boundary_boxes(tile, surface, BoundaryConfig())
    assert same_bytes(inside(part, core), inside(BOXES, core))


def test_times_are_those_of_the_points_nearby():
    x = BOXES.centre[:, 0] - (WEST - ORIGIN[0])
    assert (BOXES.time_start_s >= 100.0 + x - 0.6).all() and (BOXES.time_end_s <= 100.0 + x + 0.6).all()
    assert (BOXES.time_start_s <= BOXES.time_end_s).all()


def flush_street() -> Points:
    """A street, a little askew, that ends flush at a bright gutter 0.4 m wide and at a bright kerb stone, 9 m apart."""
    rng = np.random.default_rng(6)
    x, y = rng.uniform(0, SIZE_M, (2, 200_000))
    v = y - 0.2 * x - 5.0
    off = np.maximum(np.maximum(-v, v - 9.0), 0.0)
    z = 30.0 + 0.02 * x + 0.02 * np.minimum(np.clip(v, 0, 9), 9 - np.clip(v, 0, 9)) + 0.025 * off
    is_bright = ((v > 0.0) & (v < 0.4)) | ((v > 9.0) & (v < 9.15))
    intensity = np.where(is_bright, 800, 400) * rng.uniform(0.8, 1.2, len(x))
    order = np.lexsort((x, y))
    xyz = np.column_stack([WEST + x, SOUTH + y, z + rng.normal(0, 0.004, len(x))])
    return Points(xyz[order], intensity=intensity[order].astype(np.float32), time_s=100.0 + x[order])


STREET = flush_street()
STREET_SURFACE = find_ground(STREET, None, RoadConfig())


def boxes_with_stripes(tile: TileData, surface: Ground) -> BoxSet:
    stripes = find_marking_boxes(tile, surface, MarkingConfig())
    return find_boundary_boxes(tile, surface, BoundaryConfig(), stripes=stripes)


WITH_STRIPES = boxes_with_stripes(TileData("whole", STREET.bounds, STREET, origin=ORIGIN), STREET_SURFACE)


def test_the_street_has_channels_that_only_stripes_show():
    alone = find_boundary_boxes(
        TileData("whole", STREET.bounds, STREET, origin=ORIGIN), STREET_SURFACE, BoundaryConfig()
    )
    v = (
        (WITH_STRIPES.centre[:, 1] - SOUTH + ORIGIN[1])
        - 0.2 * (WITH_STRIPES.centre[:, 0] - WEST + ORIGIN[0])
        - 5.0
    )
    is_channel = WITH_STRIPES.form == BoxForm.CHANNEL
    for edge in (0.0, 9.0):
        assert np.count_nonzero(is_channel & (np.abs(v - edge) < 0.1)) > 30
    assert np.count_nonzero(is_channel) > np.count_nonzero(alone.form == BoxForm.CHANNEL) + 30


@settings(max_examples=examples(15), deadline=None)
@given(st.floats(0.0, 18.0), st.floats(0.0, 18.0), st.floats(1.0, 8.0), st.floats(1.0, 8.0))
def test_boxes_beside_stripes_are_the_same_to_the_last_bit_in_every_tile(west, south, width, height):
    core = Bounds(WEST + west, SOUTH + south, WEST + west + width, SOUTH + south + height)
    part = boxes_with_stripes(*tile_over(core, STREET, STREET_SURFACE, BOX_REACH_M))
    assert same_bytes(inside(part, core), inside(WITH_STRIPES, core))


@settings(max_examples=examples(5), deadline=None)
@given(st.floats(2.0, 22.0))
def test_parts_of_a_core_have_the_boxes_of_the_whole(cut):
    tile = TileData("whole", STREET.bounds, STREET, origin=ORIGIN)
    b = STREET.bounds
    parts = [Bounds(b.west, b.south, WEST + cut, b.north), Bounds(WEST + cut, b.south, b.east, b.north)]
    stripes = find_marking_boxes(tile, STREET_SURFACE, MarkingConfig())
    found = find_boundary_boxes(tile, STREET_SURFACE, BoundaryConfig(), parts, stripes)
    for part in parts:
        assert same_bytes(inside(found, part), inside(WITH_STRIPES, part))
