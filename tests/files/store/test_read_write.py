"""The tile store on disk: what is written, what is read back, what happens when bytes are missing or wrong."""

import contextlib
import json
import os
from pathlib import Path

import numpy as np
import pytest
from tests.oracles.store_twin import assert_same, made, selected, steps_of

from linework.errors import MachineError
from linework.files.store import folder
from linework.files.store.layout import RUN_DTYPE, Limits, RunTable, first_step
from linework.files.store.read import PointStore
from linework.files.store.write import StoreWriter, write_index
from linework.model.grid import Bounds, Grid, Image


def cloud(n, *, seed=0, low=(-90, -90, -50), high=(90, 90, 50)):
    rng = np.random.default_rng(seed)
    xyz = rng.uniform(low, high, (n, 3))
    return xyz, rng.integers(0, 2**16, n).astype(np.uint16), rng.uniform(0, 100, n)


def test_all_points_come_back_in_order(tmp_path):
    files = [cloud(3000, seed=1), cloud(500, seed=2)]
    store = made(tmp_path / "s", files, batch=700)
    assert store.n_points == 3500
    assert_same(store.points(), selected(files))
    unordered = store.points(ordered=False)
    assert np.array_equal(np.sort(unordered.time_s), np.sort(np.concatenate([files[0][2], files[1][2]])))


def test_columns_that_are_not_wanted_are_none(tmp_path):
    store = made(tmp_path / "s", [cloud(50)])
    points = store.points(with_time=False, with_intensity=False)
    assert points.time_s is None
    assert points.intensity is None
    assert np.array_equal(points.xyz, store.points().xyz)
    assert store.points(ordered=False, with_time=False).time_s is None


def with_further(file, *, seed=3):
    rng = np.random.default_rng(seed)
    return (*file, rng.integers(0, 4, (len(file[0]), 2)).astype(np.float32))


def test_further_columns_come_back_with_their_points(tmp_path):
    files = [with_further(cloud(3001, seed=1)), with_further((*cloud(501, seed=2)[:2], None))]
    store = made(tmp_path / "s", files, batch=700)
    expected = selected(files)
    points = store.points()
    assert np.array_equal(points.xyz, expected[0])
    assert np.array_equal(points["p_kerb"], expected[3][:, 0])
    assert np.array_equal(points["p_paint"], expected[3][:, 1])
    bounds = Bounds(-30.0, -40.0, 41.5, 63.0)
    low = Image(np.full((400, 400), -5.0, np.float32), Grid(-100.0, 100.0, 0.5, 0.5, 400, 400))
    part = store.points(bounds, lowest=low)
    inside = selected(files, bounds)
    high = inside[0][:, 2] >= -5.0
    assert 0 < high.sum() < len(high)
    assert np.array_equal(part.xyz, inside[0][high])
    assert np.array_equal(part["p_paint"], inside[3][high, 1])
    assert store.points(with_columns=False).columns == {}


def test_points_that_differ_in_a_further_column_only_have_one_order(tmp_path):
    values = np.array([[0, 1], [0, 0], [-1, 5], [0, np.nan], [-np.inf, 0], [1, 1]], np.float32)
    file = (np.zeros((6, 3)), np.ones(6, np.uint16), np.full(6, 5.0), values)
    for seed in range(4):
        order = np.random.default_rng(seed).permutation(6)
        points = made(tmp_path / str(seed), [tuple(column[order] for column in file)], batch=2).points()
        assert points["p_kerb"].tolist() == [-np.inf, -1, 0, 0, 0, 1]
        assert points["p_paint"][[0, 1, 2, 3, 5]].tolist() == [0, 5, 0, 1, 1]
        assert np.isnan(points["p_paint"][4])


def test_damage_in_a_further_column_is_reported(tmp_path):
    store = made(tmp_path / "s", [with_further(cloud(100))])
    data = tmp_path / "s" / "0.points"
    content = bytearray(data.read_bytes())
    content[-3] ^= 1
    data.write_bytes(bytes(content))
    with pytest.raises(MachineError, match="not what was written"):
        store.points()
    assert len(store.points(with_columns=False)) == 100
    data.write_bytes(bytes(content[:-8]))
    with pytest.raises(MachineError, match="cut off"):
        store.points()


