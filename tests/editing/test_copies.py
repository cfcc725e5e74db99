"""Lines that may be one line measured twice: which are queued, and which are not."""

import numpy as np
import pytest

from linework.editing.queue import copies
from linework.editing.queue.copies import copied_lines
from linework.lines.along import DrivenPath
from linework.model.lines import LineSet
from linework.workbench.review.suspects import suspects


def line(
    offset_m=0.0,
    *,
    start=0.0,
    end=60.0,
    up=0.0,
    kind="lane_marking",
    sigma_m=0.05,
    width_m=0.12,
    rate=0.0,
    **columns,
):
    """A line along east, so far to the north, that turns away from it at a rate."""
    east = np.arange(start, end + 1.0, 2.0)
    xyz = np.column_stack([east + 4e5, 5.8e6 + offset_m + rate * (east - start), up + 0.0 * east])
    return LineSet.from_lines(
        [xyz], kind=[kind], width_m=[width_m], sigma_xy_m=np.full(len(xyz), sigma_m), **columns
    )  # fmt: skip


def both(*lines):
    return LineSet.concatenate(list(lines))


def test_the_weaker_of_two_is_queued_with_what_it_shares():
    lines = both(
        line(id=["good"], confidence=[0.95]), line(0.2, start=10, end=40, id=["copy"], confidence=[0.7])
    )
    (item,) = copied_lines(lines)
    assert (item.type, item.ids, item.proposal) == ("copy", ("copy",), "")
    assert item.length_m == pytest.approx(15.0, abs=0.5)
    assert "20 cm beside" in item.reason and "30 m" in item.reason


def test_a_pipe_of_a_rail_is_no_copy_of_the_one_above():
    pipes = both(*(line(up=z, kind="guardrail", id=[f"{z}"], form=["tube"]) for z in (0.0, 0.25)))
    assert copied_lines(pipes) == []
    assert len(copied_lines(pipes.with_columns(form="w_beam"))) == 1


@pytest.mark.parametrize(
    "other",
    [
        pytest.param(line(0.24, sigma_m=0.005), id="a double line of a laser"),
        pytest.param(line(0.6), id="farther than the accuracies allow"),
        pytest.param(line(0.1, end=4.0), id="too short"),
        pytest.param(line(-2.0, rate=0.2), id="crosses"),
        pytest.param(line(0.1, kind="road_boundary"), id="another kind"),
        pytest.param(line(0.05, up=1.0), id="above it"),
        pytest.param(line(0.05, start=60.0, end=90.0), id="goes on from its end"),
    ],
)
def test_what_is_no_copy(other):
    first = line(sigma_m=0.005 if other.sigma_xy_m[0] == 0.005 else 0.05)
    assert copied_lines(both(first.with_columns(id=["a"]), other.with_columns(id=["b"]))) == []


def test_what_a_person_has_settled_stays():
    lines = both(line(id=["a"], confidence=[0.5], review=["accepted"]), line(0.1, id=["b"], confidence=[0.9]))
    assert [item.ids for item in copied_lines(lines)] == [("b",)]
    assert copied_lines(lines.with_columns(review=["accepted", "drawn"])) == []


def test_unknown_accuracy_and_width_compare_nothing():
    lines = both(
        line(sigma_m=np.nan, width_m=np.nan, id=["a"]), line(0.01, sigma_m=np.nan, width_m=np.nan, id=["b"])
    )
    assert copied_lines(lines) == []


def test_a_line_of_three_is_queued_once_and_no_copy_is_accepted_unseen():
    lines = both(*(line(0.1 * k, id=[f"line {k}"], confidence=[0.99]) for k in range(3)))
    items = suspects(lines, DrivenPath.of(np.zeros((0, 3))), lambda xy: np.ones(len(xy), dtype=bool))
    copies = [item.ids[0] for item in items if item.type == "copy"]
    assert len(copies) == len(set(copies)) == 2
    (sure,) = [item.ids for item in items if item.type == "sure"]
    assert set(sure) == {"line 0", "line 1", "line 2"} - set(copies)


def test_a_line_that_was_no_copy_is_a_line_like_any_other():
    lines = both(line(id=["a"], confidence=[0.99]), line(0.1, id=["b"], confidence=[0.98]))
    path, everywhere = DrivenPath.of(np.zeros((0, 3))), lambda xy: np.ones(len(xy), dtype=bool)
    (copy,) = [item for item in suspects(lines, path, everywhere) if item.type == "copy"]
    items = suspects(lines, path, everywhere, dismissed={copy.key})
    assert [(item.type, set(item.ids)) for item in items] == [("sure", {"a", "b"})]


def test_the_order_of_lines_does_not_matter():
    lines = both(*(line(0.1 * k, id=[f"line {k}"], confidence=[0.9 - 0.1 * k]) for k in range(3)))
    turned = lines.take([2, 0, 1])
    assert sorted(item.key for item in copied_lines(lines)) == sorted(
        item.key for item in copied_lines(turned)
    )


def test_either_of_two_may_reach_the_other():
    exact = line(sigma_m=0.005, id=["exact"], confidence=[0.95])
    vague = line(0.35, sigma_m=0.1, id=["vague"], confidence=[0.7])
    for lines in (both(exact, vague), both(vague, exact)):
        assert [item.ids for item in copied_lines(lines)] == [("vague",)]


def test_of_equal_lengths_the_nearer_line_counts():
    weak = line(id=["weak"], confidence=[0.5])
    near, far = (line(north, id=[name], confidence=[0.9]) for north, name in ((0.1, "near"), (-0.2, "far")))
    for lines in (both(weak, near, far), both(far, near, weak)):
        (item,) = [item for item in copied_lines(lines) if item.ids == ("weak",)]
        assert "10 cm beside" in item.reason


@pytest.mark.parametrize("seed", range(3))
def test_many_lines_are_compared_as_each_two_are(seed, monkeypatch):
    """What sorts out pairs beforehand loses none: lines that cross, meet, and run along each other with turns."""
    rng = np.random.default_rng(seed)
    lines = both(
        *(
            line(rng.uniform(0.0, 2.0), start=start, end=start + rng.uniform(3.0, 40.0), rate=rng.choice([0.0, 0.01, -0.3]),
                 sigma_m=rng.uniform(0.01, 0.1), id=[f"{k}"], confidence=[rng.uniform(0.3, 1.0)])
            for k, start in enumerate(rng.uniform(0.0, 60.0, 40))
        )
    )  # fmt: skip
    found = {item.ids: (item.length_m, item.reason) for item in copied_lines(lines)}
    every = np.array([(i, j) for j in range(len(lines)) for i in range(j)]).T
    monkeypatch.setattr(copies, "_near_pairs", lambda plan, reach_m: every)
    monkeypatch.setattr(
        copies, "_long_beside", lambda plan, stations, pairs, limit_m, least_m: np.arange(len(limit_m))
    )
    assert 10 < len(found) < len(lines)
    assert {item.ids: (item.length_m, item.reason) for item in copied_lines(lines)} == found
