"""Bright gutters and kerb stones are no markings; paint beside them is."""

import numpy as np
import pytest
from tests.scenes.box_scenes import boxes_on, straight

import linework
from linework.methods.tracking.arrangement import beside_kerb
from linework.methods.tracking.neighbours import LineAxis
from linework.model.boxes import BoxSet

HALF_M, LENGTH_M, KERB_M = 4.0, 40.0, 0.10


def street(bright_m: tuple[float, float]) -> linework.Points:
    """A street between kerbs, every 5 cm, with a bright strip between two distances from the left kerb's foot."""
    rng = np.random.default_rng(9891)
    x, y = rng.uniform(0.0, LENGTH_M, 200_000), rng.uniform(-HALF_M - 2.0, HALF_M + 2.0, 200_000)
    z = np.where(np.abs(y) > HALF_M, KERB_M, 0.0) + rng.normal(0.0, 0.004, len(x))
    before = HALF_M - y
    intensity = np.where((before > bright_m[0]) & (before < bright_m[1]), 200.0, 90.0) * rng.normal(
        1.0, 0.08, len(x)
    )
    return linework.Points(np.column_stack([x, y, z]), intensity=np.round(intensity))


def markings_m(points: linework.Points) -> float:
    path = linework.Trajectory([0.0, 4.0], [[0.0, -1.75, 0.0], [LENGTH_M, -1.75, 0.0]])
    found = linework.extract(points, trajectory=path, kinds="lane_marking")
    return float(found.length_m.sum())


@pytest.mark.filterwarnings("ignore:.*not taken for road:linework.errors.LineworkWarning")
def test_a_gutter_and_its_kerb_stone_are_no_marking():
    # In one piece, with the middle 8 cm before the foot
    assert markings_m(street((-0.15, 0.31))) == 0.0


@pytest.mark.filterwarnings("ignore:.*not taken for road:linework.errors.LineworkWarning")
def test_paint_along_a_gutter_is_a_marking():
    assert markings_m(street((0.20, 0.40))) >= 0.9 * LENGTH_M


def test_how_far_a_box_reaches_does_not_depend_on_the_others():
    along = np.linspace(0.0, LENGTH_M, 81)
    kerb = LineAxis.of(along, np.column_stack([along, np.zeros((81, 2))]))
    beyond = boxes_on(straight(LENGTH_M + 2.0, y=0.1)).take(slice(-1, None))
    wide = boxes_on(straight(1.0, y=500.0)).take(slice(0, 1))
    alone = beside_kerb(beyond, [kerb], -0.45, np.array([0.12]))
    both = beside_kerb(BoxSet.concatenate([beyond, wide]), [kerb], -0.45, np.array([0.12, 30.0]))
    assert alone.tolist() == [False]
    assert both.tolist() == [False, False]
