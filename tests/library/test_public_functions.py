"""The functions that Python users call: what they take, what they return, and that they are silent about nothing."""

from __future__ import annotations

import dataclasses
import warnings
from pathlib import Path

import laspy
import numpy as np
import pyproj
import pytest
from tests.conftest import CRS, road_points

import linework
from linework.errors import CrsError, InputError, LineworkError, LineworkWarning, PartialError, UsageError
from linework.files.las.write import write_las
from linework.files.trajectories.read import write_trajectory
from linework.library.extract import methods_asked
from linework.library.opened import settings_given
from linework.methods.kinds import ALL_KINDS
from linework.methods.radon.method import RadonConfig
from linework.model.points import Points
from linework.model.trajectory import Trajectory
from linework.navigation.lever import at_vehicle_origin
from linework.runs.settings import RunSettings

PUBLIC = [
    "extract",
    "trace",
    "locate",
    "calibrate",
    "open_survey",
    "read_points",
    "read_trajectory",
    "read_lines",
    "write_lines",
    "find_ground",
    "evaluate",
    "simulate",
    "compile_kernels",
    "Points",
    "LineSet",
    "Line",
    "Survey",
    "Trajectory",
    "Ground",
    "Image",
    "Scores",
    "Report",
    "Radon",
    "Obb",
    "Stereo",
    "Method",
    "LineworkError",
]


def test_the_table_of_contents():
    shown = [name for name in dir(linework) if not name.startswith("__")]
    assert shown == sorted(PUBLIC)
    for name in PUBLIC:
        assert getattr(linework, name).__doc__, name


@pytest.fixture(scope="module")
def street(tmp_path_factory):
    """Return a simulated street of 60 m and its survey folder."""
    folder = tmp_path_factory.mktemp("street") / "survey"
    return linework.simulate(folder, road="urban", seed=3, length_m=60.0, points_per_m=3000, images=False)


@pytest.fixture(scope="module")
def kerbs(street):
    return linework.extract(street, kinds="kerb_top")


def same(one, two):
    assert one == two
    assert one.xyz.tobytes() == two.xyz.tobytes()


# What can be given


def test_files_are_named_in_any_way(street, kerbs):
    (path,) = street.point_files
    folder = path.parent
    given = {"kinds": "kerb_top", "trajectory": street.trajectory_file}
    for src in (
        path,
        str(path),
        [path],
        (str(path),),
        str(folder / "*.la[sz]"),
        folder / "*.la[sz]",
        iter([path]),
    ):
        found = linework.extract(src, **given)
        assert np.array_equal(found.xyz, kerbs.xyz)
    with pytest.raises(InputError, match="nothing-here"):
        linework.extract(str(folder / "nothing-here-*.laz"))


def test_points_in_memory_give_the_lines_of_their_file(street, kerbs):
    points = linework.read_points(street)
    found = linework.extract(points, kinds="kerb_top", trajectory=linework.read_trajectory(street))
    assert np.array_equal(found.xyz, kerbs.xyz)
    assert found.id.tolist() == kerbs.id.tolist()
    assert found.crs == kerbs.crs
    assert linework.evaluate(found, kerbs).overall.at.completeness == 1.0


def test_results_of_arrays_are_written_and_read(street, tmp_path):
    points = linework.read_points(street)
    bare = Points(points.xyz - points.xyz.min(axis=0), intensity=points.intensity)
    found = linework.extract(bare, kinds="kerb_top")
    assert found.crs == "local"
    assert len(found) > 0
    assert all(found.id)
    assert all(found.source)
    linework.write_lines(found, str(tmp_path / "lines.gpkg"))
    assert np.array_equal(linework.read_lines(str(tmp_path / "lines.gpkg")).xyz, found.xyz)


