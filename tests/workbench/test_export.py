"""Lines as the browser gets them: every format, a choice of lines, the survey's feature codes."""

from __future__ import annotations

import io
import json
import zipfile
from urllib.parse import unquote

import pytest
from tests.workbench.serve_process import Served

from linework.files.vectors.read_write import read_lines
from linework.model.lines import LineSet

CODES = "kind,layer,code,color\nlane_marking,ROAD-MARK,210,#ffff00\n"


def export(served: Served, **order: object):
    return served.client.post("/api/export", json={"format": "gpkg", **order})


def lines_in(answer, path) -> LineSet:
    assert answer.status_code == 200, answer.text
    path.write_bytes(answer.content)
    return read_lines(path)


def test_a_geopackage_holds_the_lines_as_they_are_saved(served, tmp_path):
    answer = export(served)
    found = lines_in(answer, tmp_path / "a.gpkg")
    assert answer.headers["content-disposition"].endswith("lines.gpkg")
    assert set(found.id) == set(read_lines(served.lines).id)
    assert found.length_m.sum() == pytest.approx(read_lines(served.lines).length_m.sum(), abs=1e-6)


def test_the_same_lines_give_the_same_bytes(served):
    assert export(served, format="dxf").content == export(served, format="dxf").content


@pytest.mark.parametrize("suffix", ["geojson", "parquet", "fgb", "landxml"])
def test_other_formats_are_read_back(served, tmp_path, suffix):
    answer = export(served, format=suffix)
    assert len(lines_in(answer, tmp_path / f"a.{suffix}")) == len(read_lines(served.lines))
    words = unquote(answer.headers["linework-warnings"])
    assert ("bridged" in words) == (suffix in ("fgb", "landxml"))
    assert "/tmp" not in words


def test_a_choice_of_kinds_and_of_lines(served, tmp_path):
    kept = read_lines(served.lines)
    assert set(lines_in(export(served, kinds=["road_boundary"]), tmp_path / "b.gpkg").kind) == {
        "road_boundary"
    }
    ids = kept.id[:2].tolist()
    assert lines_in(export(served, ids=ids), tmp_path / "c.gpkg").id.tolist() == ids
    nothing = export(served, kinds=["cable"], ids=ids)
    assert nothing.status_code == 422
    assert "no lines to export" in nothing.json()["problem"]


def test_rejected_lines_are_left_out(served_alone, tmp_path):
    served: Served = served_alone
    rejected = served.get("/api/lines")["lines"][0]["id"]
    served.post("/api/changes", {"revision": 0, "edit": {"action": "reject", "ids": [rejected]}})
    assert rejected not in lines_in(export(served), tmp_path / "d.gpkg").id


def test_lanes_need_a_format_that_has_them(served):
    refused = export(served, format="fgb", lanes=True)
    assert refused.status_code == 422
    assert "--" not in refused.json()["problem"]
    assert export(served, format="osm", lanes=True, location="urban").status_code == 200


def test_the_table_of_feature_codes_is_kept_and_used(served_alone):
    ezdxf = pytest.importorskip("ezdxf")
    served: Served = served_alone
    assert served.get("/api/codes") == {"text": ""}
    assert served.client.put("/api/codes", json={"text": CODES}).json() == {"text": CODES}
    assert served.get("/api/codes") == {"text": CODES}
    assert (served.lines.parent / "lines.codes.csv").read_text() == CODES
    answer = export(served, format="dxf", coded=True)
    assert answer.headers["content-disposition"].endswith("lines.dxf.zip")
    with zipfile.ZipFile(io.BytesIO(answer.content)) as archive:
        assert sorted(archive.namelist()) == ["lines.dxf", "lines.prj"]
        drawing = ezdxf.read(io.StringIO(archive.read("lines.dxf").decode()))
    layers = {entity.dxf.layer for entity in drawing.modelspace()}
    assert "ROAD-MARK" in layers
    assert "road_boundary" in unquote(answer.headers["linework-warnings"])


def test_a_table_with_a_fault_is_refused_and_the_old_one_stays(served_alone):
    served: Served = served_alone
    served.client.put("/api/codes", json={"text": CODES})
    for text, word in (
        ("layer\nA\n", "kind"),
        ("kind,layer\ncable,A:B\n", "A:B"),
        ("kind,layer,color\ncable,A,red\n", "red"),
    ):
        refused = served.client.put("/api/codes", json={"text": text})
        assert refused.status_code == 422
        assert "lines.codes.csv" in refused.json()["problem"] and word in refused.json()["problem"]
        assert "/" not in refused.json()["problem"].split("lines.codes.csv")[0]
    assert served.get("/api/codes") == {"text": CODES}


def test_the_table_is_no_way_out_of_the_survey(served_alone, tmp_path):
    served: Served = served_alone
    (tmp_path / "secret.txt").write_text("kind,layer\nsecret,S\n")
    path = served.lines.parent / "lines.codes.csv"
    path.symlink_to(tmp_path / "secret.txt")
    assert served.client.get("/api/codes").status_code == 422
    assert export(served, format="dxf", coded=True).status_code == 422
    served.client.put("/api/codes", json={"text": CODES})
    assert "secret" in (tmp_path / "secret.txt").read_text()


@pytest.mark.parametrize(
    "text", ["kind,layer\n\ud800,A\n", "kind,layer\ncable,\x00\n", "\n" * 9, "x" * 600_000, ""]
)
def test_odd_tables_are_refused_in_one_line(served, text):
    answer = served.client.put(
        "/api/codes", content=json.dumps({"text": text}), headers={"Content-Type": "application/json"}
    )
    assert 400 <= answer.status_code < 500
    assert "\n" not in answer.json()["problem"]
    assert served.get("/api/codes") == {"text": ""}


def test_odd_orders_are_refused_in_one_line(served):
    for order in (
        {"format": "exe"},
        {"ids": ["x"] * 20_001},
        {"kinds": "cable"},
        {"location": "moon"},
        {"path": "/etc"},
    ):
        answer = export(served, **order)
        assert 400 <= answer.status_code < 500
        assert "\n" not in answer.json()["problem"]


def test_a_table_that_is_not_text_is_one_line(served_alone):
    served: Served = served_alone
    (served.lines.parent / "lines.codes.csv").write_bytes(b"kind,layer\nlane_marking,Stra\xdfe\n")
    assert served.client.get("/api/codes").status_code == 422
    assert export(served, format="dxf", coded=True).status_code == 422


def test_codes_without_a_table_are_missed_aloud(served_alone):
    answer = export(served_alone, format="dxf", coded=True)
    assert "no feature codes" in unquote(answer.headers["linework-warnings"])
