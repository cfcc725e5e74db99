"""`linework raster` as a user runs it."""

import json

import numpy as np
import pyogrio
import pytest
import rasterio
import typer
from tests.scenes.stereo_folders import make_stereo_folder
from typer.testing import CliRunner

from linework.cli.commands.raster import raster
from linework.errors import InputError, OutputExistsError, UsageError
from linework.files.las.write import write_las
from linework.files.trajectories.read import write_trajectory
from linework.model.points import Points
from linework.model.trajectory import Trajectory

IMAGES = {
    "classes", "density", "maximum_height", "minimum_height", "mean_height", "height_above_road",
    "intensity", "intensity_normalised", "binary", "binary_lines", "radon", "radon_dilated",
}  # fmt: skip
EAST, NORTH = 664_000.0, 5_080_000.0


def road_with_rail(*, with_intensity=True, with_time=False):
    """A flat road of 60 m by 10 m, a scan line every 0.25 m, and a rail 6 m north of its middle."""
    x = np.repeat(np.arange(0.0, 60.0, 0.25), 60)
    y = np.tile(np.linspace(-5.0, 5.0, 60), 240)
    road = np.column_stack([x, y, 0.002 * np.sin(7.0 * x + 3.0 * y)])
    rail_x = np.repeat(np.arange(0.0, 60.0, 0.25), 3)
    rail = np.column_stack([rail_x, np.full(len(rail_x), 6.0), np.tile([0.45, 0.6, 0.75], 240)])
    xyz = np.concatenate([road, rail]) + np.array([EAST, NORTH, 200.0])
    time = np.concatenate(
        [x / 0.25 * 0.01 + 5e-5 * np.tile(np.arange(60), 240), rail_x / 0.25 * 0.01 + 0.004]
    )
    return Points(
        xyz,
        intensity=np.full(len(xyz), 70.0, dtype=np.float32) if with_intensity else None,
        time_s=time + 400_000_000.0 if with_time else None,
    )


def run(*arguments):
    app = typer.Typer()
    app.command()(raster)
    return CliRunner().invoke(app, [str(a) for a in arguments])


@pytest.fixture(scope="module")
def survey(tmp_path_factory):
    path = tmp_path_factory.mktemp("survey") / "road.laz"
    write_las(road_with_rail(), path, crs="EPSG:32632")
    return path


@pytest.fixture(scope="module")
def images(survey, tmp_path_factory):
    out = tmp_path_factory.mktemp("out") / "images"
    result = run(survey, "-o", out)
    assert result.exception is None, result.output
    return out


def test_all_images_in_one_folder(images):
    out = images
    assert {p.name for p in out.iterdir()} == {f"{n}.{s}" for n in IMAGES for s in ("tif", "png")} | {
        "run.json"
    }
    record = json.loads((out / "run.json").read_text(encoding="utf-8"))
    assert set(record["images"]) == IMAGES
    assert record["counts"]["points_used"] == len(road_with_rail())
    with rasterio.open(out / "density.tif") as density, rasterio.open(out / "binary.tif") as binary:
        assert density.crs.to_epsg() == 32632
        assert density.read(1).sum() == len(road_with_rail())
        rows, _ = np.nonzero(binary.read(1))
        _, north = binary.xy(rows, np.zeros_like(rows))
        np.testing.assert_allclose(north, NORTH + 6.1, atol=1e-6)
    with rasterio.open(out / "maximum_height.tif") as maximum:
        assert np.nanmax(maximum.read(1)) == pytest.approx(200.75, abs=1e-3)
    with rasterio.open(out / "radon_dilated.tif") as dilated:
        # 240 cells of 0.2 m hold a rail point: 48 m, in two strips of half a cell each
        assert np.nanmax(dilated.read(1)) == pytest.approx(24.0, abs=0.1)


