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


@pytest.mark.parametrize("seed", range(6))
def test_a_single_head_sees_the_road_on_both_sides_of_the_van(seed):
    survey = surveyed("one", "straight", seed)
    seen = in_vehicle_frame(survey)
    low = seen[:, 2] < 0.3
    for side in (-1.0, 1.0):
        assert np.count_nonzero(low & (side * seen[:, 1] > 0.2) & (side * seen[:, 1] < 1.5)) > 500


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


@pytest.mark.parametrize("scanner", ["tilted", "spinning32", "airborne", "terrestrial"])
def test_fields_come_back_from_the_folder_through_the_tile_store(tmp_path, scanner):
    survey = surveyed(scanner, "bends", 4)
    write_survey_folder(survey, tmp_path / "s")
    names = (*FIELDS, "ring") if scanner == "spinning32" else FIELDS
    points = read_survey_points(open_survey([tmp_path / "s"], carry=names)).points
    assert len(points) == len(survey.points)
    points = points.take(np.lexsort((points["return_number"], points["scanner_channel"], points.time_s)))
    wanted = survey.points
    wanted = wanted.take(np.lexsort((wanted["return_number"], wanted["scanner_channel"], wanted.time_s)))
    np.testing.assert_allclose(points.time_s, wanted.time_s, rtol=0, atol=1e-6)
    for name in names:
        within = 0.0031 if name == "scan_angle" else 0.0
        np.testing.assert_allclose(points[name], wanted[name], rtol=0, atol=within, err_msg=name)
    assert f"scanner {scanner}" in (tmp_path / "s" / "survey.toml").read_text()


@pytest.mark.parametrize("seed", [1, 2, 4])
def test_an_airborne_swath_has_the_drawn_density_lines_and_edges(seed):
    survey = simulate_survey("bends", seed, 60.0, scanner="airborne")
    scenario, points, head = survey.scenario, survey.points, survey.scenario.scanners[0]
    assert len(scenario.flights) == 2
    assert survey.trajectory is None
    low = np.mean(draw_path(scenario)[:, 2])
    height = scenario.flights[0].start_m[2] - low
    assert 300.0 <= height <= 1000.0
    assert 0.1 <= head.divergence_rad * height <= 0.3
    # Density on the lane, of last returns of one strip: what the mirror's mean spacing promises; a mirror that swings
    # is slow at its ends and leaves a third fewer in the middle
    on_lane, area = last_returns_on_lane(survey), 56.0 * 2.0
    spacing = scenario.flights[0].speed_mps / head.lines_per_s
    swath = 2.0 * height * np.tan(np.radians(head.half_angle_deg))
    promised = head.pulses_per_line / swath / spacing
    for strip in np.unique(survey.strip):
        found = np.count_nonzero(on_lane & (survey.strip == strip)) / area
        assert 0.4 * promised < found < 2.5 * promised
    # Within a scan line, the scan angle goes one way, the one its flag says, and the flag of the edge is at its end
    by_line = np.lexsort((points.time_s, survey.sweep))
    for line in np.split(by_line, np.flatnonzero(np.diff(survey.sweep[by_line])) + 1):
        forward = set(points["scan_direction_flag"][line].tolist())
        assert len(forward) == 1
        # The vertical is that of the aircraft: mirror angles do not jitter
        steps = np.diff(points["scan_angle"][line]) * (1.0 if forward == {1.0} else -1.0)
        assert np.all(steps >= 0.0)
        assert np.all(
            points["edge_of_flight_line"][line[points.time_s[line] < points.time_s[line[-1]]]] == 0.0
        )
    assert np.abs(points["scan_angle"]).max() <= head.half_angle_deg


def draw_path(scenario):
    return drives_of(scenario)[0].xyz


def last_returns_on_lane(survey):
    """Return which points are last returns within 1 m of the middle of the first pass's lane."""
    scenario, road = survey.scenario, survey.scenario.layout.road
    s, q = road.alignment.locate(survey.points.xyz[:, :2] - np.asarray(scenario.origin_m)[:2])
    last = survey.points["return_number"] == survey.points["number_of_returns"]
    return (np.abs(q - scenario.passes[0].q_m) < 1.0) & (s > 2.0) & (s < 58.0) & last


