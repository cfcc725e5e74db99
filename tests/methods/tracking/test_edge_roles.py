"""Roles of edges beside a boundary: the order outwards from the carriageway decides."""

import numpy as np
import pytest

from linework.methods.tracking.edge_roles import edge_roles
from linework.methods.tracking.neighbours import LineAxis
from linework.simulation.roads.draw import draw_scenario
from linework.simulation.scene.parallel_edges import parallel_edges


def axis(y, *, turned=False, length=40.0):
    t = np.linspace(0.0, length, 81)
    xyz = np.column_stack([t[::-1] if turned else t, np.full(81, y), np.zeros(81)])
    return LineAxis.of(t, xyz)


def role_of(edges, *, kerb=True, walls=(), heights=None, evidence=None):
    """Roles beside a boundary at 0 with its carriageway to the north."""
    m = len(edges)
    is_wall = np.isin(np.arange(m), walls)
    height_m = np.zeros(m) if heights is None else np.array(heights)
    weight = np.ones(m) if evidence is None else np.array(evidence)
    return edge_roles(edges, is_wall, height_m, weight, [axis(0.0)], np.array([kerb])).tolist()


@pytest.mark.parametrize("turned", [False, True])
def test_the_order_outwards_decides(turned):
    edges = [axis(y, turned=turned) for y in (0.4, -2.0, -4.0)]
    assert role_of(edges) == ["gutter", "footway_back", "verge"]
    # Without a kerb there is no footway behind
    assert role_of(edges, kerb=False) == ["gutter", "verge", "verge"]


def test_what_stands_up_behind_is_a_wall():
    assert role_of([axis(-2.0), axis(-3.0)], walls=[0]) == ["wall_foot", "verge"]


def test_what_belongs_to_the_kerb_or_lies_apart_has_no_role():
    # The back of the kerb's stone, an edge beyond the section, a step that stands on the carriageway
    edges = [axis(-0.2), axis(-20.0), axis(0.6)]
    assert role_of(edges, heights=[0.0, 0.0, 0.12]) == ["", "", ""]
    assert (
        edge_roles([], np.zeros(0, bool), np.zeros(0), np.zeros(0), [axis(0.0)], np.ones(1, bool)).size == 0
    )
    assert edge_roles(
        [axis(0.0)], np.zeros(1, bool), np.zeros(1), np.ones(1), [], np.zeros(0, bool)
    ).tolist() == [""]


def test_of_two_tracks_of_one_edge_the_one_with_more_evidence_has_the_role():
    edges = [axis(-2.0), axis(-2.1)]
    assert role_of(edges, evidence=[1.0, 5.0]) == ["", "footway_back"]
    assert role_of(edges, evidence=[5.0, 1.0]) == ["footway_back", ""]
    assert role_of(edges, evidence=[1.0, 5.0], walls=[0]) == ["wall_foot", ""]


def test_the_simulator_knows_the_edges_beside_its_boundaries():
    scenario = draw_scenario("village", 961, 60.0)
    edges = parallel_edges(scenario)
    assert {"footway_back", "wall_foot"} <= set(edges.role.tolist())
    assert set(edges.kind.tolist()) == {"edge_other"}
    road = scenario.layout.road
    for sign in (1, -1):
        side = road.side(sign)
        back = side.width_m + float(side.land_d_m[1])
        xyz = road.on_ground(10.0, sign * back) + np.asarray(scenario.origin_m)
        of_backs = edges.xyz[np.repeat(edges.role == "footway_back", np.diff(edges.offsets))]
        assert np.min(np.linalg.norm(of_backs - xyz, axis=1)) < 0.5
