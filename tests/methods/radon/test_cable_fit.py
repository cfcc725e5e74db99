"""A wire takes all points on it however it was found, and its ends follow from what is near them alone."""

from __future__ import annotations

import numpy as np
import pytest

from linework.kernels.cables import fit as kernels
from linework.lines.catenary import Catenary
from linework.methods.cables.band import Widths, cable_band
from linework.methods.cables.fit import (
    FITTING_METRES,
    fit_members,
    fit_wire,
    near_end,
    settle_wire,
    split_at_kink,
    surroundings,
)

WIDTHS = Widths(0.10)


def wire_points(length_m, seed, per_m=3.0):
    """Return (n, 3) points of a wire that runs east through (7, 50), by station."""
    rng = np.random.default_rng(seed)
    s = np.sort(rng.uniform(0.0, length_m, round(per_m * length_m)))
    hang = Catenary(length_m / 2.0, 8.0, 0.0, 8.0 * 0.02 / length_m)
    noise = rng.normal(0.0, 0.01, (2, len(s)))
    return np.column_stack([7.0 + s, 50.0 + noise[0], hang.height_at(s) + noise[1]])


def band_of(points, origin=(0.0, 0.0, 0.0)):
    band = cable_band(points, points[:, 2].astype(np.float32), 4.0, np.array(origin))
    assert band is not None
    return band


@pytest.mark.parametrize("part", [slice(30, 60), slice(0, 40), slice(60, 110)])
def test_any_part_of_a_wire_settles_to_the_whole(part):
    band = band_of(wire_points(40.0, 1))
    whole = fit_wire(band, np.arange(len(band.xyz)), WIDTHS)
    found = fit_wire(band, np.arange(len(band.xyz))[part], WIDTHS)
    assert whole is not None
    assert found is not None
    one, other = settle_wire(band, whole), settle_wire(band, found)
    assert np.array_equal(one.members, other.members)
    assert one.fit.curve == other.fit.curve
    assert one.length_m > 39.0


@pytest.mark.parametrize("side", [0, 1])
def test_an_end_of_a_long_wire_does_not_depend_on_its_other_end(side):
    points = wire_points(240.0, 2)
    x = points[:, 0]
    kept = points[x < 187.0] if side == 0 else points[x > 67.0]
    ends = []
    for cloud in (points, kept):
        band = band_of(cloud)
        wire = fit_wire(band, np.arange(len(band.xyz)), WIDTHS)
        assert wire is not None
        ends.append(near_end(band, settle_wire(band, wire), side, 60.0))
    assert ends[0].length_m == pytest.approx(60.0, abs=1.0)
    assert np.array_equal(ends[0].at(np.zeros(1)), ends[1].at(np.zeros(1)))


def test_a_short_wire_is_its_own_end():
    band = band_of(wire_points(40.0, 3))
    wire = fit_wire(band, np.arange(len(band.xyz)), WIDTHS)
    assert wire is not None
    assert near_end(band, wire, 0, 60.0) is wire


def test_what_a_wire_hangs_on_is_not_in_its_way():
    points = wire_points(30.0, 4)
    beside = np.array([0.0, 0.3, 0.0])
    at_end = points[points[:, 0] < 7.0 + FITTING_METRES - 0.5] + beside
    mid_span = points[(points[:, 0] > 20.0) & (points[:, 0] < 23.0)] + beside
    for others, taken in ((at_end, 0), (mid_span, 3)):
        band = band_of(np.concatenate([points, others]))
        wire = fit_wire(band, np.arange(len(points)), WIDTHS)
        assert wire is not None
        around = surroundings(band, wire, np.zeros(len(band.xyz), dtype=bool))
        assert taken <= around.taken <= 2 * taken
        assert around.crowded > 0.0


