"""Several drives over one road: which they are, the correction that makes them agree, and extraction from all of them."""

import json

import numpy as np
import pytest
from tests.scenes.two_drives import path_of, straight, two_drives
from typer.testing import CliRunner

import linework
from linework.cli.app import app
from linework.evaluation.measures import match_lines, score
from linework.files.las.tally import TimeCounts
from linework.files.las.write import write_las
from linework.files.trajectories.read import write_trajectory
from linework.model.lines import LineSet
from linework.model.trajectory import Trajectory
from linework.runs.drives import adjusted as adjusted_module
from linework.runs.drives import stores
from linework.runs.drives.adjusted import adjusted_drives
from linework.runs.drives.adjustment import DriveTies, adjusted_path
from linework.runs.drives.separate import may_tie, separate_drives, share_road, with_points
from linework.runs.drives.stores import write_changed_stores

KINDS = ("lane_marking", "lane_marking_dash", "road_boundary")
#: So small that the survey has several tiles, and is given to worker processes.
SMALL_TILES = {"tiling": {"core_m": 64.0, "shift_east_m": 20.0, "shift_north_m": 20.0, "max_points": 60_000}}


# Which drives there are


def test_a_drive_ends_where_the_trajectory_pauses():
    there = ((0.0, 0.0), (300.0, 0.0))
    drives = separate_drives(path_of(there, 60.0, ((0.0, 3.0), (300.0, 3.0))))
    assert len(drives) == 2
    assert share_road(drives)
    assert drives[0].end_s == drives[1].start_s
    # A short rest is no pause
    assert len(separate_drives(path_of(there, 5.0, ((310.0, 0.0), (600.0, 0.0))))) == 1


def test_a_drive_ends_where_the_path_returns_to_its_road():
    there, back = ((0.0, 0.0), (300.0, 0.0)), ((300.0, 20.0), (0.0, 6.0))
    first, second = separate_drives(path_of((*there, *back)))
    assert share_road((first, second))
    assert 30.0 < first.end_s < 60.0
    assert first.end_s == second.start_s


def test_roads_that_cross_or_lie_apart_are_not_shared():
    crossing = path_of(((0.0, 0.0), (300.0, 0.0)), 60.0, ((150.0, -100.0), (150.0, 100.0)))
    assert not share_road(separate_drives(crossing))
    loop = path_of(((0.0, 0.0), (200.0, 0.0), (200.0, 100.0), (100.0, 100.0), (100.0, -100.0)))
    assert len(separate_drives(loop)) == 1
    apart = path_of(((0.0, 0.0), (300.0, 0.0)), 60.0, ((0.0, 40.0), (300.0, 40.0)))
    assert not share_road(separate_drives(apart))
    assert not share_road(separate_drives(path_of(((0.0, 0.0), (300.0, 0.0)))))


def test_only_where_another_drive_passes_there_is_something_to_tie():
    drives = separate_drives(path_of(((0.0, 0.0), (1000.0, 0.0)), 60.0, ((0.0, 3.0), (300.0, 3.0))))
    places = np.array([[10.0, 5.0], [300.0, -20.0], [385.0, 0.0], [400.0, 0.0], [900.0, 0.0], [10.0, 120.0]])
    for drive in drives:
        near = may_tie(drive, drives, places)
        assert near.tolist() == [True, True, True, False, False, False]
        # Nor where lines tie them already
        near = may_tie(drive, drives, places, np.array([[290.0, 3.0]]))
        assert near.tolist() == [False, True, False, False, False, False]
    assert may_tie(drives[0], drives, places[:0]).tolist() == []


def test_drives_share_no_road_where_one_has_measured_nothing():
    there = ((0.0, 0.0), (1000.0, 0.0))
    path = path_of(there, 60.0, ((0.0, 3.0), (1000.0, 3.0)))
    whole, times = separate_drives(path), TimeCounts()
    times.add(path.time_s[path.time_s < whole[1].time_s[0] + 20.0])
    drives = with_points(whole, times)
    assert [round(float(drive.xy[-1, 0])) for drive in drives] == [1000, 190]
    places = np.array([[10.0, 5.0], [250.0, 0.0], [400.0, 0.0]])
    for drive in drives:
        assert may_tie(drive, drives, places).tolist() == [True, True, False]
    # Nothing has to tie them there
    part = [LineSet.from_lines([straight(y).xyz[:200]], kind=["lane_marking"]) for y in (5.0, 5.1)]
    assert not adjusted_drives(whole, path, part).is_held
    adjusted = adjusted_drives(drives, path, part, whole)
    assert adjusted.is_held and len(adjusted.accounted().drives) == 2
    # Poses without points are corrected as those of a whole drive are: ever less away from what ties them
    ahead = adjusted.correction.at(whole[1].time_s[[10, 90]])
    assert abs(ahead[1, 1]) < 0.05 * abs(ahead[0, 1])
    times = TimeCounts()
    times.add(path.time_s[path.time_s < whole[1].start_s])
    assert not share_road(with_points(whole, times))


