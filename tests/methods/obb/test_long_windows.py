"""Kerbs looked for over a longer stretch, where few points show none: what a long window may show, and how well."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from linework.kernels.boundaries.boundary_boxes import make_scratch
from linework.kernels.boundaries.kerbs.bends import follow_bend
from linework.kernels.boundaries.kerbs.boxes import kerb_in_cell, kerb_in_window
from linework.kernels.boundaries.kerbs.sides import measure_seen_step
from linework.kernels.boundaries.kerbs.steps import (
    CLEAREST_COLUMNS,
    MOST_TRIED,
    STEP_COLUMNS,
    STEP_FOOT,
    STEP_SIGMA_V,
    best_step,
)
from linework.kernels.boundaries.profiles import HALF_LENGTH_M, MOST_PLACE_POINTS, LocalFloor, gather_at
from linework.kernels.cells.places import (
    AREA_M,
    BOX_ELSEWHERE,
    BOX_FOUND,
    BOX_NO_ROAD,
    COLUMNS,
    S_V,
    S_Z,
    floor_near,
    gather_area,
    slope_at,
)
from linework.kernels.cells.surroundings import fit_surroundings
from linework.methods.obb.kerbs_and_edges import (
    BoundaryConfig,
    FloorPoints,
    find_boundary_boxes,
    kernel_settings,
)
from linework.model.boxes import BoxForm, BoxSet
from linework.model.points import Points
from linework.model.tile import TileData
from linework.surface.road import RoadConfig, find_ground

ORIGIN = (600_000.0, 5_400_000.0, 0.0)
OFFSET = (20.0, 20.0, 100.0)
#: Points a square metre, and their noise: in a metre of road and footway 20 points show no step of 5 cm.
FEW, NOISE_M = 12, 0.010


def few_points(rng, length_m=40.0, noise_m=NOISE_M, per_m2=FEW):
    """Plan positions u, v of a road from v = 0 to 5 m with 2 m beside it, and noise, (n,) each."""
    n = int(length_m * 7 * per_m2)
    return rng.uniform(0, length_m, n), rng.uniform(-2, 5, n), rng.normal(0, noise_m, n)


def tile_of(u, v, h):
    """A level road of points u, v, h, and its ground."""
    points = Points(np.column_stack([u, v, h]) + np.array(ORIGIN) + OFFSET)
    surface = find_ground(points, None, RoadConfig())
    return TileData("t", points.bounds, points, surface=surface, origin=ORIGIN), surface


def kerbs_of(u, v, h) -> BoxSet:
    """Kerb boxes of points of a level road, with centres as u, v, h."""
    tile, surface = tile_of(u, v, h)
    boxes = find_boundary_boxes(tile, surface, BoundaryConfig())
    kerbs = boxes.take(boxes.form == BoxForm.KERB)
    return replace(kerbs, centre=kerbs.centre - OFFSET)


class Looked:
    """A window of a given length about a place of a survey, and what the kernels make of it."""

    def __init__(self, u, v, h):
        tile, surface = tile_of(u, v, h)
        self.base = FloorPoints.of(tile.points, surface, ORIGIN)
        self.limits = kernel_settings(BoundaryConfig())
        self.box = np.full(COLUMNS, np.nan)

    def at(self, place):
        """Set floor, surroundings and search area of a place u, v."""
        data, self.scratch = self.base.data, make_scratch()
        self.place = place[0] + OFFSET[0], place[1] + OFFSET[1]
        plane, slopes = np.zeros(3), np.empty((4, 4))
        slope = slope_at(self.place, self.base.ground)
        noise, usual = floor_near(data.facets, data.span, *self.place, slope, plane)
        rise, _ = fit_surroundings(data.sums, data.span, self.place, plane, noise, slopes)
        self.floor = LocalFloor(plane, noise, *slope, usual, usual)
        self.around = slopes, rise
        self.area = gather_area(data.points, data.starts, data.span, self.place, plane, self.scratch.work)
        return self

    def in_window(self, times):
        """What a window so many times as long as the usual one shows; its box is in `box`."""
        data, (_, scale) = self.base.data, self.area
        half_u = times * HALF_LENGTH_M * scale
        radius = np.hypot(half_u, AREA_M * scale)
        n = gather_at(
            data.points, data.starts, data.span, self.place, radius, self.floor.plane, MOST_PLACE_POINTS,
            self.scratch.work,
        )  # fmt: skip
        return kerb_in_window(
            data, self.place, self.floor, self.around, (n, scale, half_u), self.limits, self.scratch, self.box
        )

    def in_cell(self, near_road=True):
        data = self.base.data._replace(near_road=np.full_like(self.base.data.near_road, near_road))
        return kerb_in_cell(
            data, self.place, self.floor, self.around, self.area, self.limits, self.scratch, self.box
        )


def seen_only_over_a_longer_stretch(seed, step_m=0.05, noise_m=0.012):
    """Places along a low kerb in noise where a kerb is found by the road, and none away from it."""
    u, v, noise = few_points(np.random.default_rng(seed), noise_m=noise_m)
    looked = Looked(u, v, np.where(v < 0, step_m, 0.0) + noise)
    places = [(at_u, at_v) for at_u in np.arange(3.25, 37.0, 0.5) for at_v in (-0.25, 0.25)]
    places = [p for p in places if looked.at(p).in_cell(near_road=False) != BOX_FOUND]
    return looked, [p for p in places if looked.at(p).in_cell() == BOX_FOUND]


def test_a_longer_stretch_is_looked_at_by_the_road_only():
    _, places = seen_only_over_a_longer_stretch(1)
    assert len(places) >= 5


def test_what_long_windows_show_is_as_unsure_as_what_it_errs_alike_with():
    looked, places = seen_only_over_a_longer_stretch(1)
    for place in places:
        looked.at(place).in_cell()
        in_cell = looked.box[[S_V, S_Z]]
        times = next(times for times in (2.0, 4.0) if looked.at(place).in_window(times) == BOX_FOUND)
        np.testing.assert_allclose(in_cell, looked.box[[S_V, S_Z]] * np.sqrt(times))


def test_a_long_step_rises_in_both_halves_of_its_window():
    at_end, along = [], []
    for seed in range(6):
        u, v, noise = few_points(np.random.default_rng(seed), noise_m=0.006, per_m2=40)
        looked = Looked(u, v, np.where((v < 0) & (u > 20.0), 0.06, 0.0) + noise)
        places = [(at_u, at_v) for at_u in np.arange(19.25, 21.5, 0.5) for at_v in (-0.25, 0.25)]
        at_end += [looked.at(place).in_window(4.0) for place in places]
        along += [looked.at((at_u + 5.0, at_v)).in_window(4.0) for at_u, at_v in places]
    # Windows that end with the kerb are refused for that
    assert at_end.count(BOX_ELSEWHERE) >= 15 and at_end.count(BOX_FOUND) <= 5
    assert along.count(BOX_FOUND) >= 24


def test_the_floor_of_a_long_window_is_as_even_as_the_smoothest_around():
    u, v, noise = few_points(np.random.default_rng(0), per_m2=40, noise_m=1.0)
    # Asphalt, gravel from v = 1 m to the step, and grass behind it
    h = np.where(v < 0, 0.10, 0.0) + noise * np.where(v > 1.0, 0.004, 0.015)
    looked = Looked(u, v, h)
    places = [(at_u, at_v) for at_u in np.arange(10.25, 20.0, 1.0) for at_v in (-0.25, 0.25)]
    found = [looked.at(place).in_window(4.0) for place in places]
    assert found == [BOX_NO_ROAD] * len(places)


def test_on_noise_alone_the_long_windows_show_no_more_steps_than_the_usual_one():
    rng, n_shown = np.random.default_rng(1), {}
    for half_u in (0.5, 1.0, 2.0):
        radius = np.hypot(half_u, 0.75)
        n = int(40 * np.pi * radius**2)
        n_shown[half_u] = 0
        for _ in range(1000):
            work = np.zeros((n, 5))
            turn, r = rng.uniform(0, 2 * np.pi, n), radius * np.sqrt(rng.uniform(0, 1, n))
            work[:, 0], work[:, 1], work[:, 2] = r * np.cos(turn), r * np.sin(turn), rng.normal(0, 0.01, n)
            sums, out, tried = np.zeros((73, 9)), np.zeros(CLEAREST_COLUMNS), np.zeros((MOST_TRIED, 2))
            n_shown[half_u] += best_step(work, n, (1.0, 0.0), 1.0, half_u, sums, tried, out)
    assert n_shown[1.0] + n_shown[2.0] <= n_shown[0.5]


@pytest.mark.parametrize(("radius_m", "side"), [(8.0, 1.0), (8.0, -1.0), (1e6, 1.0)])
def test_the_foot_in_a_bend_is_where_the_kerb_is_and_not_the_mean_of_its_window(radius_m, side):
    rng = np.random.default_rng(3)
    off, ratio = [], []
    at_m = -side * 2.0**2 / 6 / radius_m
    for _ in range(20):
        u, v = rng.uniform(-2, 2, 400), rng.uniform(-1, 1, 400)
        foot = side * (u**2 / 2 - 2.0**2 / 6) / radius_m
        work = np.zeros((1002, 5))
        # v to the left of u
        work[:400, 0], work[:400, 1] = u, v
        work[:400, 2] = np.where(v < foot, 0.08, 0.0) + rng.normal(0, 0.01, 400)
        first = np.array([0.0, 1.0, 100.0, 0.0, 0.0, 0.08, 0.02])
        step = np.zeros(STEP_COLUMNS)
        assert measure_seen_step(work, 400, first, 1.0, 2.0, step)
        follow_bend(work, 400, first, 1.0, 2.0, step)
        off.append(step[STEP_FOOT])
        ratio.append((off[-1] - at_m) / step[STEP_SIGMA_V])
    assert abs(np.mean(off) - at_m) < 0.015
    assert np.sqrt(np.mean(np.square(ratio))) < 1.12


@pytest.mark.parametrize("inside", [True, False])
def test_boxes_in_a_bend_err_by_what_they_say(inside):
    ratios = []
    for seed in range(6):
        rng = np.random.default_rng(seed)
        n, half = 6000, 1.3
        r, a = np.sqrt(rng.uniform(2.0**2, 13.0**2, n)), rng.uniform(-half, half, n)
        v = (7.0 - r) if inside else (r - 7.0)
        keep = v > -2.5
        h = np.where(v < 0, 0.06, 0.0) + rng.normal(0, NOISE_M, n)
        kerbs = kerbs_of((r * np.cos(a))[keep], (r * np.sin(a))[keep] + 15.0, h[keep])
        off = np.hypot(kerbs.centre[:, 0], kerbs.centre[:, 1] - 15.0) - 7.0
        near = np.abs(off) < 0.25
        ratios += (off[near] / kerbs.sigma_v_m[near]).tolist()
    assert np.sqrt(np.mean(np.square(ratios))) < 1.3
