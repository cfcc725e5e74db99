"""Overhead cables against exact truth: small scenes made here, and simulated surveys."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from tests.scenes.places import REAL

from linework.evaluation.measures import evaluate
from linework.lines.catenary import Catenary
from linework.methods.cables.find import CableConfig, find_cables
from linework.model.lines import LineSet
from linework.simulation.simulate import simulate_survey
from linework.surface.road import RoadConfig, find_ground, height_above_ground

ORIGIN = np.array([500_000.0, 5_400_000.0, 100.0])  # ground is level here
POWERLINE = REAL / "powerline/12AN2_20.laz"


def span(start, end, sag_m):
    """Return the axis of a wire, a vertex per 0.1 m; level ends."""
    start, end = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
    length = float(np.hypot(*(end - start)[:2]))
    wire = Catenary(length / 2, start[2] - sag_m, 0.0, 8.0 * sag_m / length**2)
    s = np.linspace(0.0, length, round(length / 0.1) + 1)
    t = (s / length)[:, None]
    return np.column_stack([(start + t * (end - start))[:, :2], wire.height_at(s)]) + ORIGIN


def hits(line, per_m, noise_m, rng, radius_m=0.008):
    """Return points on the side of a wire that faces a scanner below and beside it, at random along it."""
    length = 0.1 * (len(line) - 1)
    at = np.sort(rng.uniform(0, len(line) - 1, round(per_m * length)))
    xyz = np.column_stack([np.interp(at, np.arange(len(line)), column) for column in line.T])
    along = (line[-1] - line[0])[:2] / np.linalg.norm((line[-1] - line[0])[:2])
    turn = rng.uniform(-1.25 * np.pi, -0.25 * np.pi, len(at))
    across = np.column_stack([-along[1] * np.cos(turn), along[0] * np.cos(turn), np.sin(turn)])
    return xyz + radius_m * across + rng.normal(0, noise_m, xyz.shape)


def pole(x, y, height_m, rng):
    z, a = np.arange(0.0, height_m, 0.03), rng.uniform(0, 2 * np.pi, round(height_m / 0.03 + 1))
    a = a[: len(z)]
    return np.column_stack([x + 0.12 * np.cos(a), y + 0.12 * np.sin(a), z]) + ORIGIN


def crown(x, y, z, radius_m, n, rng):
    v = rng.normal(size=(n, 3))
    v *= radius_m * rng.uniform(0.3, 1.0, (n, 1)) ** (1 / 3) / np.linalg.norm(v, axis=1, keepdims=True)
    return v + np.array([x, y, z]) + ORIGIN


def facade(x0, x1, y, height_m, rng, step=(0.10, 0.06)):
    x, z = np.meshgrid(np.arange(x0, x1, step[0]), np.arange(0.0, height_m, step[1]))
    xyz = np.column_stack([x.ravel(), np.full(x.size, y), z.ravel()]) + ORIGIN
    return xyz + rng.normal(0, 0.01, xyz.shape)


def cables_of(points):
    height = (points[:, 2] - ORIGIN[2]).astype(np.float32)
    found = find_cables(points, None, height, CableConfig())
    return found.take(found.kind == "cable")


def scores(lines, truth):
    reference = LineSet.from_lines([line[::5] for line in truth], kind=["cable"] * len(truth))
    return evaluate(lines, reference, tolerance_m=0.10, kinds=["cable"]).kinds[0]


def two_spans(rng, per_m=6.0, noise_m=0.01):
    """Return truth and points of four wires over two spans: two 0.3 m apart in height, two side by side."""
    truth = []
    for x0, x1, sag in ((0.0, 38.0, 0.7), (38.0, 70.0, 0.5)):
        for y, z in ((0.0, 8.0), (0.0, 8.3), (0.5, 8.9), (-0.5, 8.9)):
            truth.append(span((x0, y, z), (x1, y, z), sag))
    points = [hits(line, per_m, noise_m, rng) for line in truth]
    points += [pole(x, 0.0, 9.2, rng) for x in (0.0, 38.0, 70.0)]
    return truth, points


def test_every_wire_of_every_span_is_one_line():
    truth, points = two_spans(np.random.default_rng(1))
    found = cables_of(np.concatenate(points))
    s = scores(found, truth)
    assert len(found) == len(truth)
    assert s.at.completeness > 0.99
    assert s.at.correctness > 0.99
    assert s.at.pieces_per_line == 1.0
    assert s.at.space.rmse_m < 0.012
    assert set(found.kind) == {"cable"}
    assert np.all(found.clearance_m == pytest.approx(found.clearance_m.clip(7.2, 8.5)))


def test_wires_end_at_their_pole():
    truth, points = two_spans(np.random.default_rng(2), per_m=2.0)
    found = cables_of(np.concatenate(points))
    ends = np.concatenate([found[i].xyz[[0, -1], 0] for i in range(len(found))]) - ORIGIN[0]
    assert len(found) == len(truth)
    assert np.min(np.abs(ends[:, None] - [0.0, 38.0, 70.0]), axis=1).max() < 0.5


@pytest.mark.parametrize("seed", range(3))
def test_trees_facades_and_stray_points_are_no_cables(seed):
    rng = np.random.default_rng(seed)
    points = [crown(5.0 + 9.0 * i, 3.0, 6.5, rng.uniform(2, 3.5), 2500, rng) for i in range(5)]
    points += [facade(0.0, 40.0, 12.0, 14.0, rng), facade(0.0, 40.0, 30.0, 9.0, rng, step=(0.2, 0.35))]
    points.append(rng.uniform([0, -10, 0], [60, 30, 20], (500, 3)) + ORIGIN)
    assert len(cables_of(np.concatenate(points))) == 0


def test_the_chord_of_a_gantry_is_no_cable():
    rng = np.random.default_rng(4)
    x = np.repeat(np.arange(0.0, 16.0, 0.05), 6)
    beam = np.column_stack([x, rng.uniform(-0.06, 0.06, len(x)), 6.0 + rng.uniform(-0.06, 0.0, len(x))])
    points = [beam + ORIGIN + rng.normal(0, 0.005, beam.shape), pole(0, 0, 6, rng), pole(16, 0, 6, rng)]
    assert len(cables_of(np.concatenate(points))) == 0


def test_a_wire_is_found_beside_a_facade_and_bridged_through_a_crown():
    rng = np.random.default_rng(7)
    line = span((0.0, 0.0, 8.0), (40.0, 0.0, 8.0), 0.8)
    wire = hits(line, 5.0, 0.01, rng)
    x = wire[:, 0] - ORIGIN[0]
    points = [wire[(x < 16.0) | (x > 22.0)], crown(19.0, 0.5, 7.0, 2.8, 3000, rng)]
    points += [facade(0.0, 40.0, 1.5, 12.0, rng), pole(0, 0, 8.2, rng), pole(40, 0, 8.2, rng)]
    found = cables_of(np.concatenate(points))
    s = scores(found, [line])
    assert len(found) == 1
    assert s.at.completeness > 0.98
    assert 2.0 < found.bridged_m[0] < 8.0


def test_the_answer_does_not_depend_on_the_order_of_the_points():
    rng = np.random.default_rng(9)
    _, points = two_spans(rng, per_m=3.0)
    cloud = np.concatenate([*points, crown(20.0, 1.0, 7.0, 2.5, 2000, rng)])
    first, second = cables_of(cloud), cables_of(cloud[rng.permutation(len(cloud))])
    assert np.array_equal(first.offsets, second.offsets)
    assert np.array_equal(first.xyz, second.xyz)


def test_nothing_in_the_band_is_nothing_found():
    ground = np.zeros((50, 3)) + ORIGIN
    assert len(cables_of(ground)) == 0
    assert len(find_cables(ground[:0], None, np.zeros(0, np.float32), CableConfig())) == 0


def test_times_of_the_points_become_the_time_of_the_line():
    rng = np.random.default_rng(3)
    wire = hits(span((0, 0, 7), (30, 0, 7), 0.4), 8.0, 0.01, rng)
    time_s = 1000.0 + (wire[:, 0] - ORIGIN[0]) / 10.0
    found = find_cables(wire, time_s, (wire[:, 2] - 100.0).astype(np.float32), CableConfig())
    assert found.time_start_s[0] == pytest.approx(1000.0, abs=0.2)
    assert found.time_end_s[0] == pytest.approx(1003.0, abs=0.2)


def test_sigma_is_honest():
    rng = np.random.default_rng(11)
    errors, sigmas = [], []
    for _ in range(12):
        truth = [span((0.0, 3.0 * i, 8.0), (35.0, 3.0 * i, 8.0), 0.6) for i in range(3)]
        found = cables_of(np.concatenate([hits(line, 1.5, 0.02, rng, radius_m=0.006) for line in truth]))
        for i in range(len(found)):
            x, y, z = (found[i].xyz - ORIGIN).T
            row = round(float(np.median(y)) / 3.0)
            inside = (x > 0.0) & (x < 35.0)
            wire = np.interp(x, truth[row][:, 0] - ORIGIN[0], truth[row][:, 2] - ORIGIN[2])
            own = slice(found.offsets[i], found.offsets[i + 1])
            errors.append(np.column_stack([y - 3.0 * row, z - wire])[inside])
            sigmas.append(np.column_stack([found.sigma_xy_m[own], found.sigma_z_m[own]])[inside])
    ratio = np.sqrt(np.mean((np.concatenate(errors) / np.concatenate(sigmas)) ** 2, axis=0))
    assert len(errors) == 36
    assert np.all((ratio > 0.7) & (ratio < 1.5)), ratio


@pytest.mark.parametrize(("kind", "seed"), [("straight", 1), ("bends", 2), ("urban", 1)])
def test_cables_of_a_simulated_survey(kind, seed):
    survey = simulate_survey(kind, seed, 120.0, points_per_m=3000.0)
    surface = find_ground(survey.points, survey.trajectory, RoadConfig())
    height = height_above_ground(surface, survey.points.xyz)
    found = find_cables(survey.points.xyz, survey.points.time_s, height, CableConfig())
    found = dataclasses.replace(found, crs=survey.crs)
    s = evaluate(found, survey.truth, tolerance_m=0.10, kinds=["cable"]).kinds[0]
    assert s.observed_m > 50.0
    assert s.at.completeness > 0.95
    assert s.at.correctness > 0.97
    assert s.at.space.rmse_m < 0.06
    assert s.at.redundancy < 0.02
    assert s.at.pieces_per_line < 1.3


def test_conductors_of_a_real_power_line():
    if not POWERLINE.exists():
        pytest.skip(f"no real survey at {POWERLINE}")
    laspy = pytest.importorskip("laspy")
    las = laspy.read(POWERLINE)
    xyz, code = np.column_stack([las.x, las.y, las.z]), np.asarray(las.classification)
    ground = float(np.median(xyz[code == 2, 2]))  # polder: level to a metre
    found = find_cables(xyz, None, (xyz[:, 2] - ground).astype(np.float32), CableConfig())
    is_conductor = _near_any(found, xyz, code == 14)
    assert found.length_m.sum() > 1000.0
    assert is_conductor > 0.95


def _near_any(lines, xyz, chosen):
    """Return the share of the lines' vertices with a chosen point within 3 m."""
    from scipy.spatial import cKDTree

    return float(np.mean(cKDTree(xyz[chosen]).query(lines.xyz)[0] < 3.0))