@pytest.mark.parametrize(("first_m", "last_m", "is_shared"), [(600.0, 1400.0, False), (400.0, 1600.0, True)])
def test_drives_share_no_road_where_one_measured_before_and_behind_only(first_m, last_m, is_shared):
    path = path_of(((0.0, 0.0), (2000.0, 0.0)), 60.0, ((0.0, 3.0), (2000.0, 3.0)))
    east, is_back = path.xyz[:, 0], path.xyz[:, 1] > 0.0
    measured = np.where(is_back, (east >= first_m) & (east <= last_m), (east <= 500.0) | (east >= 1500.0))
    times = TimeCounts()
    times.add(path.time_s[measured])
    assert share_road(with_points(separate_drives(path), times)) == is_shared


# The correction


def slow(time_s, number):
    return 0.06 * np.sin(2.0 * np.pi * time_s / 20.0 + 2.0 * number)


def drawn_ties(path, rng, *, n=400, n_wrong=40, sigma_m=0.01):
    """Return ties of two drives over one road, of which some are between different lines."""
    one, other = separate_drives(path)
    share = rng.uniform(0.0, 1.0, n)
    at = [d.time_s[0] + s * (d.time_s[-1] - d.time_s[0]) for d, s in ((one, share), (other, 1.0 - share))]
    normal = np.zeros((n, 3))
    normal[np.arange(n), rng.integers(0, 3, n)] = 1.0
    apart = slow(at[1], 1) - slow(at[0], 0) + sigma_m * rng.normal(size=n)
    apart[:n_wrong] += rng.choice([-0.3, 0.3], n_wrong)
    return (one, other), DriveTies(at[0], at[1], normal, apart, np.full(n, sigma_m))


@pytest.mark.parametrize("seed", [1, 2])
def test_the_correction_makes_drives_agree_and_takes_more_from_the_worse_one(seed):
    path = path_of(((0.0, 0.0), (400.0, 0.0)), 60.0, ((400.0, 3.0), (0.0, 3.0)))
    drives, ties = drawn_ties(path, np.random.default_rng(seed))
    sigma = np.where(drives[0].holds(path.time_s)[:, None], 0.01, 0.06) * np.ones((1, 3))
    path = Trajectory(path.time_s, path.xyz, None, sigma)
    correction = adjusted_path(drives, path, ties)
    good = slice(40, None)
    left = ties.apart_m + np.sum(
        ties.normal * (correction.at(ties.other_s) - correction.at(ties.time_s)), axis=1
    )
    assert np.sqrt(np.mean(ties.apart_m[good] ** 2)) > 0.03
    assert np.sqrt(np.mean(left[good] ** 2)) < 0.013
    size = [np.sqrt(np.mean(correction.at(d.time_s) ** 2)) for d in drives]
    assert size[1] > 3.0 * size[0]
    assert (
        np.abs(
            np.median(np.diagonal(correction.covariance_m2, axis1=1, axis2=2), axis=0) ** 0.5 - 0.012
        ).max()
        < 0.008
    )


def test_errors_of_the_corrected_path_are_as_large_as_its_sigma():
    path = path_of(((0.0, 0.0), (400.0, 0.0)), 60.0, ((400.0, 3.0), (0.0, 3.0)))
    path = Trajectory(path.time_s, path.xyz, None, np.full((len(path), 3), 0.06 / np.sqrt(2.0)))
    drives, ties = drawn_ties(path, np.random.default_rng(3))
    correction = adjusted_path(drives, path, ties)
    ratios = []
    for number, drive in enumerate(drives):
        own = drive.holds(correction.knot_s)
        error = slow(correction.knot_s[own], number)[:, None] + correction.xyz_m[own]
        ratios.append(error / np.sqrt(np.diagonal(correction.covariance_m2[own], axis1=1, axis2=2)))
    assert 0.7 < np.sqrt(np.mean(np.concatenate(ratios) ** 2)) < 1.5