def test_a_crs_is_given_in_any_form(tmp_path):
    points, header = road_points(), laspy.LasHeader(point_format=1, version="1.2")
    header.scales, header.offsets = np.full(3, 1e-3), points.xyz[0]
    without_crs = laspy.LasData(header)
    without_crs.xyz = points.xyz
    without_crs.write(tmp_path / "a.las")
    for crs in (25832, "EPSG:25832", pyproj.CRS.from_epsg(25832), pyproj.CRS.from_epsg(25832).to_wkt()):
        with pytest.warns(LineworkWarning, match="no GPS time|no intensity"):
            found = linework.extract(tmp_path / "a.las", crs=crs, kinds="cable")
        assert pyproj.CRS.from_wkt(found.crs).to_epsg() == 25832
    with pytest.raises(CrsError) as refused:
        linework.extract(tmp_path / "a.las")
    assert "crs=" in str(refused.value)
    assert "--" not in str(refused.value)
    for wrong in (4326, "EPSG:1", 3.5):
        with pytest.raises(CrsError, match=r"\S"):
            linework.extract(tmp_path / "a.las", crs=wrong)


def test_kinds_are_names(las_file):
    assert linework.extract(las_file, kinds="guardrail").report.kinds == ("guardrail",)
    assert linework.extract(las_file, kinds=["cable", "guardrail"]).report.kinds == ("guardrail", "cable")
    assert linework.extract(las_file, kinds=None).report.kinds == ALL_KINDS
    with pytest.raises(UsageError, match="guardrail") as refused:
        linework.extract(las_file, kinds="gardrail")
    assert str(refused.value).startswith("kinds: ")
    assert "--" not in str(refused.value)
    for wrong in ((), "", 3, ["cable", 4]):
        with pytest.raises(UsageError, match="kinds"):
            linework.extract(las_file, kinds=wrong)


def test_settings_are_tables_or_a_file(las_file, tmp_path):
    (tmp_path / "run.toml").write_text("[radon]\ncell_m = 0.25\n")
    for settings in ({"radon": {"cell_m": 0.25}}, tmp_path / "run.toml", str(tmp_path / "run.toml")):
        linework.extract(las_file, kinds="guardrail", settings=settings)
    for wrong in (
        {"radon": {"cell_m": -1.0}},
        {"radon": {"cell_m": float("nan")}},
        {"radon": {"cel_m": 1.0}},
    ):
        with pytest.raises(linework.LineworkError, match="cel") as refused:
            linework.extract(las_file, settings=wrong)
        assert isinstance(refused.value, ValueError)


def test_settings_reach_methods_that_are_objects():
    given = settings_given({"radon": {"cell_m": 0.25}})
    (rails,) = methods_asked([linework.Radon()], "guardrail", given)
    (own,) = methods_asked([linework.Radon(config=RadonConfig(cell_m=0.3))], "guardrail", RunSettings())
    (same,) = methods_asked([linework.Radon(config=RadonConfig(cell_m=0.25))], "guardrail", given)
    assert (rails.config.cell_m, own.config.cell_m, same.config.cell_m) == (0.25, 0.3, 0.25)
    with pytest.raises(UsageError, match="settings of its own"):
        methods_asked([linework.Radon(config=RadonConfig(cell_m=0.3))], "guardrail", given)
    with pytest.raises(UsageError, match="RadonConfig"):
        methods_asked([linework.Radon(config={"cell_m": 0.3})], "guardrail", given)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ({"workers": 0}, "workers"),
        ({"workers": 1.5}, "workers"),
        ({"on_problem": "ignore"}, "on_problem"),
        ({"resume": True}, "work="),
        ({"methods": "radom"}, "radon"),
        ({"methods": "radon", "kinds": "kerb_top"}, "kerb_top"),
        ({"progress": 3}, "progress"),
        ({"methods": 5}, "methods"),
        ({"methods": ["obb", "auto"]}, "obb"),
        ({"methods": linework.Radon(find_peaks=5)}, "find_peaks"),
        ({"methods": linework.Obb(paint=5)}, "paint"),
        ({"methods": linework.Radon(kinds=("gardrail",))}, "guardrail"),
        ({"methods": linework.Radon(kinds="guardrail")}, r'\("guardrail",\)'),
        ({"methods": "stereo"}, "methods|images"),
        ({"settings": 5}, "settings"),
        ({"trajectory": 5}, "trajectory"),
    ],
)
def test_wrong_arguments_are_refused_in_the_callers_words(las_file, arguments, says):
    with pytest.raises(LineworkError, match=says) as refused:
        linework.extract(las_file, **arguments)
    assert "--" not in str(refused.value)
    assert "\n" not in str(refused.value)


