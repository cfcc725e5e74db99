"""Edits over the wire: saved when they are answered, told to all, undone, and refused when they come too late."""

from __future__ import annotations

import numpy as np
import pytest

from linework.files.vectors.read_write import read_lines


def changed(served, edit, revision=None):
    revision = served.get("/api/survey")["revision"] if revision is None else revision
    return served.post("/api/changes", {"revision": revision, "edit": edit})


def lines_of(served, kind):
    return [line for line in served.get("/api/lines")["lines"] if line["kind"] == kind]


def test_an_edit_is_in_the_file_when_it_is_answered_and_can_be_undone(served):
    line = max(lines_of(served, "road_boundary"), key=lambda line: line["length_m"])
    before = served.get("/api/survey")["revision"]
    answer = changed(served, {"action": "trim", "id": line["id"], "first": 0, "last": len(line["xyz"]) - 4})
    assert answer["revision"] == before + 1
    assert answer["can_undo"]
    assert answer["lines"][0]["review"] == "edited"
    saved = read_lines(served.lines)
    there = saved.take(saved.id == line["id"])
    assert len(there.xyz) == len(line["xyz"]) - 3
    undone = served.post("/api/undo", {})
    assert undone["can_redo"]
    assert np.allclose(undone["lines"][0]["xyz"], line["xyz"])
    assert len(served.post("/api/redo", {})["lines"][0]["xyz"]) == len(line["xyz"]) - 3
    record = served.get("/api/history")[-1 - before]
    assert (record["action"], record["ids"], record["undone"]) == ("trim", [line["id"]], False)


def test_heights_of_moved_and_drawn_vertices_come_from_the_points(served):
    line = max(lines_of(served, "lane_marking"), key=lambda line: line["length_m"])
    east, north, up = line["xyz"][4]
    answer = changed(served, {"action": "move", "id": line["id"], "vertex": 4, "to": [east + 0.3, north]})
    moved = answer["lines"][0]
    assert moved["xyz"][4][:2] == pytest.approx([east + 0.3, north], abs=1e-3)
    assert moved["xyz"][4][2] == pytest.approx(up, abs=0.05)
    assert moved["sigma_z_m"][4] is not None
    assert moved["sigma_xy_m"][4] is None
    places = [[east, north], [east + 2.0, north + 0.5]]
    drawn = changed(served, {"action": "draw", "kind": "lane_marking", "xyz": places})["lines"][0]
    assert [z for _, _, z in drawn["xyz"]] == pytest.approx([up, up], abs=0.15)
    assert (drawn["review"], drawn["method"], drawn["confidence"]) == ("drawn", "drawn", 1.0)


def test_a_line_is_put_beside_another_at_measured_heights(served):
    line = max(lines_of(served, "lane_marking"), key=lambda line: line["length_m"])
    (e0, n0, _), (e1, n1, _) = line["xyz"][2], line["xyz"][-3]
    long = np.hypot(e1 - e0, n1 - n0)
    left = np.array([n0 - n1, e1 - e0]) / long
    at = [(np.array(line["xyz"][k][:2]) + 0.5 * left).tolist() for k in (2, -3)]
    edit = {"action": "beside", "id": line["id"], "kind": "road_marking_other", "at": at}
    (new,) = changed(served, edit)["lines"]
    assert (new["kind"], new["review"]) == ("road_marking_other", "drawn")
    assert new["length_m"] == pytest.approx(long, rel=0.05)
    along = [np.hypot(e - e0, n - n0) for e, n, _ in line["xyz"]]
    for e, n, z in new["xyz"]:
        assert z == pytest.approx(
            np.interp(np.hypot(e - e0, n - n0), along, [v[2] for v in line["xyz"]]), abs=0.1
        )
    assert any(sigma is not None for sigma in new["sigma_z_m"])


def test_a_wire_hangs_through_three_places(served):
    east, north, up = lines_of(served, "lane_marking")[0]["xyz"][0]
    places = [[east, north, up + 7.0], [east + 40.0, north, up + 7.4], [east + 20.0, north, up + 6.4]]
    (wire,) = changed(served, {"action": "wire", "xyz": places})["lines"]
    assert wire["kind"] == "cable"
    assert min(z for _, _, z in wire["xyz"]) == pytest.approx(up + 6.4, abs=0.05)
    nothing = [[*place[:2]] for place in places]
    answer = served.client.post(
        "/api/changes",
        json={"revision": served.get("/api/survey")["revision"], "edit": {"action": "wire", "xyz": nothing}},
    )
    assert answer.status_code == 400
    assert "no cable was measured" in answer.json()["problem"]


def test_a_stale_edit_is_refused_and_changes_nothing(served):
    line = lines_of(served, "road_boundary")[0]
    revision = served.get("/api/survey")["revision"]
    changed(served, {"action": "accept", "ids": [line["id"]]}, revision)
    late = {"revision": revision, "edit": {"action": "reject", "ids": [line["id"]]}}
    answer = served.client.post("/api/changes", json=late)
    assert answer.status_code == 412
    assert line["id"] in answer.json()["problem"]
    assert served.get("/api/survey")["revision"] == revision + 1


@pytest.mark.parametrize(
    ("edit", "status"),
    [
        ({"action": "accept", "ids": ["nobody"]}, 404),
        ({"action": "split", "id": "nobody", "at": [9e7, 0]}, 400),
        ({"action": "keep", "trace": "none", "first": 0, "last": 1}, 400),
        ({"action": "draw", "kind": "wall", "xyz": [[0, 0], [1, 1]]}, 400),
        ({"action": "explode"}, 422),
    ],
)
def test_problems_are_one_line_with_a_status(served, edit, status):
    revision = served.get("/api/survey")["revision"]
    answer = served.client.post("/api/changes", json={"revision": revision, "edit": edit})
    assert answer.status_code == status, answer.text
    assert set(answer.json()) == {"problem", "status"}
    assert served.get("/api/survey")["revision"] == revision


def test_the_queue_is_settled_step_by_step(served):
    queue = served.get("/api/queue")
    assert queue
    keys = [item["key"] for item in queue]
    assert len(set(keys)) == len(keys)
    first = queue[0]
    west, south, east, north = first["box"]
    assert west <= first["at"][0] <= east
    assert south <= first["at"][1] <= north
    changed(served, {"action": "dismiss", "key": first["key"]})
    assert first["key"] not in [item["key"] for item in served.get("/api/queue")]
    served.post("/api/undo", {})
    assert first["key"] in [item["key"] for item in served.get("/api/queue")]


def test_a_line_that_was_judged_is_not_in_the_queue(served):
    line = next(item for item in served.get("/api/queue") if item["type"] in ("line", "sure"))
    changed(served, line["proposal"] or {"action": "accept", "ids": line["ids"]})
    assert line["key"] not in [item["key"] for item in served.get("/api/queue")]


def test_an_edit_that_comes_again_under_its_key_is_made_once(served):
    line = max(lines_of(served, "lane_marking"), key=lambda line: line["length_m"])
    document = {
        "revision": served.get("/api/survey")["revision"],
        "edit": {"action": "draw", "kind": "lane_marking", "xyz": line["xyz"][:5]},
    }
    first, again = (
        served.client.post("/api/changes", json=document, headers={"Idempotency-Key": "one-of-mine"}).json()
        for _ in range(2)
    )
    assert again == first
    assert served.get("/api/survey")["revision"] == document["revision"] + 1
    assert served.get("/api/lines")["can_undo"]
    served.post("/api/undo", {})
    refused = served.client.post("/api/changes", json=document, headers={"Idempotency-Key": "x" * 65})
    assert refused.status_code == 422