def test_a_drive_of_one_pose_is_no_fault():
    path = path_of(
        ((0.0, 0.0), (400.0, 0.0)), 60.0, ((400.0, 3.0), (0.0, 3.0)), 60.0, ((0.0, 3.0), (0.0, 3.0))
    )
    two = path_of(((0.0, 0.0), (400.0, 0.0)), 60.0, ((400.0, 3.0), (0.0, 3.0)))
    _, ties = drawn_ties(two, np.random.default_rng(5))
    drives = separate_drives(path)
    assert len(drives) == 3 and len(drives[2].time_s) == 1
    correction = adjusted_path(drives, path, ties)
    assert np.isfinite(correction.xyz_m).all() and np.isfinite(correction.covariance_m2).all()


def test_without_stated_sigmas_the_differences_say_how_good_the_drives_are():
    path = path_of(((0.0, 0.0), (400.0, 0.0)), 60.0, ((400.0, 3.0), (0.0, 3.0)))
    drives, ties = drawn_ties(path, np.random.default_rng(4), n_wrong=0)
    correction = adjusted_path(drives, path, ties)
    size = [np.sqrt(np.mean(correction.at(d.time_s) ** 2)) for d in drives]
    assert 0.5 < size[0] / size[1] < 2.0
    sigma = np.sqrt(np.diagonal(correction.covariance_m2, axis1=1, axis2=2))
    assert 0.015 < np.median(sigma) < 0.06


# Extraction


@pytest.fixture(scope="module")
def survey():
    return two_drives()


@pytest.fixture(scope="module")
def adjusted(survey):
    scene, _ = survey
    return linework.extract(scene.points, kinds=KINDS, trajectory=scene.path, on_problem="warn")


def rms_across(lines, truth):
    parts = match_lines(lines, truth, kinds=("lane_marking", "road_boundary"))
    return score(parts, "all", 0.15).at.lateral.rmse_m


def test_adjusted_lines_are_nearer_to_the_truth_than_those_of_either_drive(survey, adjusted):
    scene, middle = survey
    as_they_are = linework.extract(scene.points, kinds=KINDS, trajectory=scene.path, adjust=False)
    assert adjusted != as_they_are
    assert adjusted.report.adjusted.startswith("2 drives adjusted") and as_they_are.report.adjusted == ""
    error = rms_across(adjusted, scene.truth)
    for first, last in ((-np.inf, middle), (middle, np.inf)):
        points, path = scene.part(first, last)
        assert error < rms_across(linework.extract(points, kinds=KINDS, trajectory=path), scene.truth)
    # What the drives still have in common is in the sigmas
    assert np.median(adjusted.sigma_xy_m) > 2.0 * np.median(as_they_are.sigma_xy_m)


def test_adjusted_lines_depend_neither_on_workers_nor_tiles_nor_order(survey, adjusted):
    scene, _ = survey
    order = np.random.default_rng(1).permutation(len(scene.points))
    again = linework.extract(
        scene.points.take(order), kinds=KINDS, trajectory=scene.path, workers=2, settings=SMALL_TILES
    )
    assert again == adjusted


def test_a_killed_run_goes_on_with_the_drives_that_are_done(survey, adjusted, tmp_path):
    scene, _ = survey
    stages = []

    def killing(stage, done, total):
        stages.append(stage)
        if stage == "adjust drives" or (stage == "move points" and stages.count("find lines") > 2):
            raise KeyboardInterrupt

    given = {"kinds": KINDS, "trajectory": scene.path, "work": tmp_path / "work"}
    with pytest.raises(KeyboardInterrupt):
        linework.extract(scene.points, progress=killing, **given)
    before, stages = list(stages), []

    def watching(stage, done, total):
        stages.append(stage)

    resumed = linework.extract(scene.points, progress=watching, resume=True, **given)
    assert resumed == adjusted
    assert stages.count("find the road") < before.count("find the road") + stages.count("find the road")
    # Nothing of the run stays: not the points of a drive, nor the moved ones
    assert not [path for path in (tmp_path / "work" / "runs").rglob("*") if path.is_file()]


def test_a_run_that_is_killed_while_it_looks_around_untied_places_goes_on(survey, monkeypatch, tmp_path):
    scene, _ = survey
    monkeypatch.setattr(adjusted_module, "untied_places", lambda drives, ties: drives[0].xy[:1])
    whole = linework.extract(scene.points, kinds=KINDS, trajectory=scene.path)
    stages = []

    def killing(stage, done, total):
        stages.append(stage)
        if stages.count("separate drives") and stage == "find lines" and asked == ["road_boundary"]:
            raise KeyboardInterrupt

    asked, find = [], adjusted_module.find_lines

    def finding(recordings, methods, *given, **named):
        asked[:] = [kind for kind in ("road_boundary",) if any(kind in m.kinds for m in methods)]
        return find(recordings, methods, *given, **named)

    monkeypatch.setattr(adjusted_module, "find_lines", finding)
    given = {"kinds": KINDS, "trajectory": scene.path, "work": tmp_path / "work"}
    with pytest.raises(KeyboardInterrupt):
        linework.extract(scene.points, progress=killing, **given)
    assert linework.extract(scene.points, resume=True, **given) == whole


