"""Templates of cross-sections: kept beside the lines, followed with a line, added to a saved one, one edit each."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from tests.workbench.follow_talk import longest, talk_with

from linework.files.vectors.read_write import read_lines

KERB = {
    "name": "kerb",
    "nodes": [
        {"name": "top", "edge": "top", "across_m": 0.02, "up_m": 0.1, "kind": "kerb_top", "role": ""},
        {
            "name": "beside",
            "edge": "fixed",
            "across_m": -1.0,
            "up_m": 0.0,
            "kind": "edge_other",
            "role": "verge",
        },
    ],
}


@pytest.fixture(scope="module")
def truth(made_drive):
    return read_lines(made_drive / "truth.gpkg")


def put(served, template):
    return served.client.put("/api/templates", json=template)


def in_order(lines):
    return lines.take(np.argsort(lines.id))


def off_m(xyz, truth):
    return shapely.distance(shapely.LineString(truth[:, :2]), shapely.points(np.asarray(xyz)[:, :2]))


def test_templates_are_kept_beside_the_lines(served):
    assert served.get("/api/templates") == {"templates": []}
    assert put(served, KERB).status_code == 200
    assert served.get("/api/templates") == {"templates": [KERB]}
    text = served.lines.with_suffix(".templates.csv").read_text(encoding="utf-8")
    assert text.splitlines()[1] == "kerb,top,top,0.020,0.100,kerb_top,"


@pytest.mark.parametrize(
    "change",
    [
        {"edge": "hedge"},
        {"kind": "nothing"},
        {"name": "a,b"},
        {"name": " "},
        {"name": "beside"},
        {"role": 'a"b'},
        {"role": "verge"},
    ],
)
def test_a_template_with_a_fault_is_refused_and_the_old_ones_stay(served, change):
    put(served, KERB)
    wrong = {"name": "wrong", "nodes": [{**KERB["nodes"][0], **change}, KERB["nodes"][1]]}
    answer = put(served, wrong)
    assert answer.status_code in (400, 422)
    assert served.get("/api/templates") == {"templates": [KERB]}


def test_a_line_is_followed_with_its_template_and_kept_as_one_edit(served, truth):
    put(served, KERB)
    kerb = longest(truth, "road_boundary")
    at = np.round(kerb[len(kerb) // 2, :2], 3).tolist()
    before = read_lines(served.lines)
    with talk_with(served) as talk:
        *_, stopped = talk.follow(type="pick", at=at, kind="road_boundary", template="kerb")
    assert stopped["unseen"] == []
    assert [line["method"] for line in stopped["lines"]].count("template") == 2
    top = next(
        line for line in stopped["lines"] if (line["kind"], line["method"]) == ("kerb_top", "template")
    )
    n = len(stopped["lines"][0]["xyz"])
    edit = {"action": "keep", "trace": stopped["trace"], "first": n // 4, "last": n - 1}
    revision = served.get("/api/survey")["revision"]
    served.post("/api/changes", {"revision": revision, "edit": edit})
    saved = read_lines(served.lines)
    beside = saved.take((saved.kind == "edge_other") & (saved.method == "template"))
    assert len(beside) == 1
    # As long as what was kept, and a metre beside it
    assert 0.5 < beside.length_m[0] / stopped["lines"][0]["length_m"] < 0.9
    assert np.median(off_m(beside.xyz, kerb)) == pytest.approx(1.0, abs=0.05)
    assert np.quantile(off_m(top["xyz"], longest(truth, "kerb_top")), 0.9) < 0.05
    # A top that was there already is one with the template's
    near = [
        k
        for k, line in enumerate(saved)
        if line.kind == "kerb_top" and np.median(off_m(line.xyz, kerb)) < 0.3
    ]
    assert len(near) == len([1 for line in before if line.kind == "kerb_top" and np.median(off_m(line.xyz, kerb)) < 0.3])  # fmt: skip
    served.post("/api/undo", {})
    assert in_order(read_lines(served.lines)) == in_order(before)


def test_the_lines_of_a_template_are_added_beside_a_saved_line(served, truth):
    put(served, KERB)
    line = max((one for one in served.get("/api/lines")["lines"] if one["kind"] == "road_boundary"), key=lambda one: one["length_m"])  # fmt: skip
    revision = served.get("/api/survey")["revision"]
    order = {"revision": revision, "edit": {"action": "template", "id": line["id"], "template": "kerb"}}
    added = served.post("/api/changes", order)
    assert sorted(one["kind"] for one in added["lines"]) == ["edge_other", "kerb_top"]
    assert line["id"] not in added["removed"]
    served.post("/api/undo", {})
    order["edit"]["template"] = "absent"
    answer = served.client.post(
        "/api/changes", json={**order, "revision": served.get("/api/survey")["revision"]}
    )
    assert answer.status_code == 422 or answer.status_code == 400
    assert "no template" in answer.json()["problem"]


def test_what_is_edited_by_hand_stays_when_the_page_saves_or_removes_one(served):
    put(served, KERB)
    path = served.lines.with_suffix(".templates.csv")
    by_hand = "wall,foot,foot,2.000,0.000,edge_other,wall_foot\n"
    text = path.read_text(encoding="utf-8").replace("0.100", "0.150") + by_hand
    path.write_text(text, encoding="utf-8")
    other = {"name": "other", "nodes": KERB["nodes"][1:]}
    saved = put(served, other).json()["templates"]
    assert [one["name"] for one in saved] == ["kerb", "wall", "other"]
    assert saved[0]["nodes"][0]["up_m"] == 0.15
    assert by_hand in path.read_text(encoding="utf-8")
    again = put(served, {**other, "nodes": KERB["nodes"]}).json()["templates"]
    assert [len(one["nodes"]) for one in again] == [2, 1, 2]
    left = served.client.request("DELETE", "/api/templates", params={"name": "other"}).json()["templates"]
    assert left == saved[:2]
    # What cannot be read is not written over
    path.write_text(text.replace("edge_other", "hedge"), encoding="utf-8")
    wrong = path.read_text(encoding="utf-8")
    answer = put(served, KERB)
    assert answer.status_code == 422 and "line 3" in answer.json()["problem"]
    assert path.read_text(encoding="utf-8") == wrong
    path.unlink()
