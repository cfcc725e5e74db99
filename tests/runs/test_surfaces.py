"""The surface of a whole survey: which regions are road, what failed, what is used again."""

import errno
import json
from dataclasses import dataclass, replace

import numpy as np
import pytest
from tests.scenes.surface_scenes import (
    CONFIG,
    ORIGIN,
    SMALL_TILES,
    along,
    on_lattice,
    store_of,
    surface_of,
    winding_road,
)

from linework.errors import MachineError
from linework.files.store.cell_tiles import SurfaceTiles, read_surface_record
from linework.files.store.read import PointStore
from linework.model.grid import Bounds
from linework.model.points import Points
from linework.model.trajectory import Trajectory
from linework.runs.opened import surface_passes as passes
from linework.runs.opened.surface import SurfaceTiling, SurveySurface
from linework.surface.cells import CellWindow
from linework.surface.road import find_ground, height_above_ground, height_above_road, is_road_point

#: One tile of 32 m holds what is 31 m or less from here.
CORNER = np.array([499_968.0, 5_800_000.0, 100.0])


def plane(rng, west, south, east, north, up=0.0, per_m2=30, rough_m=0.01):
    """A level patch of points, relative to `CORNER`."""
    n = int((east - west) * (north - south) * per_m2)
    xyz = rng.uniform([west, south, up - rough_m], [east, north, up + rough_m], (n, 3))
    return on_lattice(xyz + CORNER)


def at(east, north, up=0.0):
    return np.array([[east, north, up]]) + CORNER


def path_over(*places, time_s=0.0):
    xyz = np.concatenate([at(*place) for place in places])
    return Trajectory(time_s + np.arange(float(len(xyz))), xyz)


def place(west, south, east, north):
    return Bounds(CORNER[0] + west, CORNER[1] + south, CORNER[0] + east, CORNER[1] + north)


@pytest.fixture
def car_park(tmp_path):
    """A road of 200 m x 8 m, and beside its far end, over a wall of 1 m, a car park: the larger of both there."""
    rng = np.random.default_rng(4)
    road = plane(rng, 0, 2, 200, 10)
    park = plane(rng, 162, 10.5, 190, 30, up=1.0)
    return store_of(tmp_path / "store", np.concatenate([road, park]))


@pytest.mark.parametrize("with_path", [True, False])
def test_in_every_tile_the_road_is_the_one_that_the_van_drove_on(car_park, tmp_path, with_path):
    """In the tiles at 160 m no path is seen, and the car park is the largest smooth region."""
    path = path_over((5, 6), (40, 6), (80, 6)) if with_path else None
    there = place(160, 0, 192, 31.5)
    alone = find_ground(car_park.points(there), None, CONFIG)
    assert is_road_point(alone, at(175, 20, 1.0)).all()
    surface = surface_of(car_park, path, tmp_path / "surface").over(there)
    assert not is_road_point(surface, at(175, 20, 1.0)).any()
    assert is_road_point(surface, at(175, 6)).all()
    assert height_above_road(surface, at(175, 12, 1.0))[0] == pytest.approx(1.0, abs=0.02)
    # It lies level with the road within a metre and a bit: ground all the same
    assert height_above_ground(surface, at(175, 20, 1.0))[0] == pytest.approx(0.0, abs=0.02)


def test_a_roof_over_a_tile_without_path_is_neither_road_nor_ground(tmp_path):
    rng = np.random.default_rng(5)
    road, roof = plane(rng, 0, 2, 200, 10), plane(rng, 165, 12, 190, 30, up=7.0)
    store = store_of(tmp_path / "store", np.concatenate([road, roof]))
    surface = surface_of(store, path_over((5, 6), (40, 6)), tmp_path / "surface").over(place(160, 0, 192, 31))
    assert height_above_ground(surface, at(178, 20, 7.0))[0] == pytest.approx(7.0, abs=0.02)
    assert height_above_road(surface, at(178, 20, 7.0))[0] == pytest.approx(7.0, abs=0.02)


