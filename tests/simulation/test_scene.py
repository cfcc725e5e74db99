"""Truth lines are where formats.md says, measured on the very triangles the rays meet."""

import numpy as np
import pytest

from linework.simulation.roads.draw import USUAL_ROADS, draw_scenario
from linework.simulation.roads.draw_pieces import arrow
from linework.simulation.roads.scenario import Barrier, Cable, Fence, Marking, Rail, Symbol
from linework.simulation.scene.ground import boundary_truth, ground, marking_truth, symbol_truth
from linework.simulation.scene.materials import Material
from linework.simulation.scene.part import assemble_scene
from linework.simulation.scene.rails import barrier, fence, guardrail, rail_top
from linework.simulation.scene.wires import cable, catenary
from linework.simulation.sensors.scanner import Caster


@pytest.fixture(scope="module")
def road():
    """A winding road: grades, superelevation, radii under 30 m."""
    return draw_scenario("bends", 3, 120.0).layout.road


def offsets_of(road, xyz):
    return road.alignment.locate(np.asarray(xyz)[:, :2])


def first_hit(part, origin, direction):
    scene = assemble_scene([part])
    o, d = np.atleast_2d(origin).astype(float), np.atleast_2d(direction).astype(float)
    d = d / np.linalg.norm(d, axis=1, keepdims=True)
    ray, triangle, reach = Caster(scene).cast(o, d, 100.0, 0, np.random.default_rng(0))
    return ray, o[ray] + d[ray] * reach[:, None], scene.mesh.target[triangle]


@pytest.mark.parametrize("faces", [1, -1])
def test_guardrail_truth_is_midway_between_crest_and_valley_at_the_top_edge(road, faces):
    spec = Rail(q_m=-faces * 4.2, faces=faces, start_m=5.0, end_m=100.0, top_m=0.75, depth_m=0.08)
    part = guardrail(road, spec)
    beam = part.meshes[0].vertices
    s, q = offsets_of(road, beam)
    towards_traffic = (q - spec.q_m) * faces
    assert towards_traffic.max() == pytest.approx(0.04, abs=1e-6)  # crests
    assert towards_traffic.min() == pytest.approx(-0.04, abs=1e-6)  # valley and lips
    line = part.lines[0]
    s_line, q_line = offsets_of(road, line.xyz)
    assert np.abs(q_line - spec.q_m).max() < 1e-6
    top = road.carriageway_height(s_line, q_line) + 0.75
    assert np.abs(line.xyz[:, 2] - top).max() < 1e-9
    # the highest point of the mesh near each truth vertex is that height
    for i in range(0, len(s_line), 40):
        near = np.abs(s - s_line[i]) < 1.0
        slope = 1.0 * np.abs(road.alignment.grade(s_line[i])) + 0.03
        assert abs(beam[near, 2].max() - line.xyz[i, 2]) < slope
    assert line.height_m == 0.75


def test_rays_on_a_beam_scatter_evenly_about_its_truth_line(road):
    spec = Rail(q_m=-4.2, faces=1, start_m=5.0, end_m=100.0, top_m=0.75)
    part = guardrail(road, spec)
    s = np.random.default_rng(1).uniform(20.0, 90.0, 4000)
    origin = road.over_carriageway(s, -1.0, 2.2)
    aim = road.over_carriageway(s, -4.2, np.random.default_rng(2).uniform(0.46, 0.74, 4000))
    _, xyz, target = first_hit(part, origin, aim - origin)
    _, q = offsets_of(road, xyz[target == 0])
    assert len(q) > 3700  # steel returns 97 % of beams
    assert abs(np.mean(q + 4.2)) < 0.02  # within half the corrugation
    assert np.abs(q + 4.2).max() < 0.0410  # crest plus chords of the bend
    assert np.abs(q + 4.2).max() > 0.035


