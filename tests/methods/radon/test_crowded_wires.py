"""Wires with something beside them: close together, in one cable, or hung from each other."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree
from tests.scenes.street_wires import EAST_M, NORTH_M, contact_line, hanging_wire

from linework.methods.cables.find import CableConfig, find_cables


def cables_in(xyz) -> list:
    found = find_cables(xyz, None, xyz[:, 2].astype(np.float32), CableConfig())
    return [line.xyz for line in found if line.kind == "cable"]


def side_by_side(seed, *, n, apart_m, noise_m, per_m=30.0):
    """Return points and wires of `n` wires beside each other, of unlike sags."""
    rng = np.random.default_rng(seed)
    drawn = [
        hanging_wire(
            rng,
            (0.0, apart_m * k, 8.0),
            (40.0, apart_m * k, 8.2),
            sag_m=0.6 * (1.0 + 0.04 * k),
            noise_m=noise_m,
            per_m=per_m,
        )
        for k in range(n)
    ]
    return np.concatenate([points for points, _ in drawn]), [wire for _, wire in drawn]


@pytest.mark.parametrize("seed", [9951, 9952, 9953])
@pytest.mark.parametrize(("n", "noise_m"), [(2, 0.03), (4, 0.02)])
def test_wires_as_near_as_the_ring_about_them_are_each_a_line(seed, n, noise_m):
    points, wires = side_by_side(seed, n=n, apart_m=0.2, noise_m=noise_m)
    lines = cables_in(points)
    assert len(lines) == n
    for wire in wires:
        tree = cKDTree(wire)
        assert min(tree.query(line[2:-2])[0].max() for line in lines) < 0.05


@pytest.mark.parametrize("seed", [9954, 9955])
def test_wires_twisted_into_a_cable_are_one_line(seed):
    points, wires = side_by_side(seed, n=3, apart_m=0.08, noise_m=0.01)
    (line,) = cables_in(points)
    assert np.hypot(*(line[-1] - line[0])[:2]) == pytest.approx(40.0, abs=2.0)
    assert cKDTree(wires[1]).query(line[2:-2])[0].max() < 0.05


@pytest.mark.parametrize("noise_m", [0.01, 0.02])
@pytest.mark.parametrize("seed", [9956, 9957])
def test_a_contact_wire_hangs_from_the_wire_above(seed, noise_m):
    points, wires = contact_line(seed, noise_m=noise_m)
    lines = np.concatenate(cables_in(points))
    for wire in wires:
        assert (cKDTree(lines).query(wire)[0] < 0.6).mean() > 0.9
    on_wires = cKDTree(np.concatenate(wires)).query(lines)[0]
    assert np.quantile(on_wires, 0.9) < 0.08


def test_a_straight_line_with_others_along_it_and_nothing_above_is_no_wire():
    points, _ = contact_line(9958, with_messenger=False)
    assert cables_in(points) == []


@pytest.mark.parametrize("across_m", [0.3, 1.0])
def test_the_edge_of_a_plate_is_no_bundle(across_m):
    rng = np.random.default_rng(9959)
    plate = np.column_stack(
        [rng.uniform(0.0, 40.0, 4000), rng.uniform(0.0, across_m, 4000), rng.normal(6.0, 0.01, 4000)]
    )
    assert cables_in(plate + np.array([EAST_M, NORTH_M, 0.0])) == []


@pytest.mark.parametrize("slope_deg", [35.0, 50.0])
@pytest.mark.parametrize("seed", [9971, 9972, 9973])
def test_a_sloping_strip_is_no_bundle(seed, slope_deg):
    """The edge of a roof: 0.5 m wide, as many points between any four wires as on them."""
    rng = np.random.default_rng(seed)
    n = 900
    along, up_it, off = rng.uniform(0.0, 14.0, n), rng.uniform(0.0, 0.5, n), rng.normal(0.0, 0.006, n)
    slope = np.radians(slope_deg)
    across, up = (
        np.cos(slope) * up_it - np.sin(slope) * off,
        np.sin(slope) * up_it + np.cos(slope) * off,
    )
    strip = np.stack([EAST_M + along, NORTH_M + across, 4.0 + 0.063 * along + up], axis=1)
    assert cables_in(strip) == []


def test_a_wall_with_few_points_is_no_bundle():
    rng = np.random.default_rng(9960)
    wall = np.column_stack(
        [rng.uniform(0.0, 40.0, 900), rng.normal(0.0, 0.01, 900), rng.uniform(4.0, 8.0, 900)]
    )
    assert cables_in(wall + np.array([EAST_M, NORTH_M, 0.0])) == []


@pytest.mark.parametrize("noise_m", [0.0, 1e-4])
def test_points_without_noise_are_one_wire(noise_m):
    rng = np.random.default_rng(9961)
    points, _ = hanging_wire(rng, (0.0, 0.0, 8.0), (40.0, 0.0, 8.0), sag_m=0.6, noise_m=noise_m, per_m=10.0)
    (line,) = cables_in(points)
    assert np.hypot(*(line[-1] - line[0])[:2]) == pytest.approx(40.0, abs=2.0)
