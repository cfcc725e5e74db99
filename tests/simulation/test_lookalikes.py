"""Scenes in which things are what they look like, and others in which they are not; roads on two levels, tunnels."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree

from linework.simulation.lookalikes.draw_lookalikes import PAIRS
from linework.simulation.lookalikes.explanations import EXPLANATIONS, explanations_table, signs_of
from linework.simulation.roads.draw import draw_scenario
from linework.simulation.roads.true_lanes import true_lanes
from linework.simulation.scene.materials import Material
from linework.simulation.scene.paint import paint_cover, stain_shade
from linework.simulation.scene.scene import build_scene
from linework.simulation.sensors.scanner import Caster
from linework.simulation.simulate import simulate_survey, survey_of

PAGE = Path(__file__).parents[2] / "docs/simulation.md"
PAINT = ("lane_marking", "lane_marking_dash", "road_marking_other")
#: Seeds in which what a table says of a road must be found.
SEEDS = range(30)


def test_the_page_has_the_table_of_explanations():
    assert explanations_table() in PAGE.read_text(encoding="utf-8")
    assert {one.name for one in EXPLANATIONS} >= set(PAIRS)


@pytest.mark.parametrize("which", ["truth", "trap"])
def test_every_explanation_has_a_scene_in_which_it_is_the_truth_and_one_in_which_it_is_the_trap(which):
    scenes = [getattr(one, which) for one in EXPLANATIONS]
    found = {
        road: {sign for seed in SEEDS for sign in signs_of(draw_scenario(road, seed, 150.0))}
        for road in {scene.road for scene in scenes}
    }
    assert [scene for scene in scenes if scene.sign not in found[scene.road]] == []
    # Nothing is on every road: a sign that is always there tells nothing
    assert "tunnel" not in found.get("rural", set()) | found.get("village", set())


def test_the_truth_has_lines_where_a_lookalike_is_paint_and_none_where_it_is_not():
    seen = set()
    for seed in range(2):
        scenario = draw_scenario("lookalikes", seed, 160.0)
        alignment = scenario.layout.road.alignment
        lines = [line for line in build_scene(scenario).lines if line.kind in PAINT]
        place = [np.stack(alignment.locate(line.xyz[:, :2]), axis=1) for line in lines]
        for one in scenario.layout.lookalikes:
            low, high = np.array([one.start_m, one.right_m]), np.array([one.end_m, one.left_m])
            inside = any(np.all((p >= low) & (p <= high)) for p in place)
            touched = any(np.any(np.all((p >= low) & (p <= high), axis=1)) for p in place)
            assert inside == touched == one.has_line, (seed, one)
            seen.add((one.of, one.is_so))
    assert seen == {(of, is_so) for of in PAIRS for is_so in (True, False)}


def test_of_a_pair_both_are_there_to_be_seen_and_lie_on_their_own_place():
    scenario = draw_scenario("lookalikes", 3, 150.0)
    layout = scenario.layout
    new = [replace(one, wear=0.0) for one in layout.symbols]
    for one in layout.lookalikes:
        s, q = np.meshgrid(
            np.arange(one.start_m, one.end_m, 0.05), np.arange(one.right_m - 0.3, one.left_m + 0.3, 0.02)
        )
        grid = np.stack([s.ravel(), q.ravel()], axis=1)
        changed = (paint_cover(grid, [], scenario.seed, new) > 0.5) | (
            np.abs(stain_shade(grid, layout.stains) - 1.0) > 0.05
        )
        assert changed.any() == ((one.of, one.is_so) != ("bare asphalt", True))
        beside = (grid[:, 1] < one.right_m - 0.05) | (grid[:, 1] > one.left_m + 0.05)
        assert not np.any(changed & beside), one
        assert not np.any(changed[(grid[:, 0] < one.start_m + 0.3) | (grid[:, 0] > one.end_m - 0.2)])


@pytest.mark.parametrize("road", ["village", "rural", "mixed", "motorway", "roofs", "tunnel", "lookalikes"])
def test_what_is_no_line_has_no_truth(road):
    """Stains, walls, hedges, houses, cars, bridges, gantries and tunnels change what is seen, and no true line."""
    bare = dict.fromkeys(
        ("stains", "walls", "hedges", "houses", "plants", "cars", "bridges", "gantries", "tunnels"), ()
    )
    for seed in (1, 2):
        scenario = draw_scenario(road, seed, 60.0)
        without = replace(scenario, layout=replace(scenario.layout, **bare))
        one, other = build_scene(scenario).lines, build_scene(without).lines
        assert [line.kind for line in one] == [line.kind for line in other]
        assert all(np.array_equal(a.xyz, b.xyz) for a, b in zip(one, other, strict=True))


def test_two_generations_of_paint_have_their_own_truth():
    notes = set()
    for seed in range(4):
        scenario = draw_scenario("repainted", seed, 60.0)
        whole = [line for line in build_scene(scenario).lines if line.kind == "lane_marking"]
        force = [line for line in whole if line.note != "older"]
        older = np.concatenate([line.xyz for line in whole if line.note == "older"])
        assert len(force) == 3
        notes |= {line.note for line in whole}
        for line in force:
            # Beside the older paint at the end, whether or not it began on it
            assert 0.2 < cKDTree(older).query(line.xyz[-20:])[0].min() < 1.3
        lanes = true_lanes(scenario, most_m=4.4)
        width = np.linalg.norm(lanes.left_xyz - lanes.right_xyz, axis=1)
        assert len(lanes)
        # Two lanes of what is in force: older lines between them cut none into strips
        assert np.median(width) > 2.0
    assert notes == {"", "older", "temporary"}


def test_older_and_new_paint_are_both_bright():
    survey = simulate_survey("repainted", 2, 40.0, points_per_m=4000)
    assert set(survey.truth.note) == {"", "older", "temporary"}
    origin = np.asarray(survey.scenario.origin_m)
    s, q = survey.scenario.layout.road.alignment.locate(survey.points.xyz[:, :2] - origin[:2])
    place = np.stack([s, q], axis=1)
    half = survey.scenario.layout.road.right.width_m
    on_road = np.abs(q) < half - 0.2
    for generation in ("older", "temporary"):
        marks = [replace(m, wear=0.0) for m in survey.scenario.layout.markings if m.generation == generation]
        cover = paint_cover(place, marks, survey.scenario.seed)
        bright, dark = (survey.points.intensity[on_road & which] for which in (cover > 0.9, cover == 0.0))
        assert np.median(bright) > 1.15 * np.median(dark)


@pytest.mark.parametrize("seed", range(4))
def test_a_bridge_carries_a_road_of_its_own_above_the_other(seed):
    scenario = draw_scenario("overpass", seed, 80.0)
    scene = build_scene(scenario)
    (over,) = scenario.layout.over
    under, above = scenario.layout.road, over.road
    # From far above, the upper road is met over the lower one, and its paint lies on it
    upper = [line for line in scene.lines if line.kind in PAINT and line.xyz[:, 2].min() > 4.0]
    assert len(upper) >= 3
    for line in upper:
        inner = line.xyz[1:-1]
        origin = inner + np.array([0.0, 0.0, 30.0])
        down = np.tile([0.0, 0.0, -1.0], (len(inner), 1))
        ray, triangle, reach = Caster(scene).cast(origin, down, 60.0, 0, np.random.default_rng(0))
        assert np.abs(origin[ray, 2] - reach - inner[ray, 2]).max() < 0.001
        assert np.all(scene.mesh.material[triangle] == Material.ASPHALT)
    # From the lower road upwards there is the underside, with room for a lorry, and then nothing of the lower road
    middle = above.alignment.position(0.5 * (above.alignment.start_m + above.alignment.end_m))
    s, q = under.alignment.locate(middle[None])
    eye = under.on_ground(s, q, 0.5)
    ray, triangle, reach = Caster(scene).cast(
        eye, np.array([[0.0, 0.0, 1.0]]), 60.0, 0, np.random.default_rng(1)
    )
    assert len(ray) == 1 and scene.mesh.material[triangle][0] == Material.CONCRETE
    assert 4.5 < reach[0] + 0.5 < 9.0
    # Stretches of the two roads do not share a chainage, by which paint is known
    assert above.alignment.start_m > under.alignment.end_m


def test_paint_of_the_upper_road_is_on_the_upper_road_only():
    survey = simulate_survey("overpass", 3, 60.0, scanner="airborne")
    scenario = survey.scenario
    without = replace(scenario.layout.over[0], markings=())
    plain = survey_of(replace(scenario, layout=replace(scenario.layout, over=(without,))))
    assert np.array_equal(plain.points.xyz, survey.points.xyz)
    brighter = survey.points.intensity > plain.points.intensity
    height = survey.points.xyz[:, 2] - scenario.origin_m[2]
    level = scenario.layout.road.alignment.height(30.0)
    assert brighter.sum() > 10
    assert height[brighter].min() > level + 4.0


@pytest.mark.parametrize("seed", range(4))
def test_a_tunnel_has_no_sky_and_nothing_of_it_stands_on_the_road(seed):
    scenario = draw_scenario("tunnel", seed, 80.0)
    scene, road = build_scene(scenario), scenario.layout.road
    (tube,) = scenario.layout.tunnels
    rng = np.random.default_rng(seed)
    s = rng.uniform(tube.start_m + 0.5, tube.end_m - 0.5, 400)
    q = rng.uniform(-road.right.width_m, road.left.width_m, 400)
    eye = road.on_ground(s, q, 1.5)
    heading, around = road.alignment.heading(s), rng.uniform(0.0, np.pi, 400)
    # Across the road, sideways and upwards: all beams meet wall or vault
    way = np.stack(
        [-np.sin(heading) * np.cos(around), np.cos(heading) * np.cos(around), np.sin(around)], axis=1
    )
    ray, triangle, _ = Caster(scene).cast(eye, way, 60.0, 0, rng)
    material = scene.mesh.material[triangle]
    assert len(ray) > 380  # concrete returns 99 of 100 beams
    assert np.all(material == Material.CONCRETE)
    straight = Caster(scene).cast(eye, np.tile([0.0, 0.0, 1.0], (400, 1)), 60.0, 0, rng)[2]
    # Room for a lorry: 4.2 m over the road
    assert straight.min() > 2.7
    # Before the tunnel there is the sky
    before = road.on_ground(tube.start_m - 4.0, 0.0, 1.5)[None]
    assert len(Caster(scene).cast(before, np.array([[0.0, 0.0, 1.0]]), 60.0, 0, rng)[0]) == 0
