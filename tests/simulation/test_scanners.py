"""Simulated scanners: geometry of every beam, scan lines, density, and the fields of a file there and back."""

import numpy as np
import pytest

from linework.errors import UsageError
from linework.files.store.in_memory import read_survey_points
from linework.files.survey.open import open_survey
from linework.simulation.folder import write_survey_folder
from linework.simulation.roads.draw import draw_scenario
from linework.simulation.sensors.rigs import SCANNERS, with_scanner
from linework.simulation.sensors.scanner import to_local_frame
from linework.simulation.simulate import drives_of, simulate_survey

PROFILES = ("default", "one", "tilted")
FIELDS = (
    "point_source_id", "scanner_channel", "scan_angle", "return_number", "number_of_returns", "scan_direction_flag",
    "edge_of_flight_line",
)  # fmt: skip


def surveyed(scanner, kind="straight", seed=1, **options):
    return simulate_survey(kind, seed, 40.0, points_per_m=2000.0, scanner=scanner, **options)


def in_vehicle_frame(survey):
    """Return the points of the first pass as its vehicle saw them: rotated back by its pose at their times."""
    drive, points = drives_of(survey.scenario)[0], survey.points.take(survey.strip == 0)
    time = points.time_s
    place = np.stack([np.interp(time, drive.time_s, c) for c in drive.xyz.T], axis=1)
    angles = [np.interp(time, drive.time_s, a) for a in (drive.roll_rad, drive.pitch_rad, drive.yaw_rad)]
    axes = [to_local_frame(np.tile(axis, (len(time), 1)), *angles) for axis in np.eye(3)]
    seen = points.xyz - np.asarray(survey.scenario.origin_m) - place
    return np.stack([np.sum(seen * axis, axis=1) for axis in axes], axis=1)


@pytest.mark.parametrize("scanner", SCANNERS)
def test_the_same_seed_gives_the_same_bits(scanner):
    one, two = surveyed(scanner), surveyed(scanner)
    assert one.points == two.points
    for name in ("sweep", "beam", "strip"):
        column = getattr(one, name)
        assert column.dtype == np.int32
        assert len(column) == len(one.points)
        assert np.array_equal(column, getattr(two, name))
    assert np.array_equal(one.truth.observed, two.truth.observed)
    assert np.all(np.diff(one.points.time_s) >= 0.0)


@pytest.mark.parametrize("scanner", SCANNERS)
def test_the_density_is_about_the_wanted_one(scanner):
    survey = simulate_survey("urban", 2, 50.0, points_per_m=6000.0, scanner=scanner)
    assert 0.5 < len(survey.points) / (50.0 * 6000.0) < 2.5


@pytest.mark.parametrize("scanner", PROFILES)
def test_a_scan_line_of_a_profile_scanner_is_a_turn_of_its_mirror_in_one_plane(scanner):
    survey = surveyed(scanner, "urban", 3)
    seen, first = in_vehicle_frame(survey), survey.strip == 0
    sweep, beam, time = survey.sweep[first], survey.beam[first], survey.points.time_s[first]
    for i, head in enumerate(survey.scenario.scanners):
        own = beam == i
        yaw, pitch = np.radians(head.yaw_deg), np.radians(head.pitch_deg)
        axis = [np.cos(yaw) * np.cos(pitch), np.sin(yaw) * np.cos(pitch), -np.sin(pitch)]
        away = (seen[own] - np.asarray(head.position_m)) @ np.array(axis)
        # Range noise stays within the plane; roughness and the pose error do not
        assert np.quantile(np.abs(away), 0.99) < 0.08
        _, start, n = np.unique(sweep[own], return_index=True, return_counts=True)
        order = np.argsort(sweep[own], kind="stable")
        turns = np.split(time[own][order], np.cumsum(n)[:-1])
        assert max(t[-1] - t[0] for t in turns) <= 1.0 / head.turns_per_s + 1e-9
        # A turn for a turn: numbers follow time
        assert np.all(np.diff(time[own][start]) > 0.0)
        assert np.all(np.diff(sweep[own]) >= 0)
    shared = [set(sweep[beam == i].tolist()) for i in range(len(survey.scenario.scanners))]
    assert sum(map(len, shared)) == len(set().union(*shared))


