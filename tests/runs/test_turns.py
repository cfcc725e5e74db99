"""Turns of a spinning lidar that disagree in height are levelled before lines are looked for."""

import json

import numpy as np
import pytest
from tests.oracles.store_twin import made
from tests.scenes.turning_lidar import KERB_Y_M, street_m, turned_street
from typer.testing import CliRunner

import linework
from linework.cli.app import app
from linework.errors import LineworkWarning
from linework.files.las.write import write_las
from linework.runs.drives import turns
from linework.runs.drives.turns import turn_levels


def levels_of(tmp_path, points):
    store = made(tmp_path / "store", [(points.xyz, points.intensity.astype(np.uint16), points.time_s)])
    return turn_levels(store, lambda done, total: None)


def blur_m(points):
    """Return the standard deviation of heights within places of a metre: how high all turns are together is not known."""
    xyz = points.xyz - [500_000.0, 5_800_000.0, 60.0]
    off = xyz[:, 2] - street_m(xyz[:, 1])
    place = np.unique(np.floor(xyz[:, :2]), axis=0, return_inverse=True)[1].ravel()
    mean = np.bincount(place, off) / np.bincount(place)
    return np.std(off - mean[place])


@pytest.mark.parametrize("spread_s", [0.0, 0.0999])
def test_levelled_points_show_the_street(tmp_path, spread_s):
    points, too_high = turned_street(1)
    # Times of each point's own: a turn is a tenth of a second
    time = points.time_s + np.random.default_rng(0).uniform(0.0, 1.0, len(points)) * spread_s
    points = linework.Points(points.xyz, intensity=points.intensity, time_s=time, crs="local")
    levels = levels_of(tmp_path, points)
    level = levels.levelled(points)
    assert np.std(too_high) > 0.04
    assert blur_m(points) > 0.04
    assert blur_m(level) < 0.016
    assert levels.planes.apart_m > 0.04
    assert levels.planes.left_apart_m < 0.012
    assert np.array_equal(level.xyz[:, :2], points.xyz[:, :2])


def test_what_passed_is_left_out(tmp_path):
    points, _ = turned_street(6, n_rings=50, rings_deg=0.4)
    xyz, time = points.xyz.copy(), points.time_s
    # A van drives ahead, 2 m wide, 4 m long, from the middle of the street on
    van = 500_000.0 + 6.0 * (time - 1000.0) + 8.0
    away = xyz - np.array([0.0, 5_800_000.0, 0.0])
    is_van = (
        (np.abs(away[:, 0] - van) < 2.0) & (np.abs(away[:, 1] - 1.0) < 1.0) & (np.arange(len(xyz)) % 2 == 0)
    )
    xyz[is_van, 2] += 0.9
    ahead = linework.Points(xyz, intensity=points.intensity, time_s=time, crs="local")
    level = levels_of(tmp_path, ahead).levelled(ahead)
    high = level.xyz[:, 2] > 60.5
    assert is_van.sum() > 4000
    assert high.sum() < 0.25 * is_van.sum()
    assert len(level) - high.sum() > 0.999 * (~is_van).sum()


def test_turns_that_agree_stay_as_they_were_recorded(tmp_path):
    points, _ = turned_street(2, apart_m=0.001, tilt=0.0)
    assert levels_of(tmp_path, points) is None


def test_a_profile_scanner_has_nothing_to_level(tmp_path):
    points, _ = turned_street(3)
    # Each place is seen once: at the time when the van is beside it
    time = 1000.0 + 0.2 * (points.xyz[:, 0] - points.xyz[:, 0].min())
    alone = linework.Points(points.xyz, intensity=points.intensity, time_s=time, crs="local")
    assert levels_of(tmp_path, alone) is None


@pytest.mark.parametrize("speed", [0.0, 0.4])
def test_a_profile_scanner_at_walking_speed_uphill_is_left_alone(tmp_path, speed):
    rng = np.random.default_rng(9)
    time = np.sort(rng.uniform(0.0, 20.0, 120_000))
    x, y = speed * time + rng.normal(0.0, 0.01, len(time)), rng.uniform(-8.0, 8.0, len(time))
    xyz = np.stack([x + 5.0, y + 20.0, 0.08 * x + rng.normal(0.0, 0.003, len(x))], axis=1)
    slow = linework.Points(xyz, intensity=np.full(len(x), 9.0, np.float32), time_s=time, crs="local")
    assert levels_of(tmp_path, slow) is None


