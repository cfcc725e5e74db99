"""Scenes that contradict what is usual: their truth is on the very triangles, and land without a road has none."""

import numpy as np
import pytest

import linework
from linework.simulation.roads.draw import ROADS, USUAL_ROADS, draw_scenario
from linework.simulation.roads.scenario import Stain
from linework.simulation.scene.ground import boundary_truth, ground
from linework.simulation.scene.materials import Material
from linework.simulation.scene.paint import stain_shade
from linework.simulation.scene.part import assemble_scene
from linework.simulation.scene.scene import build_scene
from linework.simulation.sensors.scanner import Caster
from linework.simulation.simulate import simulate_survey

EMPTY = ("forest", "field", "roofs")
SCENES = [kind for kind in ROADS if kind not in (*USUAL_ROADS, *EMPTY, "mixed")]


def heights_under(scene, xyz):
    """Heights of the ground under places, from rays straight down."""
    origin = xyz + np.array([0.0, 0.0, 3.0])
    down = np.tile([0.0, 0.0, -1.0], (len(xyz), 1))
    ray, triangle, reach = Caster(scene).cast(origin, down, 20.0, 0, np.random.default_rng(0))
    return ray, origin[ray, 2] - reach, scene.mesh.material[triangle]


@pytest.mark.parametrize("kind", SCENES)
@pytest.mark.parametrize("seed", range(4))
def test_paint_lies_on_asphalt_and_boundaries_where_it_ends(kind, seed):
    layout = draw_scenario(kind, seed, 80.0).layout
    road = layout.road
    scene = assemble_scene([ground(one) for one in (road, *(over.road for over in layout.over))])
    for line in build_scene(draw_scenario(kind, seed, 80.0)).lines:
        if line.kind in ("lane_marking", "lane_marking_dash", "road_marking_other"):
            ray, z, material = heights_under(scene, line.xyz[1:-1])
            assert np.abs(z - line.xyz[1:-1][ray, 2]).max(initial=0.0) < 0.001
            assert np.all(material == Material.ASPHALT)
    for line in boundary_truth(road, ()).lines:
        if line.kind != "road_boundary":
            continue
        d = np.diff(line.xyz[:, :2], axis=0)
        long = np.linalg.norm(d, axis=1) > 0.01
        normal = np.stack([-d[long, 1], d[long, 0], 0.0 * d[long, 0]], 1)
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        middle = 0.5 * (line.xyz[1:] + line.xyz[:-1])[long]
        # 3 mm to either side of the line one is asphalt at the line's height, the other is not
        found = np.zeros((2, len(middle)), dtype=bool)
        for i, side in enumerate((0.003, -0.003)):
            ray, z, material = heights_under(scene, middle + side * normal)
            found[i, ray] = (material == Material.ASPHALT) & (np.abs(z - middle[ray, 2]) < 0.0015)
        # Asphalt returns 99 of 100 beams
        assert np.mean(found[0] ^ found[1]) > 0.97


@pytest.mark.parametrize("kind", SCENES)
def test_the_same_seed_gives_the_same_scene(kind):
    one, two = (build_scene(draw_scenario(kind, 3, 60.0)) for _ in range(2))
    assert np.array_equal(one.mesh.vertices, two.mesh.vertices)
    assert all(np.array_equal(a.xyz, b.xyz) for a, b in zip(one.lines, two.lines, strict=True))


@pytest.mark.parametrize("kind", EMPTY)
def test_land_without_a_road_has_points_and_no_lines(kind, tmp_path):
    survey = simulate_survey(kind, 2, 40.0, points_per_m=500)
    assert len(survey.points) > 5000
    assert len(survey.truth) == 0
    folder = linework.simulate(
        tmp_path / "land", road=kind, seed=2, length_m=40.0, points_per_m=500, images=False
    )
    assert len(linework.read_lines(folder.root / "truth.gpkg")) == 0


def test_verges_lie_lower_and_higher_than_the_pavement():
    steps = [
        side.step_m(0.0)
        for seed in range(30)
        for side in (lambda road: (road.left, road.right))(draw_scenario("rural", seed, 60.0).layout.road)
    ]
    assert np.mean(np.array(steps) < -0.05) > 0.3
    assert np.mean(np.array(steps) > 0.05) > 0.15
    assert np.abs(steps).max() <= 0.12


def test_mixed_scenes_are_of_many_kinds_and_most_are_stained():
    layouts = [draw_scenario("mixed", seed, 80.0).layout for seed in range(40)]
    roads = [one for one in layouts if one.road.surface == Material.ASPHALT]
    assert 25 < len(roads) < 40
    assert any(one.rails for one in roads)
    assert any(one.islands for one in roads)
    assert any(one.road.left.mouths or one.road.right.mouths for one in roads)
    assert {one.road.right.form for one in roads} >= {"kerb", "edge"}
    assert np.mean([bool(one.stains) for one in roads]) > 0.8


def test_a_stain_changes_the_brightness_within_it_and_fades_at_its_edge():
    stain = Stain(start_m=0.0, end_m=10.0, right_m=-1.0, left_m=1.0, shade=0.5, soft_m=0.2)
    place = np.array([[5.0, 0.0], [5.0, 1.0], [5.0, 1.2], [11.0, 0.0], [0.0, 0.5]])
    assert stain_shade(place, [stain]) == pytest.approx([0.5, 0.75, 1.0, 1.0, 0.75])