def test_places_that_nothing_connects_have_a_road_each(tmp_path):
    rng = np.random.default_rng(6)
    near, far = plane(rng, 0, 2, 60, 10), plane(rng, 3000, 2, 3030, 10, up=40.0)
    kerb = plane(rng, 3000, 10, 3030, 13, up=40.15)
    store = store_of(tmp_path / "store", np.concatenate([near, far, kerb]))
    for path in (None, path_over((5, 6), (40, 6))):
        surface = surface_of(store, path, tmp_path / "surface", key=str(path is None))
        here, there = surface.over(place(0, 0, 60, 12)), surface.over(place(3000, 0, 3030, 14))
        assert is_road_point(here, at(30, 6)).all()
        assert is_road_point(there, at(3015, 6, 40.0)).all()
        assert not is_road_point(there, at(3015, 11.5, 40.15)).any()
        assert height_above_ground(there, at(3015, 11.5, 40.15))[0] == pytest.approx(0.0, abs=0.02)


def test_a_bridge_over_the_path_is_no_road_and_a_path_may_cross_itself(tmp_path):
    """The path is that of an antenna, 2 m above the road; it passes under a bridge and comes back over it."""
    rng = np.random.default_rng(7)
    road = plane(rng, 0, 2, 100, 10)
    deck = plane(rng, 40, -20, 50, 40, up=6.0)
    under = (road[:, 0] > CORNER[0] + 42) & (road[:, 0] < CORNER[0] + 48)
    store = store_of(tmp_path / "store", np.concatenate([road[~under], deck]))
    under_it = path_over((5, 6, 2), (40, 6, 2), (80, 6, 2))
    over_it = path_over((45, -15, 8), (45, 30, 8), time_s=100.0)
    both = Trajectory(
        np.concatenate([under_it.time_s, over_it.time_s]), np.concatenate([under_it.xyz, over_it.xyz])
    )
    for path, deck_is_road in ((under_it, False), (both, True)):
        surface = surface_of(store, path, tmp_path / "surface", key=str(deck_is_road))
        whole = surface.over(place(0, -20, 100, 40))
        assert is_road_point(whole, at(20, 6)).all()
        assert is_road_point(whole, at(45, 6, 6.0)).all() == deck_is_road


def test_a_jump_of_the_path_leads_over_nothing(tmp_path):
    """Between two drives the path leaps over a field: it is no road."""
    rng = np.random.default_rng(8)
    field = plane(rng, 60, 2, 120, 10, up=0.5, rough_m=0.02)
    parts = [plane(rng, 0, 2, 40, 10), field, plane(rng, 160, 2, 200, 10)]
    store = store_of(tmp_path / "store", np.concatenate(parts))
    path = path_over((5, 6), (35, 6), (165, 6), (195, 6))
    surface = surface_of(store, path, tmp_path / "surface").over(place(0, 0, 200, 12))
    assert is_road_point(surface, at(20, 6)).all()
    assert is_road_point(surface, at(180, 6)).all()
    assert not is_road_point(surface, at(90, 6, 0.5)).any()


@pytest.mark.parametrize("west_m", [0.0, -37.0, 13.5])
def test_another_carriageway_is_as_even_as_the_one_driven_on(tmp_path, west_m):
    rng = np.random.default_rng(5)
    east_m = west_m + 100
    other = plane(rng, west_m, 16, east_m, 24, up=0.4, per_m2=24)
    field = plane(rng, west_m, 30, east_m, 40, rough_m=0.02)
    # Where the barrier between them is open, the two touch
    opening = plane(rng, west_m + 50, 10, west_m + 51, 16.5, up=0.2)
    store = store_of(
        tmp_path / "store", np.concatenate([plane(rng, west_m, 2, east_m, 10), other, field, opening])
    )
    surface = surface_of(store, path_over((west_m + 5, 6), (east_m - 5, 6)), tmp_path / "surface")
    around = surface.over(place(west_m, 0, 100, 44))

    def share_of_road(north, up=0.0):
        places = np.concatenate([at(east, north, up) for east in np.arange(west_m + 5, east_m - 5, 2.5)])
        return is_road_point(around, places).mean()

    assert share_of_road(6) > 0.9
    assert share_of_road(20, 0.4) > 0.8
    assert share_of_road(35) == 0.0


def test_a_footway_along_the_road_is_none(tmp_path):
    rng = np.random.default_rng(6)
    parts = [plane(rng, 0, 2, 100, 10), plane(rng, 0, 10, 100, 16, up=0.15)]
    store = store_of(tmp_path / "store", np.concatenate(parts))
    surface = surface_of(store, path_over((5, 6), (95, 6)), tmp_path / "surface")
    around = surface.over(place(0, 0, 100, 18))
    assert is_road_point(around, at(50, 6)).all()
    assert not is_road_point(around, at(50, 13, 0.15)).any()


