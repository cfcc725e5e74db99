"""Laws of the simulation, for any seed: the world does not depend on who measures it; nothing stands on the road."""

import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from tests.scenes.effort import examples

from linework.simulation.roads.draw import ROADS, draw_scenario
from linework.simulation.scene.ground import boundary_truth, marking_truth
from linework.simulation.scene.rails import rail_offset, rail_top
from linework.simulation.scene.scene import build_scene
from linework.simulation.simulate import simulate_survey

roads = st.sampled_from(ROADS)
seeds = st.integers(0, 10_000)
few = settings(max_examples=examples(12), deadline=None, suppress_health_check=[HealthCheck.too_slow])
many = settings(max_examples=examples(60), deadline=None)


@settings(few, max_examples=examples(5))
@given(roads, seeds)
def test_the_truth_does_not_depend_on_the_density_of_points(kind, seed):
    thin = simulate_survey(kind, seed, 40.0, points_per_m=1200)
    dense = simulate_survey(kind, seed, 40.0, points_per_m=6000)
    assert len(dense.points) > 1.5 * len(thin.points)
    assert np.array_equal(thin.truth.xyz, dense.truth.xyz)
    assert np.array_equal(thin.truth.kind, dense.truth.kind)
    assert dense.truth.observed.sum() >= thin.truth.observed.sum()


#: Highest top edges of rails, by form, over the road [m]: bridge rails of pipes are the highest in use.
HIGHEST_M = {"w_beam": 0.85, "thrie_beam": 0.86, "box_beam": 0.78, "tube": 1.10, "cable_barrier": 0.90}


@many
@given(roads, seeds, st.floats(40.0, 400.0))
def test_every_scenario_is_sound(kind, seed, length_m):
    layout = draw_scenario(kind, seed, min(length_m, 250.0) if kind == "roundabout" else length_m).layout
    road = layout.road
    start, end = road.alignment.start_m, road.alignment.end_m
    width = {1: road.left.width_m, -1: road.right.width_m}
    for rail in layout.rails:
        assert start <= rail.start_m < rail.end_m <= end
        assert abs(rail.q_m) > width[int(np.sign(rail.q_m))] + 0.2
        top, offset = rail_top(rail), rail_offset(rail)
        assert np.all(np.diff(top.x) > 0)
        assert np.all(np.diff(offset.x) > 0)
        assert 0.05 < top.y.min() <= top.y.max() <= HIGHEST_M[rail.form]
        # flares lead away from the traffic
        assert np.all((offset.y - rail.q_m) * rail.faces <= 1e-12)
    for group in (layout.barriers, layout.fences, layout.hedges, layout.walls):
        for one in group:
            assert start - 1e-9 <= one.start_m < one.end_m <= end + 1e-9
            assert abs(one.q_m) > width[int(np.sign(one.q_m))]
    for one in layout.markings:
        assert start <= one.start_m < one.end_m <= end
    for one in layout.cables:
        line = np.array([one.start, one.end])
        assert np.all((line[:, 0] >= start) & (line[:, 0] <= end))
        assert np.all(line[:, 2] > 4.0)


@many
@given(roads, seeds)
def test_lines_along_the_road_keep_their_offset_and_do_not_jump(kind, seed):
    layout = draw_scenario(kind, seed, 120.0).layout
    lines = list(boundary_truth(layout.road, layout.far_edges_m).lines)
    lines += [line for m in layout.markings for line in marking_truth(layout.road, m).lines]
    for line in lines:
        step = np.linalg.norm(np.diff(line.xyz, axis=0), axis=1)
        assert step.max() < 0.8
        assert step.min() > 0.0
        # 12 % of grade and 6 % of crossfall at most, kerb ramps apart
        if line.kind != "kerb_top":
            assert np.abs(np.diff(line.xyz[:, 2]) / step).max() < 0.2


@few
@given(roads, seeds)
def test_the_same_seed_builds_the_same_triangles(kind, seed):
    a, b = (build_scene(draw_scenario(kind, seed, 60.0)) for _ in range(2))
    assert np.array_equal(a.mesh.vertices, b.mesh.vertices)
    assert np.array_equal(a.mesh.triangles, b.mesh.triangles)
    assert np.all(np.isfinite(a.mesh.vertices))
    assert a.mesh.target.max() < len(a.lines)
    assert a.mesh.triangles.max() < len(a.mesh.vertices)