def test_what_is_not_a_survey_is_told_what_to_do():
    with pytest.raises(UsageError, match=r"linework\.Points\(array"):
        linework.extract(np.zeros((10, 3)))
    with pytest.raises(UsageError, match="10 of 10 points have NaN"):
        linework.find_ground(Points(np.full((10, 3), np.nan)))


# Nothing is lost in silence


def test_markings_without_intensity_are_said():
    scan = road_points(seed=3)
    with pytest.warns(LineworkWarning, match="no intensity"):
        found = linework.extract(Points(scan.xyz), kinds="lane_marking")
    assert "no intensity" in found.report.warnings[0]
    assert linework.extract(Points(scan.xyz), kinds="guardrail").report.warnings == ()


@pytest.fixture
def cut_off(tmp_path):
    """Return a folder of two sound files and one that is cut off."""
    for i in range(3):
        write_las(road_points(east_m=500_000.0 + 40 * i, seed=i), tmp_path / f"{i}.laz", crs=CRS)
    whole = (tmp_path / "1.laz").read_bytes()
    (tmp_path / "1.laz").write_bytes(whole[: len(whole) // 2])
    return tmp_path


def test_a_file_that_is_cut_off_among_good_ones_is_an_error_with_the_lines(cut_off):
    with pytest.raises(PartialError, match=r"1\.laz") as partial:
        linework.extract(cut_off, kinds="cable")
    assert isinstance(partial.value.lines, linework.LineSet)
    assert [problem.name for problem in partial.value.lines.report.left_out] == [str(cut_off / "1.laz")]


def test_or_a_warning_if_asked_for(cut_off):
    with pytest.warns(LineworkWarning, match=r"1\.laz"):
        found = linework.extract(cut_off, kinds="cable", on_problem="warn")
    assert len(found.report.left_out) == 1
    assert "1.laz" in repr(found.report)


def test_a_trajectory_over_a_third_of_the_points_is_a_warning(las_file):
    time_s = np.linspace(3.0e8 - 1.0, 3.0e8 + 4.0 / 3.0, 30)
    xyz = np.column_stack([500_000.0 + 10.0 * (time_s - 3.0e8), np.full(30, 5_400_000.0), np.full(30, 100.0)])
    with pytest.warns(LineworkWarning, match="outside the trajectory's time"):
        found = linework.extract(las_file, kinds="cable", trajectory=Trajectory(time_s, xyz))
    assert any("outside the trajectory's time" in text for text in found.report.warnings)


def test_the_trajectory_is_that_of_the_vehicles_origin(tmp_path):
    points = road_points(2000)
    write_las(points, tmp_path / "a.laz", crs=CRS)
    time_s = np.linspace(3.0e8 - 1.0, 3.0e8 + 5.0, 60)
    xyz = np.column_stack([500_000.0 + 8.0 * (time_s - 3.0e8), np.full(60, 5_400_000.0), np.full(60, 101.8)])
    attitude = np.column_stack([np.zeros(60), np.zeros(60), np.full(60, 90.0)])
    antenna = Trajectory(time_s, xyz, attitude_deg=attitude)
    write_trajectory(antenna, tmp_path / "path.csv")
    (tmp_path / "survey.toml").write_text(
        '[points]\nfiles = ["a.laz"]\n[trajectory]\nfile = "path.csv"\nlever_m = [1.0, 2.0, 3.0]\n'
    )
    found = linework.read_trajectory(tmp_path)
    expected = at_vehicle_origin(antenna, (1.0, 2.0, 3.0), (0.0, 0.0, 0.0))
    assert np.abs(found.xyz - antenna.xyz).max() > 2.9
    assert np.array_equal(found.xyz, expected.xyz)
    # The file alone is read as it is
    assert np.array_equal(linework.read_trajectory(str(tmp_path / "path.csv")).xyz, antenna.xyz)


def test_the_report_tells_what_was_read(street, kerbs):
    report = kerbs.report
    (source,) = report.inputs
    assert source.name == str(street.point_files[0])
    assert source.n_used > 100_000
    assert report.left_out == ()
    assert report.kinds == ("kerb_top",)
    assert sum(report.timings_s.values()) > 0.0
    assert len(repr(report).splitlines()) <= 10
    assert kerbs[:1].report is report


# Progress, work folder, processes


def test_progress_is_given_to_a_function(las_file):
    calls = []
    linework.extract(
        las_file, kinds="cable", progress=lambda stage, done, total: calls.append((stage, done, total))
    )
    stages = list(dict.fromkeys(stage for stage, _, _ in calls))
    assert {"read points", "find the road", "find lines", "join lines"} <= set(stages)
    for stage in stages:
        *_, (_, done, total) = [call for call in calls if call[0] == stage]
        assert done == total > 0


def test_nothing_is_printed(las_file, capfd):
    linework.extract(las_file, kinds="cable")
    out, err = capfd.readouterr()
    assert (out, err) == ("", "")
    linework.extract(las_file, kinds="cable", progress=True)
    assert "find lines" in capfd.readouterr().err


def test_workers_and_tiles_do_not_matter(street, kerbs, tmp_path):
    many = {"tiling": {"core_m": 64.0, "max_points": 20_000}}
    for workers in (1, 2):
        same(linework.extract(street, kinds="kerb_top", workers=workers, settings=many), kerbs)


def test_the_work_folder_keeps_the_decoded_points(las_file, tmp_path):
    stages = []
    for _ in range(2):
        linework.extract(
            las_file, kinds="cable", work=tmp_path / "work", progress=lambda *call: stages.append(call)
        )
    assert {stage for stage, _, _ in stages} >= {"read points"}
    begun = [stage for stage, done, total in stages if stage == "read points" and (done, total) == (0, 0)]
    assert len(begun) == 1
    assert [path.name for path in las_file.parent.iterdir()] == [las_file.name]


# Following one line


def test_a_line_is_traced_from_a_place(street, kerbs):
    line = max(kerbs, key=lambda line: line.length_m)
    at = line.xyz[len(line.xyz) // 2]
    found = linework.trace(street, at[:2], kind="road_boundary")
    assert found.kind[0] == "road_boundary"
    assert found.length_m[0] > 10.0
    assert "kerb_top" in found.kinds
    again = linework.trace(linework.read_points(street), (float(at[0]), float(at[1])), kind="road_boundary")
    assert again.length_m[0] > 10.0
    in_space = linework.trace(street, at, kind="road_boundary")
    assert np.array_equal(in_space.xyz, found.xyz)
    with pytest.raises(UsageError, match="at: "):
        linework.trace(street, (1.0, float("nan")))
    with pytest.raises(InputError) as refused:
        linework.trace(street, (at[0], at[1] + 500.0))
    assert "--" not in str(refused.value)


def test_reading_warns_of_what_it_leaves_out(cut_off):
    with pytest.warns(LineworkWarning, match=r"1\.laz"):
        points = linework.read_points(cut_off)
    assert len(points) == 800


def test_surveys_are_values(street):
    assert dataclasses.replace(street, name="other").name == "other"
    assert isinstance(street.root, Path)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert linework.open_survey(street.root).point_files == street.point_files


def test_a_name_that_would_be_a_path_is_refused(las_file):
    class Outside(linework.Method):
        name = "outside"
        kinds = ("../ridge",)

        def look(self, piece):
            return linework.LineSet.empty()

    with pytest.raises(UsageError, match="is not a name"):
        linework.extract(las_file, methods=Outside())


def test_tracing_loses_nothing_in_silence(street, kerbs, tmp_path):
    line = max(kerbs, key=lambda line: line.length_m)
    at = line.xyz[len(line.xyz) // 2][:2]
    (path,) = street.point_files
    (tmp_path / "cut.laz").write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(PartialError, match=r"cut\.laz") as partial:
        linework.trace([path, tmp_path / "cut.laz"], at, kind="road_boundary")
    assert partial.value.lines.kind[0] == "road_boundary"
    with pytest.warns(LineworkWarning, match=r"cut\.laz"):
        found = linework.trace([path, tmp_path / "cut.laz"], at, kind="road_boundary", on_problem="warn")
    assert len(found.report.left_out) == 1
