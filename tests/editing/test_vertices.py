"""What a person does to a line by hand: vertices, parts, words; each on one line or two, none changed in place."""

import numpy as np
import pytest

from linework.editing.edits.attributes import with_attribute, with_kind, with_review
from linework.editing.edits.split_join import join_two_lines, split_line
from linework.editing.edits.vertices import (
    insert_vertex,
    move_vertex,
    remove_vertex,
    reversed_line,
    trim_to_vertices,
)
from linework.errors import UsageError
from linework.model.lines import LineSet


def line(start=0.0, end=10.0, *, y=0.0, n=None, kind="lane_marking", name="a", **columns):
    t = np.linspace(start, end, n or int(abs(end - start)) + 1)
    xyz = np.column_stack([t, np.full(len(t), y), 0.1 * t])
    vertex = {"sigma_xy_m": np.full(len(t), 0.01), "sigma_z_m": np.full(len(t), 0.02)}
    return LineSet.from_lines([xyz], kind=[kind], id=[name], **(vertex | columns))


def arc(start_deg, end_deg, radius=50.0, *, n=40, name="a", kind="lane_marking"):
    t = np.radians(np.linspace(start_deg, end_deg, n))
    xyz = np.column_stack([radius * np.cos(t), radius * np.sin(t), np.zeros(n)])
    return LineSet.from_lines([xyz], kind=[kind], id=[name])


def test_a_moved_vertex_is_known_as_well_as_its_height():
    one = line()
    after = move_vertex(one, 3, np.array([3.0, 0.4, 1.0]), sigma_z_m=0.03)
    assert after.xyz[3].tolist() == [3.0, 0.4, 1.0]
    assert np.isnan(after.sigma_xy_m[3])
    assert after.sigma_z_m[3] == 0.03
    others = np.arange(11) != 3
    assert np.array_equal(after.xyz[others], one.xyz[others])
    assert np.array_equal(after.sigma_xy_m[others], one.sigma_xy_m[others])
    assert one.xyz[3].tolist() == [3.0, 0.0, pytest.approx(0.3)]


@pytest.mark.parametrize("after", [-1, 4, 10])
def test_a_vertex_is_inserted_inside_and_at_both_ends(after):
    place = np.array([after + 0.5, 0.2, 0.0])
    longer = insert_vertex(line(), after, place)
    assert len(longer.xyz) == 12
    assert longer.xyz[after + 1].tolist() == place.tolist()
    assert np.isnan(longer.sigma_xy_m[after + 1])
    assert longer.id.tolist() == ["a"]


def test_a_vertex_inserted_over_a_gap_measures_nothing():
    one = line(bridged=[False] * 4 + [True] * 2 + [False] * 5)
    assert insert_vertex(one, 4, np.array([4.5, 0.1, 0.0])).bridged[5]
    assert not insert_vertex(one, 8, np.array([8.5, 0.1, 0.0])).bridged[9]
    assert insert_vertex(one, 4, np.array([4.5, 0.0, 0.45])).bridged_m == pytest.approx(one.bridged_m)


def test_removing_and_trimming_keep_the_rest_as_it_is():
    one = line()
    assert remove_vertex(one, 5).xyz[:, 0].tolist() == [0, 1, 2, 3, 4, 6, 7, 8, 9, 10]
    assert trim_to_vertices(one, 2, 6).xyz[:, 0].tolist() == [2, 3, 4, 5, 6]
    assert trim_to_vertices(one, 2, 6).sigma_z_m.tolist() == [0.02] * 5


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: move_vertex(line(), 11, np.zeros(3)),
        lambda: move_vertex(line(), -1, np.zeros(3)),
        lambda: move_vertex(line(), 1, np.array([0.0, 0.0, 0.0])),
        lambda: insert_vertex(line(), 11, np.zeros(3)),
        lambda: insert_vertex(line(), 0, np.array([1.0, 0.0, 0.1])),
        lambda: remove_vertex(line(n=2), 0),
        lambda: trim_to_vertices(line(), 4, 4),
        lambda: trim_to_vertices(line(), 0, 11),
        lambda: split_line(line(), np.array([-3.0, 0.0])),
        lambda: split_line(line(), np.array([10.0, 0.0])),
        lambda: join_two_lines(line(), line(12, 20, kind="road_boundary")),
        lambda: join_two_lines(line(), line(400, 420)),
        lambda: with_kind(line(), "wall"),
        lambda: with_review(line(), "perhaps"),
        lambda: with_attribute(line(), "role", "middle"),
        lambda: with_attribute(line(), "width_m", "0.1"),
        lambda: with_attribute(line(), "double", "yes"),
        lambda: with_attribute(line(), "note", "x" * 501),
        lambda: with_attribute(line(kind="cable"), "role", "edge"),
        lambda: with_attribute(line(), "role", "wall_foot"),
        lambda: with_attribute(line(kind="road_boundary"), "form", "w_beam"),
    ],
)
def test_what_makes_no_sense_is_refused_in_one_line(wrong):
    with pytest.raises(UsageError) as refused:
        wrong()
    assert "\n" not in str(refused.value)
    assert refused.value.advice


def test_a_reversed_line_has_its_left_on_the_right():
    one = line(disagreement_mean_m=[0.03], bridged=[True] * 2 + [False] * 9)
    turned = reversed_line(one)
    assert turned.xyz[:, 0].tolist() == one.xyz[::-1, 0].tolist()
    assert turned.disagreement_mean_m.tolist() == [-0.03]
    assert turned.bridged.tolist() == [False] * 9 + [True] * 2
    assert np.array_equal(reversed_line(turned).xyz, one.xyz)


