"""Failures are put down to what caused them: made-up truth, lines and stages in which only one cause is there."""

import numpy as np
import pytest
from benchmarks._failures import Stages, failures, is_near, places_of
from benchmarks._simulated_worlds import (
    SceneResult,
    causes_table,
    scored_scene,
    scores_table,
    simulated,
    summed,
)
from benchmarks.worlds import main

from linework.model.boxes import BoxForm, BoxSet
from linework.model.grid import Grid
from linework.model.ground import Ground
from linework.model.lines import LineSet
from linework.model.points import Points

GRID = Grid(-50.0, 50.0, 1.0, 1.0, 100, 200)


def line(kind: str, y: float, x: tuple[float, float] = (0.0, 40.0), z: float = 0.0, **columns) -> LineSet:
    return LineSet.from_lines([[[x[0], y, z], [x[1], y, z]]], kind=[kind], **columns)


def ground(road: bool = True, measured: bool = True) -> Ground:
    flat = np.zeros(GRID.shape, dtype=np.float32)
    cells = np.ones(GRID.shape, dtype=np.bool_)
    return Ground(GRID, 0.0, flat, flat, cells & road & measured, cells & measured)


def boxes(form: BoxForm, y: float, x: tuple[float, float] = (0.0, 40.0)) -> BoxSet:
    at = np.arange(x[0] + 0.25, x[1], 0.5)
    centre = np.column_stack([at, np.full_like(at, y), np.zeros_like(at)])
    u = np.tile([1.0, 0.0], (len(at), 1))
    return BoxSet(centre=centre, u=u, form=np.full(len(at), form, dtype=np.int8))


def points(x_step: float = 0.05, paint: float = 90.0) -> Points:
    """Points on the line at y = 3, dense enough to show it, and on the road beside it, which is 40 bright."""
    x, y = np.meshgrid(np.arange(0.0, 40.0, x_step), [2.7, 3.0, 3.3])
    speckle = np.where(np.arange(x.size) % 2 == 0, 2.0, -2.0)
    intensity = np.where(y.ravel() == 3.0, paint, 40.0) + speckle
    return Points(np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)]), intensity=intensity)


def beside_the_middle(paint: float) -> Points:
    """Points 12 cm beside the middle of the line, so that no window of 4 cm to both sides of it holds any."""
    dense = points(paint=paint)
    xyz = dense.xyz.copy()
    xyz[xyz[:, 1] == 3.0, 1] = 3.12
    return Points(xyz, intensity=dense.intensity)


def stages(**changes) -> Stages:
    told = {
        "boxes": BoxSet.concatenate([]), "tracked": LineSet.empty(), "ground": ground(),
        "points": points(), "scan_line_s": 0.01, "path": np.zeros((0, 3)),
    }  # fmt: skip
    return Stages(**{**told, **changes})


def causes_of(found: LineSet, truth: LineSet, of: Stages, kind: str) -> dict[tuple[str, str], float]:
    return {(c.failure, c.cause): c.metres for c in failures(found, truth, of, [kind], 0.1)}


NOTHING = LineSet.empty()
TRUTH = line("lane_marking", 3.0)


@pytest.mark.parametrize(
    ("cause", "found", "of"),
    [
        ("not seen as paint", NOTHING, {}),
        ("no brighter than the road beside it", NOTHING, {"points": points(paint=40.0)}),
        ("no brighter than the road beside it", NOTHING, {"points": points(paint=20.0)}),
        ("few points on it", NOTHING, {"points": points(0.5)}),
        # Without 4 points on the middle of the paint nothing can be compared, however bright they are
        ("few points on it", NOTHING, {"points": beside_the_middle(200.0)}),
        ("off what was taken for road", NOTHING, {"ground": ground(road=False)}),
        ("seen as wide paint", NOTHING, {"boxes": boxes(BoxForm.OTHER_PAINT, 3.1)}),
        ("seen, not linked", NOTHING, {"boxes": boxes(BoxForm.STRIPE, 3.05)}),
        (
            "seen, thrown away beside a kerb",
            NOTHING,
            {"boxes": boxes(BoxForm.STRIPE, 3.0), "tracked": line("road_boundary", 3.3, form=["kerb"])},
        ),
        ("tracked, thrown away behind a boundary", NOTHING, {"tracked": TRUTH}),
        ("taken for road_marking_other", line("road_marking_other", 3.05), {}),
        ("found, but off", line("lane_marking", 3.2), {}),
    ],
)
def test_missed_paint(cause, found, of):
    causes = causes_of(found, TRUTH, stages(**of), "lane_marking")
    assert causes["missed", cause] == pytest.approx(40.0)
    assert sum(m for (failure, _), m in causes.items() if failure == "missed") == pytest.approx(40.0)


def test_short_paint_that_was_seen_is_too_short_to_be_linked():
    truth = line("lane_marking_dash", 3.0, x=(0.0, 1.0))
    causes = causes_of(NOTHING, truth, stages(boxes=boxes(BoxForm.STRIPE, 3.0)), "lane_marking_dash")
    assert causes == {("missed", "seen, too short"): pytest.approx(1.0)}


def test_what_nobody_could_see_is_not_missed():
    truth = line("lane_marking", 3.0, observed=[False, False])
    assert causes_of(NOTHING, truth, stages(), "lane_marking") == {}


@pytest.mark.parametrize(
    ("cause", "truth"),
    [
        ("beside its own truth, off", line("lane_marking", 3.2)),
        ("on a kerb or an edge", line("road_boundary", 3.3)),
        ("on an arrow, a bar or hatching", line("road_marking_other", 2.6)),
        ("on a barrier", line("barrier", 3.4)),
        ("elsewhere", line("road_boundary", 9.0)),
    ],
)
def test_false_paint(cause, truth):
    found = line("lane_marking", 3.0)
    assert causes_of(found, truth, stages(), "lane_marking")["false", cause] == pytest.approx(40.0)


