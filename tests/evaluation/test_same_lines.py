"""What differs of lines that both surveys have: other edges for some metres are unsure, a kerb in pieces has moved once."""

import numpy as np
import pytest

from linework.evaluation.changes.epoch_change import EpochChange
from linework.evaluation.changes.epochs import compare_epochs
from linework.evaluation.changes.joined_moves import moved_together
from linework.lines.along import line_stretch
from linework.model.lines import LineSet

X = np.arange(0.0, 600.1, 2.0)
OFFSETS = (0.0, 3.5, -3.5, 5.0, -5.0, 6.0)


def survey(seed, moved=(), pieces=None):
    """Return three markings and three edges of 600 m; `moved` has line, ends and shift, `pieces` cuts the last edge."""
    rng = np.random.default_rng(seed)
    rows = []
    for k, offset in enumerate(OFFSETS):
        y = offset + np.interp(X, np.arange(0, 640, 40), 0.006 * rng.normal(size=16))
        for line, a, b, shift in moved:
            y = y + shift * ((line == k) & (a <= X) & (b >= X))
        rows.append(np.column_stack([X, y, np.zeros(len(X))]))
    lines = LineSet.from_lines(
        rows, kind=["lane_marking"] * 3 + ["road_boundary"] * 3, form=[""] * 3 + ["edge"] * 3, id=[f"{o:g}" for o in OFFSETS],
        sigma_xy_m=0.01, sigma_z_m=0.01, confidence=0.95, crs="EPSG:25832",
    )  # fmt: skip
    if pieces is None:
        return lines
    cut = [line_stretch(lines.take([5]), a, b).with_columns(id=[f"piece {a}"]) for a, b in pieces]
    return LineSet.concatenate([lines.take(np.arange(5)), *cut])


def differing(old, new):
    return [
        (c.status, str(c.line.id[0]), c.what) for c in compare_epochs(old, new)[0] if c.across_m == c.across_m
    ]


#: Another edge was measured for some metres, once on one edge and once on another.
OTHER_EDGE = [(3 + k % 2, 30.0 + 70.0 * k, 38.0 + 70.0 * k, 0.4) for k in range(8)]


def test_another_edge_for_some_metres_is_unsure_and_a_long_move_is_one():
    found = differing(survey(1), survey(2, [*OTHER_EDGE, (5, 300.0, 500.0, 0.12)]))
    assert found.count(("unsure", "5", "moved")) + found.count(("unsure", "-5", "moved")) == len(OTHER_EDGE)
    assert [f for f in found if f[0] == "moved"] == [("moved", "6", "")]


def test_a_short_move_of_lines_that_never_err_has_moved():
    assert differing(survey(1), survey(2, [(2, 300.0, 310.0, 0.12)])) == [("moved", "-3.5", "")]


def test_an_edge_that_moved_in_pieces_moved_once():
    """Each piece by itself is as long as the places where another edge was measured."""
    pieces = [(a, a + 14.0) for a in range(300, 500, 20)]
    new = survey(2, [*OTHER_EDGE, (5, 300.0, 500.0, 0.12)])
    changes = [
        c for c in compare_epochs(survey(1, pieces=pieces), new)[0] if str(c.line.id[0]).startswith("piece")
    ]
    assert {c.status for c in changes} == {"moved"} and len(changes) == len(pieces)
    assert len({c.probability for c in changes}) == 1


def test_moves_are_one_only_where_nothing_between_has_stayed_and_the_shift_is_the_same():
    def moved(start, across, y=0.0):
        x = np.arange(start, start + 10.1, 2.0)
        line = LineSet.from_lines([np.column_stack([x, np.full(len(x), y), 0.0 * x])], kind="road_boundary")
        return EpochChange("moved", line, 0.0, 10.0, across, 0.0, 0.01, 0.01, "")

    def groups(*moves, still=(), kind="road_boundary"):
        kinds = np.full(len(still), kind)
        return moved_together(moves, np.reshape(still, (-1, 2)), kinds).tolist()

    assert groups(moved(0, 0.1), moved(18, 0.1), moved(36, 0.1)) == [0, 0, 0]
    assert groups(moved(0, 0.1), moved(18, 0.2)) == [0, 1]
    assert groups(moved(0, 0.1), moved(18, 0.1), still=[(14.0, 0.0)]) == [0, 1]
    assert groups(moved(0, 0.1), moved(18, 0.1), still=[(14.0, 0.0)], kind="lane_marking") == [0, 0]
    assert groups(moved(0, 0.1), moved(18, 0.1, y=1.0)) == [0, 1]
    assert groups(moved(0, 0.1), moved(28, 0.1)) == [0, 1]
    assert groups() == []