def test_all_batches_of_a_file_have_the_same_further_columns(tmp_path):
    writer = StoreWriter(tmp_path / "0.points")
    xyz, intensity, time, further = with_further(cloud(10))
    writer.append(xyz, intensity, time, further.T)
    with pytest.raises(ValueError, match="columns: 0, and 2 in other batches"):
        writer.append(xyz, intensity, time)
    with pytest.raises(ValueError, match="columns: shape"):
        writer.append(xyz, intensity, time, further.T[:, :3])
    writer.abort()


def test_times_are_given_only_where_all_files_have_them(tmp_path):
    with_time, without = cloud(100, seed=1), (*cloud(80, seed=2)[:2], None)
    store = made(tmp_path / "s", [with_time, without])
    points = store.points()
    xyz, intensity, _ = selected([with_time, without])
    assert points.time_s is None
    assert np.array_equal(points.xyz, xyz)
    assert np.array_equal(points.intensity, intensity)
    assert made(tmp_path / "t", [without]).points().time_s is None


def test_bounds_are_half_open_and_exact(tmp_path):
    x = np.array([-64.0, -0.0001, 0.0, 0.0001, 63.9999, 64.0])
    xyz = np.stack([x, np.zeros(6), np.zeros(6)], axis=1)
    store = made(tmp_path / "s", [(xyz, np.zeros(6, np.uint16), np.arange(6.0))])
    assert store.points(Bounds(-64.0, -1.0, 64.0, 1.0)).xyz[:, 0].tolist() == x[:5].tolist()
    assert store.points(Bounds(np.nextafter(-64.0, 0.0), 0.0, 0.0, 1.0)).xyz[:, 0].tolist() == [-0.0001]
    assert store.points(Bounds(0.0001, 0.0, np.nextafter(64.0, 65.0), 1.0)).xyz[:, 0].tolist() == [
        0.0001,
        63.9999,
        64.0,
    ]
    assert len(store.points(Bounds(-100.0, -1.0, 100.0, 0.0))) == 0
    assert len(store.points(Bounds(-np.inf, -np.inf, np.inf, np.inf))) == 6
    assert len(store.points(Bounds(10.0, 10.0, 5.0, 5.0))) == 0


@pytest.mark.parametrize("far", [99_999_999.9999, -99_999_999.9999, 1677.7216, -1677.7216, 3355.4432])
def test_far_coordinates_and_edges_of_blocks(tmp_path, far):
    xyz = np.array([[far, -far, far], [far, -far, far - 0.0001], [0.0, 0.0, 0.0]])
    files = [(xyz, np.arange(3, dtype=np.uint16), np.arange(3.0))]
    assert_same(made(tmp_path / "s", files).points(), selected(files))


def test_halves_go_to_the_even_step(tmp_path):
    # Odd sixteenths of a metre are 625 steps; odd 2**-5 are 312.5
    halves = np.array([-3, -1, 1, 3, 5]) / 32.0
    xyz = np.stack([halves, halves, halves], axis=1)
    points = made(tmp_path / "s", [(xyz, np.arange(5, dtype=np.uint16), None)]).points()
    steps = {int(i): s.tolist() for i, s in zip(points.intensity, steps_of(points.xyz), strict=True)}
    assert steps == {i: [s] * 3 for i, s in enumerate([-938, -312, 312, 938, 1562])}


def test_extent_counts_and_blocks(tmp_path):
    xyz = np.array([[1.0, 2.0, 0.0], [65.0, 2.0, 0.0], [3.0, -5.0, 0.0], [3.0, -5.0, 2000.0]])
    store = made(tmp_path / "s", [(xyz, np.zeros(4, np.uint16), None)])
    assert store.bounds == Bounds(1.0, -5.0, 65.0, 2.0)
    blocks, counts = store.block_counts
    assert blocks.tolist() == [[0, -1], [0, 0], [1, 0]]
    assert counts.tolist() == [2, 1, 1]
    assert store.count_in(Bounds(0.0, -64.0, 64.0, 0.0)) == 2
    assert store.count_in(Bounds(10.0, 10.0, 20.0, 20.0)) == 0