def test_the_points_of_a_drive_are_separated_once_for_each_place(survey, monkeypatch):
    scene, _ = survey
    written, n_points, asked, beside = [], [], [], []
    choose, find = adjusted_module.choose_methods, adjusted_module.find_lines

    def choosing(method, kinds, **given):
        asked.append(kinds)
        return choose(method, kinds, **given)

    def finding(recordings, methods, *given, **named):
        beside.append(methods[0].beside_boundaries)
        return find(recordings, methods, *given, **named)

    monkeypatch.setattr(adjusted_module, "choose_methods", choosing)
    monkeypatch.setattr(adjusted_module, "find_lines", finding)
    assert linework.extract(scene.points, kinds=KINDS, trajectory=scene.path).report.adjusted
    # Markings tie them all along, and no boundary is looked for to tell edge lines
    assert asked == [("lane_marking", "lane_marking_dash")]
    assert beside == [False, False, True]
    monkeypatch.setattr(adjusted_module, "find_lines", find)

    def writing(store, changes, advance, near_xy):
        written.append((len(changes), 0 if near_xy is None else len(near_xy)))
        n_points.append(store.n_points)
        write_changed_stores(store, changes, advance, near_xy)

    monkeypatch.setattr(stores, "write_changed_stores", writing)
    # So that boundaries and guardrails are looked for, too
    monkeypatch.setattr(adjusted_module, "untied_places", lambda drives, ties: drives[0].xy[:1])
    lines = linework.extract(scene.points, kinds=KINDS, trajectory=scene.path)
    assert lines.report.adjusted.startswith("2 drives adjusted")
    # Both drives, then of each what lies around the place without a tie, for boundaries and rails, then all points moved
    assert written == [(2, 0), (1, 1), (1, 1), (1, 0)]
    assert n_points[0] == n_points[3] == len(scene.points) > max(n_points[1:3])
    assert asked[1:] == [KINDS[:2], ("road_boundary", "kerb_top"), ("guardrail", "barrier")]


def test_a_path_that_goes_on_without_points_ties_nothing(survey, monkeypatch):
    scene, middle = survey
    points, _ = scene.part(-np.inf, middle)
    monkeypatch.setattr(adjusted_module, "choose_methods", lambda *a, **b: pytest.fail("ties are looked for"))
    lines = linework.extract(points, kinds=("lane_marking_dash",), trajectory=scene.path, on_problem="warn")
    assert lines.report.adjusted == ""


def test_one_drive_is_extracted_as_without_adjustment(survey):
    scene, middle = survey
    points, path = scene.part(-np.inf, middle)
    found = [
        linework.extract(points, kinds=KINDS, trajectory=path, adjust=adjust) for adjust in (True, False)
    ]
    assert found[0] == found[1]


def test_the_command_says_what_was_corrected(survey, tmp_path):
    scene, _ = survey
    write_las(scene.points, tmp_path / "survey" / "points" / "both.laz", crs=scene.points.crs)
    write_trajectory(scene.path, tmp_path / "survey" / "trajectory.csv")
    (tmp_path / "survey" / "survey.toml").write_text(
        '[points]\nfiles = ["points/*.laz"]\n[trajectory]\nfile = "trajectory.csv"\n'
    )
    out = tmp_path / "lines.gpkg"
    given = [str(tmp_path / "survey"), "-o", str(out), "--features", ",".join(KINDS), "--quiet"]
    result = CliRunner().invoke(app, ["extract", *given])
    assert result.exit_code == 0, result.output
    assert "2 drives adjusted at their lines: " in result.output
    drives = json.loads((tmp_path / "run.json").read_text())["drives"]
    assert len(drives["adjusted"]) == 2
    assert drives["left_apart_m"][0] < 0.01 < drives["apart_m"][0]
    result = CliRunner().invoke(app, ["extract", *given, "--no-adjust", "--overwrite"])
    assert result.exit_code == 0, result.output
    assert "adjusted" not in result.output
    assert "drives" not in json.loads((tmp_path / "run.json").read_text())