@pytest.mark.parametrize("split_m", [0.0, 8.0, 11.5, 14.0])
def test_a_small_piece_of_ground_beyond_a_hole_counts_as_a_whole(tmp_path, split_m):
    """30 m2 of pavement: whichever way an edge between tiles parts it, there is enough of it."""
    rng = np.random.default_rng(9)
    road, pavement = plane(rng, 0, 2, 30, 10), plane(rng, 10, 13, 16, 18)
    store = store_of(tmp_path / "store", np.concatenate([road, pavement]))
    east = round((CORNER[0] + split_m) / CONFIG.cell_m)
    layout = SurfaceTiling(64, (east, round(CORNER[1] / CONFIG.cell_m) + 31))
    surface = surface_of(store, path_over((5, 6), (25, 6)), tmp_path / "surface", layout=layout)
    whole = surface.over(place(0, 0, 30, 20))
    rows, cols = (np.floor(v).astype(int) for v in whole.grid.to_cell(at(13.2, 15.2)[:, :2]))
    assert whole.is_ground[rows, cols].all()


def test_far_from_all_ground_the_nearest_block_with_ground_must_do(tmp_path):
    rng = np.random.default_rng(10)
    road, lamp = plane(rng, 0, 2, 60, 10, up=3.0), plane(rng, 190, 2, 190.4, 2.4, up=30.0)
    store = store_of(tmp_path / "store", np.concatenate([road, lamp]))
    surface = surface_of(store, None, tmp_path / "surface")
    path = place(0, 0, 250, 12)
    over = surface.over(path)
    assert np.isfinite(over.ground_m).all()
    assert np.isfinite(over.road_m).all()
    assert height_above_ground(over, at(115, 6, 3.0))[0] == pytest.approx(0.0, abs=0.02)
    # Nothing of the survey is here: not even a tile
    empty = surface.over(place(900, 900, 905, 905))
    assert empty.ground_m + empty.z0_m == pytest.approx(CORNER[2] + 3.0, abs=0.02)


# ---------------------------------------------------------------- failures, resuming, reading


@dataclass(frozen=True)
class Broken:
    """A store that cannot give the points of one place."""

    store: PointStore
    place: Bounds
    is_broken: bool = True

    @property
    def block_counts(self):
        return self.store.block_counts

    def points(self, bounds, **how):
        p = self.place
        apart = (
            bounds.east <= p.west
            or bounds.west >= p.east
            or bounds.north <= p.south
            or bounds.south >= p.north
        )
        if self.is_broken and not apart:
            raise RuntimeError("decoder died")
        return self.store.points(bounds, **how)


def test_a_tile_that_fails_is_named_has_no_surface_and_is_tried_again(tmp_path):
    store = store_of(tmp_path / "store", winding_road(1))
    west, south = ORIGIN[0] + 65.0, ORIGIN[1] + 12.0 * np.sin(65 / 25)
    broken = Broken(store, Bounds(west, south, west + 0.1, south + 0.1))
    surface = surface_of(broken, along(), tmp_path / "surface")
    assert len(surface.failures) == 1
    name, problem = surface.failures[0]
    assert name.startswith("surface e")
    assert problem == "RuntimeError: decoder died"
    window = surface.tiles.window(next(iter(surface.failed))).bounds(CONFIG.cell_m)
    inside = surface.over(
        Bounds(window.west + 0.1, window.south + 0.1, window.east - 0.1, window.north - 0.1)
    )
    assert np.isnan(inside.road_m).all()
    assert np.isnan(inside.ground_m).all()
    assert not inside.is_road.any()
    whole = surface.over(store.bounds)
    assert np.isfinite(whole.road_m).mean() > 0.7
    again = surface_of(replace(broken, is_broken=False), along(), tmp_path / "surface")
    assert not again.failures
    assert np.isfinite(again.over(store.bounds).road_m).all()


