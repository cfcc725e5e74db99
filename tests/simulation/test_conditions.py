"""Hard conditions: each error moves points as physics says, within its range, and the truth follows."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from linework.errors import UsageError
from linework.simulation.roads.draw import ROADS, draw_scenario
from linework.simulation.scene.materials import Material
from linework.simulation.scene.meshes import Mesh
from linework.simulation.scene.part import Part, assemble_scene
from linework.simulation.scene.scene import build_scene
from linework.simulation.sensors.conditions import false_ranges, misplaced
from linework.simulation.sensors.rigs import SCANNERS, equipped
from linework.simulation.sensors.scanner import Caster, Hits
from linework.simulation.simulate import carriers_of, scan_passes, simulate_survey, survey_of


def hard(kind="straight", seed=1, scanner="one", **changes):
    scenario = draw_scenario(kind, seed, 40.0, points_per_m=2000.0)
    scenario = equipped(scenario, scanner=scanner, points_per_m=2000.0, conditions="hard")
    return replace(scenario, conditions=replace(scenario.conditions, **changes)) if changes else scenario


CLEAN = {"delay_s": 0.0, "wander_m": 0.0, "mirror_share": 0.0, "rain_share": 0.0, "zero_counts": 0.0}


def test_usual_conditions_change_nothing_and_other_names_are_refused():
    scenario = draw_scenario("urban", 1, 40.0)
    assert equipped(scenario) is scenario
    with pytest.raises(UsageError, match=r"no conditions 'hrad'\. Did you mean hard\?"):
        equipped(scenario, conditions="hrad")


@pytest.mark.parametrize("scanner", SCANNERS)
def test_hard_surveys_are_the_same_again(scanner):
    one, two = (
        simulate_survey("urban", 5, 40.0, points_per_m=2000.0, scanner=scanner, conditions="hard")
        for _ in range(2)
    )
    assert one.points == two.points
    assert np.array_equal(one.truth.observed, two.truth.observed)
    usual = simulate_survey("urban", 5, 40.0, points_per_m=2000.0, scanner=scanner)
    assert usual.scenario.layout.markings == one.scenario.layout.markings
    assert not np.array_equal(usual.points.intensity, one.points.intensity)


def test_ranges_hold_over_many_seeds():
    opposite = two = eight = wet = 0
    for kind in ROADS:
        for seed in range(30):
            scenario = hard(kind, seed, SCANNERS[seed % len(SCANNERS)])
            sensor, bad = scenario.sensor, scenario.conditions
            assert 0.002 <= sensor.range_noise_m <= 0.040
            assert 0.2 <= sensor.drift <= 0.6
            assert 0.0 <= bad.zero_counts <= 0.3 * 2**sensor.intensity_bits
            assert 0.002 <= bad.wander_m <= 0.030
            speed = scenario.flights[0].speed_mps if scenario.flights else scenario.passes[0].speed_mps
            assert 0.002 <= abs(bad.delay_s) * speed <= 0.030 + 1e-9
            assert len(bad.boresight_rad) == len(scenario.scanners)
            assert len(bad.gain) == sum(head.n_beams for head in scenario.scanners)
            assert bad.rain_share == 0.0 or not scenario.flights
            eight += sensor.intensity_bits == 8
            wet += bad.rain_share > 0.0
            two += len(scenario.passes) == 2
            opposite += {p.direction for p in scenario.passes} == {1, -1}
    n = 30 * len(ROADS)
    assert 0.5 * n < eight < 0.75 * n
    assert wet > 0.2 * n
    assert two > 0.5 * n
    assert opposite > 0.4 * two


def test_a_boresight_error_turns_beams_about_the_scanner():
    scenario = hard(**CLEAN, boresight_rad=((0.0, 0.0, 0.002),))
    scene, carriers = build_scene(scenario), carriers_of(scenario)
    hits = Hits.concatenate(list(scan_passes(scenario, scene, carriers)))
    first = hits.strip == 0
    pose = np.stack(
        [np.interp(hits.time_s[first], carriers[0].time_s, e) for e in carriers[0].error_m.T], axis=1
    )
    moved = hits.error_m[first] - pose
    lever = hits.direction[first] * hits.range_m[first, None]
    # About the upright axis of a van that leans by a few degrees at most
    assert np.abs(np.sum(moved * lever, axis=1)).max() < 1e-9
    assert np.allclose(np.linalg.norm(moved, axis=1), 0.002 * np.hypot(lever[:, 0], lever[:, 1]), atol=0.012)
    assert np.abs(moved[:, 2]).max() < 0.1 * np.abs(moved[:, :2]).max()


def test_late_times_move_the_points_of_opposite_passes_apart():
    seed = next(s for s in range(30) if {p.direction for p in hard("urban", s).passes} == {1, -1})
    scenario = hard("urban", seed, **CLEAN | {"delay_s": 0.001}, boresight_rad=((0.0, 0.0, 0.0),))
    road = scenario.layout.road
    for i, carrier in enumerate(carriers_of(scenario)):
        scene = build_scene(scenario)
        hits = Hits.concatenate(
            [h for h in scan_passes(scenario, scene, carriers_of(scenario)) if h.strip[0] == i]
        )
        off = misplaced(scenario.conditions, carrier, 0, hits)
        s, _ = road.alignment.locate(hits.xyz[:, :2])
        heading = road.alignment.heading(s)
        ahead = off[:, 0] * np.cos(heading) + off[:, 1] * np.sin(heading)
        speed = scenario.passes[i].speed_mps * scenario.passes[i].direction
        assert np.median(ahead) == pytest.approx(0.001 * speed, rel=0.15)


def test_slow_errors_are_those_of_the_trajectory_too():
    scenario = hard("straight", 2, **CLEAN | {"wander_m": 0.03}, boresight_rad=((0.0, 0.0, 0.0),))
    survey, true = survey_of(scenario), carriers_of(replace(scenario, conditions=None))
    way = np.concatenate([d.xyz for d in true]) + np.asarray(scenario.origin_m)
    off = np.abs(survey.trajectory.xyz - way)
    assert 0.005 < off.max() < 0.036
    # Nothing leaps: over a tenth of a second it changes by less than a millimetre
    for d, wandering in zip(true, carriers_of(scenario), strict=True):
        assert np.abs(wandering.error_m[10:] - wandering.error_m[:-10]).max() < 0.003
        assert not np.array_equal(d.error_m, wandering.error_m)


def test_a_mirrored_return_lies_behind_the_mirror_as_far_as_the_light_went():
    # A steel plate 5 m ahead, turned by 45 degrees, sends light to a wall 10 m to the left
    plate = np.array([[3.0, -2.0, -9.0], [7.0, 2.0, -9.0], [5.0, 0.0, 20.0]])
    wall = np.array([[-50.0, 10.0, -50.0], [50.0, 10.0, -50.0], [0.0, 10.0, 90.0]])
    triangle = np.array([[0, 1, 2]])
    scene = assemble_scene(
        [Part((Mesh.of(plate, triangle, Material.STEEL), Mesh.of(wall, triangle, Material.WALL)))]
    )
    n = 2000
    zero, beams = np.zeros(n), np.tile([1.0, 0.0, 0.0], (n, 1))
    hits = Hits(
        zero, np.zeros((n, 3)), beams, zero + 5.0, zero.astype(int), np.zeros((n, 2)), zero, np.zeros((n, 3)),
        zero, zero, zero, zero, zero > 0, zero > 0, zero, zero, zero * np.nan,
    )  # fmt: skip
    conditions = replace(hard().conditions, mirror_share=0.3, rain_share=0.0)
    found = false_ranges(conditions, Caster(scene), scene, hits, 0, np.random.default_rng(0))
    mirrored = np.isfinite(found)
    assert np.mean(mirrored) == pytest.approx(0.3, abs=0.04)
    assert np.allclose(found[mirrored], 15.0, atol=1e-6)
    wet = false_ranges(
        replace(conditions, mirror_share=0.0, rain_share=0.5),
        Caster(scene),
        scene,
        hits,
        0,
        np.random.default_rng(0),
    )
    drops = wet[np.isfinite(wet)]
    assert np.mean(np.isfinite(wet)) == pytest.approx(0.5, abs=0.05)
    assert drops.min() >= 0.8
    assert drops.max() < 5.0
    assert np.median(drops) < 2.0


def test_what_only_drops_and_mirrors_gave_is_not_observed():
    dry = survey_of(hard("urban", 3, **CLEAN))
    wet = survey_of(hard("urban", 3, **CLEAN | {"rain_share": 1.0}))
    assert dry.truth.observed.mean() > 0.5
    assert wet.truth.observed.mean() < 0.1
    assert len(wet.points) == len(dry.points)


def test_intensities_have_an_offset_and_saturate():
    scenario = hard("urban", 3, **CLEAN)
    bare = survey_of(scenario).points.intensity
    top = 2**scenario.sensor.intensity_bits - 1
    raised = survey_of(replace(scenario, conditions=replace(scenario.conditions, zero_counts=11.0)))
    assert raised.points.intensity.min() >= 11.0
    clear = (bare > 0) & (raised.points.intensity < top)
    assert np.all(raised.points.intensity[clear] - bare[clear] == 11.0)
    bright = survey_of(replace(scenario, sensor=replace(scenario.sensor, gain=50.0 * scenario.sensor.gain)))
    assert np.mean(bright.points.intensity == top) > 0.3


def test_heads_see_things_differently_bright():
    scenario = hard("urban", 3, "tilted", **CLEAN)
    n = len(scenario.scanners)
    even = survey_of(replace(scenario, conditions=replace(scenario.conditions, gain=(1.0,) * n)))
    stepped = survey_of(
        replace(scenario, conditions=replace(scenario.conditions, gain=(1.0, *(0.5,) * (n - 1))))
    )
    top = 2**scenario.sensor.intensity_bits - 1
    clear = (even.points.intensity > 30) & (even.points.intensity < top)
    for i in range(n):
        own = clear & (even.beam == i)
        ratio = np.median(stepped.points.intensity[own] / even.points.intensity[own])
        assert ratio == pytest.approx(1.0 if i == 0 else 0.5, abs=0.02)


def test_the_second_pass_begins_after_the_first_has_ended():
    for seed in range(12):
        scenario = equipped(draw_scenario("bends", seed, 5000.0), conditions="hard")
        drives = carriers_of(scenario)
        assert all(b.time_s[0] > a.time_s[-1] for a, b in itertools.pairwise(drives))
        if len(drives) == 2:
            return
    pytest.fail("no survey of two passes")
