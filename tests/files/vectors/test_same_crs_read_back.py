"""PROJ may write a CRS with its datum ensemble or with a datum, in one process, too: another text, the same CRS."""

from __future__ import annotations

import pyproj
import pytest

from linework.crs import parse_crs
from linework.errors import MachineError
from linework.files.maps.landxml import verify_landxml
from linework.files.vectors.geojson import verify_geojson
from linework.files.vectors.read_write import write_lines
from linework.model.lines import LineSet

CRS = parse_crs("EPSG:25832+7837")


@pytest.mark.parametrize(("suffix", "verify"), [(".geojson", verify_geojson), (".landxml", verify_landxml)])
def test_a_file_whose_crs_reads_back_in_other_words_is_the_same(tmp_path, suffix, verify):
    place = [[500000.0, 5.8e6, 100.0], [500009.0, 5.8e6, 100.0]]
    lines = LineSet.from_lines([place], crs=CRS, kind=["lane_marking"])
    path = tmp_path / f"lines{suffix}"
    write_lines(lines, path)
    worded = pyproj.CRS.from_wkt(CRS).to_wkt("WKT2_2015")
    assert worded != CRS
    verify(path, lines.with_columns(crs=worded), path)
    with pytest.raises(MachineError):
        verify(path, lines.with_columns(crs=parse_crs("EPSG:25833+7837")), path)