def test_returns_of_a_pulse_are_numbered_along_it():
    survey = simulate_survey("bends", 3, 60.0, scanner="airborne")
    number, count = survey.points["return_number"], survey.points["number_of_returns"]
    assert count.max() >= 3
    assert np.all((number >= 1) & (number <= count))
    pulses = np.stack([survey.points.time_s, survey.strip], axis=1)
    _, pulse, seen = np.unique(pulses, axis=0, return_inverse=True, return_counts=True)
    assert np.array_equal(seen[pulse], count)
    height = survey.points.xyz[:, 2]
    order = np.lexsort((number, pulse))
    below = (np.diff(pulse[order]) == 0) & (np.diff(height[order]) < 0.0)
    assert np.count_nonzero(below) > 0.98 * np.count_nonzero(np.diff(pulse[order]) == 0)


def test_stations_see_the_place_from_their_tripods():
    survey = surveyed("terrestrial", "urban", 3)
    scenario, points = survey.scenario, survey.points
    assert len(scenario.stations) in (2, 3)
    head = scenario.scanners[0]
    for i, station in enumerate(scenario.stations):
        own = survey.strip == i
        seen = points.xyz[own] - np.asarray(scenario.origin_m) - np.asarray(station.place_m)
        # Below the tripod nothing is seen
        fall = np.degrees(np.arctan2(np.hypot(seen[:, 0], seen[:, 1]), -seen[:, 2]))
        assert 20.0 < np.quantile(fall, 0.001) < 35.0
        # A turn of the mirror is a plane through the tripod: level directions to either side
        sweep, along = survey.sweep[own], np.arctan2(seen[:, 1], seen[:, 0])
        first = sweep.min()
        far = np.hypot(seen[:, 0], seen[:, 1]) > 3.0
        turned = np.mod(along - station.yaw_rad - np.pi * (sweep - first + 0.5) / head.turns, np.pi)
        assert np.quantile(np.minimum(turned, np.pi - turned)[far], 0.99) < np.pi / head.turns + 0.02


def test_paint_fills_a_part_of_a_wide_footprint():
    """A line of 12 cm under a spot of 25 cm is fainter than under a fine beam, and wider."""
    from dataclasses import replace

    from linework.simulation.simulate import survey_of

    survey = simulate_survey("straight", 2, 40.0, scanner="airborne")
    head = survey.scenario.scanners[0]
    line = max(
        (m for m in survey.scenario.layout.markings if m.role == "edge"), key=lambda m: m.end_m - m.start_m
    )
    bright = []
    for spot_m in (0.02, 0.25):
        height = survey.scenario.flights[0].start_m[2]
        other = survey_of(replace(survey.scenario, scanners=(replace(head, divergence_rad=spot_m / height),)))
        s, q = other.scenario.layout.road.alignment.locate(
            other.points.xyz[:, :2] - np.asarray(other.scenario.origin_m)[:2]
        )
        away = np.abs(q - line.q_m)
        inside = (s > line.start_m) & (s < line.end_m)
        level = np.median(other.points.intensity[inside & (away > 0.4) & (away < 0.6)])
        bright.append(
            [
                other.points.intensity[inside & (away < 0.25 * line.width_m)].mean() / level,
                other.points.intensity[inside & (away > 0.7 * line.width_m) & (away < line.width_m)].mean()
                / level,
            ]
        )
    (fine_on, fine_beside), (wide_on, wide_beside) = bright
    assert wide_on < fine_on
    assert wide_beside > fine_beside


def test_flights_and_stations_have_no_path_logs_or_images(tmp_path):
    from linework.library.simulate import simulate

    for scanner, name in (("airborne", "strip"), ("terrestrial", "station")):
        made = simulate(
            tmp_path / scanner, road="urban", seed=1, length_m=40, points_per_m=500, scanner=scanner
        )
        assert made.trajectory_file is None
        assert {p.name for p in made.root.iterdir()} == {"points", "survey.toml", "truth.gpkg"}
        assert {p.name.split("_")[0] for p in made.point_files} == {name}


def test_the_default_scanner_adds_no_fields_and_wrong_names_are_refused():
    assert surveyed("default").points.columns == {}
    scenario = draw_scenario("straight", 1, 40.0)
    assert with_scanner(scenario, "default") is scenario
    with pytest.raises(UsageError, match=r"no scanner 'spining16'\. Did you mean spinning16\?"):
        with_scanner(scenario, "spining16")