@pytest.mark.parametrize("step", ["find_regions", "coarse_heights", "extend_tile_surface"])
def test_a_tile_may_fail_at_any_step(tmp_path, monkeypatch, step):
    """It has done half of its work when it dies: its neighbours do not rely on that half."""
    store = store_of(tmp_path / "store", winding_road(1))
    expected = surface_of(store, along(), tmp_path / "whole").over(store.bounds)
    done = getattr(passes, step)
    east = ORIGIN[0] + 50.0

    def dies(task):
        done(task)
        bounds = task.tiles.window(task.tile).bounds(CONFIG.cell_m)
        if bounds.west <= east < bounds.east:
            raise MemoryError

    def lives(task):
        dies(task)
        return done(task)

    monkeypatch.setattr(passes, step, lives)
    surface = surface_of(store, along(), tmp_path / "surface")
    assert {problem for _, problem in surface.failures} == {"out of memory"}
    over = surface.over(store.bounds)
    row, col = (int(v[0]) for v in over.grid.to_cell(ORIGIN[None, :2] + [[50.0, 12.0 * np.sin(2.0)]]))
    assert np.isnan(over.ground_m[row, col])
    has = ~np.isnan(over.ground_m)
    assert 0.5 < has.mean() < 0.9
    # What does not depend on the half-done tile is as it was
    same = has if step == "carry_on" else np.s_[:, :20]
    assert np.array_equal(over.ground_m[same], expected.ground_m[same])


def test_a_finished_surface_is_used_again_for_the_same_key_only(tmp_path):
    xyz = winding_road(2)
    store = store_of(tmp_path / "store", xyz)
    surface = surface_of(store, along(), tmp_path / "surface")
    # Points are not asked for again
    none = Broken(store, Bounds(-np.inf, -np.inf, np.inf, np.inf))
    again = surface_of(none, along(), tmp_path / "surface")
    assert again.known == surface.known
    assert not again.failures
    assert surface_of(none, along(), tmp_path / "surface", key="b").failures


def test_what_a_killed_pass_leaves_is_made_anew(tmp_path):
    store = store_of(tmp_path / "store", winding_road(3))
    folder = tmp_path / "surface"
    expected = surface_of(store, along(), folder).over(store.bounds)
    kept = sorted(path.name for path in folder.iterdir())
    assert all(name.startswith(("surface.", "coarse.")) for name in kept)
    # As if it had been killed in its last pass: no record, half a file, files of earlier passes
    (folder / "surface.json").unlink()
    (folder / ".cells.e1n1.99999.part.arrays").write_bytes(b"half")
    SurfaceTiles(folder, 64).write("labels", (99, 99), np.zeros(3))
    with pytest.raises(FileNotFoundError):
        SurveySurface.open(folder)
    again = surface_of(store, along(), folder).over(store.bounds)
    assert np.array_equal(again.road_m, expected.road_m)
    assert sorted(path.name for path in folder.iterdir()) == kept


def test_a_damaged_surface_is_said_with_its_file(tmp_path):
    store = store_of(tmp_path / "store", winding_road(3))
    surface = surface_of(store, along(), tmp_path / "surface")
    east, north = ORIGIN[0] + 50.0, ORIGIN[1] + 5.0
    middle = Bounds(east, north, east, north)
    east, north = next(surface.tiles.touching(CellWindow.over(middle, CONFIG.cell_m)))
    path = tmp_path / "surface" / f"surface.e{east}n{north}.arrays"
    path.write_bytes(path.read_bytes()[:5000])
    with pytest.raises(
        MachineError, match=rf"surface\.e{east}n{north}\.arrays: is damaged: 5000 bytes, expected"
    ):
        surface.over(middle)
    (tmp_path / "surface" / "surface.json").write_text("{")
    assert read_surface_record(tmp_path / "surface") is None


def test_a_full_disk_ends_the_pass_and_leaves_no_surface(tmp_path, monkeypatch):
    store = store_of(tmp_path / "store", winding_road(3))
    write, left = np.lib.format.write_array, [12]

    def full(*arguments, **how):
        left[0] -= 1
        if left[0] < 0:
            raise OSError(errno.ENOSPC, "No space left on device")
        write(*arguments, **how)

    monkeypatch.setattr(np.lib.format, "write_array", full)
    with pytest.raises(MachineError, match=r"cannot be written: No space left on device.*Free some space"):
        surface_of(store, along(), tmp_path / "surface")
    assert not list((tmp_path / "surface").iterdir())
    monkeypatch.undo()
    assert not surface_of(store, along(), tmp_path / "surface").failures


def test_the_record_says_of_what_the_surface_is(tmp_path):
    store = store_of(tmp_path / "store", winding_road(3))
    surface = surface_of(store, None, tmp_path / "surface", key="points and path")
    record = json.loads((tmp_path / "surface" / "surface.json").read_text())
    assert record["key"] == "points and path"
    assert record["z0_m"] == surface.z0_m == 100.0
    opened = SurveySurface.open(tmp_path / "surface")
    assert (opened.known, opened.cell_m) == (surface.known, CONFIG.cell_m)


