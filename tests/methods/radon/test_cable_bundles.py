"""Conductors of airborne surveys: scattered farther than the gate, in bundles, blown aside by the wind."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree
from tests.scenes.airborne_wires import airborne_wires

from linework.methods.cables.bundles import tell_apart
from linework.methods.cables.find import CableConfig, find_cables
from linework.model.lines import LineSet


def cables_of(scene, order=slice(None)) -> list:
    found = find_cables(scene.xyz[order], None, scene.height_m[order], CableConfig())
    parts = np.split(found.xyz, found.offsets[1:-1])
    return [part for part, kind in zip(parts, found.kind, strict=True) if kind == "cable"]


def off_m(line, wire) -> float:
    """Largest distance of a line's vertices from a true wire, without the three metres at its ends."""
    fine = np.column_stack(
        [np.interp(np.arange(0.0, len(wire) - 1.0, 0.02), np.arange(len(wire)), v) for v in wire.T]
    )
    return float(cKDTree(fine).query(line[3:-3])[0].max())


@pytest.mark.parametrize(
    "scene",
    [
        pytest.param({}, id="pairs 0.4 m apart, 7 cm scatter"),
        pytest.param(
            {"apart_m": (0.0, 0.5), "across_m": 0.10, "up_m": 0.06}, id="pairs 0.5 m apart, 10 cm scatter"
        ),
        pytest.param({"apart_m": (0.0, 0.4, 0.8), "phases": 1}, id="three in a row"),
        pytest.param({"apart_m": (0.0,), "across_m": 0.02, "up_m": 0.02}, id="single ones, 2 cm scatter"),
        pytest.param({"apart_m": (0.0,), "across_m": 0.03, "bow_m": 0.6}, id="blown aside by 0.6 m"),
    ],
)
@pytest.mark.parametrize("seed", [9871, 9872])
def test_every_wire_is_one_line_where_it_is(scene, seed):
    drawn = airborne_wires(seed, **scene)
    lines = cables_of(drawn)
    assert len(lines) == len(drawn.wires)
    for wire in drawn.wires:
        best = min(lines, key=lambda line: off_m(line, wire))
        # 600 points of 10 cm scatter leave 1 cm, three times as much at the ends
        assert off_m(best, wire) < 0.05
        assert np.hypot(*(best[-1] - best[0])[:2]) == pytest.approx(250.0, abs=4.0)


@pytest.mark.parametrize("seed", [1, 3, 4])
def test_a_conductor_seen_over_a_part_of_its_span_stays(seed):
    drawn = airborne_wires(seed, phases=1, bow_m=0.0)
    first = drawn.wires[0]
    along = (first[-1] - first[0])[:2] / np.hypot(*(first[-1] - first[0])[:2])
    from_end = drawn.xyz[:, :2] - first[0, :2]
    s, o = from_end @ along, from_end @ np.array([-along[1], along[0]])
    few = (o > 0.2) & (s > 45.0) & (np.random.default_rng(1).random(len(s)) > 0.06)
    seen = replace(drawn, xyz=drawn.xyz[~few], height_m=drawn.height_m[~few])
    whole, part = sorted(cables_of(seen), key=len, reverse=True)
    assert off_m(whole, first) < 0.06
    assert off_m(part, drawn.wires[1]) < 0.10
    assert len(part) >= 40


@pytest.mark.parametrize("radius_m", [100.0, 300.0])
def test_what_is_bent_in_plan_but_does_not_hang_is_no_wire(radius_m):
    rng = np.random.default_rng(9876)
    angle = rng.uniform(-20.0, 20.0, 1200) / radius_m
    edge = np.column_stack([radius_m * np.sin(angle), radius_m * np.cos(angle), np.full(1200, 12.0)])
    xyz = edge + rng.normal(0.0, 0.01, edge.shape) + np.array([200_000.0, 570_000.0, 0.0])
    assert "cable" not in find_cables(xyz, None, xyz[:, 2].astype(np.float32), CableConfig()).kind


@pytest.mark.parametrize("bow_m", [0.0, 0.6])
def test_sigmas_across_are_honest_at_the_ends_too(bow_m):
    ratios = []
    for seed in range(9891, 9897):
        drawn = airborne_wires(seed, apart_m=(0.0,), phases=1, per_m=1.5, across_m=0.06, bow_m=bow_m)
        found = find_cables(drawn.xyz, None, drawn.height_m, CableConfig())
        keep = slice(*found.offsets[:2])
        wire = drawn.wires[0]
        fine = np.column_stack([np.interp(np.arange(0.0, 249.0, 0.01), np.arange(250.0), v) for v in wire.T])
        away = cKDTree(fine[:, :2]).query(found.xyz[keep, :2])[0]
        ends = np.r_[4:24, -24:-4]
        ratios.append(away[ends] / found.sigma_xy_m[keep][ends])
    assert 0.5 < np.sqrt(np.mean(np.square(ratios))) < 1.6


def test_they_do_not_depend_on_the_order_of_the_points():
    drawn = airborne_wires(9873)
    shuffled = np.random.default_rng(1).permutation(len(drawn.xyz))
    lines = cables_of(drawn)
    assert len(lines) == 4
    for one, other in zip(lines, cables_of(drawn, shuffled), strict=True):
        np.testing.assert_array_equal(one, other)


def test_wires_that_scatter_less_than_the_gate_are_left_as_they_are(monkeypatch):
    seen = []

    def kept(band, wires):
        out = tell_apart(band, wires)
        seen.append((wires, out))
        return out

    monkeypatch.setattr("linework.methods.cables.find.tell_apart", kept)
    assert len(cables_of(airborne_wires(9874, across_m=0.02, up_m=0.02))) == 4
    ((wires, out),) = seen
    assert len(wires) > 0
    assert all(a is b for a, b in zip(wires, out, strict=True))


def test_leaves_that_scatter_make_no_wires():
    rng = np.random.default_rng(9875)
    crown = rng.normal(0.0, [12.0, 0.4, 0.4], (4000, 3)) + np.array([200_000.0, 570_000.0, 15.0])
    assert (
        find_cables(crown, None, crown[:, 2].astype(np.float32), CableConfig()).kind.tolist()
        == LineSet.empty().kind.tolist()
    )
