"""Lines like one that was corrected: what an edit teaches, what is compared, and what is listed."""

from __future__ import annotations

import numpy as np
from tests.workbench.alike_lines import drawn_dashes

from linework.editing.edits.attributes import with_attribute, with_kind, with_review
from linework.editing.queue.alike import line_measures, lines_alike
from linework.lines.along import DrivenPath
from linework.model.changes import Change
from linework.model.lines import LineSet
from linework.workbench.review.alike import alike_of, population_of, taught_by

PATH = np.column_stack([np.arange(0.0, 200.0), np.zeros(200), np.zeros(200)])


def survey():
    """Return 20 right dashes along the road, and 6 false ones: across it, short, unsure, far out."""
    rng = np.random.default_rng(7)
    lines, confidence = [], []
    for k in range(20):
        east, length = 9.0 * k, 3.0 + 0.1 * rng.standard_normal()
        lines.append(np.array([[east, 1.75, 0.0], [east + length, 1.75 + 0.02 * rng.standard_normal(), 0.0]]))
        confidence.append(rng.uniform(0.9, 0.999))
    for k in range(6):
        east, length = 20.0 + 25.0 * k, 1.0 + 0.1 * rng.standard_normal()
        lines.append(np.array([[east, 7.0, 0.0], [east + 0.1 * rng.standard_normal(), 7.0 + length, 0.0]]))
        confidence.append(rng.uniform(0.6, 0.8))
    n = len(lines)
    return LineSet.from_lines(
        lines, kind=["lane_marking_dash"] * n, id=[f"d{k}" for k in range(n)], confidence=confidence
    )


def like(taught, lines):
    whole, chosen = population_of(taught, lines)
    own = whole.take(chosen)
    measures = line_measures(whole, chosen, DrivenPath.of(PATH))
    return [(str(own.id[one.line]), one) for one in alike_of(taught, own, measures)]


def rejected(lines, *numbers):
    chosen = lines.take(list(numbers))
    return Change("reject", chosen, with_review(chosen, "rejected"))


def after(lines, change):
    return LineSet.concatenate([lines.take(~np.isin(lines.id, change.before.id)), change.after])


def test_a_rejected_line_lists_the_others_with_its_fault_and_says_why():
    lines = survey()
    change = rejected(lines, 20)
    taught = taught_by(change)
    found = like(taught, after(lines, change))
    assert taught.mend == {"action": "reject"}
    assert {name for name, _ in found[:5]} == {"d21", "d22", "d23", "d24", "d25"}
    assert len(found) <= 7
    assert {"length", "distance from the path", "direction to the path", "confidence"} & set(
        found[0][1].because
    )
    assert [one.chance for _, one in found] == sorted(one.chance for _, one in found)


def test_the_order_and_the_units_of_lines_do_not_matter():
    lines = survey()
    names = [name for name, _ in like(taught_by(rejected(lines, 20)), lines)]
    turned = lines.take(np.arange(len(lines))[::-1])
    assert names == [name for name, _ in like(taught_by(rejected(turned, len(lines) - 21)), turned)]
    rng = np.random.default_rng(1)
    measures = {name: rng.standard_normal(40) for name in "abc"}
    masks = np.arange(40) == 0, np.zeros(40, dtype=bool), np.arange(40) > 0
    plain = [one.line for one in lines_alike(*masks, measures)]
    assert plain == [one.line for one in lines_alike(*masks, {k: 1000.0 * v for k, v in measures.items()})]


def test_what_a_person_called_right_is_not_listed_and_keeps_others_from_being():
    lines = survey()
    # All other false-looking ones are right, a person says of one: those less alike than it go, too
    taught = taught_by(rejected(lines, 20))
    every = [name for name, _ in like(taught, lines)]
    kept = lines.with_columns(review=np.where(lines.id == every[0], "accepted", ""))
    assert like(taught, kept) == []
    kept = lines.with_columns(review=np.where(lines.id == every[2], "accepted", ""))
    assert [name for name, _ in like(taught, kept)] == every[:2]


def test_few_lines_teach_nothing():
    lines = survey().take([20, 21, 22])
    assert like(taught_by(rejected(lines, 0)), lines) == []


def test_an_edit_teaches_what_can_be_done_elsewhere():
    lines = survey()
    one = lines.take([20])
    kind = taught_by(Change("kind", one, with_kind(one, "road_marking_other")))
    assert kind.mend == {"action": "kind", "kind": "road_marking_other"}
    set_ = taught_by(Change("set", one, with_attribute(one, "role", "centre")))
    assert set_.mend == {"action": "set", "column": "role", "value": "centre"}
    assert taught_by(Change("delete", one, LineSet.empty())).mend == {"action": "delete"}
    noted = with_attribute(one, "note", "look again")
    moved = one.with_columns(xyz=one.xyz + 0.1)
    for action, new in (("set", noted), ("move", moved), ("accept", with_review(one, "accepted"))):
        assert taught_by(Change(action, one, new)) is None
    assert taught_by(Change("dismiss x", LineSet.empty(), LineSet.empty())) is None


def test_dashes_that_go_with_their_marking_are_no_example():
    lines = survey()
    marking = LineSet.from_lines([lines[20].xyz], kind=["lane_marking"], id=["m"])
    both = LineSet.concatenate([marking, lines.take([20])])
    taught = taught_by(Change("reject", both, with_review(both, "rejected")))
    assert taught.examples.id.tolist() == ["m"]


def test_an_attribute_is_looked_for_where_it_was_the_same():
    lines = survey().with_columns(role=np.array(["centre"] * 22 + ["edge"] * 4))
    one = lines.take([20])
    taught = taught_by(Change("set", one, with_attribute(one, "role", "edge")))
    assert [name for name, _ in like(taught, lines)][:1] == ["d21"]
    assert not {"d22", "d23", "d24", "d25"} & {name for name, _ in like(taught, lines)}


def test_the_server_lists_what_an_edit_taught(served):
    dashes = drawn_dashes(served)
    revision = served.get("/api/survey")["revision"]
    edit = {"action": "reject", "ids": [dashes[0]["id"]]}
    number = served.post("/api/changes", {"revision": revision, "edit": edit})["number"]
    found = served.get(f"/api/alike?edit={number}")
    assert (found["kind"], found["mend"]) == ("lane_marking_dash", {"action": "reject"})
    assert found["n_looked"] == len(dashes)
    listed = {item["id"] for item in found["items"]}
    assert dashes[1]["id"] in listed
    assert listed < {line["id"] for line in dashes} - {dashes[0]["id"]}
    assert all(item["reason"].startswith("like it in ") for item in found["items"])
    served.post("/api/undo", {})
    assert served.get(f"/api/alike?edit={number}")["mend"] is None