@pytest.mark.parametrize("at", [3.0, 3.4, 7.6, 8.0])
def test_the_longer_part_keeps_the_name(at):
    one = line()
    parts = split_line(one, np.array([at, 0.3]))
    assert parts.length_m.tolist() == pytest.approx([at, 10.0 - at])
    assert parts.id.tolist() == (["", "a"] if at < 5.0 else ["a", ""])
    assert parts.xyz[parts.offsets[1] - 1].tolist() == pytest.approx([at, 0.0, 0.1 * at])
    assert parts.xyz[parts.offsets[1]].tolist() == pytest.approx([at, 0.0, 0.1 * at])
    assert parts.sigma_xy_m == pytest.approx(0.01)
    assert np.all(np.diff(parts[0].xyz[:, 0]) > 0)
    assert np.all(np.diff(parts[1].xyz[:, 0]) > 0)


def test_both_halves_of_a_bridged_segment_are_bridged():
    one = line(bridged=[False] * 3 + [True] * 3 + [False] * 5)
    parts = split_line(one, np.array([4.5, 0.0]))
    assert parts.bridged_m.sum() == pytest.approx(one.bridged_m[0])


def test_what_was_split_can_be_joined_again():
    one = line()
    parts = split_line(one, np.array([6.3, 0.0]))
    whole = join_two_lines(parts.take([0]), parts.take([1]))
    assert whole.id.tolist() == ["a"]
    assert whole.length_m[0] == pytest.approx(10.0)
    assert not whole.bridged.any()


@pytest.mark.parametrize("turn_one", [False, True])
@pytest.mark.parametrize("turn_other", [False, True])
def test_a_joined_gap_is_bridged_whichever_way_the_lines_run(turn_one, turn_other):
    one, other = line(0, 20, name="a"), line(30, 60, name="b")
    first, second = (reversed_line(x) if turn else x for x, turn in ((one, turn_one), (other, turn_other)))
    whole = join_two_lines(first, second)
    assert len(whole) == 1
    assert whole.length_m[0] == pytest.approx(60.0)
    assert whole.bridged_m[0] == pytest.approx(10.0)
    assert whole.id.tolist() == ["b"]
    assert (whole.xyz[0, 0] > whole.xyz[-1, 0]) == turn_one


def test_numbers_of_joined_lines_are_means_by_length_and_words_those_there_are():
    one = line(
        0, 10, name="a", confidence=[0.4], width_m=[0.10], role=[""], time_start_s=[5.0], note=["worn"]
    )
    other = line(11, 41, name="b", confidence=[0.8], width_m=[np.nan], role=["edge"], time_start_s=[2.0])
    whole = join_two_lines(one, other)
    assert whole.confidence[0] == pytest.approx(0.7)
    assert whole.width_m[0] == pytest.approx(0.10)
    assert whole.role.tolist() == ["edge"]
    assert whole.time_start_s.tolist() == [2.0]
    assert whole.note.tolist() == ["worn"]


def test_lines_that_would_turn_back_are_not_joined():
    with pytest.raises(UsageError, match="double back"):
        join_two_lines(line(0, 20), line(18, 5, y=1.0))


def test_over_a_gap_a_line_runs_beside_the_one_that_goes_on_there():
    whole = arc(0, 90, 53.5, n=90, name="kerb", kind="road_boundary")
    one, other = arc(0, 20, name="a"), arc(60, 90, name="b")
    closed = join_two_lines(one, other, whole)
    away = np.hypot(*closed.xyz[:, :2].T)
    assert np.abs(away - 50.0).max() < 0.05
    assert closed.bridged_m[0] == pytest.approx(np.radians(40.0) * 50.0, abs=0.5)
    # With nothing beside it: as the ends lead, an arc within half a metre over 35 m
    alone = np.hypot(*join_two_lines(one, other).xyz[:, :2].T)
    assert np.abs(alone - 50.0).max() < 0.5


def test_another_kind_keeps_what_it_can_have():
    one = line(role=["edge"], pattern=["dashed"], width_m=[0.12], double=[True], form=["x"])
    kerb = with_kind(one, "road_boundary")
    assert (kerb.kind[0], kerb.role[0], kerb.pattern[0], kerb.form[0]) == ("road_boundary", "", "", "")
    assert np.isnan(kerb.width_m[0])
    assert not kerb.double[0]
    bar = with_kind(one, "road_marking_other")
    assert bar.width_m.tolist() == [0.12]


def test_words_are_said_and_taken_back():
    one = with_attribute(with_attribute(line(), "role", "edge"), "condition", "worn")
    assert (one.role[0], one.condition[0]) == ("edge", "worn")
    assert with_attribute(one, "role", "").role.tolist() == [""]
    assert with_attribute(one, "double", True).double.tolist() == [True]
    assert with_attribute(one, "note", "half of it is gone").note.tolist() == ["half of it is gone"]


def test_what_is_accepted_or_drawn_is_sure():
    one = line(confidence=[0.4])
    assert with_review(one, "accepted").confidence.tolist() == [1.0]
    assert with_review(one, "rejected").confidence.tolist() == [0.4]
    assert with_review(one, "rejected").review.tolist() == ["rejected"]
