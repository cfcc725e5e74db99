"""Data frames of other packages: loaded when somebody asks for one, and whole then."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from linework.files.vectors.read_write import write_lines
from linework.model.lines import LineSet

LATE = """
import sys
import linework.files.vectors.gdal_input
print(sorted({"pandas", "geopandas"} & set(sys.modules)))
"""
STILL = """
import sys
import linework.files.vectors.gdal_input
import geopandas
import pyogrio
print(type(pyogrio.read_dataframe(sys.argv[1], layer="cable")).__module__)
print(type(geopandas.read_file(sys.argv[1], layer="cable")).__module__, geopandas.__file__ != "")
"""


def output_of(code: str, *arguments: str) -> list[str]:
    command = [sys.executable, "-c", code, *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()


def test_no_data_frames_are_loaded_to_read_lines() -> None:
    assert output_of(LATE) == ["[]"]


def test_others_still_read_data_frames_with_pyogrio(tmp_path: Path) -> None:
    pytest.importorskip("geopandas")
    path = tmp_path / "lines.gpkg"
    write_lines(LineSet.empty("EPSG:25832"), path, kinds=("cable",))
    assert output_of(STILL, str(path)) == ["geopandas.geodataframe", "geopandas.geodataframe True"]