def test_a_line_is_there_unless_both_surveys_are_wrong():
    old, new = survey(1), survey(2, [(5, 100.0, 400.0, 0.3)])

    def probability(*confidence):
        pair = [s.with_columns(confidence=c) for s, c in zip((old, new), confidence, strict=True)]
        (change,) = compare_epochs(*pair)[0]
        return change.status, change.probability

    sure = probability(1.0, 1.0)
    assert sure == probability(np.nan, np.nan) == ("moved", pytest.approx(1.0, abs=0.01))
    assert probability(0.6, 0.5) == ("moved", pytest.approx(0.8 * sure[1], abs=0.001))
    assert probability(0.3, 0.2)[0] == "unsure"


def test_shifts_are_those_at_the_ends_that_meet():
    """The chord of a ring says nothing of what is left of it at its ends, and that of a bend little."""

    def moved(xy, across):
        xyz = np.column_stack([xy, np.zeros(len(xy))])
        line = LineSet.from_lines([xyz], kind="road_boundary")
        return EpochChange("moved", line, 0.0, float(line.length_m[0]), across, 0.0, 0.01, 0.01, "")

    def groups(*moves):
        return moved_together(moves, np.zeros((0, 2)), np.zeros(0, dtype=str)).tolist()

    angle = np.linspace(0.0, 2.0 * np.pi, 200)
    ring = 10.0 * np.column_stack([np.cos(angle), np.sin(angle)])
    on = np.array([[10.0, 0.5], [10.0, 20.0]])
    assert groups(moved(ring, 0.3), moved(on, 0.0)) == [0, 1]
    assert groups(moved(ring, 0.3), moved(on, 0.3)) == [0, 0]
    half, on = ring[:100], np.array([[-10.0, -1.0], [-10.0, -21.0]])
    assert groups(moved(half, 0.3), moved(on, 0.3)) == [0, 0]
    # Drawn the other way round, left is on the other side
    assert groups(moved(half, 0.3), moved(on[::-1], -0.3)) == [0, 0]
    assert groups(moved(half, 0.3), moved(on[::-1], 0.3)) == [0, 1]


def test_a_wall_behind_a_kerb_is_another_line():
    old, new = survey(1), survey(2)
    wall = survey(1, [(4, 0.0, 600.0, -0.7)]).take([4]).with_columns(form=["barrier"], id=["wall"])
    statuses = [
        (c.status, c.what)
        for c in compare_epochs(LineSet.concatenate([old.take([0, 1, 2, 3, 5]), wall]), new)[0]
    ]
    assert sorted(statuses) == [("gone", ""), ("new", "")]


def test_two_lines_that_disagree_know_the_registration_as_much_less():
    """Which of both has moved, or whether navigation erred, only a third line says."""
    old, new = (s.take([0, 4]) for s in (survey(1), survey(2, [(0, 200.0, 400.0, 0.2)])))
    _, registration = compare_epochs(old, new)
    assert registration.sigma_m[:, 0].max() > 0.05
    three = [s.take([0, 3, 4]) for s in (survey(1), survey(2, [(0, 200.0, 400.0, 0.2)]))]
    assert differing(*three) == [("moved", "0", "")]


def test_two_lines_that_disagree_in_height_know_the_registration_as_much_less():
    old, new = (survey(seed).take([0, 4]) for seed in (1, 2))
    xyz = new.xyz.copy()
    xyz[: len(X), 2] += 0.2 * ((X >= 200.0) & (X <= 400.0))
    _, registration = compare_epochs(old, new.with_columns(xyz=xyz))
    at = (registration.cells[:, 0] + 0.5) * 25.0
    inside, outside = (at > 260.0) & (at < 340.0), (at < 130.0) | (at > 470.0)
    assert registration.sigma_m[inside, 1].min() > 0.05 > 0.02 > registration.sigma_m[outside, 1].max()


def test_short_pieces_do_not_pull_the_registration():
    pieces = [(a, a + 6.0) for a in range(200, 300, 12)]
    old = LineSet.concatenate([survey(1, pieces=pieces).take(np.r_[0, 3, 5 : 5 + len(pieces)])])
    new = survey(2, [(5, 0.0, 600.0, 0.8)]).take([0, 3, 5])
    _, registration = compare_epochs(old, new)
    assert np.abs(registration.shift_m[:, :2]).max() < 0.05


