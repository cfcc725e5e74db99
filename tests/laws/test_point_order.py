"""The order of points in an array does not change the lines: with many tiles, and as one tile."""

import tempfile
from pathlib import Path

import laspy
import numpy as np
import pytest
from tests.scenes.effort import THOROUGH
from tests.scenes.places import REAL

from linework.crs import parse_crs
from linework.errors import CrsError
from linework.files.store.in_memory import read_survey_points
from linework.files.survey.open import open_survey
from linework.methods.choose import choose_methods
from linework.methods.kinds import ALL_KINDS
from linework.methods.point_order import in_fixed_order
from linework.methods.protocol import Method, extract_tile
from linework.model.lines import LineSet
from linework.model.points import Points
from linework.model.tile import TileData
from linework.runs.find import find_lines
from linework.runs.opened.from_points import opened_points
from linework.runs.opened.recordings import opened_recordings
from linework.runs.resume import run_folder
from linework.runs.settings import RunSettings, TilingConfig
from linework.simulation.simulate import simulate_survey

SHUFFLES = 20 if THOROUGH else 2
#: Several tiles of each method.
TILING = TilingConfig(core_m=64.0, high_core_m=100.0, max_points=10_000)
LASER_METHODS = [method for method in choose_methods("auto", ALL_KINDS) if method.recording == "points"]


def shuffled(points, seed):
    return points.take(np.random.default_rng(seed).permutation(len(points)))


def through_the_store(points, trajectory, tiling=TILING, methods=LASER_METHODS):
    with tempfile.TemporaryDirectory() as name:
        work = Path(name)
        with (
            opened_points(points, work, trajectory=trajectory) as recordings,
            run_folder(work, work / "lines", {}) as run,
        ):
            found = find_lines(recordings, methods, run, settings=RunSettings(tiling=tiling))
    assert not found.failures
    return found.lines


def as_one_tile(method, points, trajectory):
    tile = TileData("whole", points.bounds.grown(1.0), points, trajectory)
    return extract_tile(method, tile)


def assert_same_bytes(lines: LineSet, others: LineSet):
    assert lines.kind.tolist() == others.kind.tolist()
    assert lines.xyz.tobytes() == others.xyz.tobytes()
    assert lines.sigma_xy_m.tobytes() == others.sigma_xy_m.tobytes()
    assert lines.id.tolist() == others.id.tolist()
    assert lines.confidence.tobytes() == others.confidence.tobytes()


@pytest.fixture(scope="module")
def simulated():
    return simulate_survey("bends", 611, 120.0, points_per_m=1500)


def test_many_tiles(simulated):
    lines = through_the_store(simulated.points, simulated.trajectory)
    assert {"lane_marking", "road_boundary"} < set(lines.kind.tolist())
    for seed in range(SHUFFLES):
        assert_same_bytes(lines, through_the_store(shuffled(simulated.points, seed), simulated.trajectory))


@pytest.mark.parametrize(
    "method", LASER_METHODS, ids=lambda method: "-".join((method.name, *method.kinds[:1]))
)
def test_one_tile(simulated, method):
    lines = as_one_tile(method, simulated.points, simulated.trajectory)
    assert len(lines) or "cable" in method.kinds
    for seed in range(SHUFFLES):
        assert_same_bytes(lines, as_one_tile(method, shuffled(simulated.points, seed), simulated.trajectory))


#: One from the air, and one from a van.
REAL_FILES = [
    ("als-roads/als_road_t0717_0743.laz", "local"),
    ("here-a22/here_a22_uniform_south.laz", "EPSG:32632"),
]


@pytest.mark.skipif(not REAL.is_dir(), reason=f"no real surveys in {REAL}")
@pytest.mark.parametrize(("name", "crs"), REAL_FILES, ids=["air", "van"])
def test_real_points(name, crs):
    points = read_survey_points(open_survey([REAL / name], crs=crs)).points
    stored = through_the_store(points, None, TilingConfig())
    alone = [as_one_tile(method, points, None) for method in LASER_METHODS]
    assert len(stored)
    assert any(alone)
    # A million points: one order exchanges every pair that could matter
    for seed in range(SHUFFLES if THOROUGH else 1):
        mixed = shuffled(points, seed)
        assert_same_bytes(stored, through_the_store(mixed, None, TilingConfig()))
        if seed == 0 or THOROUGH:
            for method, lines in zip(LASER_METHODS, alone, strict=True):
                assert_same_bytes(lines, as_one_tile(method, mixed, None))