def test_points_outside_the_limits_are_left_out_and_counted(tmp_path):
    xyz = np.array(
        [
            [1, 1, 10],
            [2, 2, 70],
            [3, 3, -1],
            [4, 4, 5000],
            [100, 1, 10],
            [2e7, 2e7, 10],
            [1, 63.9999, 63.9999],
        ]
    ).astype(float)
    limits = Limits.around(west=0.0, south=0.0, low=0.0, east=1.0, north=1.0, high=1.0)
    store = made(tmp_path / "s", [(xyz, np.zeros(7, np.uint16), np.arange(7.0))], limits=limits)
    assert store.limits == limits
    assert store.n_points == 2
    assert store.points().time_s.tolist() == [0.0, 6.0]
    assert store.bounds == Bounds(1.0, 1.0, 1.0, 63.9999)
    assert store.block_counts[1].tolist() == [2]
    assert store.count_in(Bounds(-1e9, -1e9, 1e9, 1e9)) == 2
    assert store.points(Bounds(0.0, 0.0, 64.0, 2.0)).time_s.tolist() == [0.0]


def test_a_survey_without_intensities_has_none(tmp_path):
    assert made(tmp_path / "s", [cloud(5)], facts={"has_intensity": False}).points().intensity is None
    assert made(tmp_path / "t", [cloud(5)], facts={"has_intensity": True}).points().intensity is not None


def test_facts_come_back_as_json(tmp_path):
    facts = {"hashes": {10: "a", 9: "b", 100: "c"}, "extent": (1.5, 0.1), "name": "straße"}
    back = made(tmp_path / "s", [cloud(5)], facts=facts).facts
    assert back == {"hashes": {"10": "a", "9": "b", "100": "c"}, "extent": [1.5, 0.1], "name": "straße"}


def test_a_store_without_points(tmp_path):
    store = made(
        tmp_path / "s", [(np.zeros((0, 3)), np.zeros(0, np.uint16), np.zeros(0))], facts={"name": "x"}
    )
    assert store.facts == {"name": "x"}
    assert store.n_points == 0
    assert len(store.points()) == 0
    assert store.block_counts[0].shape == (0, 2)
    with pytest.raises(ValueError, match="no points"):
        _ = store.bounds


def test_points_below_the_lowest_wanted_are_left_out(tmp_path):
    rng = np.random.default_rng(8)
    steps = rng.integers(-700_000, 700_000, (4000, 3)) // [1000, 1000, 10_000] * [1000, 1000, 10_000]
    xyz = steps / 10_000.0  # a fifth of the points lie on edges of cells
    files = [(xyz, np.zeros(4000, np.uint16), np.arange(4000.0))]
    store = made(tmp_path / "s", files)
    for grid in (Grid(-60.0, 55.0, 0.5, 0.5, 230, 200), Grid(-60.0, 54.0, 1.0, 2.0, 50, 100)):
        values = rng.integers(-70, 70, grid.shape).astype(np.float32)
        values[rng.random(grid.shape) < 0.3] = np.nan
        bounds = Bounds(-50.0, -70.0, 70.0, 40.0)
        lattice, intensity, time = selected(files, bounds)
        col = np.floor(lattice[:, 0] / grid.cell_width_m) - round(grid.east_m / grid.cell_width_m)
        row = round(grid.north_m / grid.cell_height_m) - np.ceil(lattice[:, 1] / grid.cell_height_m)
        known = (col >= 0) & (col < grid.n_cols) & (row >= 0) & (row < grid.n_rows)
        limit = np.full(len(lattice), np.nan)
        limit[known] = values[row[known].astype(int), col[known].astype(int)]
        keep = ~(lattice[:, 2] < limit)
        assert 0 < keep.sum() < len(keep)
        assert_same(
            store.points(bounds, lowest=Image(values, grid)), (lattice[keep], intensity[keep], time[keep])
        )


