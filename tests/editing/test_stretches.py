"""The road in stretches to look over: all of it, those first where most is expected to be wrong or missing."""

import numpy as np
import pytest

from linework.editing.queue.stretches import MISSING_PER_M, road_stretches
from linework.editing.queue.suspects import EDGE_WRONG, rank_suspects, unsure_lines
from linework.lines.along import DrivenPath
from linework.model.lines import LineSet
from linework.workbench.review.queue import queue_item
from linework.workbench.review.suspects import suspects

PATH = np.column_stack([np.arange(0.0, 180.5, 0.5), np.zeros(361), np.zeros(361)])


def everywhere(xy):
    return np.ones(len(xy), dtype=bool)


def nowhere(xy):
    return np.zeros(len(xy), dtype=bool)


def line(start, end, left, **columns):
    t = np.arange(start, end + 0.5)
    xyz = np.column_stack([t, np.full(len(t), left), np.zeros(len(t))])
    return LineSet.from_lines([xyz], **({"kind": ["lane_marking"]} | columns))


def test_every_metre_of_road_is_in_a_stretch_that_fits_on_a_screen():
    found = road_stretches(LineSet.empty(), DrivenPath.of(PATH), everywhere)
    assert len(found) == 3
    boxes = sorted(s.box.west for s in found)
    assert np.diff(boxes) == pytest.approx([60.0, 60.0], abs=1.0)
    assert all(s.box.south <= -15.0 and s.box.north >= 15.0 for s in found)
    assert [s.length_m for s in found] == pytest.approx([60.0 * MISSING_PER_M] * 3, rel=0.05)
    assert all(s.proposal == "" and s.ids == () for s in found)


def test_where_nothing_was_measured_nothing_is_missing():
    found = road_stretches(LineSet.empty(), DrivenPath.of(PATH), nowhere)
    assert rank_suspects(found) == []
    assert road_stretches(LineSet.empty(), DrivenPath.of(PATH[:0]), everywhere) == []


def test_the_stretch_with_most_unchecked_length_in_doubt_comes_first():
    lines = LineSet.concatenate(
        [
            line(0, 55, 1.7, confidence=[0.9], id=["a"]),
            line(65, 115, 1.7, confidence=[0.5], id=["b"]),
            line(125, 175, 1.7, confidence=[0.2], id=["c"], review=["accepted"]),
            line(0, 175, 300.0, confidence=[0.1], id=["far"]),
        ]
    )
    way = DrivenPath.of(PATH)
    found = rank_suspects(road_stretches(lines, way, everywhere))
    assert [int(s.at[0] // 60) for s in found] == [1, 0, 2]
    extra = [s.length_m - found[2].length_m for s in found]
    # Half of what markings leave uncertain is wrong
    assert extra == pytest.approx([0.5 * 50 * 0.5, 0.5 * 55 * 0.1, 0.0], abs=0.2)
    # What has an item of its own is not counted again
    assert [s.length_m for s in road_stretches(lines, way, everywhere, frozenset("ab"))] == pytest.approx(
        [found[2].length_m] * 3, rel=0.02
    )


def test_a_stretch_that_was_looked_over_is_known_by_its_key_whatever_changes_in_it():
    way = DrivenPath.of(PATH)
    before = {s.key for s in road_stretches(LineSet.empty(), way, everywhere)}
    after = {s.key for s in road_stretches(line(0, 100, 2.0, confidence=[0.3]), way, everywhere)}
    assert before == after and len(before) == 3
    assert all("  " not in key for key in before)


def test_sure_boundaries_without_a_kerb_are_listed_one_by_one_and_nothing_is_proposed():
    edge = line(0, 100, 4.0, kind=["road_boundary"], form=["edge"], confidence=[1.0], id=["edge"])
    kerb = line(0, 100, -4.0, kind=["road_boundary"], form=["kerb"], confidence=[0.97], id=["kerb"])
    arrow = line(20, 23, 1.0, kind=["road_marking_other"], confidence=[1.0], id=["arrow"])
    found = suspects(LineSet.concatenate([edge, kerb, arrow]), DrivenPath.of(PATH), everywhere)
    items = {s.ids: s for s in found if s.type == "line"}
    assert items[("edge",)].length_m == pytest.approx(EDGE_WRONG * 100.0)
    assert items[("edge",)].proposal == ""
    # Few were counted on fresh worlds
    assert items[("kerb",)].proposal == ""
    # Bars and arrows that were wrong were as sure as any: not accepted with what is sure
    assert not [s for s in found if s.type == "sure"]
    (rest,) = (s for s in found if s.type == "rest")
    assert rest.ids == ("arrow",)


def test_the_queue_holds_stretches_among_what_is_worth_as_much():
    unsure = line(0, 150, 1.7, confidence=[0.3], id=["unsure"])
    cable = line(0, 40, 5.0, kind=["cable"], confidence=[0.8], id=["cable"])
    found = suspects(LineSet.concatenate([unsure, cable]), DrivenPath.of(PATH), everywhere)
    listed = [s.ids[0] if s.ids else s.type for s in found]
    assert listed.index("unsure") < listed.index("stretch") < listed.index("cable")
    assert all(queue_item(s).kind == "" for s in found if s.type == "stretch")


def test_an_unsure_kerb_comes_after_an_edge_of_the_same_confidence():
    way, common = DrivenPath.of(PATH), {"kind": ["road_boundary"], "confidence": [0.5]}
    kerb, edge = (line(0, 50, 4.0, form=[form], id=[form], **common) for form in ("kerb", "edge"))
    found = {s.form: s for s in unsure_lines(LineSet.concatenate([kerb, edge]), way)}
    assert found["kerb"].length_m == found["edge"].length_m == pytest.approx(25.0)
    # Of what kerbs leave uncertain 6 % was wrong
    assert found["kerb"].gain_m == pytest.approx(0.06 * 25.0)
    assert found["edge"].gain_m == pytest.approx(25.0)
    bare, of_kerb, of_edge = (
        road_stretches(lines, way, everywhere)[0].length_m for lines in (LineSet.empty(), kerb, edge)
    )
    assert of_kerb - bare == pytest.approx(0.06 * 25.0, abs=0.05)
    assert of_edge - bare == pytest.approx(25.0, abs=0.8)


def test_road_before_and_after_the_points_is_not_looked_over():
    """A trajectory goes on for hundreds of metres beyond the points of a piece of a survey."""

    def here(xy):
        return (xy[:, 0] >= 100.0) & (xy[:, 0] <= 150.0)

    (found,) = road_stretches(line(90, 170, 2.0, confidence=[0.3]), DrivenPath.of(PATH), here)
    assert found.reason.startswith("51 m of road with 1 line")
    assert (found.box.west, found.box.east) == pytest.approx((95.0, 155.0), abs=1.0)
    assert found.at[0] == pytest.approx(125.0, abs=1.0)
