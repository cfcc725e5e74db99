"""The lines of a template on a street whose kerb, gutter and footway are known exactly."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest

from linework.methods.templates import across as across_module
from linework.methods.templates.across import edge_evidence
from linework.methods.templates.parallel import TEMPLATE_STATION_M, lines_of_template
from linework.methods.templates.template import CrossTemplate, TemplateNode
from linework.model.lines import LineSet

FACE_M, STEP_M, GUTTER_M, BACK_M, STRIPE_M = 0.02, 0.12, 0.30, 0.15, 0.55
LENGTH_M = 40.0
NODES = (
    TemplateNode("foot", "foot", 0.03, 0.02, "road_boundary"),
    TemplateNode("top", "top", 0.06, 0.10, "kerb_top"),
    TemplateNode("gutter", "break", -0.26, 0.0, "edge_other", "gutter"),
    TemplateNode("back", "shade", 0.20, 0.12, "edge_other", "footway_back"),
    TemplateNode("line", "stripe", -0.50, 0.01, "lane_marking"),
    TemplateNode("void", "fixed", 1.0, 0.0, "edge_other"),
)
TRUE_M = {"foot": 0.0, "top": FACE_M, "gutter": -GUTTER_M, "back": FACE_M + BACK_M, "line": -STRIPE_M}


def street(seed=7, hidden=(18.0, 22.0)):
    """Return points and brightness beside a kerb along the x axis, its land to the right (y < 0)."""
    rng = np.random.default_rng(seed)
    n = 60_000
    x, across = rng.uniform(0.0, LENGTH_M, n), rng.uniform(-1.3, 1.0, n)
    # As many points on the face as a scanner at the side of the road puts there
    face = rng.random(n) < 0.03
    across[face] = rng.uniform(0.0, FACE_M, face.sum())
    up = np.where(across < -GUTTER_M, -0.02 * (across + GUTTER_M), 0.0) + 0.08 * np.clip(
        across + GUTTER_M, 0.0, GUTTER_M
    )
    up += STEP_M * np.clip(across / FACE_M, 0.0, 1.0) + 0.02 * np.maximum(across - FACE_M, 0.0)
    bright = np.where(across > 0.0, 160.0, 100.0)
    bright[across > FACE_M + BACK_M] = 90.0
    bright[np.abs(across + STRIPE_M) < 0.06] = 260.0
    shown = across + rng.normal(0.0, 0.006, n)
    xyz = np.column_stack([x, -shown, 30.0 + up + rng.normal(0.0, 0.004, n)])
    bright = bright * rng.normal(1.0, 0.08, n)
    is_hidden = (x > hidden[0]) & (x < hidden[1])
    return xyz[~is_hidden], bright[~is_hidden]


def reader(xyz, bright):
    def points_in(bounds):
        inside = (xyz[:, 0] >= bounds.west) & (xyz[:, 0] < bounds.east)
        inside &= (xyz[:, 1] >= bounds.south) & (xyz[:, 1] < bounds.north)
        return xyz[inside], bright[inside]

    return points_in


def followed(step=1):
    """Return the kerb's foot as it was followed: eastwards, the land to its right; or with step -1, westwards."""
    x = np.arange(0.0, LENGTH_M + 1.0, 2.0)[::step]
    xyz = np.column_stack([x, np.zeros(len(x)), np.full(len(x), 30.0 + 0.08 * GUTTER_M)])
    return LineSet.from_lines([xyz], kind=["road_boundary"], sigma_xy_m=0.01, sigma_z_m=0.01)


@pytest.fixture(scope="module")
def found():
    return lines_of_template(followed(), CrossTemplate("kerb", NODES), reader(*street()))


def line_of(found, name):
    return found.lines[found.nodes.index(name)]


@pytest.mark.parametrize(("name", "within_m"), [("foot", 0.01), ("top", 0.01), ("gutter", 0.05), ("back", 0.02), ("line", 0.01)])  # fmt: skip
def test_each_node_is_at_its_own_edge(found, name, within_m):
    line = line_of(found, name)
    assert line.length_m > LENGTH_M - 2.0 * TEMPLATE_STATION_M - 0.1
    off = -line.xyz[:, 1] - TRUE_M[name]
    measured = ~line.bridged
    assert np.sqrt(np.mean(off[measured] ** 2)) < within_m
    # What is said of it holds: errors are rarely three times sigma
    assert np.mean(np.abs(off) <= 3.0 * line.sigma_xy_m) > 0.9
    assert np.all(line.sigma_xy_m < 0.15)


def test_heights_are_those_of_the_edges(found):
    foot, top = line_of(found, "foot"), line_of(found, "top")
    level = 30.0 + 0.08 * GUTTER_M
    assert np.abs(foot.xyz[~foot.bridged, 2] - level).max() < 0.015
    assert np.abs(top.xyz[~top.bridged, 2] - level - STEP_M).max() < 0.015


