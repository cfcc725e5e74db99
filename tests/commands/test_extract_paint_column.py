"""`linework extract --paint-column`: an extra dimension that another program wrote is the evidence of paint."""

import json

import laspy
import numpy as np
import pytest
import shapely

from linework.files.las.write import write_las
from linework.files.vectors.read_write import read_lines
from linework.simulation.simulate import simulate_survey

PAINT = ("lane_marking", "lane_marking_dash", "road_marking_other")


@pytest.fixture(scope="module")
def classified(tmp_path_factory):
    """A laser file as laspy writes it, with the probability of paint of a program that knows the paint."""
    made = simulate_survey("urban", 612, 60.0, points_per_m=1500.0)
    folder = tmp_path_factory.mktemp("paint")
    write_las(made.points, folder / "plain.laz", crs=made.crs)
    truth = [i for i in range(len(made.truth)) if made.truth.kind[i] in PAINT]
    painted = shapely.union_all([
        shapely.LineString(made.truth[i].xyz[:, :2]).buffer(0.06, cap_style="flat") for i in truth
    ])  # fmt: skip
    las = laspy.read(folder / "plain.laz")
    las.add_extra_dim(laspy.ExtraBytesParams("p_paint", "f4"))
    las["p_paint"] = np.where(shapely.contains_xy(painted, np.asarray(las.x), np.asarray(las.y)), 0.9, 0.05)
    las.add_extra_dim(laspy.ExtraBytesParams("label", "u1"))
    las["label"] = np.full(len(las.points), 7, dtype=np.uint8)
    las.intensity[:] = 1000  # nothing to be seen there
    las.write(folder / "classified.laz")
    return folder / "classified.laz"


def test_a_column_of_probabilities_finds_the_paint(linework, classified, tmp_path):
    features = ("--features", ",".join(PAINT))
    without = linework("extract", classified, "-o", tmp_path / "without.gpkg", *features, "--quiet")
    assert without.code == 0, without.stderr
    assert len(read_lines(tmp_path / "without.gpkg")) == 0
    found = linework(
        "extract",
        classified,
        "-o",
        tmp_path / "lines.gpkg",
        *features,
        "--paint-column",
        "p_paint",
        "--quiet",
    )
    assert found.code == 0, found.stderr
    assert read_lines(tmp_path / "lines.gpkg")["lane_marking"].length_m.sum() > 60.0
    assert json.loads((tmp_path / "lines.gpkg.run.json").read_text())["parameters"]["paint"] == "p_paint"


def test_wrong_columns_are_refused(linework, classified, tmp_path):
    for column, message in (("p_wet", "p_wet"), ("label", "label")):
        found = linework(
            "extract",
            classified,
            "-o",
            tmp_path / "l.gpkg",
            "--features",
            "lane_marking",
            "--paint-column",
            column,
            "--quiet",
        )
        assert found.code != 0
        assert message in found.stderr.splitlines()[-1]
        assert not (tmp_path / "l.gpkg").exists()
    found = linework(
        "extract", classified, "-o", tmp_path / "l.gpkg", "--paint-column", "p_paint", "--features", "cable"
    )
    assert found.code == 2
    assert "nothing that is looked for is paint" in found.stderr
