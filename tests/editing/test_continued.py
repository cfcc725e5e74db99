"""A line picked further on continues the one that is there."""

import numpy as np
import pytest

from linework.editing.edits.continued import continue_lines
from linework.model.lines import LineSet


def line(start, end, *, y=0.0, kind="lane_marking"):
    t = np.linspace(start, end, int(abs(end - start)) + 1)
    return LineSet.from_lines([np.column_stack([t, np.full(len(t), y), np.zeros(len(t))])], kind=[kind])


@pytest.mark.parametrize("second", [(40.0, 80.0), (80.0, 40.0)])
@pytest.mark.parametrize("first", [(0.0, 30.0), (30.0, 0.0)])
def test_a_line_goes_on_beyond_a_gap_that_is_bridged(first, second):
    joined = continue_lines(line(*first), line(*second))
    assert len(joined) == 1
    assert joined.length_m[0] == pytest.approx(80.0)
    assert joined.bridged_m[0] == pytest.approx(12.0, abs=1.0)


@pytest.mark.parametrize("second", [(20.0, 80.0), (80.0, 20.0)])
def test_lines_that_overlap_become_one(second):
    joined = continue_lines(line(0.0, 30.0), line(*second, y=0.05))
    assert len(joined) == 1
    assert joined.length_m[0] == pytest.approx(80.0, abs=0.1)
    assert not joined.bridged.any()


def test_what_is_there_already_is_not_added_twice():
    assert continue_lines(line(0.0, 80.0), line(20.0, 60.0)).length_m.tolist() == pytest.approx([80.0])


@pytest.mark.parametrize("first", [(20.0, 60.0), (60.0, 20.0)])
def test_a_line_takes_in_one_that_is_a_part_of_it(first):
    there = line(*first).with_columns(id=["there"])
    joined = continue_lines(there, line(0.0, 80.0, y=0.05))
    assert joined.length_m.tolist() == pytest.approx([80.0])
    assert joined.id.tolist() == ["there"]


def test_other_lines_are_added():
    for other in (line(40.0, 80.0, y=3.0), line(40.0, 80.0, kind="road_boundary"), line(200.0, 230.0)):
        assert len(continue_lines(line(0.0, 30.0), other)) == 2
    assert len(continue_lines(LineSet.empty(), line(0.0, 30.0))) == 1
