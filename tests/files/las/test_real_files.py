"""Real laser files and maps, as they come; beside them files that other tools' authors keep because they are odd."""

import laspy
import numpy as np
import pytest
from tests.oracles.las_in_memory import read_las
from tests.scenes.places import REAL

from linework.errors import CrsError, InputError, LineworkError
from linework.files.store.in_memory import read_survey_points
from linework.files.survey.open import open_survey
from linework.files.vectors.read_write import read_lines

DATA = REAL
pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason=f"no real surveys in {DATA}")

SURVEYS = sorted(
    p for p in DATA.glob("*/*.laz") if p.parent.name != "hostile" and p.stat().st_size < 2_000_000
)
ODD = sorted(p for p in (DATA / "hostile").rglob("*.la[sz]"))


def read_anyhow(path):
    """Read with the file's own CRS, else as local."""
    try:
        return read_las(path)
    except CrsError:
        return read_las(path, crs="local")


@pytest.mark.parametrize("path", SURVEYS, ids=lambda p: p.name)
def test_surveys_read_as_laspy_reads_them(path):
    content = read_anyhow(path)
    expected = laspy.read(path)
    assert content.n_promised == len(expected.points)
    assert content.n_rejected == {}
    np.testing.assert_array_equal(content.points.xyz, expected.xyz)
    if content.points.intensity is None:
        assert not np.any(expected.intensity)
    else:
        np.testing.assert_array_equal(content.points.intensity, expected.intensity)
    if content.points.time_s is not None:
        np.testing.assert_array_equal(content.points.time_s, expected.gps_time)


@pytest.mark.parametrize("path", ODD, ids=lambda p: f"{p.parent.name}-{p.name}")
def test_odd_files_read_right_or_are_refused_in_one_line(path):
    try:
        content = read_anyhow(path)
    except LineworkError as error:
        assert path.parent.name == "laszip", error  # only these two are broken
        assert isinstance(error, InputError)
        assert str(error).startswith(f"{path}: ")
        assert len(str(error)) - len(str(path)) < 300
        return
    expected = laspy.read(path)
    assert len(content.points) + sum(content.n_rejected.values()) == len(expected.points)
    if not content.n_rejected:
        in_feet = any("feet" in w for w in content.warnings)
        scale = content.points.xyz[0] / expected.xyz[0] if in_feet else np.ones(3)
        assert np.all((np.abs(scale - 0.3048) < 1e-5) | (np.abs(scale - 1.0) < 1e-12))
        np.testing.assert_allclose(content.points.xyz, expected.xyz * scale, rtol=1e-12)


def test_what_the_odd_files_are_in():
    hostile = DATA / "hostile"
    assert "NN2000 height" in read_las(hostile / "las-rs" / "32-1-472-150-76.laz").crs
    assert read_las(hostile / "las-rs" / "32-1-472-150-76.laz").n_rejected == {"noise class": 30}
    assert "NAVD88 height" in read_las(hostile / "liblas" / "srs_vertcs.las").crs
    assert read_las(hostile / "liblas" / "1.2_3.las").gps_time_kind == "gps"
    assert read_las(hostile / "las-rs" / "autzen.copc.laz").warnings[-1].startswith("feet converted")


def test_a_folder_of_roads_is_one_survey():
    read = read_survey_points(open_survey([DATA / "als-roads"], crs="local"))
    assert len(read.files) == 12
    assert read.failures == ()
    assert sum(f.n_promised for f in read.files) == len(read.points)


def test_reference_map_with_other_kind_names():
    path = DATA / "av2" / "av2_adcf7d18_map.geojson"
    everything = read_lines(path)
    assert set(everything.kind.tolist()) == {"lane_boundary", "drivable_area_edge", "ped_crossing_edge"}
    assert np.isfinite(everything.xyz).all()
    marks = {"SOLID_WHITE": "lane_marking", "DASHED_WHITE": "lane_marking"}
    markings = read_lines(path, kind_field="mark", kinds=marks)
    assert set(markings.kind.tolist()) == {"lane_marking"}
    assert 0 < len(markings) < len(everything)


@pytest.mark.parametrize("path", sorted((DATA / "hostile" / "pdal").glob("*")), ids=lambda p: p.name)
def test_other_files_end_in_one_line(path):
    for read in (read_las, read_lines):
        try:
            read(path)
        except LineworkError as error:
            assert str(error).startswith(f"{path}: ")