def test_a_sloped_end_dips_to_the_ground(road):
    spec = Rail(q_m=4.2, faces=-1, start_m=5.0, end_m=60.0, top_m=0.75, dip_start_m=6.0)
    top = rail_top(spec)
    assert float(top(5.0)) == pytest.approx(0.06)
    assert float(top(11.0)) == 0.75
    assert float(top(60.0)) == 0.75


def test_a_flared_end_leaves_the_road_and_its_truth_with_it(road):
    spec = Rail(q_m=4.2, faces=-1, start_m=5.0, end_m=60.0, top_m=0.75, flare_end_m=0.6)
    part = guardrail(road, spec)
    s, q = offsets_of(road, part.lines[0].xyz)
    assert q[s < 51.9] == pytest.approx(4.2, abs=1e-6)
    assert q[-1] == pytest.approx(4.8, abs=1e-6)
    s_mesh, q_mesh = offsets_of(road, part.meshes[0].vertices)
    end = s_mesh > 60.0 - 1e-6
    assert q_mesh[end].max() - 4.8 == pytest.approx(0.5 * spec.depth_m, abs=1e-6)
    assert 4.8 - q_mesh[end].min() == pytest.approx(0.5 * spec.depth_m, abs=1e-6)


def test_barrier_truth_is_the_top_edge_on_every_traffic_side(road):
    spec = Barrier(
        q_m=5.0, start_m=10.0, end_m=60.0, height_m=0.9, foot_width_m=0.6, top_width_m=0.2, traffic=(1, -1)
    )
    part = barrier(road, spec)
    assert [line.kind for line in part.lines] == ["barrier", "barrier"]
    offsets = [offsets_of(road, line.xyz)[1] for line in part.lines]
    assert np.abs(offsets[0] - 5.1).max() < 1e-6
    assert np.abs(offsets[1] - 4.9).max() < 1e-6
    s = np.linspace(12.0, 58.0, 200)
    above = road.place(s, 5.099, road.carriageway_height(s, 5.0) + 5.0)
    ray, xyz, _ = first_hit(part, above, np.tile([0.0, 0.0, -1.0], (200, 1)))
    assert np.abs(xyz[:, 2] - road.carriageway_height(s[ray], 5.0) - 0.9).max() < 2e-3


def test_fence_truth_is_its_top_edge(road):
    part = fence(road, Fence(q_m=6.0, start_m=10.0, end_m=40.0, height_m=1.2, form="boards"))
    s, q = offsets_of(road, part.lines[0].xyz)
    assert np.abs(q - 6.0).max() < 1e-6
    assert np.abs(part.lines[0].xyz[:, 2] - road.ground_height(s, q) - 1.2).max() < 1e-5


@pytest.mark.parametrize("kind", USUAL_ROADS)
def test_boundary_and_paint_truth_lie_on_the_mesh(kind):
    layout = draw_scenario(kind, 5, 100.0).layout
    road = layout.road
    part = ground(road)
    down = [0.0, 0.0, -1.0]
    for marking in layout.markings[:3]:
        xyz = marking_truth(road, marking).lines[0].xyz[2:-2]
        ray, hit, _ = first_hit(part, xyz + np.array([0.0, 0.0, 3.0]), np.tile(down, (len(xyz), 1)))
        assert len(ray) > 0.9 * len(xyz)
        assert np.abs(hit[:, 2] - xyz[ray, 2]).max() < 1e-3
    for sign in (1, -1):
        side = road.side(sign)
        s = np.linspace(0.0, 95.0, 300)
        inside = road.place(s, sign * (side.width_m - 0.002), road.carriageway_height(s, 0.0) + 3.0)
        scene = assemble_scene([part])
        rng = np.random.default_rng(0)
        ray, triangle, _ = Caster(scene).cast(inside, np.tile(down, (300, 1)), 50.0, 0, rng)
        on_road = scene.mesh.material[triangle] == Material.ASPHALT
        assert on_road.mean() > 0.98
        outside = road.place(s, sign * (side.width_m + 0.05), road.carriageway_height(s, 0.0) + 3.0)
        ray, triangle, _ = Caster(scene).cast(outside, np.tile(down, (300, 1)), 50.0, 0, rng)
        assert not np.any(scene.mesh.material[triangle] == Material.ASPHALT)


