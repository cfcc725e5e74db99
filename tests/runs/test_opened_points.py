"""Points from arrays, opened as a survey: store and trajectory are checked as those of files are."""

import numpy as np
import pytest
from tests.conftest import road_points

from linework.errors import InputError, UsageError
from linework.files.survey.open import open_survey
from linework.model.points import Points
from linework.model.trajectory import Trajectory
from linework.runs.opened.from_points import opened_points
from linework.runs.opened.recordings import opened_recordings

POINTS = road_points(4000)
START = 3.0e8


def path(*, east_m=500_000.0, start_s=START, n=9):
    time_s = start_s + np.linspace(0.0, 4.0, n)
    return Trajectory(
        time_s, np.stack([east_m + np.linspace(0, 40, n), np.full(n, 5.4e6), np.full(n, 100.0)], axis=1)
    )


def test_columns_and_crs_come_through(tmp_path):
    points = Points(POINTS.xyz, crs=25832, p_paint=np.linspace(0, 1, 4000))
    with opened_points(points, tmp_path, name="mine") as recordings:
        assert recordings.survey.name == "mine"
        assert recordings.survey.carry == ("p_paint",)
        assert recordings.survey.crs == recordings.points.facts.crs
        found = recordings.points.points.points()
    assert found.crs.startswith('PROJCRS["ETRS89 / UTM zone 32N"')
    assert np.array_equal(np.sort(found["p_paint"]), points["p_paint"])
    assert found.intensity is None


def test_the_store_is_used_again_for_the_same_arrays_only(tmp_path):
    def keys(points, name="points"):
        with opened_points(points, tmp_path, name=name) as recordings:
            folder = recordings.points.points.folder
            return folder, recordings.points.key, (folder / "0.points").stat().st_mtime_ns

    first = keys(POINTS)
    assert keys(POINTS) == first
    other = keys(Points(POINTS.xyz + 1.0, crs=POINTS.crs))
    assert other[0] != first[0]
    assert other[1] != first[1]
    brighter = Points(POINTS.xyz, intensity=POINTS.intensity + 1, time_s=POINTS.time_s)
    assert keys(brighter)[1] != first[1]
    # A store of an earlier state of the same points is removed
    assert not first[0].exists()
    assert keys(brighter, "others")[0].exists()
    assert keys(brighter)[0].exists()


def test_files_with_and_without_further_columns_have_a_store_each(las_file, tmp_path):
    folders = []
    for carry in ((), ("user_data",), ("classification", "user_data"), ()):
        with opened_recordings(open_survey([las_file], carry=carry), tmp_path) as recordings:
            folders.append(recordings.points.points.folder)
            assert recordings.points.points.columns == carry
            assert recordings.identity["carry"] == carry
    assert len(set(folders)) == 3
    assert folders[0] == folders[3]


def test_a_trajectory_is_checked_as_that_of_a_file(tmp_path):
    with opened_points(POINTS, tmp_path, trajectory=path()) as recordings:
        assert recordings.warnings == ()
        assert recordings.trajectory is recordings.points.trajectory is not None
    with opened_points(POINTS, tmp_path, trajectory=path(start_s=START + 2.0)) as recordings:
        assert any(
            "50 % of the points are outside the trajectory's time" in text for text in recordings.warnings
        )
    for wrong, text in (
        (path(east_m=700_000.0), "trajectory: .* 200.0 km apart"),
        (path(start_s=5.0), "no common time"),
    ):
        with pytest.raises(InputError, match=text), opened_points(POINTS, tmp_path, trajectory=wrong):
            pass


def test_a_trajectory_that_cannot_be_used_is_refused(tmp_path):
    good = path()
    broken = Trajectory(good.time_s, np.where(np.arange(27).reshape(9, 3) == 4, np.nan, good.xyz))
    for wrong, text in (
        (broken, "trajectory: 1 of 9 poses have NaN or infinity in xyz"),
        (good.take([0]), "trajectory: 1 poses, at least 2"),
    ):
        with pytest.raises(UsageError, match=text), opened_points(POINTS, tmp_path, trajectory=wrong):
            pass