@pytest.mark.parametrize("kind", ["lane_marking", "road_boundary"])
def test_lines_on_the_verge_lie_beyond_the_edge(kind):
    path = np.column_stack([np.arange(0.0, 40.0), np.full(40, 0.0), np.zeros(40)])
    bent = LineSet.from_lines(
        [[[0.0, -3.0, 0.0], [20.0, -3.5, 0.0], [40.0, -3.0, 0.0]]], kind=["road_boundary"]
    )
    bounds = LineSet.concatenate([line("road_boundary", 3.0, x=(-5.0, 45.0)), bent])
    causes = causes_of(line(kind, 6.0), bounds, stages(path=path), kind)
    assert causes["false", "beyond the edge of the carriageway"] == pytest.approx(40.0)
    assert causes_of(line("lane_marking", 1.0), bounds, stages(path=path), "lane_marking") == {
        ("false", "elsewhere"): pytest.approx(40.0)
    }


@pytest.mark.parametrize(
    ("cause", "of"),
    [
        ("tracked, thrown away as bounding nothing", {"tracked": line("road_boundary", 3.0)}),
        ("seen, not linked", {"boxes": boxes(BoxForm.EDGE, 3.1)}),
        ("far from what was taken for road", {"ground": ground(road=False)}),
        ("not seen as an edge", {}),
    ],
)
def test_missed_boundaries(cause, of):
    assert causes_of(NOTHING, line("road_boundary", 3.0), stages(**of), "road_boundary") == {
        ("missed", cause): pytest.approx(40.0)
    }


@pytest.mark.parametrize(
    ("cause", "truth"),
    [
        ("on paint", line("lane_marking", 3.1)),
        ("on the other edge of a kerb", line("kerb_top", 3.1)),
        ("on a guardrail", line("guardrail", 3.4)),
        ("second edge beside a boundary", line("road_boundary", 4.5)),
        ("elsewhere", line("lane_marking", 9.0)),
    ],
)
def test_false_boundaries(cause, truth):
    found = line("road_boundary", 3.0)
    assert causes_of(found, truth, stages(), "road_boundary")["false", cause] == pytest.approx(40.0)


def wire(n_scan_lines: int, z: float = 8.0) -> Points:
    x = np.linspace(0.0, 40.0, 400)
    time_s = 0.01 * (np.arange(400) % n_scan_lines) + 0.005
    return Points(np.column_stack([x, np.full(400, 3.0), np.full(400, z)]), time_s=time_s)


def test_false_cables():
    found, none = line("cable", 3.0, z=8.0), LineSet.empty()

    def cause(of: Stages, truth: LineSet = none) -> dict[tuple[str, str], float]:
        return causes_of(found, truth, of, "cable")

    assert ("false", "on one or two scan lines") in cause(stages(points=wire(2)))
    assert ("false", "elsewhere") in cause(stages(points=wire(5)))
    assert ("false", "over unknown ground") in cause(stages(points=wire(5), ground=ground(measured=False)))
    leaves = np.random.default_rng(1).uniform([0.0, 2.0, 7.0], [40.0, 4.0, 9.0], (8000, 3))
    bushy = Points(np.concatenate([wire(5).xyz, leaves]), time_s=np.linspace(0.0, 1.0, 8400))
    assert ("false", "in vegetation or clutter") in cause(stages(points=bushy))
    truth = line("cable", 3.0, z=9.0)
    assert ("false", "beside a wire") in cause(stages(points=wire(5)), truth)


def test_missed_cables():
    truth = line("cable", 3.0, z=8.0)
    assert ("missed", "few points on it") in causes_of(NOTHING, truth, stages(), "cable")
    assert ("missed", "not found") in causes_of(NOTHING, truth, stages(points=wire(5)), "cable")


def test_lines_that_cross_are_not_near():
    across = LineSet.from_lines([[[20.0, -5.0, 0.0], [20.0, 10.0, 0.0]]], kind=["lane_marking"])
    places, others = places_of(TRUTH, 0.5), places_of(across, 0.1)
    assert not is_near(places, others, 0.3).any()
    assert is_near(places, others, 0.3, any_direction=True).sum() in (1, 2)


def test_a_scene_is_scored_and_its_failures_add_up():
    survey = simulated("straight", 910, 40.0, points_per_m=1500.0)
    result = SceneResult("straight")
    scored_scene(survey, ("lane_marking", "road_boundary"), result, "straight 910")
    row = next(row for row in scores_table([result]).rows if row[1] == "lane_marking")
    # 40 m of road and 6 m more at each end, and 25 to 60 m of land to both sides
    assert 0.1 < result.hectares < 1.0
    missed = sum(c.metres for c in result.causes if (c.kind, c.failure) == ("lane_marking", "missed"))
    observed, complete = float(row[2]), float(row[4].removesuffix(" %")) / 100.0
    # Stations of half a metre against pieces of the exact length
    assert missed == pytest.approx(observed * (1.0 - complete), abs=3.0)
    assert len(causes_table([summed([result])]).rows) == len(
        {(c.kind, c.failure, c.cause) for c in result.causes}
    )


def test_what_the_simulator_does_not_have_is_said(capsys):
    with pytest.raises(SystemExit, match="the simulator has no colour"):
        simulated("straight", 1, 60.0, colour="blue")
    main(["--surveys", "none", "--roads", "nowhere", "--seeds", "1,2", "--kinds", "cable"])
    assert "there is no road 'nowhere'" in capsys.readouterr().out
