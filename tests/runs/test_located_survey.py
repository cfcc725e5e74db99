"""A survey with logs and no trajectory gets one, as `linework locate` makes it."""

import numpy as np
import pytest
from tests.scenes.stereo_folders import TOML, make_stereo_folder

from linework.errors import InputError
from linework.files.survey.open import open_survey
from linework.runs.opened.recordings import located_survey, opened_recordings
from linework.runs.steps import RunSteps

SPEED_MPS = 10.0
LOGS = '[navigation]\ngnss = "gnss.csv"\ngyro = "gyro.csv"\nwheels = "wheels.csv"\n[vehicle]\ntick_m = 0.02\n'


@pytest.fixture
def work(tmp_path):
    for name in ("runs", "stores"):
        (tmp_path / "work" / name).mkdir(parents=True)
    return tmp_path / "work"


@pytest.fixture
def logged(tmp_path):
    """Return a survey folder of a van that drives east at 10 m/s for a minute, pairs in the middle of it."""
    toml = TOML.replace('[trajectory]\nfile = "trajectory.csv"\n', "") + LOGS
    folder = make_stereo_folder(tmp_path / "survey", times=[30.0, 30.5, 31.0], toml=toml)
    t = np.arange(0.0, 60.01, 0.1)
    fixes = [f"{a:.1f},{500000 + SPEED_MPS * a:.3f},5400000,100,0.02,0.02,0.04" for a in t[::2]]
    write(folder / "gnss.csv", "time_s,easting_m,northing_m,height_m,sigma_e_m,sigma_n_m,sigma_z_m", fixes)
    write(folder / "gyro.csv", "time_s,yaw_rate_dps,roll_deg,pitch_deg", [f"{a:.1f},0.001,0,0" for a in t])
    counts = (SPEED_MPS * t / 0.02).astype(int)
    write(folder / "wheels.csv", "time_s,left_ticks,right_ticks",
          [f"{a:.1f},{n},{n}" for a, n in zip(t, counts, strict=True)])  # fmt: skip
    return folder


def write(path, head, rows):
    path.write_text("\n".join([head, *rows]) + "\n")


def test_pairs_are_placed_by_the_logs(logged, work):
    with opened_recordings(open_survey([logged]), work) as recordings:
        assert recordings.stereo is not None
        np.testing.assert_allclose(recordings.stereo.poses.xyz[:, 0], [500_300, 500_305, 500_310], atol=0.05)
        np.testing.assert_allclose(recordings.stereo.poses.xyz[:, 1], 5_400_000, atol=0.05)
        np.testing.assert_allclose(recordings.stereo.poses.R_world_vehicle[:, 0, 0], 1.0, atol=1e-3)
        assert any("made from the logs" in warning for warning in recordings.warnings)


def test_the_same_logs_make_the_same_file(logged, work):
    survey = open_survey([logged])
    one, _ = located_survey(survey, work, RunSteps())
    first = one.trajectory_file.read_bytes()
    two, _ = located_survey(survey, work, RunSteps())
    assert one.trajectory_file == two.trajectory_file
    assert first == two.trajectory_file.read_bytes()


def test_a_survey_with_a_trajectory_is_left_as_it_is(tmp_path, work):
    survey = open_survey([make_stereo_folder(tmp_path / "survey", toml=TOML + LOGS)])
    assert located_survey(survey, work, RunSteps()) == (survey, ())


def test_logs_that_cannot_be_used_are_named(logged, work):
    (logged / "gnss.csv").write_text("a,b\n1,2\n")
    with pytest.raises(InputError, match=r"gnss\.csv"), opened_recordings(open_survey([logged]), work):
        pass