def test_what_is_hidden_is_bridged(found):
    foot = line_of(found, "foot")
    hidden = (foot.xyz[:, 0] > 18.5) & (foot.xyz[:, 0] < 21.5)
    assert foot.bridged[hidden].all()
    assert not foot.bridged[(foot.xyz[:, 0] < 17.5) | (foot.xyz[:, 0] > 22.5)].any()
    assert foot.sigma_xy_m[hidden].max() > 2.0 * foot.sigma_xy_m[~foot.bridged].mean()


def test_a_template_is_mirrored_for_a_line_the_other_way(found):
    back = lines_of_template(followed(-1), CrossTemplate("kerb", NODES), reader(*street()))
    assert back.nodes == found.nodes
    for name in ("foot", "top", "gutter", "back"):
        assert np.abs(-line_of(back, name).xyz[:, 1] - TRUE_M[name]).max() < 0.12
    assert np.allclose(-line_of(back, "void").xyz[:, 1], 1.0)


def test_lines_do_not_depend_on_the_order_of_the_points(found):
    xyz, bright = street()
    order = np.random.default_rng(0).permutation(len(xyz))
    again = lines_of_template(followed(), CrossTemplate("kerb", NODES), reader(xyz[order], bright[order]))
    assert again.lines == found.lines


def test_so_dense_points_are_thinned_alike_in_any_order(monkeypatch):
    """A scanner on a tripod leaves a million points at a station, which no array of all faces and points can hold."""
    rng = np.random.default_rng(5)
    n = 300_000
    across = rng.uniform(-0.7, 0.7, n)
    up = np.round(np.where(across > 0.0, 0.12, 0.0) + rng.normal(0.0, 0.004, n), 3)
    across = np.round(across, 3)
    monkeypatch.setattr(across_module, "_MOST_POINTS", 500)
    order = rng.permutation(n)
    for edge in ("top", "rail"):
        tracemalloc.start()
        found = edge_evidence(edge, across, up, np.ones(n))
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        again = edge_evidence(edge, across[order], up[order], np.ones(n))
        assert np.array_equal(found.log_ratio, again.log_ratio)
        assert np.array_equal(found.height_m, again.height_m, equal_nan=True)
        assert peak < 40 * across.nbytes
    top = edge_evidence("top", across, up, np.ones(n))
    assert abs(across_module.SOUGHT_OFFSETS_M[top.log_ratio.argmax()]) <= 0.02


def test_an_edge_that_is_nowhere_gives_no_line():
    xyz, bright = street()
    flat = np.column_stack(
        [xyz[:, :2], np.full(len(xyz), 30.0) + np.random.default_rng(1).normal(0, 0.004, len(xyz))]
    )
    found = lines_of_template(followed(), CrossTemplate("kerb", NODES[:2]), reader(flat, bright))
    measured_m = found.lines.length_m.sum() - found.lines.bridged_m.sum() if len(found.lines) else 0.0
    assert measured_m < 0.05 * LENGTH_M
    nothing = lines_of_template(followed(), CrossTemplate("kerb", NODES[:2]), reader(xyz[:0], bright[:0]))
    assert nothing.unseen == ("foot", "top")
    assert len(nothing.lines) == 0


def test_kinds_and_roles_are_those_of_the_nodes(found):
    assert found.lines.kind.tolist() == [node.kind for node in NODES]
    assert found.lines.role.tolist() == [node.role for node in NODES]
    assert line_of(found, "void").bridged.all()


def test_a_wire_and_a_rail_beside_a_line():
    rng = np.random.default_rng(3)
    n = 4000
    x = rng.uniform(0.0, LENGTH_M, n)
    wire = np.column_stack(
        [x, -0.5 + rng.normal(0, 0.01, n), 36.0 + 0.001 * (x - 20.0) ** 2 + rng.normal(0, 0.01, n)]
    )
    rail = np.column_stack([x, 1.0 + rng.normal(0, 0.01, n), 30.75 - rng.uniform(0.0, 0.3, n)])
    xyz = np.concatenate([wire, rail])
    nodes = (
        TemplateNode("second", "wire", 0.45, 6.2, "cable"),
        TemplateNode("rail", "rail", -0.9, 0.70, "guardrail"),
    )
    line = LineSet.from_lines([[[0.0, 0.0, 30.0], [LENGTH_M, 0.0, 30.0]]], kind=["cable"])
    found = lines_of_template(line, CrossTemplate("wires", nodes), reader(xyz, np.ones(len(xyz))))
    second, top = line_of(found, "second"), line_of(found, "rail")
    assert np.abs(second.xyz[:, 1] + 0.5).max() < 0.03
    assert np.abs(second.xyz[:, 2] - 36.0 - 0.001 * (second.xyz[:, 0] - 20.0) ** 2).max() < 0.03
    assert np.abs(top.xyz[:, 1] - 1.0).max() < 0.03
    # The upper edge between the highest points and the next: the points are 2 cm apart in height at a station
    assert np.abs(np.median(top.xyz[:, 2]) - 30.73) < 0.02
