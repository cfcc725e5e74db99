"""What only one survey found: missed where such lines are often missed as far, else the road has changed."""

import numpy as np
import pytest

from linework.evaluation.changes.epochs import compare_epochs
from linework.evaluation.changes.misses import Alone, change_probabilities
from linework.model.lines import LineSet

FOUND = [(("edge",), 300.0), (("rail",), 600.0)]
MISSED = [Alone(("edge",), length_m, 1.0) for length_m in (3.0, 5.0, 4.0, 9.0, 12.0, 3.0)]


def probability(one, found=FOUND, others=MISSED):
    return change_probabilities([*others, one], found)[-1]


def test_what_is_often_missed_as_far_is_no_change():
    assert probability(Alone(("edge",), 10.0, 1.0)) < 0.2
    assert probability(Alone(("rail",), 10.0, 1.0)) > 2 * probability(Alone(("edge",), 10.0, 1.0))
    assert probability(Alone(("edge",), 100.0, 1.0)) > 0.8


def test_two_changes_do_not_hide_each_other():
    both = [Alone(("edge",), 100.0, 1.0)] * 2
    assert min(change_probabilities([*MISSED, *both], FOUND)[-2:]) > 0.67


def test_a_very_long_stretch_among_very_many_short_ones_is_a_change():
    """Chances of a miss beyond what a number can hold are still smaller than that of a change."""
    short = [Alone(("edge",), 4.0, 1.0)] * 300
    assert probability(Alone(("edge",), 10_000.0, 0.9), [(("edge",), 100_000.0)], short) == pytest.approx(0.9)


def test_what_may_be_no_line_is_no_change():
    sure, unsure = (probability(Alone(("rail",), 90.0, c)) for c in (1.0, 0.5))
    assert unsure == pytest.approx(0.5 * sure)


def row(y, start, end):
    x = np.arange(start, end + 0.1, 2.0)
    return np.column_stack([x, np.full(len(x), float(y)), np.zeros(len(x))])


def road(*more, hidden=()):
    """Return three markings of 400 m, and more lines: (kind, offset, start, end, confidence)."""
    table = [("lane_marking", y, 0.0, 400.0, 0.98) for y in (0.0, 3.5, -3.5)] + list(more)
    rows = [row(*line[1:4]) for line in table]
    bridged = [np.any([(a <= r[:, 0]) & (r[:, 0] <= b) for a, b in [*hidden, (1, 0)]], axis=0) for r in rows]
    return LineSet.from_lines(
        rows, kind=[t[0] for t in table], id=[f"{t[0]} {t[1]:g} {t[2]:g}" for t in table],
        bridged=np.concatenate(bridged), sigma_xy_m=0.01, sigma_z_m=0.01, confidence=[t[4] for t in table],
    )  # fmt: skip


def statuses(old, new):
    return [(c.status, str(c.line.kind[0]), c.what) for c in compare_epochs(old, new)[0]]


def test_edges_in_pieces_that_one_survey_missed_are_unsure_and_a_new_rail_is_new():
    pieces = [("road_boundary", 5.0, s, s + 6.0 + s % 5, 0.7) for s in range(0, 390, 23)]
    both, missed = pieces[::2], pieces[1::2]
    new = road(*both, ("guardrail", 6.0, 100.0, 250.0, 0.9))
    changes = compare_epochs(road(*both, *missed), new)[0]
    assert [c.status for c in changes] == ["unsure"] * len(missed) + ["new"]
    assert {c.what for c in changes[:-1]} == {"gone"}
    assert changes[-1].probability > 0.8 > 0.2 > changes[0].probability


def test_a_line_that_is_gone_behind_parked_cars_is_gone_once():
    """Its stretches between places that were hidden are one change, with these: each by itself may have been missed."""
    old = road(("lane_marking", 7.0, 0.0, 400.0, 0.9), hidden=[(a, a + 8.0) for a in range(200, 400, 20)])
    changes = compare_epochs(old, road(("lane_marking", 7.0, 0.0, 198.0, 0.9)))[0]
    assert [(c.status, c.from_m, c.to_m) for c in changes] == [("gone", 209.0, 400.0)]


def test_a_line_of_another_kind_in_its_place_is_one_change():
    old, new = (road((kind, 6.0, 0.0, 400.0, 0.95)) for kind in ("fence", "barrier"))
    assert statuses(old, new) == [("changed", "fence", "kind fence to barrier")]
    # Edges that are no boundary any more, and the other way round
    assert statuses(*(road((k, 6.0, 0.0, 400.0, 0.95)) for k in ("road_boundary", "edge_other"))) == [
        ("changed", "road_boundary", "kind road_boundary to edge_other")
    ]
    assert statuses(*(road((k, 6.0, 0.0, 400.0, 0.95)) for k in ("edge_other", "road_boundary"))) == [
        ("changed", "road_boundary", "kind edge_other to road_boundary")
    ]
    # Beside a line that both surveys have, it is another line
    beside = ("road_boundary", 6.2, 0.0, 400.0, 0.95)
    old, new = road(("kerb_top", 6.0, 0.0, 400.0, 0.95), beside), road(beside)
    assert statuses(old, new) == [("gone", "kerb_top", "")]