def test_columns_are_counted_from_an_origin_on_any_side():
    points = wire_points(30.0, 5)
    line = np.array([20.0, 50.0, 1.0, 0.0, -5.0, 5.0])
    found = []
    for origin in ((0.0, 0.0, 0.0), (1200.0, 1200.0, 0.0), (-1200.0, 0.0, 0.0)):
        shifted = line.copy()
        shifted[:2] -= origin[:2]
        found.append(np.sort(band_of(points, origin).near(shifted, 0.2)))
    inside = np.flatnonzero((points[:, 0] >= 15.0) & (points[:, 0] <= 25.0))
    assert all(np.array_equal(numbers, inside) for numbers in found)


#: Points of three upright things: what bends through them in plan is on none of them.
THREE_POLES = np.array([
    [-1.697, 2.431, 7.270], [-1.684, 2.438, 7.298], [-1.673, 2.448, 7.324], [-1.692, 2.406, 7.487],
    [-1.688, 2.425, 7.510], [-1.683, 2.443, 7.533], [1.163, -2.402, 7.569], [1.186, -2.379, 7.621],
    [1.207, -2.353, 7.673], [-1.696, 2.424, 7.724], [-1.682, 2.431, 7.754], [1.184, -2.387, 7.842],
    [1.183, -2.394, 8.064], [1.176, -2.392, 8.281], [1.191, -2.357, 8.330], [0.868, -2.835, 8.737],
    [0.936, -2.758, 8.915], [0.863, -2.828, 8.956],
])  # fmt: skip


def test_a_bow_on_which_no_point_lies_is_none():
    band = band_of(THREE_POLES)
    wire = fit_members(band, np.arange(len(band.xyz)), Widths(0.9780819158541194))
    assert wire.plan.bow_per_m == 0.0
    assert np.isfinite(wire.fit.curve.height_at(0.0))


#: Points of upright things: of what bends through them in plan, only six lie on the bow.
MOSTLY_BESIDE = np.array([
    [0.65, -1.10, 8.10], [0.63, -1.08, 8.15], [0.44, -1.62, 9.47], [-1.82, 1.13, 9.17],
    [0.65, -1.06, 8.31], [0.63, -1.10, 8.59], [-1.86, 1.11, 9.53], [0.60, -1.06, 8.19],
    [-1.81, 1.14, 9.04], [0.41, -1.65, 9.53], [0.44, -1.62, 9.57], [-1.83, 1.08, 9.14],
    [0.61, -1.12, 7.98], [0.42, -1.60, 9.35],
])  # fmt: skip


def test_a_bow_on_which_few_points_lie_is_none():
    band = band_of(MOSTLY_BESIDE)
    wire = fit_members(band, np.arange(len(band.xyz)), Widths(0.6))
    assert wire.plan.bow_per_m == 0.0


def test_a_bow_on_which_the_points_lie_is_kept():
    points = wire_points(40.0, 1)
    points[:, 1] += 0.5 * ((points[:, 0] - 27.0) / 20.0) ** 2
    wire = fit_members(band_of(points), np.arange(len(points)), WIDTHS)
    assert wire.plan.bow_per_m == pytest.approx(2 * 0.5 / 20.0**2, rel=0.1)


def test_a_wire_is_split_at_a_pole_with_kernels_that_are_compiled(monkeypatch):
    parabola = kernels.robust_parabola

    def checked(*arrays):
        assert all(array.flags.c_contiguous for array in arrays[:3])
        return parabola(*arrays)

    monkeypatch.setattr(kernels, "robust_parabola", checked)
    first, second = (wire_points(40.0, seed) for seed in (3, 4))
    second[:, 0] += 40.0
    band = band_of(np.concatenate([first, second]))
    wire = fit_wire(band, np.arange(len(band.xyz)), Widths(0.5))
    assert wire is not None
    parts = split_at_kink(band, wire, 5.0)
    assert parts is not None
    assert band.xyz[parts[0], 0].max() == pytest.approx(47.0, abs=5.0)