def test_kerb_tops_stand_the_kerb_height_above_the_foot():
    road = draw_scenario("urban", 2, 60.0).layout.road
    lines = boundary_truth(road, ()).lines
    assert [line.kind for line in lines] == ["road_boundary", "kerb_top"] * 2
    for foot, top in ((lines[0], lines[1]), (lines[2], lines[3])):
        rise = top.xyz[:, 2] - foot.xyz[:, 2]
        assert 0.02 - 1e-9 <= rise.min() <= 0.03 + 1e-9  # dropped kerbs
        assert rise.max() == pytest.approx(foot.height_m, abs=1e-3)
        assert foot.form == "kerb"
        assert np.linalg.norm(top.xyz[:, :2] - foot.xyz[:, :2], axis=1).max() < 0.025


@pytest.fixture(scope="module")
def junction():
    """A street with a side street."""
    for seed in range(20):
        road = draw_scenario("urban", seed, 120.0).layout.road
        if road.left.mouths or road.right.mouths:
            return road
    raise AssertionError("no side street in 20 seeds")


def test_the_kerb_turns_into_a_side_street_and_its_truth_with_it(junction):
    sign = 1 if junction.left.mouths else -1
    side = junction.side(sign)
    (mouth,) = side.mouths
    lines = [line for line in boundary_truth(junction, ()).lines if line.kind == "road_boundary"]
    assert len(lines) == 3  # two pieces beside the side street, one on the other side
    pieces = [offsets_of(junction, line.xyz) for line in lines]
    here = [(s, q * sign - side.width_m) for s, q in pieces if np.median(q * sign) > 0]
    before, after = sorted(here, key=lambda piece: piece[0].min())
    assert before[0].max() == pytest.approx(mouth.start_m, abs=1e-6)
    assert after[0].min() == pytest.approx(mouth.end_m, abs=1e-6)
    for (s, beyond), corner in (
        (before, mouth.start_m - mouth.radius_m),
        (after, mouth.end_m + mouth.radius_m),
    ):
        assert beyond.max() == pytest.approx(side.reach_m, abs=1e-5)
        on_arc = (beyond > 1e-6) & (beyond < mouth.radius_m)
        from_centre = np.hypot(s[on_arc] - corner, beyond[on_arc] - mouth.radius_m)
        assert on_arc.sum() > 30
        assert np.abs(from_centre - mouth.radius_m).max() < 1e-5


def test_rays_from_above_see_the_kerb_of_a_side_street_where_its_truth_is(junction):
    sign = 1 if junction.left.mouths else -1
    side = junction.side(sign)
    (mouth,) = side.mouths
    scene = assemble_scene([ground(junction)])
    caster = Caster(scene)
    rng = np.random.default_rng(3)

    def material_at(s, beyond):
        q = sign * (side.width_m + beyond)
        origin = junction.place(s, q, junction.carriageway_height(s, q) + 5.0)
        ray, triangle, reach = caster.cast(origin, np.tile([0.0, 0.0, -1.0], (len(s), 1)), 50.0, 0, rng)
        z = origin[ray, 2] - reach - junction.ground_height(s[ray], q[ray])
        return scene.mesh.material[triangle], z

    turn = np.linspace(0.05, 1.5, 300)
    for off, wanted in ((-0.03, True), (0.06, False)):  # to the street's side of the arc, and behind it
        r = mouth.radius_m - off
        s = mouth.start_m - mouth.radius_m + r * np.sin(turn)
        found, z = material_at(s, mouth.radius_m - r * np.cos(turn))
        assert np.mean((found == Material.ASPHALT) == wanted) > 0.98
        if wanted:
            assert np.abs(z).max() < 1e-3
    s = rng.uniform(mouth.start_m + 0.05, mouth.end_m - 0.05, 300)
    found, z = material_at(s, rng.uniform(0.0, side.reach_m - 0.1, 300))
    assert np.all(found == Material.ASPHALT)
    assert np.abs(z).max() < 1e-3