def test_progress_ends_where_it_said_it_would(tmp_path):
    store = store_of(tmp_path / "store", winding_road(3))
    told = []
    from linework.processes.executors import Serial
    from linework.runs.opened.surface import make_surface

    make_surface(
        store,
        None,
        CONFIG,
        tmp_path / "surface",
        Serial(),
        lambda *how: told.append(how),
        key="a",
        layout=SMALL_TILES,
    )
    done, total = zip(*told, strict=True)
    assert list(done) == sorted(done)
    assert len(set(total)) == 1
    assert done[-1] == total[0]


def test_a_store_without_points_has_no_surface_and_no_error(tmp_path):
    store = store_of(tmp_path / "store", np.zeros((0, 3)))
    surface = surface_of(store, along(), tmp_path / "surface")
    assert np.isnan(surface.over(place(0, 0, 5, 5)).road_m).all()


def test_tiles_grow_with_what_they_look_beyond():
    assert SurfaceTiling.for_cells(CONFIG) == SurfaceTiling(384)
    assert SurfaceTiling.for_cells(replace(CONFIG, cell_m=0.05)) == SurfaceTiling(1200)
    assert SurfaceTiling.for_cells(replace(CONFIG, cell_m=0.2)).n_cells * 0.2 > 100.0


def test_cells_that_binary_fractions_miss_lose_no_point_at_the_edges_of_tiles(tmp_path):
    """Cells of 0.3 m: their edges, times 0.3, are not what points on them are divided into."""
    config = replace(CONFIG, cell_m=0.3)
    rng = np.random.default_rng(11)
    xyz = np.column_stack(
        [rng.integers(0, 120, 40_000) * 0.3, rng.integers(0, 40, 40_000) * 0.3, rng.normal(0, 0.01, 40_000)]
    )
    xyz = on_lattice(xyz + np.array([300_000.0, 600_000.0, 50.0]))
    store = store_of(tmp_path / "store", xyz)
    whole = find_ground(Points(xyz), None, config)
    split = surface_of(store, None, tmp_path / "surface", layout=SurfaceTiling(64, (3, 1)), config=config)
    over = split.over(store.bounds)
    assert np.array_equal(over.is_road, whole.is_road)
    assert np.abs((over.ground_m + over.z0_m) - (whole.ground_m + whole.z0_m)).max() < 1e-4
    assert whole.is_road.sum() > 4000


def test_a_store_without_smooth_places_has_ground_and_no_road(tmp_path):
    rng = np.random.default_rng(12)
    xyz = on_lattice(rng.uniform([0, 0, 0], [20, 20, 0.15], (3000, 3)) * [1, 1, 1] + CORNER)
    rough = replace(CONFIG, max_grade=0.01)
    store = store_of(tmp_path / "store", xyz)
    surface = surface_of(store, None, tmp_path / "surface", config=rough).over(store.bounds)
    assert surface.is_ground.mean() > 0.8
    assert np.isfinite(surface.road_m).all()


@pytest.mark.parametrize("layout", [SMALL_TILES, SurfaceTiling(50, (3, -7))])
def test_stray_points_are_left_out_alike_in_any_tiles(tmp_path, layout):
    rng = np.random.default_rng(6)
    road = plane(rng, 0, 2, 100, 14, per_m2=100)
    below = road[rng.random(len(road)) < 0.01] - [0.0, 0.0, 3.0]
    below[:, 2] += rng.uniform(-2.5, 2.5, len(below))
    around = rng.uniform([-20, -20, -20], [120, 40, 60], (2000, 3)) + CORNER
    xyz = on_lattice(np.concatenate([road, below, around]))
    store = store_of(tmp_path / "store", xyz)
    tiled = surface_of(store, None, tmp_path / "surface", layout=layout).over(Points(xyz).bounds)
    whole = find_ground(Points(xyz), None, CONFIG)
    for name in ("is_road", "is_ground", "ground_m"):
        one, two = (getattr(ground, name)[cells_at(ground, road)] for ground in (whole, tiled))
        assert np.array_equal(one, two), name
    assert whole.is_road[cells_at(whole, road)].mean() > 0.98


def cells_at(ground, xyz):
    rows, cols = ground.grid.to_cell(xyz[:, :2])
    return np.floor(rows).astype(int), np.floor(cols).astype(int)
