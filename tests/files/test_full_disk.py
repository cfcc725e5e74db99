"""A disk that is full never gives a file: one line, exit code 5, nothing left."""

import subprocess
import sys

import pytest

#: Runs with a limit on the size of files, which the system treats as a full disk does.
CODE = """
import resource, signal, sys
from pathlib import Path
import numpy as np
from linework.errors import LineworkError
from linework.files.las.write import write_las
from linework.files.images.geotiff import write_geotiff
from linework.files.output.record import write_json
from linework.files.trajectories.read import write_trajectory
from linework.files.vectors.read_write import write_lines
from linework.model.grid import Grid, Image
from linework.model.lines import LineSet
from linework.model.points import Points
from linework.model.trajectory import Trajectory

folder, size, names = Path(sys.argv[1]), int(sys.argv[2]), sys.argv[3:]
rng = np.random.default_rng(0)
line = np.cumsum(rng.random((4000, 3)), axis=0)


def make(path):
    if path.suffix in (".las", ".laz"):
        write_las(Points(rng.random((20000, 3)) * 100), path, crs="local")
    elif path.suffix == ".tif":
        write_geotiff(Image(rng.random((300, 300)), Grid(0, 0, 1, 1, 300, 300)), path, crs="local")
    elif path.suffix == ".csv":
        write_trajectory(Trajectory(np.arange(4000.0), line), path)
    elif path.name == "run.json":
        write_json({"values": line.tolist()}, path)
    else:
        write_lines(LineSet.from_lines([line], kind=["cable"], crs="local"), path)


signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))
for name in names:
    try:
        make(folder / name)
    except LineworkError as error:
        print(error.exit_code, error)
"""
NAMES = ["a.gpkg", "a.geojson", "a.dxf", "a.fgb", "a.laz", "a.las", "a.tif", "a.csv", "run.json"]


@pytest.mark.parametrize("size", [1000, 30_000])
def test_full_disk(tmp_path, size):
    done = subprocess.run(
        [sys.executable, "-c", CODE, str(tmp_path), str(size), *NAMES], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert len(lines) == len(NAMES)
    for name, line in zip(NAMES, lines, strict=True):
        assert line.startswith(f"5 {tmp_path / name}: cannot be written: "), line
    assert list(tmp_path.iterdir()) == []