class Stripes(Method):
    """Lines along the brightest points of each metre of road, as a network sees them."""

    name = "stripes"
    kinds = ("stripe",)

    def look(self, piece):
        painted = piece.points.take(piece.points["p_paint"] > 0.5)
        along = np.floor(painted.xyz[:, 0]).astype(np.int64)
        mean = [painted.xyz[along == metre].mean(axis=0) for metre in np.unique(along)]
        return LineSet.from_lines([np.array(mean)], kind=["stripe"]) if len(mean) > 1 else LineSet.empty()


def test_further_columns_reach_methods_from_files_and_from_arrays(tmp_path):
    rng = np.random.default_rng(3)
    corner = np.array([500_000.0, 5_400_000.0, 100.0])
    xyz = np.round(rng.uniform([0, -4, 0], [300, 4, 0.02], (60_000, 3)), 3) + corner
    paint = np.round(np.exp(-np.abs(xyz[:, 1] - 5_400_001.0)), 4).astype(np.float32)
    points = Points(
        xyz, intensity=rng.integers(1, 900, 60_000), time_s=3e8 + np.arange(60_000) / 1e3, p_paint=paint
    )
    header = laspy.LasHeader(version="1.4", point_format=6)
    header.scales, header.offsets = np.full(3, 0.001), corner
    header.global_encoding.gps_time_type = laspy.header.GpsTimeType.STANDARD
    header.add_extra_dims([laspy.ExtraBytesParams("label", "u1"), laspy.ExtraBytesParams("p_paint", "f4")])
    data = laspy.LasData(header)
    data.x, data.y, data.z = xyz.T
    data.intensity, data.gps_time, data.p_paint = points.intensity, points.time_s, paint
    data.write(tmp_path / "points.laz")
    survey, found = open_survey([tmp_path / "points.laz"], crs="local", carry="p_paint"), []
    for tiling in (TILING, TilingConfig()):
        with (
            opened_recordings(survey, tmp_path) as recordings,
            run_folder(tmp_path, tmp_path / "lines", {}) as run,
        ):
            of_files = find_lines(recordings, [Stripes()], run, settings=RunSettings(tiling=tiling))
        assert not of_files.failures
        found.append(of_files.lines)
        assert_same_bytes(of_files.lines, through_the_store(shuffled(points, 1), None, tiling, [Stripes()]))
    assert found[1].length_m.sum() > 290.0
    assert np.abs(found[1].xyz[:, 1] - 5_400_001.0).max() < 0.3
    assert len(np.unique(found[0].xyz[:, 0])) >= 290


def test_the_lines_of_a_tile_have_the_crs_of_its_points():
    xyz = np.stack([np.arange(9.0), np.zeros(9), np.zeros(9)], axis=1)
    lines = as_one_tile(Stripes(), Points(xyz, crs=25832, p_paint=np.ones(9)), None)
    assert len(lines) == 1
    assert lines.crs == parse_crs("EPSG:25832")
    with pytest.raises(CrsError, match=r"crs: .*degrees"):
        as_one_tile(Stripes(), Points(xyz, crs=4326, p_paint=np.ones(9)), None)


def test_the_fixed_order_is_that_of_the_tile_store():
    rng = np.random.default_rng(5)
    # Few places, values and columns: ties of every sort, in several blocks
    xyz = rng.integers(-3, 3, (4000, 3)) * [40.0, 40.0, 900.0] + rng.integers(0, 2, (4000, 3)) * 0.25
    points = Points(
        xyz, intensity=rng.integers(1, 3, 4000), time_s=rng.integers(100, 102, 4000), crs="EPSG:25832",
        b=rng.integers(0, 3, 4000), a=rng.normal(size=4000),
    )  # fmt: skip
    ordered = in_fixed_order(points)
    assert len({*map(tuple, ordered.xyz.tolist())}) < 2000
    with tempfile.TemporaryDirectory() as name, opened_points(points, Path(name)) as recordings:
        stored = recordings.points.points.points()
    assert list(stored.columns) == ["a", "b"]
    for column, values in stored.by_name().items():
        assert ordered[column].tobytes() == values.tobytes(), column