@pytest.mark.parametrize("scanner", ["spinning16", "spinning64"])
def test_every_beam_of_a_spinning_scanner_looks_where_it_was_mounted(scanner):
    survey = surveyed(scanner)
    head = survey.scenario.scanners[0]
    seen = in_vehicle_frame(survey) - np.asarray(head.position_m)
    first = survey.strip == 0
    ring = survey.points["ring"][first].astype(int)
    assert np.array_equal(ring, survey.beam[first])
    tilt = np.radians(head.tilt_deg)
    upright = np.stack(
        [
            np.cos(tilt) * seen[:, 0] - np.sin(tilt) * seen[:, 2],
            seen[:, 1],
            np.sin(tilt) * seen[:, 0] + np.cos(tilt) * seen[:, 2],
        ],
        axis=1,
    )
    reach = np.linalg.norm(upright, axis=1)
    elevation = np.degrees(np.arcsin(upright[:, 2] / reach))
    for beam in np.unique(ring):
        # On the lane: blades of grass rise above the ground
        own = (ring == beam) & (reach > 3.0) & (np.abs(seen[:, 1]) < 1.2)
        if np.count_nonzero(own) > 30:
            assert np.median(elevation[own]) == pytest.approx(head.elevation_deg[beam], abs=0.02)
    azimuth = np.degrees(np.arctan2(-upright[:, 1], upright[:, 0]))
    off = np.mod(azimuth - survey.points["scan_angle"][first] + 180.0, 360.0) - 180.0
    assert np.median(np.abs(off[reach > 3.0])) < 0.02
    # A scan line is one turn of one beam
    sweep, time = survey.sweep[first], survey.points.time_s[first]
    order = np.lexsort((time, sweep))
    cut = np.flatnonzero(np.diff(sweep[order])) + 1
    for lines in np.split(order, cut):
        assert len(set(ring[lines].tolist())) == 1
        assert time[lines[-1]] - time[lines[0]] <= 1.0 / head.turns_per_s + 1e-9


def test_beams_have_the_range_bias_and_the_gain_they_were_drawn_with():
    survey = surveyed("spinning16", "urban", 2)
    head = survey.scenario.scanners[0]
    assert np.std(head.range_bias_m) > 0.001
    from dataclasses import replace

    from linework.simulation.simulate import survey_of

    true_head = replace(head, range_bias_m=(0.0,) * 16, gain=(1.0,) * 16)
    other = survey_of(replace(survey.scenario, scanners=(true_head,)))
    shift = np.linalg.norm(survey.points.xyz - other.points.xyz, axis=1)
    brighter = survey.points.intensity / np.maximum(other.points.intensity, 1.0)
    clear = other.points.intensity > 20.0
    for beam in np.unique(survey.beam):
        own = survey.beam == beam
        assert np.median(shift[own]) == pytest.approx(abs(head.range_bias_m[beam]), abs=1e-5)
        bright = own & clear & (survey.points.intensity < 2**survey.scenario.sensor.intensity_bits - 1)
        if np.count_nonzero(bright) > 50:
            assert np.median(brighter[bright]) == pytest.approx(head.gain[beam], rel=0.05)


@pytest.mark.parametrize("scanner", ["tilted", "spinning32"])
def test_fields_come_back_from_the_folder_through_the_tile_store(tmp_path, scanner):
    survey = surveyed(scanner, "bends", 4)
    write_survey_folder(survey, tmp_path / "s")
    names = (*FIELDS, "ring") if scanner == "spinning32" else FIELDS
    points = read_survey_points(open_survey([tmp_path / "s"], carry=names)).points
    assert len(points) == len(survey.points)
    points = points.take(np.lexsort((points["scanner_channel"], points.time_s)))
    wanted = survey.points.take(np.lexsort((survey.points["scanner_channel"], survey.points.time_s)))
    np.testing.assert_allclose(points.time_s, wanted.time_s, rtol=0, atol=1e-6)
    for name in names:
        within = 0.0031 if name == "scan_angle" else 0.0
        np.testing.assert_allclose(points[name], wanted[name], rtol=0, atol=within, err_msg=name)
    assert f"scanner {scanner}" in (tmp_path / "s" / "survey.toml").read_text()


def test_the_default_scanner_adds_no_fields_and_wrong_names_are_refused():
    assert surveyed("default").points.columns == {}
    scenario = draw_scenario("straight", 1, 40.0)
    assert with_scanner(scenario, "default") is scenario
    with pytest.raises(UsageError, match=r"no scanner 'spining16'\. Did you mean spinning16\?"):
        with_scanner(scenario, "spining16")
