"""A simulated survey: the same from the same seed, hidden where things hide it, within its ranges."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from linework.errors import OutputExistsError, UsageError
from linework.simulation.roads.draw import USUAL_ROADS, draw_scenario
from linework.simulation.roads.scenario import Marking, Symbol
from linework.simulation.scene.ground import ground, marking_truth
from linework.simulation.scene.materials import Material
from linework.simulation.scene.meshes import boxes
from linework.simulation.scene.paint import paint_cover
from linework.simulation.scene.part import Part, assemble_scene
from linework.simulation.scene.scene import OBSERVED, build_scene
from linework.simulation.sensors.scanner import Caster, Hits, to_local_frame
from linework.simulation.simulate import drives_of, scan_passes, simulate_survey


@pytest.fixture(scope="module")
def survey():
    return simulate_survey("bends", 4, 60.0, points_per_m=1500)


def test_the_same_seed_gives_the_same_bits_and_another_seed_others(survey):
    again = simulate_survey("bends", 4, 60.0, points_per_m=1500)
    for name in ("xyz", "intensity", "time_s"):
        assert np.array_equal(getattr(survey.points, name), getattr(again.points, name))
    assert np.array_equal(survey.truth.xyz, again.truth.xyz)
    assert np.array_equal(survey.truth.observed, again.truth.observed)
    assert np.array_equal(survey.trajectory.xyz, again.trajectory.xyz)
    other = simulate_survey("bends", 5, 60.0, points_per_m=1500)
    assert len(other.points) != len(survey.points)


def test_times_rise_and_lie_within_the_trajectory(survey):
    time = survey.points.time_s
    assert np.all(np.diff(time) >= 0)
    assert survey.trajectory.time_s[0] <= time[0]
    assert time[-1] <= survey.trajectory.time_s[-1] + 0.02


def test_the_trajectory_is_on_the_road_and_looks_along_it(survey):
    road, origin = survey.scenario.layout.road, np.array(survey.scenario.origin_m)
    xyz = survey.trajectory.xyz - origin
    s, q = road.alignment.locate(xyz[:, :2])
    assert np.abs(xyz[:, 2] - road.carriageway_height(s, q)).max() < 0.006  # pose error and chords
    heading = np.radians(90.0 - survey.trajectory.attitude_deg[:, 2])
    ahead = np.cos(heading - road.alignment.heading(s))
    assert np.all(np.abs(ahead) > 0.98)
    grade = np.tan(np.radians(survey.trajectory.attitude_deg[:, 1])) * np.sign(ahead)
    assert np.abs(grade - road.alignment.grade(s)).max() < 0.03


def test_poses_and_scanner_explain_the_hits_to_a_tenth_of_a_millimetre():
    scenario = draw_scenario("straight", 1, 50.0, points_per_m=300)
    scene = build_scene(scenario)
    drives = drives_of(scenario)
    hits = Hits.concatenate(list(scan_passes(scenario, scene, drives)))
    d = drives[0]
    first = hits.time_s < d.time_s[-1] + 1.0
    place = np.stack([np.interp(hits.time_s[first], d.time_s, c) for c in d.xyz.T], axis=1)
    mounts = [s.position_m for s in scenario.scanners]
    angles = [np.interp(hits.time_s[first], d.time_s, a) for a in (d.roll_rad, d.pitch_rad, d.yaw_rad)]
    arms = [to_local_frame(np.broadcast_to(np.array(m), place.shape), *angles) for m in mounts]
    gap = np.min([np.linalg.norm(hits.origin[first] - place - arm, axis=1) for arm in arms], axis=0)
    assert gap.max() < 1e-4


def test_a_wall_hides_what_is_behind_it():
    road = draw_scenario("straight", 0, 60.0).layout.road
    feet = road.over_carriageway(np.array([30.0]), -6.0, -1.0)
    wall = boxes(feet, road.alignment.heading(np.array([30.0])), (20.0, 0.2, 3.0), Material.WALL, target=-1)
    origin = np.broadcast_to(road.over_carriageway(30.0, 0.0, 2.0), (500, 3))
    aim = road.place(np.linspace(24.0, 36.0, 500), -12.0, origin[:, 2] - 2.0)
    direction = aim - origin
    direction = direction / np.linalg.norm(direction, axis=1, keepdims=True)
    for parts, hidden in (([ground(road)], False), ([ground(road), Part((wall,))], True)):
        scene = assemble_scene(parts)
        _, triangle, _ = Caster(scene).cast(origin, direction, 80.0, 0, np.random.default_rng(0))
        assert np.all(scene.mesh.material[triangle] == Material.WALL) == hidden


def test_wire_mesh_lets_a_part_of_the_beams_through_and_passing_cars_are_in_one_pass():
    corner = np.array([[5.0, -50.0, -50.0], [5.0, 50.0, -50.0], [5.0, 0.0, 80.0]])
    back = corner + np.array([5.0, 0.0, 0.0])
    from linework.simulation.scene.meshes import Mesh

    tri = np.array([[0, 1, 2]])
    front = Mesh.of(corner, tri, Material.MESH)
    scene = assemble_scene([Part((front, Mesh.of(back, tri, Material.CONCRETE)))])
    origin, direction = np.zeros((20_000, 3)), np.tile([1.0, 0.0, 0.0], (20_000, 1))
    _, triangle, reach = Caster(scene).cast(origin, direction, 50.0, 0, np.random.default_rng(0))
    assert np.mean(triangle == 0) == pytest.approx(0.30, abs=0.02)
    assert np.allclose(reach, np.where(triangle == 0, 5.0, 10.0), atol=1e-9)
    car = assemble_scene(
        [Part((Mesh.of(corner, tri, Material.CAR).in_pass(1), Mesh.of(back, tri, Material.CONCRETE)))]
    )
    for i_pass, seen in ((0, False), (1, True)):
        _, triangle, _ = Caster(car).cast(origin, direction, 50.0, i_pass, np.random.default_rng(0))
        assert np.any(triangle == 0) == seen


@pytest.mark.parametrize("kind", ["urban", "motorway"])
def test_observed_flags_equal_a_brute_force_recount(kind):
    scenario = draw_scenario(kind, 2, 50.0, points_per_m=400)
    from linework.simulation.scene.materials import GROUND
    from linework.simulation.scene.scene import PAINT_KINDS, TIMED_M, truth_lines

    scene = build_scene(scenario)
    hits = Hits.concatenate(list(scan_passes(scenario, scene, drives_of(scenario))))
    truth = truth_lines(scenario, scene, (hits.xyz, hits.triangle, hits.time_s), "local")
    material = scene.mesh.material[hits.triangle]
    target = scene.mesh.target[hits.triangle]
    xyz = hits.xyz + np.array(scenario.origin_m)
    origin = np.array(scenario.origin_m)
    starts = {(t.kind, *np.round(t.xyz[0] + origin, 6)): i for i, t in enumerate(scene.lines)}
    for i in range(len(truth)):
        line, line_kind = truth[i].xyz, str(truth.kind[i])
        own = target == starts[(line_kind, *np.round(line[0], 6))]
        if line_kind in PAINT_KINDS:
            own = material == Material.ASPHALT
        elif line_kind in ("road_boundary", "kerb_top"):
            own = GROUND[material]
        n, within = OBSERVED[line_kind]
        near = xyz[own]
        some = slice(0, None, 7)
        count = np.array([np.sum(np.linalg.norm(near - v, axis=1) <= within) for v in line[some]])
        flags = truth.observed[truth.offsets[i] : truth.offsets[i + 1]][some]
        assert np.array_equal(count >= n, flags), line_kind
        away = cKDTree(line).query(xyz, distance_upper_bound=TIMED_M)[0]
        times = hits.time_s[np.isfinite(away)]
        assert np.isnan(truth.time_start_s[i]) == (len(times) == 0)
        if len(times):
            assert (truth.time_start_s[i], truth.time_end_s[i]) == (times.min(), times.max())


def test_wear_takes_its_share_of_the_paint():
    s, q = np.meshgrid(np.arange(0.0, 300.0, 0.05), np.linspace(-0.05, 0.05, 5))
    place = np.stack([s.ravel(), q.ravel()], axis=1)
    for wear in (0.0, 0.3, 0.7):
        line = Marking(q_m=0.0, start_m=0.0, end_m=300.0, width_m=0.14, role="edge", wear=wear)
        left = np.mean(paint_cover(place, [line], 5) > 0.5)
        assert left == pytest.approx(1.0 - wear, abs=0.06)
    outside = place + np.array([0.0, 0.2])
    assert np.all(paint_cover(outside, [line], 5) == 0.0)


def test_symbols_are_painted_and_are_no_lines():
    bar = Symbol(start_m=10.0, end_m=13.0, right_m=1.0, left_m=1.5)
    place = np.array([[11.0, 1.2], [11.0, 1.6], [9.9, 1.2], [12.9, 1.05]])
    assert paint_cover(place, [], 0, [bar]).tolist() == [1.0, 0.0, 0.0, 1.0]
    layout = next(x for x in (draw_scenario("urban", s, 80.0).layout for s in range(20)) if x.symbols)
    assert len(build_scene_lines(layout)) == len(layout.markings)


def build_scene_lines(layout):
    return [
        line
        for m in layout.markings
        for line in marking_truth(layout.road, m).lines
        if line.kind == "lane_marking"
    ]


def test_points_scatter_about_the_road_with_the_drawn_noise():
    survey = simulate_survey("straight", 3, 50.0, points_per_m=1500)
    road, origin = survey.scenario.layout.road, np.array(survey.scenario.origin_m)
    xyz = survey.points.xyz - origin
    s, q = road.alignment.locate(xyz[:, :2])
    on = (np.abs(q) < 2.0) & (s > 2.0) & (s < 48.0)
    height = xyz[on, 2] - road.carriageway_height(s[on], q[on])
    height = height[np.abs(height) < 0.1]
    assert abs(height.mean()) < 0.002
    assert (
        0.3 * survey.scenario.sensor.range_noise_m < height.std() < 1.6 * survey.scenario.sensor.range_noise_m
    )


@pytest.mark.parametrize("kind", USUAL_ROADS)
def test_ranges_hold_over_many_seeds_and_most_roads_have_rails_and_wires(kind):
    rails = wires = tight = 0
    for seed in range(40):
        scenario = draw_scenario(kind, seed, 200.0)
        sensor, layout = scenario.sensor, scenario.layout
        assert 0.003 <= sensor.range_noise_m <= 0.020
        assert 1.3 <= sensor.contrast <= 4.0
        assert 0.0 <= sensor.drift <= 0.4
        assert 1e-4 <= sensor.stray_share <= 1e-3
        assert sensor.intensity_bits in (8, 16)
        assert 60.0 <= sensor.max_range_m <= 100.0
        assert len(scenario.scanners) in (1, 2)
        spacing = scenario.passes[0].speed_mps / scenario.scanners[0].turns_per_s
        assert 0.9 * spacing >= 0.04
        assert 1.1 * spacing <= 0.25
        assert all(np.linalg.norm(p.pose_error_m) <= 0.0025 for p in scenario.passes)
        assert all(0.0 <= m.wear <= 0.7 for m in layout.markings)
        road = layout.road
        assert np.abs(road.alignment.grade.y).max() <= 0.12
        assert max(np.abs(road.slope_left.y).max(), np.abs(road.slope_right.y).max()) <= 0.06
        radius = 1.0 / max(np.abs(road.alignment.curvature.y).max(), 1e-9)
        assert radius >= 18.0
        tight += radius < 30.0
        rails += bool(layout.rails)
        wires += bool(layout.cables)
        assert all(r.end_m - r.start_m >= 8.0 for r in layout.rails)
        assert all(
            r.start_m >= road.alignment.start_m and r.end_m <= road.alignment.end_m for r in layout.rails
        )
        assert all(c.sag_m > 0.0 for c in layout.cables)
    assert rails >= 38
    assert wires >= 30
    assert tight >= 39 or kind != "bends"


def test_urban_kerbs_are_parked_up_by_20_to_60_percent():
    shares = []
    for seed in range(30):
        layout = draw_scenario("urban", seed, 300.0).layout
        shares.append(sum(c.length_m + 1.0 for c in layout.cars) / 624.0)
    assert min(shares) > 0.15
    assert max(shares) < 0.70
    assert np.ptp(shares) > 0.2


def test_wrong_arguments_are_refused():
    with pytest.raises(UsageError, match="no road 'lunar'"):
        draw_scenario("lunar", 0, 100.0)
    with pytest.raises(UsageError, match="cannot be simulated"):
        draw_scenario("urban", 0, 3.0)
    with pytest.raises(UsageError, match="seed"):
        draw_scenario("urban", -1, 100.0)


def test_the_folder_holds_the_survey_and_is_not_overwritten(survey, tmp_path):
    from tests.oracles.las_in_memory import read_las

    from linework.files.survey.open import open_survey
    from linework.files.vectors.read_write import read_lines
    from linework.simulation.folder import write_survey_folder

    folder = tmp_path / "made"
    write_survey_folder(survey, folder)
    opened = open_survey([folder])
    assert len(opened.point_files) == len(survey.scenario.passes)
    n = sum(len(read_las(p).points) for p in opened.point_files)
    assert n == len(survey.points)
    truth = read_lines(folder / "truth.gpkg")
    assert len(truth) == len(survey.truth)
    assert truth.observed.sum() == survey.truth.observed.sum()
    with pytest.raises(OutputExistsError):
        write_survey_folder(survey, folder)
    first = {p.name: p.read_bytes() for p in sorted(folder.rglob("*.*"))}
    write_survey_folder(survey, folder, overwrite=True)
    assert first == {p.name: p.read_bytes() for p in sorted(folder.rglob("*.*"))}