@pytest.mark.parametrize(
    "grid",
    [Grid(0.1, 0.0, 0.5, 0.5, 2, 2), Grid(0.0, 0.0, 0.2, 0.2, 2, 2), Grid(0.0, 0.0, 0.5, 0.5, 2, 2, 10.0)],
)
def test_lowest_on_another_lattice_is_refused(tmp_path, grid):
    store = made(tmp_path / "s", [cloud(10)])
    with pytest.raises(ValueError, match="lattice"):
        store.points(lowest=Image(np.zeros((2, 2), np.float32), grid))


def test_lowest_is_compared_exactly(tmp_path):
    limit = np.float32(100.1)  # 100.0999985: 100.0999 is below, 100.1 is not
    xyz = np.array([[0.2, 0.2, 100.0999], [0.2, 0.2, 100.1], [0.2, 0.2, -1700.0], [0.2, 0.2, 1700.0]])
    store = made(tmp_path / "s", [(xyz, np.zeros(4, np.uint16), None)])
    image = Image(np.full((1, 1), limit), Grid(0.0, 0.5, 0.5, 0.5, 1, 1))
    assert store.points(lowest=image).xyz[:, 2].tolist() == [100.1, 1700.0]
    for value, n in ((np.inf, 0), (-np.inf, 4), (np.float32(3e38), 0)):
        image = Image(np.full((1, 1), value, np.float32), Grid(0.0, 0.5, 0.5, 0.5, 1, 1))
        assert len(store.points(lowest=image)) == n


def test_heights_are_counted(tmp_path):
    xyz = np.array([[0, 0, -0.00004], [0, 0, -0.1], [0, 0, 63.9], [0, 0, 64.0], [0, 0, 64.0], [0, 0, -9e7]])
    writer = StoreWriter(tmp_path / "0.points")
    writer.append(xyz[:3], np.zeros(3, np.uint16), None)
    writer.append(xyz[3:], np.zeros(3, np.uint16), None)
    writer.abort()
    # A hair below 0 is step 0
    assert writer.height_counts == {0: 2, -1: 1, 1: 2, -1406250: 1}
    assert not (tmp_path / "0.points").exists()


def test_the_writer_refuses_what_it_was_not_promised(tmp_path):
    writer = StoreWriter(tmp_path / "0.points")
    xyz, intensity, time = cloud(5)
    writer.append(xyz, intensity, time)
    with pytest.raises(ValueError, match="time_s"):
        writer.append(xyz, intensity, None)
    with pytest.raises(ValueError, match="intensity"):
        writer.append(xyz, intensity[:3], time)
    with pytest.raises(ValueError, match="beyond"):
        writer.append(xyz * np.nan, intensity, time)
    writer.abort()
    writer.abort()
    (tmp_path / "1.points").touch()
    with pytest.raises(MachineError, match=r"1\.points: cannot be written"):
        StoreWriter(tmp_path / "1.points")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no /dev/full")
def test_a_full_disk_is_one_line(tmp_path, monkeypatch):
    writer = StoreWriter(tmp_path / "0.points")
    write = os.write
    with Path("/dev/full").open("wb", buffering=0) as full:
        monkeypatch.setattr(os, "write", lambda _, data: write(full.fileno(), data))
        with pytest.raises(MachineError, match=r"0\.points: cannot be written: No space left"):
            writer.append(*cloud(5))
    writer.abort()
    assert not (tmp_path / "0.points").exists()


