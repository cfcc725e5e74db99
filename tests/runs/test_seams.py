"""Lines across the seams of tiles: cut and joined they are as if never cut."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from linework.methods.seams import inside_core, join_seams
from linework.model.grid import Bounds
from linework.model.lines import LineSet

CORES = [Bounds(x, y, x + 50.0, y + 50.0) for y in (0.0, 50.0) for x in (0.0, 50.0)]


def winding() -> LineSet:
    """Return two winding rails over four cores, and a wire across the middle."""
    t = np.linspace(0, 1, 60)
    rail = np.stack([2 + 96 * t, 50 + 40 * np.sin(7 * t), 5 + t], axis=1)
    wire = np.array([[45.0, 20.0, 9.0], [52.0, 20.0, 8.0], [58.0, 20.0, 9.0]])
    return LineSet.from_lines(
        [rail, rail[::-1] + np.array([0, 3, 0]), wire],
        kind=["guardrail", "guardrail", "cable"],
        height_m=[0.7, 0.8, np.nan],
        bridged=np.arange(123) % 10 == 0,
        sigma_xy_m=np.linspace(0.01, 0.02, 123),
    )


def in_place(lines: LineSet) -> list[np.ndarray]:
    """Return the vertices of all lines, each from its western end, in a fixed order."""
    found = [lines[i].xyz for i in range(len(lines))]
    found = [xyz if xyz[0, 0] < xyz[-1, 0] else xyz[::-1] for xyz in found]
    return sorted(found, key=lambda xyz: xyz[0].tolist())


def test_cut_and_joined_is_as_never_cut():
    lines = winding()
    parts = [inside_core(lines, core) for core in CORES]
    assert sum(map(len, parts)) > 8
    for part, core in zip(parts, CORES, strict=True):
        rails = part["guardrail"].xyz
        assert rails[:, 0].min() >= core.west
        assert rails[:, 1].max() <= core.north
    for order in ([0, 1, 2, 3], [3, 1, 0, 2]):
        joined = join_seams(LineSet.concatenate([parts[k] for k in order]), CORES)
        assert len(joined) == 3
        np.testing.assert_allclose(sorted(joined.length_m), sorted(lines.length_m), rtol=1e-9)
        np.testing.assert_allclose(sorted(joined.bridged_m), sorted(lines.bridged_m), rtol=1e-9)
        assert sorted(joined.height_m[joined.kind == "guardrail"]) == pytest.approx([0.7, 0.8])
        for one, two in zip(in_place(joined), in_place(lines), strict=True):
            at = np.cumsum(np.r_[0, np.linalg.norm(np.diff(two, axis=0), axis=1)])
            near = np.cumsum(np.r_[0, np.linalg.norm(np.diff(one, axis=0), axis=1)])
            for axis in range(3):
                np.testing.assert_allclose(np.interp(near, at, two[:, axis]), one[:, axis], atol=1e-9)


def test_a_wire_is_never_cut_and_belongs_to_one_core():
    wires = [inside_core(winding(), core)["cable"] for core in CORES]
    assert [len(w) for w in wires] == [0, 1, 0, 0]
    assert len(wires[1].xyz) == 3


def test_ends_that_differ_by_a_little_meet_half_way_and_far_ones_do_not():
    def pieces(step_m: float) -> LineSet:
        west = np.array([[40.0, 10.0, 1.0], [50.0, 10.0, 1.0]])
        east = np.array([[50.0, 10.0 + step_m, 1.0], [60.0, 10.0 + step_m, 1.0]])
        return LineSet.from_lines([west, east], kind=["guardrail"] * 2, confidence=[0.5, 0.9])

    joined = join_seams(pieces(0.04), CORES)
    assert joined.xyz.tolist() == [[40, 10, 1], [60, 10.04, 1]]  # half-way lies on the line
    assert joined.confidence.tolist() == pytest.approx([0.7])
    assert len(join_seams(pieces(0.2), CORES)) == 2


def test_lines_that_end_at_a_seam_but_do_not_go_on_stay_apart():
    side_by_side = [np.array([[40.0, y, 1.0], [50.0, y, 1.0]]) for y in (10.0, 10.05)]
    assert len(join_seams(LineSet.from_lines(side_by_side, kind=["guardrail"] * 2), CORES)) == 2
    other_kind = [np.array([[40.0, 10, 1], [50.0, 10, 1]]), np.array([[50.0, 10, 1], [60.0, 10, 1]])]
    assert len(join_seams(LineSet.from_lines(other_kind, kind=["guardrail", "fence"]), CORES)) == 2
    away_from_seams = [np.array([[40.0, 10, 1], [45.0, 10, 1]]), np.array([[45.0, 10, 1], [49.0, 10, 1]])]
    assert len(join_seams(LineSet.from_lines(away_from_seams, kind=["guardrail"] * 2), CORES)) == 2


def test_a_ring_comes_back_as_one_line():
    angle = np.linspace(0, 2 * np.pi, 80)
    ring = np.stack([50 + 20 * np.cos(angle), 50 + 20 * np.sin(angle), 0 * angle], axis=1)
    lines = LineSet.from_lines([ring], kind=["guardrail"])
    joined = join_seams(LineSet.concatenate([inside_core(lines, core) for core in CORES]), CORES)
    assert len(joined) == 1
    assert joined.length_m[0] == pytest.approx(lines.length_m[0])


def test_no_vertex_stays_where_a_line_was_cut():
    lines = winding()["guardrail"]
    for cores in (CORES, [Bounds(x, y, x + 7.0, y + 7.0) for y in range(0, 98, 7) for x in range(0, 98, 7)]):
        joined = join_seams(LineSet.concatenate([inside_core(lines, core) for core in cores]), cores)
        assert len(joined) == 2
        for one, two in zip(in_place(joined), in_place(lines), strict=True):
            np.testing.assert_allclose(one, two, atol=1e-9)
        for name in ("bridged", "sigma_xy_m"):
            own, whole = (np.sort(getattr(x, name)) for x in (joined, lines))
            np.testing.assert_allclose(own, whole, atol=1e-12)


def test_a_kink_at_a_seam_keeps_its_vertex():
    west = np.array([[40.0, 10.0, 1.0], [50.0, 10.0, 1.0]])
    east = np.array([[50.0, 10.0, 1.0], [60.0, 11.0, 1.0]])
    joined = join_seams(LineSet.from_lines([west, east], kind=["guardrail"] * 2), CORES)
    assert joined.xyz.tolist() == [[40, 10, 1], [50, 10, 1], [60, 11, 1]]


@pytest.mark.parametrize("over_m", [1e-7, 0.0004, 0.02, 0.3])
def test_a_line_that_ends_just_beyond_a_seam_keeps_its_end(over_m):
    line = np.array([[30.0, 10.0, 1.0], [40.0, 10.0, 1.0], [50.0 + over_m, 10.1, 1.2]])
    lines = LineSet.from_lines([line], kind=["guardrail"])
    joined = join_seams(LineSet.concatenate([inside_core(lines, core) for core in CORES]), CORES)
    assert len(joined) == 1
    np.testing.assert_allclose(joined.xyz, line, atol=1e-9)


def test_a_shard_that_goes_on_nowhere_is_left_out():
    shard = np.array([[50.0, 10.0, 1.0], [50.01, 10.0, 1.0]])
    lines = LineSet.from_lines([shard, shard + 5.0], kind=["guardrail"] * 2)
    assert join_seams(lines, CORES).xyz.tolist() == (shard + 5.0).tolist()


def test_pieces_vote_by_their_length():
    west = np.array([[20.0, 10.0, 1.0], [50.0, 10.0, 1.0]])
    east = np.array([[50.0, 10.0, 1.0], [60.0, 10.0, 1.0]])
    pieces = LineSet.from_lines(
        [east, west], kind=["guardrail"] * 2, double=[False, True], time_start_s=[5.0, np.nan], width_m=[1, 2]
    )
    joined = join_seams(pieces, CORES)
    assert (joined.double.tolist(), joined.time_start_s.tolist(), joined.width_m.tolist()) == (
        [True],
        [5],
        [1.75],
    )


@pytest.mark.parametrize("order", [[0, 1, 2], [2, 1, 0], [1, 0, 2]])
def test_the_form_of_a_joined_rail_is_that_of_most_of_it(order):
    # A shard, a long piece and the rest: two forms
    at = [48.0, 50.0, 100.0, 130.0]
    pieces = [np.array([[a, 10.0, 1.0], [b, 10.0, 1.0]]) for a, b in itertools.pairwise(at)]
    lines = LineSet.from_lines(
        pieces, kind=["guardrail"] * 3, form=["thrie_beam", "w_beam", ""],
        lower_m=[0.3, 0.44, np.nan], n_beams=[2.0, 1.0, np.nan],
    )  # fmt: skip
    cores = [*CORES, Bounds(100.0, 0.0, 150.0, 50.0)]
    joined = join_seams(lines.take(order), cores)
    assert (joined.form.tolist(), joined.lower_m.tolist(), joined.n_beams.tolist()) == (
        ["w_beam"],
        [0.44],
        [1.0],
    )


@pytest.mark.parametrize("order", [[0, 1], [1, 0]])
def test_of_forms_of_equal_length_the_first_by_name_is_taken(order):
    pieces = [np.array([[a, 10.0, 1.0], [a + 10.0, 10.0, 1.0]]) for a in (40.0, 50.0)]
    lines = LineSet.from_lines(
        pieces, kind=["guardrail"] * 2, form=["w_beam", "thrie_beam"], lower_m=[0.4, 0.3]
    )
    joined = join_seams(lines.take(order), CORES)
    assert (joined.form.tolist(), joined.lower_m.tolist()) == (["thrie_beam"], [0.3])