def test_surveys_without_turns_are_left_alone(tmp_path):
    points, _ = turned_street(7, n_turns=40)
    assert levels_of(tmp_path / "turns", points) is not None
    at_once = points.time_s * 0.0 + 5.0
    stations = 1000.0 + np.floor((points.time_s - 1000.0) * 10.0 + 0.5) * 300.0
    for name, time in (("one", at_once), ("stations", stations)):
        still = linework.Points(points.xyz, intensity=points.intensity, time_s=time, crs="local")
        assert levels_of(tmp_path / name, still) is None
    # Along a border of blocks the middles of the blocks are empty
    xyz = points.xyz - [500_000.0, 5_800_000.0, 0.0]
    narrow = np.abs(xyz[:, 1]) < 4.0
    border = linework.Points(
        xyz[narrow] + [0.0, 64.0, 0.0],
        intensity=points.intensity[narrow],
        time_s=points.time_s[narrow],
        crs="local",
    )
    levels_of(tmp_path / "border", border)


def test_slopes_hold_no_farther_than_what_a_turn_saw(tmp_path):
    points, _ = turned_street(8)
    levels = levels_of(tmp_path, points)
    far = np.array([[500_000.0 + 4000.0, 5_800_000.0, 60.0]] * 2)
    assert np.abs(levels.too_high_m(np.array([1000.0, 1099.0]), far)).max() < 0.5


def test_few_cells_and_turns_taken_together_do_as_well(tmp_path, monkeypatch):
    monkeypatch.setattr(turns, "_MOST_CELLS", 4000)
    points, _ = turned_street(4)
    levels = levels_of(tmp_path, points)
    assert blur_m(levels.levelled(points)) < 0.02
    monkeypatch.setattr(turns, "_MOST_TURNS", 40)
    together = levels_of(tmp_path / "two", points)
    assert len(together.number) == len(levels.number)
    assert np.array_equal(together.planes.plane[0], together.planes.plane[1])
    assert blur_m(together.levelled(points)) < 0.9 * blur_m(points)


@pytest.mark.filterwarnings("ignore:.*not taken for road")
def test_a_killed_run_goes_on_with_the_turns_that_are_levelled(tmp_path):
    points, _ = turned_street(10, n_turns=40)
    stages = []

    def killing(stage, done, total):
        stages.append(stage)
        if stage == "find lines":
            raise KeyboardInterrupt

    given = {"kinds": "road_boundary", "work": tmp_path / "work"}
    with pytest.raises(KeyboardInterrupt):
        linework.extract(points, progress=killing, **given)
    assert "level turns" in stages
    stages.clear()
    resumed = linework.extract(
        points, progress=lambda stage, done, total: stages.append(stage), resume=True, **given
    )
    assert "level turns" not in stages
    assert resumed == linework.extract(points.take(np.arange(len(points))[::-1]), kinds="road_boundary")


def kerbs_in_place_m(lines):
    """Return the length of kerb found within 0.1 m of the kerbs of the street."""
    kerbs = [line.xyz for line in lines if line.form == "kerb"]
    near = [np.abs(np.abs(xyz[:, 1] - 5_800_000.0) - KERB_Y_M) < 0.1 for xyz in kerbs]
    step = [np.abs(np.diff(xyz[:, 0])) for xyz in kerbs]
    return sum(float(d[ok[1:] & ok[:-1]].sum()) for d, ok in zip(step, near, strict=True))


def test_levelled_turns_show_more_of_the_kerbs_than_their_sum(tmp_path):
    points, _ = turned_street(5)
    write_las(points, tmp_path / "street.las", crs="local")
    output = tmp_path / "lines.gpkg"
    command = [
        "extract",
        str(tmp_path / "street.las"),
        "--crs",
        "local",
        "--features",
        "road_boundary",
        "-o",
        str(output),
    ]
    result = CliRunner().invoke(app, command)
    assert result.exit_code == 0, result.output
    assert "60 turns of the scanner levelled" in result.output
    record = json.loads((tmp_path / "run.json").read_text())
    assert record["turns"]["left_apart_m"] < 0.012
    found = linework.read_lines(output)
    kerbs = found.take(found.form == "kerb")
    assert kerbs_in_place_m(found) > 140.0
    assert np.median(np.abs(np.abs(kerbs.xyz[:, 1] - 5_800_000.0) - KERB_Y_M)) < 0.05
    assert (kerbs.sigma_z_m > 0.9 * record["turns"]["common_sigma_m"]).all()

    with pytest.warns(LineworkWarning, match="not taken for road"):
        recorded = linework.extract(points, kinds="road_boundary", adjust=False)
    # Five centimetres of noise hide some of a kerb of 12 cm, not all of it
    assert kerbs_in_place_m(recorded) < 0.75 * kerbs_in_place_m(found)