def test_cells_along_and_across_turn_the_grid(tmp_path):
    turned = road_with_rail()
    angle = np.radians(30.0)
    spin = np.array([[np.cos(angle), np.sin(angle), 0], [-np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    centre = np.array([EAST, NORTH, 0.0])
    path = tmp_path / "turned.laz"
    write_las(
        Points((turned.xyz - centre) @ spin + centre, intensity=turned.intensity), path, crs="EPSG:32632"
    )
    result = run(path, "-o", tmp_path / "out", "--cell-along-m", 0.5, "--cell-across-m", 0.25, "--json")
    assert result.exception is None, result.output
    grid = json.loads(result.stdout)["parameters"]["grid"]
    assert (grid["cell_width_m"], grid["cell_height_m"]) == (0.5, 0.25)
    assert grid["rotation_deg"] == pytest.approx(30.0, abs=0.2)
    with rasterio.open(tmp_path / "out" / "density.tif") as density:
        assert np.degrees(np.arctan2(density.transform.d, density.transform.a)) == pytest.approx(
            30.0, abs=0.2
        )


def test_the_cell_along_can_be_the_scan_line_spacing(tmp_path):
    write_las(road_with_rail(with_time=True), tmp_path / "road.laz", crs="EPSG:32632")
    time_s = np.array([-1.0, 5.0])
    path = np.column_stack([EAST + 25.0 * time_s, np.full(2, NORTH), np.full(2, 200.0)])
    write_trajectory(Trajectory(time_s + 400_000_000.0, path), tmp_path / "trajectory.csv")
    result = run(
        tmp_path / "road.laz", "-o", tmp_path / "out", "--cell-along-m", "auto", "--json",
        "--trajectory", tmp_path / "trajectory.csv",
    )  # fmt: skip
    assert result.exception is None, result.output
    assert json.loads(result.stdout)["parameters"]["grid"]["cell_width_m"] == pytest.approx(0.25, rel=0.01)


def test_no_intensity_and_nothing_in_the_band(tmp_path):
    write_las(road_with_rail(with_intensity=False), tmp_path / "road.laz", crs="local")
    result = run(
        tmp_path / "road.laz", "-o", tmp_path / "out", "--crs", "local", "--json",
        "--min-height-m", 50, "--max-height-m", 60,
    )  # fmt: skip
    assert result.exception is None, result.output
    assert set(json.loads(result.stdout)["images"]) == IMAGES - {"intensity", "intensity_normalised"}
    with rasterio.open(tmp_path / "out" / "binary_lines.tif") as lines:
        assert lines.crs is None
        assert not lines.read(1).any()


def test_a_folder_with_something_in_it_is_not_touched_and_a_second_run_gives_the_same(
    survey, images, tmp_path
):
    kept = tmp_path / "density.tif"
    kept.write_text("mine")
    result = run(survey, "-o", tmp_path)
    assert isinstance(result.exception, OutputExistsError)
    assert [p.name for p in tmp_path.iterdir()] == ["density.tif"]
    assert kept.read_text() == "mine"
    assert run(survey, "-o", tmp_path, "--overwrite", "--quiet").exception is None
    for path in images.iterdir():
        if path.name != "run.json":
            assert path.read_bytes() == (tmp_path / path.name).read_bytes(), path.name


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        (["--cell-m", 0], UsageError, "--cell-m is 0"),
        (["--cell-m", "nan"], UsageError, "--cell-m is nan"),
        (["--cell-along-m", "wide"], UsageError, "expected a number of metres or auto"),
        (["--cell-across-m", -1], UsageError, "--cell-across-m is -1"),
        (["--min-height-m", 2], UsageError, "is not below --max-height-m 1.2"),
        (["--cell-along-m", "auto"], InputError, "needs times"),
        (["--cell-m", 0.001], InputError, "the limit is"),
        (["--peaks", "publishd"], UsageError, "Did you mean published?"),
        (["--candidates", "lines.dxf"], UsageError, "cannot write candidate lines as '.dxf'"),
        (["--threshold", "nan"], UsageError, "--threshold is nan, expected 0 to 10000 m"),
        (["--pair", 3], InputError, "no stereo images"),
    ],
)
def test_what_cannot_be_drawn_is_said_and_leaves_nothing(survey, tmp_path, options, error, message):
    result = run(survey, "-o", tmp_path / "out", *options)
    assert isinstance(result.exception, error), result.output
    assert message in str(result.exception)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("peaks", ["ours", "published"])
def test_candidate_lines_have_their_place_in_the_radon_image(survey, tmp_path, peaks):
    lines = tmp_path / "candidates.csv"
    result = run(survey, "-o", tmp_path / "out", "--peaks", peaks, "--candidates", lines, "--quiet")
    assert result.exception is None, result.output
    names, strongest, *_ = (row.split(",") for row in lines.read_text().splitlines())
    found = dict(zip(names, map(float, strongest), strict=True))
    # The rail: 60 m from west to east
    assert (found["rank"], found["theta_deg"]) == (1.0, pytest.approx(90.0, abs=0.5))
    # A scan line every 0.25 m fills four of five cells, which may lie in two strips
    assert 20.0 < found["strength_m"] <= 60.0


def test_a_roof_over_the_rail_hides_it_from_the_maximum_image_only(tmp_path):
    points = road_with_rail()
    roof = points.xyz[points.xyz[:, 2] > 200.4] + np.array([0.0, 0.0, 5.0])
    path = tmp_path / "roof.laz"
    write_las(Points(np.concatenate([points.xyz, roof])), path, crs="EPSG:32632")
    n_lines = {}
    for peaks in ("ours", "published"):
        lines = tmp_path / f"{peaks}.csv"
        result = run(path, "-o", tmp_path / peaks, "--peaks", peaks, "--candidates", lines, "--quiet")
        assert result.exception is None, result.output
        n_lines[peaks] = len(lines.read_text().splitlines()) - 1
    assert n_lines["ours"] >= 1
    assert n_lines["published"] == 0


def test_a_threshold_leaves_out_weaker_lines(survey, tmp_path):
    lines = tmp_path / "candidates.gpkg"
    result = run(survey, "-o", tmp_path / "out", "--threshold", 500, "--candidates", lines, "--quiet")
    assert result.exception is None, result.output
    assert len(pyogrio.read_dataframe(lines)) == 0


def test_the_steps_on_a_stereo_pair_are_written(tmp_path):
    folder = make_stereo_folder(tmp_path / "van")
    result = run(folder, "-o", tmp_path / "steps", "--pair", 1, "--json", "--quiet")
    assert result.exception is None, result.output
    steps = ("grey", "median_minus_mean", "binary", "thinned", "chains")
    expected = {f"{side}_{step}.png" for side in ("left", "right") for step in steps}
    assert {path.name for path in (tmp_path / "steps").iterdir()} == {*expected, "chains.json"}
    chains = json.loads((tmp_path / "steps" / "chains.json").read_text())
    assert json.loads(result.output)["lines"] == {side: len(own) for side, own in chains.items()}
    missing = run(folder, "-o", tmp_path / "none", "--pair", 999, "--quiet")
    assert "no stereo pair 999 with a pose" in str(missing.exception)
    assert not (tmp_path / "none").exists()
