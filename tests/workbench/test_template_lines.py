"""The lines of a template are saved beside a line: joined with saved ones that are the same, and with no others."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import TypeAdapter

from linework.errors import UsageError
from linework.model.lines import LineSet
from linework.workbench.edits.apply import EditInputs, change_of
from linework.workbench.edits.orders import EditOrder

ORDER = TypeAdapter(EditOrder)


def straight(start, end, *, name="", kind="kerb_top", aside=0.0, up=0.0, **columns):
    t = np.arange(start, end + 0.5)
    xyz = np.column_stack([t, np.full(len(t), aside), np.full(len(t), up)])
    return LineSet.from_lines([xyz], kind=[kind], id=[name], **columns)


def round_line(radius, *, name="", kind="road_boundary", share=1.0):
    turn = np.linspace(0.0, 2.0 * np.pi * share, 60)
    xyz = np.column_stack([radius * np.cos(turn), radius * np.sin(turn), 0.0 * turn])
    return LineSet.from_lines([xyz], kind=[kind], id=[name])


def added(there, line, *beside):
    """Return the change that adds the lines of a template beside a saved line."""
    given = EditInputs(beside=LineSet.concatenate(beside))
    lines = LineSet.concatenate([line, there]) if len(there) else line
    edit = {"action": "template", "id": str(line.id[0]), "template": "any"}
    return change_of(ORDER.validate_python(edit), lines, given)


def kept(there, trace, *beside, first=0, last=1000):
    """Return the change that saves a followed line with the lines of a template."""
    given = EditInputs(kept=trace, beside=LineSet.concatenate(beside))
    edit = {"action": "keep", "trace": "any", "first": first, "last": last}
    return change_of(ORDER.validate_python(edit), there, given)


@pytest.mark.parametrize(
    ("kind", "low", "high", "n_before"),
    [
        ("cable", 6.5, 8.0, 0),
        ("guardrail", 0.75, 1.15, 0),
        ("guardrail", 0.75, 0.80, 1),
        ("cable", 6.5, 6.55, 1),
    ],
)
def test_lines_above_one_another_stay_apart(kind, low, high, n_before):
    line = straight(0, 30, name="followed", kind=kind, aside=1.0, up=low)
    there = straight(-10, 25, name="there", kind=kind, up=low)
    change = added(there, line, straight(0, 30, kind=kind, up=high))
    assert len(change.before) == n_before
    assert change.after.id.tolist() == ["there"] * n_before + [""] * (1 - n_before)
    assert change.after.length_m[0] == pytest.approx(40.0 if n_before else 30.0, abs=0.01)
    assert np.ptp(change.after.xyz[:, 2]) < 0.1


def test_a_wire_that_only_crosses_another_is_not_joined_with_it():
    line = straight(0, 30, name="followed", kind="cable", aside=1.0, up=6.0)
    there = straight(29, 60, name="next", kind="cable", up=6.0)
    assert len(added(there, line, straight(0, 30, kind="cable", up=6.0)).before) == 0


@pytest.mark.parametrize("saved", [(-100, 3), (-12, 3), (5, 12), (25, 60)])
def test_a_saved_top_is_one_with_that_of_the_template(saved):
    """Also where the followed line has a top of its own, which is joined with nothing."""
    trace = LineSet.concatenate(
        [straight(0, 30, kind="road_boundary", aside=0.2), straight(0, 30, aside=0.02)]
    )
    top = straight(*saved, name="K1", review=["accepted"])
    change = kept(top, trace, straight(2, 30, method=["template"]))
    assert change.before.id.tolist() == ["K1"]
    tops = change.after["kerb_top"]
    assert tops.id.tolist() == ["K1"]
    assert [tops.xyz[:, 0].min(), tops.xyz[:, 0].max()] == [min(saved[0], 2), max(saved[1], 30)]
    assert change.after["road_boundary"].length_m.tolist() == [30.0]


def test_a_top_of_another_height_is_not_that_of_the_template():
    trace = LineSet.concatenate([straight(0, 30, kind="road_boundary", aside=0.2), straight(0, 30)])
    change = kept(LineSet.empty(), trace, straight(2, 30, up=0.5))
    assert len(change.after["kerb_top"]) == 2


def test_the_line_that_a_template_lies_beside_is_joined_with_none_of_its_lines():
    line = straight(0, 30, name="a", kind="road_boundary")
    change = added(LineSet.empty(), line, straight(1, 29, kind="road_boundary", aside=0.03))
    assert len(change.before) == 0
    assert change.after.id.tolist() == [""]
    assert change.after.length_m.tolist() == [28.0]


def test_the_lines_beside_a_closed_line_are_whole():
    beside = round_line(4.8, kind="kerb_top", share=0.9)
    change = added(LineSet.empty(), round_line(5.0, name="island"), beside)
    assert change.after.length_m == pytest.approx(beside.length_m)
    change = kept(LineSet.empty(), round_line(5.0), beside)
    assert change.after["kerb_top"].length_m == pytest.approx(beside.length_m)
    # Of a part that is not closed, only what lies beside it
    change = kept(LineSet.empty(), round_line(5.0), beside, last=30)
    assert change.after["kerb_top"].length_m[0] == pytest.approx(15.0, abs=0.6)


def test_a_line_is_kept_without_a_template_that_shows_nothing_beside_the_kept_part():
    trace, beside = straight(0, 30, kind="road_boundary"), straight(0, 10, aside=0.3)
    change = kept(LineSet.empty(), trace, beside, first=20)
    assert change.after.kind.tolist() == ["road_boundary"]
    line = straight(20, 30, name="a", kind="road_boundary")
    with pytest.raises(UsageError, match="no edge of the template"):
        added(LineSet.empty(), line, beside)


def test_a_steep_line_is_cut_beside_the_end_of_its_line():
    t = np.arange(0.0, 41.0)
    steep = LineSet.from_lines([np.column_stack([t, 0.0 * t + 0.3, 0.5 * t])], kind=["kerb_top"])
    line = LineSet.from_lines([np.column_stack([t, 0.0 * t, 0.5 * t])[10:31]], kind=["road_boundary"], id=["a"])  # fmt: skip
    cut = added(LineSet.empty(), line, steep).after
    assert cut.xyz[[0, -1], 0].tolist() == [10.0, 30.0]
    assert cut.xyz[[0, -1], 2].tolist() == [5.0, 15.0]
