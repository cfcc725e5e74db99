"""Recovered scan lines of simulated surveys against the true turns of the mirrors."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from linework.model.points import Points
from linework.scanlines.crossings import support_of
from linework.scanlines.pattern import mean_spacing_m
from linework.scanlines.recover import recover_scan_lines
from linework.scanlines.timing import scanner_timing
from linework.simulation.sensors.crossings import count_crossings
from linework.simulation.simulate import simulate_survey

#: Kind of road, seed, scanner, and the columns that the recovery must do without.
SURVEYS = [
    ("urban", 5, "default", ()),
    ("motorway", 2, "default", ()),
    ("bends", 3, "one", ()),
    ("bends", 3, "one", ("scan_angle",)),
    ("urban", 3, "tilted", ()),
    ("urban", 3, "tilted", ("scan_angle", "scanner_channel")),
    ("urban", 2, "spinning16", ()),
    ("bends", 4, "spinning64", ("scan_angle",)),
    ("urban", 3, "airborne", ()),
    ("bends", 4, "airborne", ("scan_direction_flag", "edge_of_flight_line")),
]
NAMES = [
    "-".join([kind, scanner, *("no_" + name for name in without)]) for kind, _, scanner, without in SURVEYS
]
DENSITIES = {"airborne": None, "spinning16": 8_000.0, "spinning64": 16_000.0}
KINDS = {"default": "profile", "one": "profile", "tilted": "profile", "airborne": "airborne"}


@pytest.fixture(scope="module", params=SURVEYS, ids=NAMES)
def recovered(request):
    kind, seed, scanner, without = request.param
    # Lidars in which a turn has a few hundred columns, as real ones have
    density = DENSITIES.get(scanner, 4000.0)
    survey = simulate_survey(kind, seed, 40.0, points_per_m=density, scanner=scanner)
    points = survey.points
    kept = {name: values for name, values in points.columns.items() if name not in without}
    points = Points(points.xyz, intensity=points.intensity, time_s=points.time_s, columns=kept)
    return scanner, survey, points, recover_scan_lines(points)


def neighbours(points, beam, k=6):
    """Return pairs of points that are neighbours, (m, 2): nearest in space, and next to each other in time for a laser."""
    sample = np.arange(0, len(points), max(len(points) // 20_000, 1))
    _, near = cKDTree(points.xyz).query(points.xyz[sample], k + 1)
    in_space = np.stack([np.repeat(sample, k), near[:, 1:].ravel()], axis=1)
    order = np.lexsort((points.time_s, beam))
    in_time = np.stack([order[:-1], order[1:]], axis=1)
    close = np.linalg.norm(points.xyz[in_time[:, 0]] - points.xyz[in_time[:, 1]], axis=1) < 1.5
    return np.concatenate([in_space, in_time[close & (beam[in_time[:, 0]] == beam[in_time[:, 1]])]])


def test_neighbouring_points_are_of_one_line_or_of_two_as_they_truly_are(recovered):
    scanner, survey, points, lines = recovered
    assert lines.kind == KINDS.get(scanner, "spinning")
    pairs = neighbours(points, survey.beam)
    found = lines.line[pairs[:, 0]] == lines.line[pairs[:, 1]]
    true = survey.sweep[pairs[:, 0]] == survey.sweep[pairs[:, 1]]
    assert 0.01 < true.mean() < 0.99
    assert np.mean(found == true) >= 0.99
    # Neither by parting nor by joining everything; where a turn of a lidar begins is a convention
    assert np.mean(found[true]) > 0.95
    assert np.mean(~found[~true]) > 0.95


def test_directions_are_those_of_the_true_lines(recovered):
    scanner, survey, points, lines = recovered
    order = np.lexsort((points.time_s, survey.sweep))
    sweep, xyz = survey.sweep[order], points.xyz[order]
    # The chord between points before and after in the true line, on the ground; rings of a lidar bend
    half = 2 if scanner.startswith("spinning") else 5
    a = np.arange(len(order) - 2 * half)
    b = a + 2 * half
    chord = xyz[b] - xyz[a]
    step = np.linalg.norm(np.diff(xyz, axis=0), axis=1)
    longest = np.lib.stride_tricks.sliding_window_view(step, 2 * half).max(axis=1)
    flat = (sweep[a] == sweep[b]) & (longest < 1.5) & (np.abs(chord[:, 2]) < 0.1 * np.hypot(*chord[:, :2].T))
    # Chords of less turn by degrees with the noise of two points
    flat &= np.hypot(*chord[:, :2].T) > (1.0 if scanner != "airborne" else 2.0)
    assert np.count_nonzero(flat) > 500
    own = lines.direction[order[a + half]][flat]
    along = chord[flat, :2] / np.hypot(*chord[flat, :2].T)[:, None]
    off = np.degrees(np.arccos(np.clip(np.sum(own * along, axis=1), -1.0, 1.0)))
    assert np.isfinite(off).mean() > 0.99
    off = off[np.isfinite(off)]
    # Grass scatters the ranges of grazing beams by decimetres, and rings with them
    assert np.quantile(off, 0.9 if not scanner.startswith("spinning") else 0.7) < 3.0
    assert np.median(off) < 1.5


def test_crossings_are_counted_as_by_truth(recovered):
    scanner, survey, points, lines = recovered
    within = 0.6 if scanner == "airborne" else 0.3
    stations = survey.truth.xyz[:: max(len(survey.truth.xyz) // 300, 1)]
    true = count_crossings(survey, stations, within)
    near = cKDTree(points.xyz).query_ball_point(stations, within)
    found = [support_of(lines, np.array(index, dtype=np.int64)) for index in near]
    n_lines = np.array([s.n_lines for s in found])
    looked_at = true.n_sweeps >= 2
    assert np.count_nonzero(looked_at) > 10
    assert n_lines[looked_at].sum() == pytest.approx(true.n_sweeps[looked_at].sum(), rel=0.10)
    assert np.median(np.abs(n_lines - true.n_sweeps)[looked_at] / true.n_sweeps[looked_at]) <= 0.10
    passes = np.array([s.n_passes for s in found])
    assert np.mean(passes[looked_at] == true.n_strips[looked_at]) > 0.95
    if scanner.startswith("spinning"):
        beams = np.array([s.n_beams for s in found])
        assert np.array_equal(beams[looked_at], true.n_beams[looked_at])


def test_ranks_and_positions_follow_time_along_each_line(recovered):
    *_, points, lines = recovered
    assert sorted(lines.order.tolist()) == list(range(len(points)))
    rank, time = lines.rank[lines.order], points.time_s[lines.order]
    first = np.zeros(len(points), dtype=bool)
    first[lines.start[:-1]] = True
    assert np.all(rank[first] == 0)
    assert np.all(np.diff(rank)[~first[1:]] == 1)
    assert np.all(np.diff(time)[~first[1:]] >= 0.0)
    step = np.linalg.norm(np.diff(points.xyz[lines.order], axis=0), axis=1)[~first[1:]]
    np.testing.assert_allclose(np.diff(lines.position_m[lines.order])[~first[1:]], step, atol=2e-2)


def test_spacing_to_the_next_line_is_that_of_the_turns():
    """A head on a van: turns are speed / turns_per_s apart along the road, times the cosine of the line's own turn."""
    survey = simulate_survey("straight", 7, 60.0, points_per_m=4000.0, scanner="one")
    lines = recover_scan_lines(survey.points)
    head, speed = survey.scenario.scanners[0], survey.scenario.passes[0].speed_mps
    middle = survey.trajectory.xyz[len(survey.trajectory) // 2]
    near = np.hypot(*(survey.points.xyz[:, :2] - middle[:2]).T) < 3.0
    wanted = speed / head.turns_per_s * np.cos(np.radians(head.yaw_deg))
    assert np.nanmedian(lines.spacing_across_m[near]) == pytest.approx(wanted, rel=0.15)
    assert np.isfinite(lines.spacing_across_m).mean() > 0.95


def test_points_without_times_have_the_direction_and_spacings_of_their_pattern():
    rng = np.random.default_rng(3)
    # Lines 0.5 m apart at 30 degrees, pulses 0.35 m apart and not in step from line to line, both with noise
    line, pulse = np.meshgrid(np.arange(-160, 160), np.arange(-220, 220), indexing="ij")
    u = 0.35 * (pulse + rng.uniform(0.0, 1.0, 320)[:, None]) + rng.normal(0.0, 0.05, line.shape)
    v = 0.5 * line + rng.normal(0.0, 0.05, line.shape)
    turn = np.radians(30.0)
    x, y = np.cos(turn) * u - np.sin(turn) * v, np.sin(turn) * u + np.cos(turn) * v
    inside = (np.abs(x) < 50.0) & (np.abs(y) < 50.0)
    points = Points(np.stack([x[inside], y[inside], np.zeros(inside.sum())], axis=1))
    lines = recover_scan_lines(points)
    assert (lines.kind, lines.n_lines, lines.line.max()) == ("none", 0, -1)
    off = np.degrees(np.arctan2(lines.direction[:, 1], lines.direction[:, 0])) - 30.0
    off = np.abs((off + 90.0) % 180.0 - 90.0)
    assert np.isfinite(off).mean() > 0.99
    assert np.nanmax(off) < 3.0
    assert np.median(lines.spacing_across_m) == pytest.approx(0.5, rel=0.05)
    assert np.median(lines.spacing_along_m) == pytest.approx(0.35, rel=0.1)
    # A line of 20 m across the lines crosses one every 0.5 m
    across = np.array([-np.sin(turn), np.cos(turn)])
    on = np.flatnonzero(
        (np.abs(points.xyz[:, :2] @ across) < 10.0)
        & (np.abs(points.xyz[:, :2] @ [across[1], -across[0]]) < 0.3)
    )
    found = support_of(lines, on, (20.0 * across[0], 20.0 * across[1]))
    assert found.n_eff == pytest.approx(40.0, rel=0.1)
    assert found.angle_deg == pytest.approx(90.0, abs=3.0)


@pytest.mark.parametrize("size", [9.0, 15.0, 60.0])
def test_random_points_have_no_direction(size):
    """Nor have those whose coordinates are rounded to centimetres."""
    rng = np.random.default_rng(5)
    xyz = np.round(np.stack([*rng.uniform(0.0, size, (2, 20_000)), np.zeros(20_000)], axis=1), 2)
    assert mean_spacing_m(xyz) == pytest.approx(size / np.sqrt(20_000), rel=0.1)
    lines = recover_scan_lines(Points(xyz))
    assert np.isnan(lines.direction).mean() > 0.97


@pytest.mark.parametrize("damage", ["late", "gaps", "equal", "sources", "rings"])
def test_damaged_fields_are_survived(damage):
    rng = np.random.default_rng(1)
    survey = simulate_survey("straight", 1, 40.0, points_per_m=1000.0, scanner="one").points
    n, time, columns = len(survey), survey.time_s.copy(), dict(survey.columns)
    if damage == "late":
        time[::1000] = 1e100
    elif damage == "gaps":
        time += np.cumsum(np.where(rng.random(n) < 0.001, 10.0 ** rng.uniform(0, 7, n), 0.0))
    elif damage == "equal":
        time[n // 2 :] = time[n // 2]
    elif damage == "sources":
        columns["point_source_id"] = rng.uniform(-1e9, 1e9, n)
    else:
        columns["ring"] = rng.integers(0, 128, n)
    columns.pop("scan_angle")
    lines = recover_scan_lines(Points(survey.xyz, time_s=time, columns=columns))
    assert len(lines) == n
    assert lines.n_lines <= n
    assert lines.kind == "none" or lines.line.min() == 0


@pytest.mark.parametrize("n", [0, 1, 2, 7])
def test_hardly_any_points_are_no_trouble(n):
    rng = np.random.default_rng(n)
    xyz, time = rng.uniform(0.0, 5.0, (n, 3)), np.arange(n) * 1e-3
    for points in (Points(xyz), Points(xyz, time_s=time), Points(xyz, time_s=time, ring=np.arange(n))):
        lines = recover_scan_lines(points, scanner_timing(points))
        assert len(lines) == len(lines.direction) == n
