"""How a survey is cut into tiles changes nothing: the same rails, to a millimetre, over tile size and origin."""

import functools

import numpy as np
import pytest

from linework.methods.radon.method import RailMethod
from linework.methods.seams import inside_core, join_seams
from linework.model.grid import Bounds
from linework.model.lines import LINE_COLUMNS, VERTEX_COLUMNS, LineSet
from linework.model.tile import TileData, local_origin
from linework.simulation.simulate import simulate_survey
from linework.surface.road import RoadConfig, find_ground

WITHIN_M = 0.001
METHOD = RailMethod()


@functools.cache
def whole(road, seed, length_m):
    """The survey, its surface, and its rails found in one tile."""
    survey = simulate_survey(road, seed, length_m, points_per_m=2000)
    points = survey.points
    surface = find_ground(points, survey.trajectory, RoadConfig())
    origin = local_origin(*points.xyz.min(axis=0))
    tile = TileData("whole", points.bounds.grown(1.0), points, survey.trajectory, "", surface, origin)
    return tile, METHOD.extract(tile)


def inside(points, bounds):
    """Which points lie in a rectangle, half open."""
    east, north = points.xyz[:, 0], points.xyz[:, 1]
    return (east >= bounds.west) & (east < bounds.east) & (north >= bounds.south) & (north < bounds.north)


def cores_over(points, core_m, shift_m):
    """Cores of a lattice that hold points."""
    low, high = (
        np.floor((v[:2] - shift_m) / core_m).astype(int) for v in (points.xyz.min(0), points.xyz.max(0))
    )
    corners = [
        shift_m + core_m * np.array([i, j])
        for j in range(low[1], high[1] + 1)
        for i in range(low[0], high[0] + 1)
    ]
    cores = [Bounds(*corner, *(corner + core_m)) for corner in corners]
    return [core for core in cores if inside(points, core).any()]


def in_tiles(tile, core_m, shift_m):
    """The rails of a survey that is worked in tiles, each of which sees its buffer and no more."""
    cores, found = cores_over(tile.points, core_m, np.array(shift_m)), []
    for core in cores:
        points = tile.points.take(np.flatnonzero(inside(tile.points, core.grown(METHOD.buffer_m))))
        part = TileData("part", core, points, tile.trajectory, "", tile.surface, tile.origin)
        found.append(inside_core(METHOD.extract(part), core))
    return join_seams(LineSet.concatenate(found), cores)


def farthest_m(vertices, line):
    """Largest distance of vertices from a line, in space [m]."""
    begin, step = line[:-1], np.diff(line, axis=0)
    along = np.sum((vertices[:, None] - begin) * step, axis=2) / np.maximum(np.sum(step**2, axis=1), 1e-18)
    foot = begin + np.clip(along, 0.0, 1.0)[..., None] * step
    return np.linalg.norm(vertices[:, None] - foot, axis=2).min(axis=1).max()


def ends_apart_m(one, two):
    return np.linalg.norm(one[[0, -1]] - two[[0, -1]], axis=1).max()


def matched(lines, reference):
    """Each line with the one of the reference whose ends are nearest, turned alike; no two with the same."""
    pairs = []
    for i in range(len(lines)):
        own = lines[i].xyz
        away = [
            min(ends_apart_m(own, b), ends_apart_m(own, b[::-1])) for b in (line.xyz for line in reference)
        ]
        j = int(np.argmin(away))
        turned = ends_apart_m(own, reference[j].xyz) > ends_apart_m(own, reference[j].xyz[::-1])
        pairs.append((i, j, slice(None, None, -1 if turned else 1)))
    assert sorted(j for _, j, _ in pairs) == list(range(len(reference)))
    return pairs


def assert_the_same(lines, reference):
    """As many lines, of the same kinds, with the same vertices and what is said of each."""
    assert len(lines) == len(reference)
    for i, j, turn in matched(lines, reference):
        own, other = lines[i].xyz, reference[j].xyz[turn]
        assert lines.kind[i] == reference.kind[j]
        assert ends_apart_m(own, other) <= WITHIN_M
        assert max(farthest_m(own, other), farthest_m(other, own)) <= WITHIN_M
        assert len(own) == len(other)
        mine, theirs = lines.take([i]), reference.take([j])
        for name in VERTEX_COLUMNS:
            # A line that moves by tenths of a millimetre has a sigma that differs in its fourth digit
            np.testing.assert_allclose(getattr(mine, name), getattr(theirs, name)[turn], rtol=1e-3, atol=1e-6)
        assert mine.double == theirs.double
        assert mine.height_m == pytest.approx(theirs.height_m, abs=0.05)  # means of medians
        assert mine.confidence == pytest.approx(theirs.confidence, abs=0.1)
        np.testing.assert_array_equal(mine.time_start_s, theirs.time_start_s)
        np.testing.assert_array_equal(mine.time_end_s, theirs.time_end_s)
    assert set(lines.method) == {"radon"}
    assert {"height_m", "confidence", "double"} <= set(LINE_COLUMNS)


@pytest.mark.parametrize(
    ("road", "seed", "length_m"), [("bends", 600, 260.0), ("motorway", 605, 260.0), ("straight", 611, 260.0)]
)
@pytest.mark.parametrize(("core_m", "shift_m"), [(100.0, (71.6, 80.6)), (130.0, (3.3, 119.9))])
def test_rails_do_not_depend_on_the_tiles(road, seed, length_m, core_m, shift_m):
    tile, reference = whole(road, seed, length_m)
    assert len(reference) >= 2
    assert len(cores_over(tile.points, core_m, np.array(shift_m))) >= 3
    assert_the_same(in_tiles(tile, core_m, shift_m), reference)


def test_a_tile_without_points_has_no_lines():
    tile, _ = whole("bends", 600, 260.0)
    nothing = TileData("part", tile.core, tile.points.take(np.zeros(0, dtype=np.int64)), surface=tile.surface)
    assert len(METHOD.extract(nothing)) == 0