def test_markings_that_come_together_stay_lines_of_their_own():
    """Where lanes end, lines of both surveys lie beside other ones for some metres; kerbs on both sides that moved stay two."""

    def road(seed, end_m, shift):
        lines = survey(seed, [(4, 100.0, 300.0, shift), (5, 100.0, 300.0, shift)])
        together = np.clip((X - 400.0) / 150.0, 0.0, 1.0)
        xyz = lines.xyz.reshape(6, -1, 3).copy()
        for k in (1, 2, 3):
            xyz[k, :, 1] += together * (float(k) - OFFSETS[k])
        lines = lines.with_columns(xyz=xyz.reshape(-1, 3))
        ended = [line_stretch(lines.take([k]), 0.0, end_m) for k in (1, 2, 3)]
        return LineSet.concatenate([lines.take([0]), *ended, lines.take([4, 5])])

    changes, registration = compare_epochs(road(1, 600.0, 0.0), road(2, 580.0, 0.3))
    assert set(registration.n_lines.tolist()) == {6}
    assert np.abs(registration.shift_m[:, 1]).max() < 0.05
    long = [(c.status, str(c.line.id[0])) for c in changes if c.length_m > 50.0]
    assert long == [("moved", "-5"), ("moved", "6")]


def test_pieces_of_a_line_count_as_one():
    old, new = survey(1, pieces=[(0, 200.0), (202.0, 400.0), (402.0, 600.0)]), survey(2)
    assert set(compare_epochs(old, new)[1].n_lines.tolist()) == {6}


@pytest.mark.parametrize("pattern", ["solid", "solid_solid"])
def test_dashes_of_what_is_solid_now_are_not_gone(pattern):
    old = survey(1).with_columns(pattern=["dashed", "solid", "solid", "", "", ""])
    dashes = [
        line_stretch(old.take([0]), s, s + 3.0).with_columns(
            kind=["lane_marking_dash"], id=[f"d{s}"], pattern=[""]
        )
        for s in range(6, 590, 9)
    ]
    both = LineSet.concatenate([old, *dashes])
    worn = LineSet.concatenate(
        [survey(2).with_columns(pattern=["dashed", "solid", "solid", "", "", ""]), *dashes[:20], *dashes[26:]]
    )
    whats = [c.what for c in compare_epochs(both, worn)[0]]
    assert whats == ["6 dashes gone"]
    solid = LineSet.concatenate(
        [survey(2).with_columns(pattern=[pattern, "solid", "solid", "", "", ""]), *dashes[:20], *dashes[26:]]
    )
    whats = [c.what for c in compare_epochs(both, solid)[0]]
    assert whats == [f"pattern dashed to {pattern}"]


@pytest.mark.parametrize("pattern", ["", "solid_dashed", "dashed_solid", "dashed_dashed"])
def test_dashes_beside_a_solid_stripe_may_be_gone(pattern):
    old, new = (
        s.with_columns(pattern=[pattern, "solid", "solid", "", "", ""]) for s in (survey(1), survey(2))
    )
    dashes = [
        line_stretch(old.take([0]), s, s + 3.0).with_columns(
            kind=["lane_marking_dash"], id=[f"d{s}"], pattern=[""]
        )
        for s in range(6, 590, 9)
    ]
    worn = LineSet.concatenate([new, *dashes[:20], *dashes[26:]])
    assert [c.what for c in compare_epochs(LineSet.concatenate([old, *dashes]), worn)[0]] == ["6 dashes gone"]


def other_patterns(*stretches):
    """Return two surveys: in the new one, stretches (line, from, to) of three dashed markings are solid ones."""
    old = survey(1).with_columns(pattern=["dashed"] * 3 + [""] * 3)
    rows = []
    for k in range(3):
        own = sorted((a, b) for line, a, b in stretches if line == k)
        marking = survey(2).take([k])
        for start, end in zip([0.0, *(b for _, b in own)], [*(a for a, _ in own), 600.0], strict=True):
            if end - start > 2.0:
                piece = line_stretch(marking, start + 1.0 * (start > 0), end - 1.0 * (end < 600))
                rows.append(piece.with_columns(pattern=["dashed"]))
        rows += [line_stretch(marking, a, b).with_columns(pattern=["solid"]) for a, b in own]
    edges = survey(2).take([3, 4, 5])
    return old, LineSet.concatenate([*rows, edges])


def test_another_pattern_for_some_metres_is_unsure_where_that_happens_and_else_a_change():
    (alone,) = compare_epochs(*other_patterns((0, 0.0, 6.0)))[0]
    assert (alone.status, alone.what) == ("changed", "pattern dashed to solid")
    several = compare_epochs(*other_patterns(*((k % 3, 60.0 * k, 60.0 * k + 6.0) for k in range(8))))[0]
    assert [(c.status, c.what) for c in several] == [("unsure", "pattern dashed to solid")] * 8
    among = [*((k % 3, 60.0 * k, 60.0 * k + 6.0) for k in range(8)), (1, 480.0, 600.0)]
    long = [c for c in compare_epochs(*other_patterns(*among))[0] if c.length_m > 50.0]
    assert [c.status for c in long] == ["changed"]
