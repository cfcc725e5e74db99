"""An installation without any extra: laser points in, lines out; what needs an extra says so in one line."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.conftest import CRS, road_points
from tests.scenes.blocked import environment_without, run_linework

from linework.errors import EXTRAS
from linework.files.las.write import write_las
from linework.files.trajectories.read import write_trajectory
from linework.model.trajectory import Trajectory

#: Packages that extras bring along, beside those that they name.
BROUGHT = ("mpl_toolkits", "pydantic_core", "skimage", "fontTools", "pyarrow", "anyio", "dask")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a road of 40 m, in points.laz."""
    folder = tmp_path_factory.mktemp("core")
    write_las(road_points(4000), folder / "points.laz", crs=CRS)
    return folder


@pytest.fixture(scope="module")
def blocked(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Return the environment of a Python with the core alone."""
    modules = {*BROUGHT, *(module for _, modules in EXTRAS.values() for module in modules)}
    return environment_without(tmp_path_factory.mktemp("blocked"), sorted(modules))


@pytest.fixture(scope="module")
def core(blocked: dict[str, str]) -> Callable[..., Any]:
    """Return a function that runs the command line there."""
    return lambda *arguments: run_linework(blocked, *arguments)


def test_the_core_extracts_lines_from_laser_points(core, folder):
    found = core(
        "extract", folder / "points.laz", "-o", folder / "lines.gpkg", "--features", "guardrail,road_boundary"
    )
    assert (found.returncode, "error" in found.stderr) == (0, False), found.stderr
    record = json.loads((folder / "run.json").read_text())
    assert set(record["counts"]["lines"]) == {"guardrail", "road_boundary"}
    for command in (
        ("info", folder / "points.laz"),
        ("convert", folder / "lines.gpkg", folder / "lines.geojson"),
        ("evaluate", folder / "lines.gpkg", folder / "lines.gpkg"),
        ("config",),
    ):
        found = core(*command)
        assert found.returncode == 0, found.stderr


def test_every_public_name_is_there(blocked):
    code = "import linework; [getattr(linework, name) for name in linework.__all__]; print(len(linework.__all__))"
    found = subprocess.run([sys.executable, "-c", code], env=blocked, capture_output=True, text=True)
    assert int(found.stdout or 0) > 10, found.stderr


@pytest.mark.parametrize(
    ("extra", "package", "command"),
    [
        ("cad", "ezdxf", "extract points.laz -o lines.dxf"),
        ("reports", "matplotlib", "extract points.laz -o new.gpkg --report report.html"),
        ("cad", "ezdxf", "convert lines.gpkg lines.dxf"),
        ("parquet", "pyarrow", "convert lines.gpkg lines.parquet"),
        ("reports", "matplotlib", "evaluate lines.gpkg lines.gpkg --picture hits.png"),
        ("reports", "matplotlib", "raster points.laz -o raster"),
        ("reports", "matplotlib", "photolog . -o page.html"),
        ("reports", "matplotlib", "locate . -o trajectory.csv --plot track.png"),
        ("simulate", "embreex", "simulate -o survey --no-images"),
        ("simulate", "embreex", "demo demo"),
        ("workbench", "fastapi", "serve points.laz"),
        ("stereo", "opencv-python-headless", "live . -o new.gpkg"),
    ],
)
def test_what_needs_an_extra_says_so_in_one_line_before_any_work(core, folder, extra, package, command):
    before = sorted(folder.iterdir())
    names = [folder / word if "." in word or (word in ("raster", "survey", "demo") and word != command.split()[0]) else word
             for word in command.split()]  # fmt: skip
    found = core(*names)
    assert found.returncode == 5
    assert found.stderr.count("\n") == 1
    assert f"needs the package {package}. pip install 'linework[{extra}]'\n" in found.stderr
    assert sorted(folder.iterdir()) == before


def test_images_are_left_out_by_name_where_points_can_be_used(core, tmp_path):
    pytest.importorskip("PIL")  # images are drawn with it
    from tests.scenes.image_folders import stereo_folder

    drive = tmp_path / "drive"
    stereo_folder(
        drive, [round(0.05 + 0.1 * i, 3) for i in range(8)], more='[points]\nfiles = ["points.laz"]\n'
    )
    points = road_points(4000)
    write_las(points, drive / "points.laz", crs="local")
    time_s = np.linspace(float(points.time_s.min()), float(points.time_s.max()), 11)
    xyz = np.stack([500_000.0 + np.linspace(0, 40, 11), np.full(11, 5_400_000.0), np.full(11, 100.0)], axis=1)
    write_trajectory(Trajectory(time_s, xyz, np.tile([0.0, 0.0, 90.0], (11, 1))), tmp_path / "path.csv")
    found = core("extract", drive, "-o", tmp_path / "lines.gpkg", "--trajectory", tmp_path / "path.csv")
    assert found.returncode == 4, found.stderr
    assert (tmp_path / "lines.gpkg").is_file()
    assert "pip install 'linework[stereo]'" in found.stderr.splitlines()[-1]
    alone = core("extract", drive, "-o", tmp_path / "stereo.gpkg", "--method", "stereo")
    assert alone.returncode == 5
    assert alone.stderr.splitlines()[-1].endswith("pip install 'linework[stereo]'")