def test_a_dashed_line_runs_from_its_first_dash_to_its_last(road):
    m = Marking(
        q_m=0.0, start_m=1.0, end_m=40.0, width_m=0.12, role="centre", pattern="dashed", dash_m=3, gap_m=6
    )
    whole, *dashes = marking_truth(road, m).lines
    assert len(dashes) == 5
    assert np.allclose(whole.xyz[0], dashes[0].xyz[0])
    assert np.allclose(whole.xyz[-1], dashes[-1].xyz[-1])
    s, _ = offsets_of(road, np.stack([d.xyz[-1] for d in dashes]))
    assert np.allclose(s, [4.0, 13.0, 22.0, 31.0, 40.0], atol=1e-6)


def test_a_symbol_is_the_line_along_its_longer_side(road):
    stop = Symbol(start_m=20.0, end_m=20.5, right_m=-3.0, left_m=-0.2, form="stop")
    bar = Symbol(start_m=21.5, end_m=25.0, right_m=0.25, left_m=0.75, form="zebra")
    across, along = (symbol_truth(road, symbol).lines[0] for symbol in (stop, bar))
    s, q = offsets_of(road, across.xyz)
    assert np.allclose(s, 20.25, atol=1e-6)
    assert np.allclose((q[0], q[-1]), (-3.0, -0.2), atol=1e-6)
    s, q = offsets_of(road, along.xyz)
    assert np.allclose(q, 0.5, atol=1e-6)
    assert np.allclose((s[0], s[-1]), (21.5, 25.0), atol=1e-6)
    assert (across.kind, across.form, across.width_m) == ("road_marking_other", "stop", 0.5)
    assert (along.kind, along.form, along.width_m) == ("road_marking_other", "zebra", 0.5)
    shaft, *head = arrow(np.random.default_rng(1), 30.0, -1.5)
    assert len(symbol_truth(road, shaft).lines) == 1
    assert not any(symbol_truth(road, step).lines for step in head)


def test_a_cable_hangs_as_a_catenary_between_its_fixings(road):
    a, b = np.array([0.0, 0.0, 8.0]), np.array([30.0, 40.0, 9.5])
    t = np.linspace(0.0, 1.0, 101)
    xyz = catenary(a, b, 1.0, t)
    assert np.allclose(xyz[[0, -1]], [a, b])
    chord = a[2] + t * (b[2] - a[2])
    assert (chord - xyz[:, 2]).max() == pytest.approx(1.0, rel=0.003)
    # z'' = sqrt(1 + z'^2) / c: the differential equation of the catenary
    z1 = np.gradient(xyz[:, 2], 0.5)
    z2 = np.gradient(z1, 0.5)
    c = 50.0**2 / 8.0
    assert np.allclose(z2[5:-5], np.sqrt(1.0 + z1[5:-5] ** 2) / c, rtol=2e-3)


def test_cable_clearance_is_the_least_height_above_the_ground(road):
    spec = Cable(start=(20.0, 6.0, 7.0), end=(60.0, 6.0, 7.0), sag_m=0.8)
    line = cable(road, spec).lines[0]
    dense = np.stack(
        [np.interp(np.linspace(0, 1, 4000), np.linspace(0, 1, len(line.xyz)), c) for c in line.xyz.T], 1
    )
    s, q = offsets_of(road, dense)
    assert line.clearance_m == pytest.approx(np.min(dense[:, 2] - road.ground_height(s, q)), abs=0.03)
