"""Remains of scraped lines are fainter than the paint beside them everywhere, worn lines only where they are worn."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from tests.scenes.box_scenes import boxes_on, straight

from linework.methods.obb.beside_paint import REMAINS, chances_as_whole_paint
from linework.methods.obb.method import OBB_KINDS, Obb
from linework.methods.protocol import SurveyContext
from linework.methods.tracking.neighbours import LineAxis
from linework.model.boxes import BoxSet
from linework.model.lines import CANDIDATE


def line(y, excess, *, length_m=80.0, x=0.0, seed=0):
    """Boxes of a line that is brighter than the road by `excess` (ratio), which is repeated along it."""
    boxes = boxes_on(straight(length_m, y=y, x=x), noise=0.004, seed=seed)
    return replace(boxes, contrast=1.0 + np.resize(np.asarray(excess, dtype=float), len(boxes)))


#: Three of four places worn to a third of the paint's contrast, and remains of which none has more.
WORN, SCRAPED = (0.3, 0.3, 0.9, 0.3), (0.3, 0.2, 0.25, 0.3)


def chances(*lines, confidence=1.0):
    """Chances of lines of boxes, each straight along x."""
    starts = np.cumsum([0, *(len(boxes) for boxes in lines)])
    axes = []
    for boxes in lines:
        x, y = np.arange(boxes.centre[:, 0].min(), boxes.centre[:, 0].max()), boxes.centre[:, 1].mean()
        axes.append(LineAxis.of(x, np.column_stack([x, np.full(len(x), y)])))
    own = [np.arange(a, b) for a, b in itertools.pairwise(starts)]
    return chances_as_whole_paint(
        axes, own, BoxSet.concatenate(lines), np.full(len(lines), confidence)
    ).tolist()


def test_the_brightest_of_a_worn_line_is_as_bright_as_the_paint_beside_it():
    paint, worn, scraped = chances(line(0.0, 1.0), line(0.4, WORN, seed=1), line(-0.4, SCRAPED, seed=2))
    assert paint == 1.0 and worn > 0.98 and scraped < 0.2


def test_only_paint_beside_most_of_a_line_speaks_of_it():
    assert chances(line(0.0, 1.0), line(2.5, SCRAPED, seed=1)) == [1.0, 1.0], "the line of another lane"
    beyond = line(0.4, SCRAPED, length_m=100.0, x=50.0, seed=1)
    assert chances(line(0.0, 1.0), beyond) == [1.0, 1.0], "most of it lies elsewhere"
    assert chances(line(0.0, 1.0), line(0.4, SCRAPED, seed=1), confidence=0.3)[1] > 0.7, "hardly paint itself"


@pytest.mark.parametrize("excess", [np.nan, 0.0, -0.1])
def test_what_is_no_brighter_than_its_road_tells_nothing(excess):
    assert chances(line(0.0, 1.0), line(0.4, excess, seed=1)) == [1.0, 1.0]
    assert chances(line(0.0, excess), line(0.4, SCRAPED, seed=1)) == [1.0, 1.0]


def test_a_road_that_reads_next_to_nothing_tells_nothing():
    # As on the real motorway here-a22, whose asphalt has an intensity of 0 to 2
    noise = np.exp(np.random.default_rng(3).normal(3.5, 1.5, (2, 178)))
    assert chances(line(0.0, noise[0]), line(0.4, 0.2 * noise[1], seed=1)) == [1.0, 1.0]


def test_lines_are_compared_where_both_are():
    # On 30 of 80 m the asphalt is dark, so that all paint has more contrast there
    dark = line(0.0, 3.0, length_m=30.0, x=80.0)
    paint = BoxSet.concatenate([line(0.0, 0.5), dark])
    assert chances(paint, line(0.4, 0.45, seed=1))[1] > 0.98


def joined(*sets):
    return Obb(kinds=(*OBB_KINDS, CANDIDATE)).join(
        BoxSet.concatenate(sets), SurveyContext(origin=(0.0, 0.0, 0.0))
    )


@pytest.mark.parametrize(("length_m", "kind"), [(60.0, "lane_marking"), (4.0, "road_marking_other")])
def test_remains_are_candidates_whether_long_or_short(length_m, kind):
    paint = line(0.0, 1.0)
    lines = joined(paint, line(0.7, SCRAPED, x=10.0, length_m=length_m, seed=1))
    refused = lines.take((lines.kind == CANDIDATE) & (lines.reason == REMAINS))
    assert refused.candidate_kind.tolist() == [kind]
    assert len(lines["lane_marking"]) == 1 and len(lines["road_marking_other"]) == 0
    lines = joined(paint, line(0.7, WORN, x=10.0, length_m=length_m, seed=1))
    assert len(lines[kind]) == (2 if kind == "lane_marking" else 1)
