"""Points and a trajectory whose clocks differ by what is known of clocks."""

import numpy as np
import pytest

from linework.files.las.write import write_las
from linework.files.survey.open import open_survey
from linework.files.trajectories.read import write_trajectory
from linework.model.points import Points
from linework.model.trajectory import Trajectory
from linework.runs.opened.points import opened_survey

START_S = 4.0e8  # 2024
TOML = 'crs = "EPSG:25832"\n[points]\nfiles = ["a.laz"]\n[trajectory]\nfile = "t.csv"\n'


def warnings_of(folder, offset_s):
    """Drive 600 m at 15 m/s, scan 10 m to both sides, and write the trajectory by a clock that is off."""
    rng = np.random.default_rng(4)
    time = np.sort(rng.uniform(40.0, 80.0, 8000))
    xyz = np.stack([5e5 + 15.0 * time, 5.4e6 + rng.uniform(-10, 10, 8000), np.full(8000, 100.0)], axis=1)
    write_las(
        Points(xyz, intensity=np.full(8000, 900.0, np.float32), time_s=START_S + time),
        folder / "a.laz",
        crs="EPSG:25832",
    )
    way = np.linspace(0.0, 120.0, 1201)
    path = np.stack([5e5 + 15.0 * way, np.full(1201, 5.4e6), np.full(1201, 100.0)], axis=1)
    write_trajectory(Trajectory(START_S + way + offset_s, path), folder / "t.csv")
    (folder / "survey.toml").write_text(TOML)
    (folder / "work").mkdir()
    with opened_survey(open_survey([folder]), folder / "work") as opened:
        return opened.warnings


@pytest.mark.parametrize(
    ("offset_s", "name"),
    [
        (-18.0, "UTC taken for GPS time"), (18.0, "GPS time taken for UTC"),
        (19.0, "TAI taken for GPS time"), (-37.0, "UTC taken for TAI"),
    ],
)  # fmt: skip
def test_a_clock_that_is_off_is_named(tmp_path, offset_s, name):
    (warning,) = warnings_of(tmp_path, offset_s)
    assert warning.startswith(f"t.csv: points lie {abs(offset_s) * 15:.0f} m from the van at their times")
    assert f"with {-offset_s:+.0f} s on the trajectory's times 5 m: {name}?" in warning


@pytest.mark.parametrize("offset_s", [0.0, 0.3, -1.0])
def test_a_clock_that_is_right_or_nearly(tmp_path, offset_s):
    assert warnings_of(tmp_path, offset_s) == ()
