"""Poles at the ends of wires, and wires followed from pole to pole."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from linework.lines.catenary import Catenary
from linework.methods.cables.band import cable_band
from linework.methods.cables.networks import with_networks
from linework.methods.cables.poles import AIR_M, find_poles, without_repeats
from linework.methods.cables.supports import hanging
from linework.model.lines import POLE, LineSet


def span(a, b, sag_m=0.5):
    """Return the vertices (n, 3) of a wire between two fixings, from west to east."""
    a, b = sorted((np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64)), key=tuple)
    share = np.linspace(0.0, 1.0, 20)[:, None]
    return a + share * (b - a) - np.array([0.0, 0.0, 4.0 * sag_m]) * share * (1.0 - share)


def lines_of(wires, kind="cable"):
    return LineSet.from_lines(wires, kind=[kind] * len(wires), confidence=[0.9] * len(wires))


#: Fixings of three poles of a bent line with three wires each, one above another.
POLES = [(0.0, 0.0), (40.0, 3.0), (80.0, -2.0)]
LEVELS = (8.0, 7.5, 7.0)


def line_and_drop():
    """Return a line of two spans of three wires, and a drop line from its middle pole: seven wires."""
    main = [span((*a, z), (*b, z)) for a, b in itertools.pairwise(POLES) for z in LEVELS]
    return lines_of([*main, span((40.0, 3.0, 6.5), (42.0, 22.0, 5.0))])


def groups(column):
    """Return which rows are in one group, whatever it is called."""
    return {frozenset(np.flatnonzero(column == name).tolist()) for name in set(column.tolist())}


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_wires_are_followed_from_pole_to_pole_in_any_order(seed):
    lines = line_and_drop()
    order = np.random.default_rng(seed).permutation(len(lines))
    found = with_networks(lines.take(order))
    back = found.take(np.argsort(order))
    assert groups(back.network) == {frozenset(range(7))}
    assert groups(back.circuit) == {frozenset(range(6)), frozenset([6])}
    assert groups(back.span) == {frozenset([0, 1, 2]), frozenset([3, 4, 5]), frozenset([6])}
    assert back == with_networks(lines)


def test_lines_on_both_sides_of_a_road_are_two_networks():
    rows = [[span((*a, z), (*b, z)) for a, b in itertools.pairwise(POLES) for z in LEVELS]]
    rows.append([wire + np.array([0.0, 7.0, 0.0]) for wire in rows[0]])
    found = with_networks(lines_of([*rows[0], *rows[1]]))
    assert groups(found.network) == {frozenset(range(6)), frozenset(range(6, 12))}


def test_a_millimetre_does_not_change_the_groups():
    lines = line_and_drop()
    moved = lines.with_columns(xyz=lines.xyz + np.random.default_rng(4).normal(0.0, 0.001, lines.xyz.shape))
    one, other = with_networks(lines), with_networks(moved)
    for name in ("network", "circuit", "span"):
        assert groups(getattr(one, name)) == groups(getattr(other, name))


def test_pieces_of_a_long_span_and_wide_arms_are_of_one_span():
    ends = [((0.0, 0.0, 30.0), (300.0, 0.0, 30.0)), ((0.0, 12.0, 30.0), (180.0, 12.0, 28.0)),
            ((60.0, 0.4, 25.0), (300.0, 0.4, 30.0))]  # fmt: skip
    hung = hanging(np.array(ends))
    assert hung.span.tolist() == [0, 0, 0]
    assert hung.support[0, 0] == hung.support[1, 0]
    assert hung.support[0, 1] == hung.support[2, 1]
    assert len({*hung.support[:, 0].tolist(), *hung.support[:, 1].tolist()}) == 4


def test_nothing_hangs_nowhere():
    assert len(hanging(np.zeros((0, 2, 3))).span) == 0
    assert with_networks(LineSet.empty()) == LineSet.empty()


@pytest.mark.parametrize("at", [0, 7, -1])
def test_a_wire_at_no_finite_place_has_no_network(at):
    lines = line_and_drop()
    wire = span((0.0, 0.0, 8.0), (40.0, 3.0, 8.0))
    wire[at, 0] = np.nan
    broken = lines_of([wire])
    found = with_networks(LineSet.concatenate([broken, lines]))
    assert (found.network[0], found.circuit[0], found.span[0]) == ("", "", "")
    assert found.take(np.arange(1, len(found))) == with_networks(lines)


def upright(x, y, top_m, rng, n=250, radius_m=0.12):
    """Return points on the side of a column that faces the scanner, which is to the south."""
    turn = rng.uniform(-np.pi, 0.0, n)
    ring = np.column_stack(
        [x + radius_m * np.cos(turn), y + radius_m * np.sin(turn), rng.uniform(0.0, top_m, n)]
    )
    return ring + rng.normal(0.0, 0.005, ring.shape)


def found_poles(others, wires=None):
    """Return the poles of a line of three, with points (n, 3) of whatever stands there."""
    wires = line_and_drop() if wires is None else wires
    on_wire = np.concatenate([wires.xyz[::2], wires.xyz[1::2]])
    points = np.concatenate([on_wire, *others])
    order = np.random.default_rng(8).permutation(len(points))
    band = cable_band(points[order], points[order][:, 2].astype(np.float32), 4.0, np.zeros(3))
    return find_poles(band, wires, (order < len(on_wire))[band.index])


def test_a_pole_stands_where_its_points_are():
    rng = np.random.default_rng(5)
    poles = found_poles([upright(x, y, 8.3, rng) for x, y in POLES])
    assert poles.form.tolist() == ["pole"] * 3
    assert np.abs(poles.xyz[::2, :2] - np.array(POLES)).max() < 0.02
    assert np.abs(poles.height_m - 8.3).max() < 0.15
    assert np.array_equal(poles.xyz[1::2], poles.xyz[::2] + poles.height_m[:, None] * [0.0, 0.0, 1.0])
    assert poles.sigma_xy_m.max() < 0.03
    assert poles.confidence.min() > 0.7


def test_what_is_met_but_not_seen_is_less_sure():
    rng = np.random.default_rng(5)
    seen, unseen = found_poles([upright(*POLES[1], 8.3, rng)]), found_poles([])
    assert len(seen) == len(unseen) == 1
    assert unseen.confidence[0] < 0.6 < seen.confidence[0]
    assert unseen.sigma_xy_m[0] > seen.sigma_xy_m[0]


def test_a_crown_and_a_wall_are_no_poles():
    rng = np.random.default_rng(6)
    wires = lines_of([span((*POLES[0], z), (*POLES[1], z)) for z in LEVELS])
    crown = np.column_stack(
        [rng.normal(0.0, 0.8, 4000), rng.normal(0.0, 0.8, 4000), rng.uniform(0.0, 9.0, 4000)]
    )
    wall = np.column_stack([np.full(4000, 40.0), rng.uniform(-2.0, 8.0, 4000), rng.uniform(0.0, 9.0, 4000)])
    assert len(found_poles([crown, wall], wires)) == 0
    trunk = upright(*POLES[0], 9.0, rng)
    assert len(found_poles([trunk], wires)) == 1
    assert len(found_poles([crown, trunk], wires)) == 0


def test_a_pole_before_a_wall_is_one_and_the_corner_of_a_house_is_none():
    rng = np.random.default_rng(11)
    wires = lines_of([span((*POLES[0], z), (*POLES[1], z)) for z in LEVELS])
    along, up = rng.uniform(0.0, 6.0, 8000), rng.uniform(0.0, 9.0, 8000)
    behind = np.column_stack([np.full(8000, -0.8), along - 3.0, up])
    assert len(found_poles([upright(*POLES[0], 8.3, rng), behind], wires)) == 1
    corner = [
        np.column_stack([np.full(8000, 0.0), along, up]),
        np.column_stack([-along, np.full(8000, 0.0), up]),
    ]
    assert len(found_poles(corner, wires)) == 0


def test_a_tower_is_wide_and_stands_clear():
    rng = np.random.default_rng(7)
    wires = lines_of([span((0.0, y, z), (250.0, y, z), 8.0) for y in (-6.0, 6.0) for z in (30.0, 24.0)])
    up = rng.uniform(0.0, 34.0, 1500)
    half = 3.0 - 2.4 * up / 34.0
    body = np.column_stack([*(half * rng.choice([-1.0, 1.0], (2, 1500))), up])
    trees = np.column_stack([*rng.uniform(-14.0, 14.0, (2, 4000)), rng.uniform(0.0, 12.0, 4000)])
    poles = found_poles([body, trees], wires)
    assert poles.form.tolist() == ["tower"]
    assert np.hypot(*poles.xyz[0, :2]) < 0.5
    assert poles.height_m[0] == pytest.approx(34.0, abs=0.5)
    forest = np.column_stack([*rng.uniform(-14.0, 14.0, (2, 9000)), rng.uniform(0.0, 34.0, 9000)])
    assert len(found_poles([forest], wires)) == 0


def test_a_pole_of_two_tiles_is_one():
    rng = np.random.default_rng(5)
    poles = found_poles([upright(*POLES[1], 8.3, rng)])
    other = poles.with_columns(xyz=poles.xyz + 0.001, confidence=poles.confidence - 0.1)
    assert without_repeats(LineSet.concatenate([other, poles])) == poles
    assert poles.kind.tolist() == [POLE]


@pytest.mark.parametrize("seed", [0, 1])
def test_of_poles_closer_than_one_can_stand_the_surest_stays(seed):
    rng = np.random.default_rng(seed)
    feet = np.column_stack([rng.uniform(0.0, 12.0, (300, 2)), np.zeros(300)])
    poles = LineSet.from_lines(
        [np.stack([foot, [*foot[:2], 8.0]]) for foot in feet],
        kind=[POLE] * 300, confidence=rng.uniform(0.1, 0.9, 300).round(1),
    )  # fmt: skip
    kept = without_repeats(poles)
    left, found = kept.xyz[::2, :2], feet[:, :2]
    apart = np.hypot(*(left[:, None] - left[None]).T) + np.eye(len(left))
    assert apart.min() >= AIR_M[0]
    # Each that is left out stands beside one that is as sure
    beside = np.hypot(*(found[:, None] - left[None]).transpose(2, 0, 1)) < AIR_M[0]
    assert (beside & (kept.confidence[None] >= poles.confidence[:, None])).any(axis=1).all()


def test_catenary_of_the_tests_sags():
    """The parabola above is within millimetres of the catenary that is fitted."""
    wire = span((0.0, 0.0, 8.0), (40.0, 0.0, 8.0))
    curve = Catenary(20.0, 7.5, 0.0, 8.0 * 0.5 / 40.0**2)
    assert np.abs(curve.height_at(wire[:, 0]) - wire[:, 2]).max() < 0.01