def test_a_cut_file_is_told(tmp_path):
    store = made(tmp_path / "s", [cloud(1000)], batch=300)
    path = tmp_path / "s" / "0.points"
    size = path.stat().st_size
    for keep in (size - 8, size // 2, 0):
        os.truncate(path, keep)
        with pytest.raises(MachineError, match=r"0\.points: .*cut off.* linework clean"):
            store.points()
    path.unlink()
    with pytest.raises(MachineError, match=r"0\.points: cannot be read: No such file.* linework clean"):
        store.points()


def test_a_flipped_byte_is_told(tmp_path):
    store = made(tmp_path / "s", [cloud(1000)], batch=300)
    path = tmp_path / "s" / "0.points"
    sound, before = path.read_bytes(), store.points()
    rng = np.random.default_rng(4)
    for at in rng.integers(0, len(sound), 50).tolist():
        damaged = bytearray(sound)
        damaged[at] ^= 1 << int(rng.integers(8))
        path.write_bytes(damaged)
        try:
            after = store.points()
        except MachineError as error:
            assert "damaged" in str(error)
        else:  # only what fills up a run's last word is not looked at
            assert_same(after, (before.xyz, before.intensity, before.time_s))
    path.write_bytes(bytes(len(sound)))
    with pytest.raises(MachineError, match="damaged"):
        store.points()


def test_a_damaged_index_is_told(tmp_path):
    folder = tmp_path / "s"
    made(folder, [cloud(100)], facts={"hash": "abc"})
    index, runs = folder / "store.json", folder / "runs.npy"
    sound, sound_runs = index.read_text(), runs.read_bytes()
    for text in ("", "[]", "{}", sound.replace("abc", "abd"), sound.replace('"version": 2', '"version": 99')):
        index.write_text(text)
        with pytest.raises(MachineError, match=r"store\.json: .* linework clean"):
            PointStore.open(folder)
    index.write_text(sound)
    runs.write_bytes(sound_runs[:-1] + b"\xff")
    with pytest.raises(MachineError, match=r"runs\.npy: .*damaged"):
        PointStore.open(folder)
    runs.unlink()
    with pytest.raises(MachineError, match=r"runs\.npy: No such file"):
        PointStore.open(folder)
    index.unlink()
    with pytest.raises(MachineError, match=r"store\.json: No such file"):
        PointStore.open(folder)


def test_reads_that_return_less_than_asked_for_are_gone_on_with(tmp_path, monkeypatch):
    files = [cloud(1000)]
    store = made(tmp_path / "s", files)
    whole = os.preadv

    def some(handle, buffers, offset):
        return whole(handle, [memoryview(buffers[0]).cast("B")[:777]], offset)

    monkeypatch.setattr(os, "preadv", some)
    assert_same(store.points(), selected(files))
    os.truncate(tmp_path / "s" / "0.points", 9000)
    with pytest.raises(MachineError, match="9,000 bytes"):
        store.points(Bounds(0.0, 0.0, 90.0, 90.0))


def test_a_hundred_files_need_a_handful_of_open_ones(tmp_path, monkeypatch):
    xyz, intensity, time = cloud(100)
    files = [(xyz[i : i + 1], intensity[i : i + 1], time[i : i + 1]) for i in range(100)]
    store = made(tmp_path / "s", files)
    # The process holds other files too: those of this store are counted
    n_open, one_read = [], folder.read_at

    def counted(handle, views, offset):
        n_open.append(len(_open_below(tmp_path)))
        return one_read(handle, views, offset)

    monkeypatch.setattr(folder, "read_at", counted)
    assert_same(store.points(), selected(files))
    assert len(n_open) >= 100
    assert 1 <= max(n_open) <= 8
    assert not _open_below(tmp_path)


def _open_below(path: Path) -> list[Path]:
    """Return the files below `path` that this process has open."""
    found = []
    for handle in Path("/dev/fd").iterdir():
        with contextlib.suppress(OSError):
            found.append(handle.readlink())
    return [each for each in found if each.is_relative_to(path)]


def test_tables_of_runs_come_back(tmp_path):
    table = RunTable(np.ones(3, RUN_DTYPE))
    assert np.array_equal(RunTable.from_bytes(table.to_bytes()).rows, table.rows)
    assert len(RunTable.concatenate()) == 0
    assert RunTable.concatenate(table, RunTable.empty(), table).n_points == 6
    with pytest.raises(ValueError, match="runs"):
        RunTable(np.zeros(3))


def test_an_index_is_never_written_over(tmp_path):
    made(tmp_path / "s", [cloud(5)])
    with pytest.raises(MachineError, match="index already exists"):
        write_index(tmp_path / "s", RunTable.empty(), {})
    assert json.loads((tmp_path / "s" / "store.json").read_text())["limits"] is None


@pytest.mark.parametrize("value", [0.0, 0.1, -0.1, 1e8, -1e8, 5_400_000.123, 63.99995])
def test_the_first_step_is_exact(value):
    for v in (value, np.nextafter(value, np.inf), np.nextafter(value, -np.inf)):
        step = first_step(float(v))
        assert step / 10_000 >= v > (step - 1) / 10_000
