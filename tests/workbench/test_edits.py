"""From what a page asks for to what is on the disk: changes of a real drawing, without a server."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import TypeAdapter, ValidationError

from linework.errors import AbsentError, UsageError
from linework.files.line_file.file import LineFile
from linework.files.vectors.read_write import read_lines
from linework.model.changes import Change
from linework.model.lines import LineSet
from linework.workbench.edits.apply import EditInputs, change_of, dashes_change
from linework.workbench.edits.keep_trace import kept_change
from linework.workbench.edits.measure import check_reach
from linework.workbench.edits.orders import ChangeOrder, EditOrder

ORDER = TypeAdapter(EditOrder)


@pytest.fixture
def line_file(drive_lines):
    crs = read_lines(drive_lines).crs
    with LineFile.opened(drive_lines, crs=crs) as line_file:
        yield line_file


def done(line_file, given=None, **edit):
    """Save an edit and return it."""
    change = change_of(ORDER.validate_python(edit), line_file.lines, given or EditInputs())
    return line_file.commit(change, who="tester", based_on=line_file.revision)


def longest(line_file, kind):
    lines = line_file.lines[kind]
    return str(lines.id[int(np.argmax(lines.length_m))])


def with_dashes(line_file):
    """Put some dashes on a marking, as extraction finds them; return its id."""
    name = longest(line_file, "lane_marking")
    xyz = one_of(line_file, name).xyz
    pieces = [xyz[k : k + 3] for k in (1, 7, 13)]
    dashes = LineSet.from_lines(pieces, crs=line_file.lines.crs, kind=["lane_marking_dash"] * 3)
    line_file.commit(Change("extract", LineSet.empty(line_file.lines.crs), dashes), who="")
    return name


def one_of(line_file, name):
    return line_file.lines.take(line_file.lines.id == name)


def test_accepting_a_dashed_line_accepts_its_dashes(line_file):
    name = with_dashes(line_file)
    done(line_file, action="accept", ids=[name])
    dashes = line_file.lines["lane_marking_dash"]
    assert one_of(line_file, name).review.tolist() == ["accepted"]
    assert one_of(line_file, name).confidence.tolist() == [1.0]
    assert np.count_nonzero(dashes.review == "accepted") == 3


def test_a_dash_that_was_rejected_by_itself_stays_so_when_its_line_is_accepted(line_file):
    name = with_dashes(line_file)
    wrong, *others = line_file.lines["lane_marking_dash"].id.tolist()
    done(line_file, action="reject", ids=[wrong])
    done(line_file, action="accept", ids=[name])
    assert one_of(line_file, wrong).review.tolist() == ["rejected"]
    assert {one_of(line_file, other).review[0] for other in others} == {"accepted"}


def test_dashes_that_were_rejected_with_their_line_are_accepted_with_it(line_file):
    name = with_dashes(line_file)
    done(line_file, action="reject", ids=[name])
    assert set(line_file.lines["lane_marking_dash"].review) == {"rejected"}
    done(line_file, action="accept", ids=[name])
    assert set(line_file.lines["lane_marking_dash"].review) == {"accepted"}


def test_dashes_follow_their_line_through_accepting_rejecting_and_restoring(line_file):
    name = with_dashes(line_file)
    for action, review in (("accept", "accepted"), ("reject", "rejected"), ("restore", "")):
        done(line_file, action=action, ids=[name])
        assert set(line_file.lines["lane_marking_dash"].review) == {review}


def test_a_rejected_kerb_takes_its_top_along_and_comes_back(line_file):
    name = longest(line_file, "road_boundary")
    n_tops = np.count_nonzero(line_file.lines.review == "rejected")
    done(line_file, action="reject", ids=[name])
    gone = line_file.lines.take(line_file.lines.review == "rejected")
    assert set(gone.kind.tolist()) == {"road_boundary", "kerb_top"}
    # Others do not read what is rejected
    assert name not in read_lines(line_file.path).id.tolist()
    done(line_file, action="restore", ids=gone.id.tolist())
    assert np.count_nonzero(line_file.lines.review == "rejected") == n_tops == 0


def test_split_and_joined_again(line_file):
    name = longest(line_file, "road_boundary")
    before = one_of(line_file, name)
    place = before.xyz[len(before.xyz) // 3, :2].tolist()
    edit = done(line_file, action="split", id=name, at=place)
    parts = edit.change.after
    assert name in parts.id.tolist()
    assert len(set(parts.id.tolist())) == 2
    assert parts.review.tolist() == ["edited", "edited"]
    done(line_file, action="join", ids=parts.id.tolist())
    whole = one_of(line_file, name)
    assert whole.length_m[0] == pytest.approx(before.length_m[0])
    assert np.array_equal(whole.bridged, before.bridged)


def test_a_moved_vertex_takes_the_height_that_was_measured(line_file):
    name = longest(line_file, "lane_marking")
    east, north, up = one_of(line_file, name).xyz[2].tolist()
    given = EditInputs(heights=np.array([[up + 0.05, 0.01]]))
    done(line_file, given, action="move", id=name, vertex=2, to=[east + 0.1, north])
    line = one_of(line_file, name)
    assert line.xyz[2].tolist() == pytest.approx([east + 0.1, north, up + 0.05])
    assert line.sigma_z_m[2] == pytest.approx(0.01)
    assert np.isnan(line.sigma_xy_m[2])
    assert line.review.tolist() == ["edited"]


def test_where_nothing_was_measured_a_vertex_is_as_high_as_its_line(line_file):
    name = longest(line_file, "lane_marking")
    east, north, up = one_of(line_file, name).xyz[2].tolist()
    given = EditInputs(heights=np.array([[np.nan, np.nan]]))
    done(line_file, given, action="insert", id=name, after=2, to=[east + 0.01, north])
    assert one_of(line_file, name).xyz[3, 2] == pytest.approx(up)


def test_a_drawn_line_is_sure_and_says_so(line_file):
    east, north, _ = line_file.lines.xyz[0].tolist()
    given = EditInputs(heights=np.array([[30.0, 0.02], [np.nan, np.nan], [32.0, 0.02]]))
    xyz = [[east, north], [east + 5.0, north], [east + 10.0, north]]
    (line,) = [done(line_file, given, action="draw", kind="fence", xyz=xyz).change.after]
    assert (line.review[0], line.method[0], line.confidence[0]) == ("drawn", "drawn", 1.0)
    assert line.xyz[:, 2].tolist() == pytest.approx([30.0, 31.0, 32.0])
    # What is drawn stays drawn when it is moved
    done(line_file, action="move", id=str(line.id[0]), vertex=0, to=[east - 1.0, north, 30.0])
    assert one_of(line_file, str(line.id[0])).review.tolist() == ["drawn"]


def test_another_kind_leaves_no_dashes_behind(line_file):
    name = with_dashes(line_file)
    done(line_file, action="kind", ids=[name], kind="road_boundary")
    assert one_of(line_file, name).kind.tolist() == ["road_boundary"]
    dashes = line_file.lines["lane_marking_dash"]
    assert np.count_nonzero(dashes.review == "rejected") == 3


def test_a_dismissal_changes_no_line_and_can_be_undone(line_file):
    before = line_file.lines
    edit = done(line_file, action="dismiss", key="gap lane_marking 1 2")
    assert edit.change.action == "dismiss gap lane_marking 1 2"
    assert line_file.lines.id.tolist() == before.id.tolist()
    assert line_file.undo(who="tester") is not None


@pytest.mark.parametrize(
    ("error", "edit"),
    [
        (AbsentError, {"action": "accept", "ids": ["nobody"]}),
        (AbsentError, {"action": "keep", "trace": "1", "first": 0, "last": 3}),
        (UsageError, {"action": "set", "ids": ["LINE"], "column": "kind", "value": "x"}),
        (UsageError, {"action": "join", "ids": ["LINE", "LINE"]}),
        (UsageError, {"action": "draw", "kind": "wall", "xyz": [[0, 0, 0], [1, 0, 0]]}),
        (UsageError, {"action": "draw", "kind": "fence", "xyz": [[0, 0], [1, 0]]}),
        (UsageError, {"action": "draw", "kind": "fence", "xyz": [[0, 0, 0], [0, 0, 0]]}),
        (UsageError, {"action": "beside", "id": "LINE", "kind": "wall", "at": [[0, 0]]}),
        (UsageError, {"action": "beside", "id": "LINE", "kind": "fence", "at": [[0, 0]]}),
        (UsageError, {"action": "wire", "xyz": [[0, 0], [20, 0, 7], [40, 0, 7]]}),
        (UsageError, {"action": "dashes", "ids": ["LINE"]}),
    ],
)
def test_what_cannot_be_done_changes_nothing(line_file, error, edit):
    name = longest(line_file, "road_boundary")
    filled = {k: name if v == "LINE" else [name if x == "LINE" else x for x in v] if isinstance(v, list) else v
              for k, v in edit.items()}  # fmt: skip
    given = EditInputs(heights=np.full((2, 2), np.nan)) if edit["action"] == "draw" else EditInputs()
    with pytest.raises(error):
        done(line_file, given, **filled)
    assert line_file.revision == 0


@pytest.mark.parametrize(
    "edit",
    [
        {"action": "explode"},
        {"action": "accept", "ids": []},
        {"action": "accept", "ids": ["a"], "more": 1},
        {"action": "accept", "ids": ["a"] * 10_001},
        {"action": "move", "id": "a", "vertex": -1, "to": [0, 0]},
        {"action": "move", "id": "a", "vertex": 0, "to": [float("nan"), 0]},
        {"action": "move", "id": "a", "vertex": 0, "to": [1e300, 0]},
        {"action": "move", "id": "a", "vertex": 0, "to": [0]},
        {"action": "draw", "kind": "fence", "xyz": [[0, 0]]},
        {"action": "join", "ids": ["a", "b", "c"]},
        {"action": "dismiss", "key": "x" * 300},
    ],
)
def test_documents_are_checked_at_the_door(edit):
    with pytest.raises(ValidationError):
        ChangeOrder.model_validate({"revision": 0, "edit": edit})


def test_places_far_from_the_survey_are_refused():
    bounds = (0.0, 0.0, 100.0, 100.0)
    check_reach(ORDER.validate_python({"action": "split", "id": "a", "at": [-200, 50]}), bounds)
    for place in ([-400, 50], [50, 401]):
        with pytest.raises(UsageError, match="outside the survey"):
            check_reach(ORDER.validate_python({"action": "split", "id": "a", "at": place}), bounds)
    order = ORDER.validate_python({"action": "move", "id": "a", "vertex": 0, "to": [0, 0, 20_000]})
    with pytest.raises(UsageError, match="height"):
        check_reach(order, bounds)


def straight(start, end, *, name="", kind="lane_marking", up=0.0, **columns):
    t = np.arange(start, end + 0.5)
    xyz = np.column_stack([t, 0.0 * t, np.full(len(t), up)])
    return LineSet.from_lines([xyz], kind=[kind], id=[name], **columns)


def test_a_kept_line_is_one_with_those_it_runs_over():
    there = LineSet.concatenate(
        [
            straight(0, 30, name="a"),
            straight(60, 90, name="b"),
            straight(20, 25, name="c", kind="road_boundary"),
        ]
    )
    change = kept_change(there, straight(25, 70), (0, 45))
    assert set(change.before.id.tolist()) == {"a", "b"}
    assert len(change.after) == 1
    assert change.after.length_m[0] == pytest.approx(90.0)
    assert change.after.review.tolist() == ["drawn"]
    assert not change.after.bridged.any()


@pytest.mark.parametrize("aside_m", [0.05, 0.2])
def test_a_followed_part_of_a_line_is_that_line(aside_m):
    """Also where images saw a metre of it elsewhere than points did."""
    there, trace = straight(0, 70, name="a", confidence=[0.7]), straight(5, 65)
    xyz = trace.xyz.copy()
    xyz[30, 1] += aside_m
    trace = trace.with_columns(xyz=xyz)
    change = kept_change(there, trace, (0, 60))
    assert change.before.id.tolist() == change.after.id.tolist() == ["a"]
    assert change.after.length_m.tolist() == pytest.approx([70.0])
    again = kept_change(straight(0, 70, name="a"), straight(-20, 100), (0, 120), straight(0, 70, name="a"))
    assert again.after.length_m.tolist() == pytest.approx([120.0])


def test_a_kept_line_stays_apart_from_one_that_only_ends_near_it():
    change = kept_change(straight(0, 30, name="a"), straight(40, 70), (0, 30))
    assert len(change.before) == 0
    whole = kept_change(straight(0, 30, name="a"), straight(40, 70), (0, 30), straight(0, 30, name="a"))
    assert whole.before.id.tolist() == ["a"]
    assert whole.after.bridged_m[0] == pytest.approx(10.0)


def test_of_a_kept_line_only_what_was_asked_for_is_kept():
    dashes = [straight(s, s + 3, kind="lane_marking_dash") for s in (0, 9, 18, 27)]
    trace = LineSet.concatenate([straight(0, 30), *dashes])
    there = straight(9, 12, name="mine", kind="lane_marking_dash")
    change = kept_change(there, trace, (0, 22))
    kept = change.after
    assert kept["lane_marking"].length_m.tolist() == [22.0]
    # The dash that was there already is not added again, the last one lies beyond
    assert kept["lane_marking_dash"].xyz[::4, 0].tolist() == [0.0, 18.0]


def test_wires_above_one_another_are_two():
    lower = straight(0, 40, name="low", kind="cable", up=6.0)
    change = kept_change(lower, straight(0, 40, kind="cable", up=7.0), (0, 40))
    assert len(change.before) == 0
    again = kept_change(lower, straight(0, 40, kind="cable", up=6.05), (0, 40))
    assert again.before.id.tolist() == ["low"]


def test_what_was_measured_of_a_wire_stays_when_a_part_is_followed_again():
    wire = straight(0, 40, name="w", kind="cable", up=6.0)
    change = kept_change(wire, straight(15, 60, kind="cable", up=6.0), (0, 45), wire)
    assert change.after.id.tolist() == ["w"] and change.before.id.tolist() == ["w"]
    assert change.after.length_m.tolist() == pytest.approx([60.0], abs=0.1)
    covered = kept_change(wire, straight(-1, 41, kind="cable", up=6.0), (0, 42), wire)
    assert covered.after.id.tolist() == ["w"]
    assert covered.after.length_m.tolist() == pytest.approx([42.0], abs=0.1)


@pytest.mark.parametrize("up", [6.0, 6.02, 6.12])
@pytest.mark.parametrize("start", [15, 15.4])
def test_a_wire_that_is_followed_again_is_bridged_only_where_it_was(up, start):
    wire = straight(0, 40, name="w", kind="cable", up=6.0)
    wire = wire.with_columns(bridged=(wire.xyz[:, 0] >= 5) & (wire.xyz[:, 0] <= 8))
    trace = straight(start, start + 45, kind="cable", up=up)
    change = kept_change(wire, trace, (0, 45), wire)
    assert change.after.length_m.tolist() == pytest.approx([start + 45.0], abs=0.2)
    assert change.after.bridged_m[0] == pytest.approx(wire.bridged_m[0])


def test_a_piece_under_the_gap_of_a_continued_wire_is_replaced():
    wire, piece = (straight(a, b, name=n, kind="cable", up=6.0) for a, b, n in ((0, 40, "w"), (42, 48, "p")))
    lines = LineSet.concatenate([wire, piece])
    change = kept_change(lines, straight(50, 80, kind="cable", up=6.0), (0, 30), wire)
    assert sorted(change.before.id.tolist()) == ["p", "w"]
    assert change.after.length_m.tolist() == pytest.approx([80.0], abs=0.1)


def test_a_wire_that_is_followed_again_from_its_end_stays_one(tmp_path):
    with LineFile.opened(tmp_path / "lines.gpkg", crs="local") as line_file:
        line_file.commit(
            Change("extract", LineSet.empty(), straight(0, 40, name="w", kind="cable", up=6.0)), who=""
        )
        there = line_file.lines
        change = kept_change(there, straight(-1, 41, kind="cable", up=6.02), (0, 42), there)
        saved = line_file.commit(change, who="tester", based_on=line_file.revision)
        assert saved.change.before.id.tolist() == ["w"]
        assert line_file.lines.length_m.tolist() == pytest.approx([42.0])
        beyond = kept_change(
            line_file.lines, straight(41, 80, kind="cable", up=6.0), (0, 39), line_file.lines
        )
        line_file.commit(beyond, who="tester", based_on=line_file.revision)
        assert line_file.lines.length_m.tolist() == pytest.approx([81.0], abs=0.1)


def test_a_solid_line_gets_no_dashes():
    line = straight(0, 60, name="a", pattern=["solid"])
    with pytest.raises(UsageError, match="the line is solid"):
        dashes_change(line, line, {"a": np.array([[9.0, 12.0], [18.0, 21.0]])})


def test_paint_that_was_taken_for_bars_goes_when_its_line_is_kept():
    bar = straight(10, 24, name="bar", kind="road_marking_other")
    assert kept_change(bar, straight(0, 40), (0, 40)).before.id.tolist() == ["bar"]


def test_tops_of_joined_kerbs_are_joined():
    def top(start, end, name):
        line = straight(start, end, name=name, kind="kerb_top", up=0.12)
        return line.with_columns(xyz=line.xyz + np.array([0.0, 0.15, 0.0]))

    feet = [straight(0, 30, name="a", kind="road_boundary"), straight(50, 90, name="b", kind="road_boundary")]
    lines = LineSet.concatenate([*feet, top(0, 29, "c"), top(51, 90, "d")])
    change = change_of(ORDER.validate_python({"action": "join", "ids": ["a", "b"]}), lines, EditInputs())
    assert set(change.before.id.tolist()) == {"a", "b", "c", "d"}
    assert change.after.kind.tolist() == ["road_boundary", "kerb_top"]
    assert change.after.length_m.tolist() == pytest.approx([90.0, 90.0])
    assert np.all(change.after[1].xyz[:, 2] == pytest.approx(0.12))
