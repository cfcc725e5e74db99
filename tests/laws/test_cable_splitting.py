"""How a survey is cut into tiles, and which low points a tile was given, does not move its cables."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from linework.methods.cables.find import CableConfig, find_cables, least_height_m
from linework.methods.seams import inside_core
from linework.model.grid import Bounds
from linework.model.lines import LineSet
from linework.model.tile import local_origin
from linework.simulation.simulate import simulate_survey
from linework.surface.road import RoadConfig, find_ground, height_above_ground

#: Margin of points about a core [m], as cables ask for it.
BUFFER_M = 200.0
#: One tile finds more than a handful of lines in each of these.
SURVEYS = [("straight", 620, 300.0), ("bends", 605, 300.0), ("urban", 614, 150.0), ("motorway", 619, 300.0)]


@cache
def survey(kind, seed, length_m):
    """Return points, times, heights above ground and local origin of a survey, heights found once for all."""
    made = simulate_survey(kind, seed, length_m, points_per_m=1200.0)
    xyz = np.rint(made.points.xyz / 1e-4) * 1e-4
    height = height_above_ground(find_ground(made.points, made.trajectory, RoadConfig()), xyz)
    return xyz, made.points.time_s, height, local_origin(*xyz.min(axis=0).tolist())


@cache
def in_one_tile(kind, seed, length_m):
    xyz, time_s, height, origin = survey(kind, seed, length_m)
    return find_cables(xyz, time_s, height, CableConfig(), origin)


def within(xyz, bounds):
    x, y = xyz[:, 0], xyz[:, 1]
    return (x >= bounds.west) & (x < bounds.east) & (y >= bounds.south) & (y < bounds.north)


def in_tiles(xyz, time_s, height, origin, core_m, shift_m):
    """Return what the tiles of a lattice of cores find, each among its own points above 1.5 m only."""
    low, high = (
        np.floor((edge(xyz[:, :2], axis=0) - shift_m) / core_m).astype(int) for edge in (np.min, np.max)
    )
    found = []
    for row in range(low[1], high[1] + 1):
        for col in range(low[0], high[0] + 1):
            west, south = shift_m[0] + col * core_m, shift_m[1] + row * core_m
            core = Bounds(west, south, west + core_m, south + core_m)
            mine = within(xyz, core.grown(BUFFER_M)) & (height >= least_height_m(CableConfig()))
            if within(xyz[mine], core).any():
                time = None if time_s is None else time_s[mine]
                lines = find_cables(xyz[mine], time, height[mine], CableConfig(), origin)
                found.append(inside_core(lines, core))
    return LineSet.concatenate(found)


def distance_m(places, line):
    """Return the largest distance [m] of places from a line, in space."""
    start, step = line[:-1], np.diff(line, axis=0)
    on = np.clip(((places[:, None] - start) * step).sum(axis=2) / (step**2).sum(axis=1), 0.0, 1.0)
    return np.linalg.norm(places[:, None] - (start + on[..., None] * step), axis=2).min(axis=1).max()


def assert_same_lines(one, other):
    """Assert that there are as many lines, with ends and course within a millimetre."""
    assert len(one) == len(other)
    left = list(range(len(other)))
    for i in range(len(one)):
        line = one[i].xyz
        apart = [np.abs(other[k].xyz[[0, -1]] - line[[0, -1]]).max() for k in left]
        partner = other[left.pop(int(np.argmin(apart)))].xyz
        assert np.linalg.norm(partner[[0, -1]] - line[[0, -1]], axis=1).max() <= 1e-3
        assert max(distance_m(line, partner), distance_m(partner, line)) <= 1e-3


@pytest.mark.parametrize(("core_m", "shift_m"), [(100.0, (37.0, 81.0)), (250.0, (190.0, 13.0))])
@pytest.mark.parametrize("place", SURVEYS)
def test_tiles_do_not_move_cables(place, core_m, shift_m):
    one = in_one_tile(*place)
    assert len(one) > 3
    assert_same_lines(one, in_tiles(*survey(*place), core_m, np.array(shift_m)))


def test_points_below_the_least_height_do_not_matter():
    xyz, time_s, height, origin = survey(*SURVEYS[0])
    high = height >= least_height_m(CableConfig())
    found = find_cables(xyz[high], time_s[high], height[high], CableConfig(), origin)
    one = in_one_tile(*SURVEYS[0])
    assert np.array_equal(found.xyz, one.xyz)
    assert np.array_equal(found.clearance_m, one.clearance_m, equal_nan=True)
    assert 0.0 < high.mean() < 0.5
