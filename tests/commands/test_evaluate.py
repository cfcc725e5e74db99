"""`linework evaluate` as a user runs it."""

import json

import numpy as np
import pytest
from matplotlib.image import imread
from tests.scenes.places import REAL

from linework.cli.app import main
from linework.crs import parse_crs
from linework.files.vectors.read_write import write_lines
from linework.model.lines import LineSet

AV2 = REAL / "av2/av2_adcf7d18_map.geojson"
ORIGIN = np.array([691_000.0, 5_336_000.0, 500.0])


def straight(y=0.0, x1=100.0, z=0.0):
    return ORIGIN + np.array([[0, y, z], [x1, y, z]])


def save(path, *vertices, kind="guardrail", layers=(), crs="local", **columns):
    kinds = [kind] * len(vertices) if isinstance(kind, str) else kind
    write_lines(LineSet.from_lines(vertices, kind=kinds, crs=crs, **columns), path, kinds=layers)
    return path


@pytest.fixture
def files(tmp_path):
    """Lines 2 cm to the left of a guardrail; a second guardrail was not found."""
    found = save(tmp_path / "lines.gpkg", straight(0.02))
    truth = save(tmp_path / "truth.gpkg", straight(), straight(10), observed=[True, True, True, True])
    return found, truth


def run(capsys, *arguments):
    code = main(["evaluate", *map(str, arguments)])
    out, err = capsys.readouterr()
    return code, out, err


def scores(capsys, *arguments):
    code, out, err = run(capsys, *arguments, "--json")
    assert code == 0, err
    return json.loads(out)


def test_the_table(files, capsys):
    code, out, err = run(capsys, *files)
    assert (code, err) == (0, "")
    row = next(line for line in out.splitlines() if "guardrail" in line)
    assert row.split() == [
        "guardrail", "1", "/", "2", "200.0", "200.0", "50.0", "%", "50.0", "%", "100.0", "%", "50.0", "%",
        "0.0", "%", "5.0", "1.00", "0.0",
    ]  # fmt: skip


def test_json_holds_everything(files, capsys):
    s = scores(capsys, *files, "--tolerance-m", "0.05")
    assert s["tolerance_m"] == 0.05
    assert s["overall"]["at"]["completeness"] == pytest.approx(0.5)
    assert s["overall"]["at"]["lateral"]["bias_m"] == pytest.approx(0.02)
    assert [c["tolerance_m"] for c in s["kinds"][0]["curve"]] == [0.05, 0.1, 0.2, 0.5]
    assert s["overall"]["chamfer_ap"] == {"0.2": 0.5, "0.5": 0.5, "1": 0.5}


def test_the_observed_truth_survives_the_file(tmp_path, capsys):
    found = save(tmp_path / "lines.gpkg", straight())
    truth = save(tmp_path / "truth.gpkg", straight(), straight(10), observed=[True, True, False, False])
    at = scores(capsys, found, truth)["overall"]["at"]
    assert (at["completeness"], at["completeness_all"]) == (1, 0.5)


def test_a_picture_of_found_missed_and_wrong(tmp_path, capsys):
    found = save(tmp_path / "lines.gpkg", straight(), straight(-10))
    truth = save(tmp_path / "truth.gpkg", straight(), straight(10))
    picture = tmp_path / "hits.png"
    code, _, err = run(capsys, found, truth, "--picture", picture)
    assert (code, err) == (0, "")
    colours = (imread(picture)[:, :, :3] * 255).round().astype(int).reshape(-1, 3)
    for colour in ((0x2A, 0x9D, 0x3F), (0xD1, 0x24, 0x2F), (0xF5, 0x8B, 0x1F)):
        assert (colours == colour).all(axis=1).sum() > 500
    first = picture.read_bytes()
    code, _, err = run(capsys, found, truth, "--picture", picture)
    assert code == 6
    assert "hits.png" in err
    assert "--overwrite" in err
    assert run(capsys, found, truth, "--picture", picture, "--overwrite")[0] == 0
    assert picture.read_bytes() == first


def test_an_empty_layer_is_a_score_of_nothing_found(tmp_path, capsys):
    found = save(tmp_path / "lines.gpkg", straight(), layers=["guardrail", "cable"])
    truth = save(tmp_path / "truth.gpkg", straight(), straight(5, z=6), kind=["guardrail", "cable"])
    kinds = {k["kind"]: k["at"]["completeness"] for k in scores(capsys, found, truth)["kinds"]}
    assert kinds == {"guardrail": 1, "cable": 0}


def test_an_empty_layer_of_edges_beside_boundaries_or_poles_makes_none_wrong(tmp_path, capsys):
    pole = ORIGIN + np.array([[0, 9, 0], [0, 9, 8]])
    found = save(
        tmp_path / "lines.gpkg", straight(), straight(3), pole, kind=["guardrail", "edge_other", "pole"]
    )
    layers = ("guardrail", "edge_other", "pole", "candidate")
    truth = save(tmp_path / "truth.gpkg", straight(), layers=layers)
    s = scores(capsys, found, truth)
    assert [k["kind"] for k in s["kinds"]] == ["guardrail"]
    s = scores(capsys, found, truth, "--kinds", "edge_other,pole")
    assert {k["kind"]: k["at"]["correctness"] for k in s["kinds"]} == {"edge_other": 0, "pole": 0}


def test_names_of_a_reference_may_stand_for_poles(tmp_path, capsys):
    pole = ORIGIN + np.array([[0, 9, 0], [0, 9, 8]])
    found = save(tmp_path / "lines.gpkg", pole, kind="pole")
    truth = save(tmp_path / "truth.gpkg", pole, kind="mast")
    assert scores(capsys, found, truth, "--kind-map", "mast=pole")["overall"]["at"]["completeness"] == 1


def test_kinds_of_one_side_only_are_left_out_and_named(tmp_path, capsys):
    found = save(tmp_path / "lines.gpkg", straight(), straight(3), kind=["guardrail", "fence"])
    truth = save(tmp_path / "truth.gpkg", straight(), straight(5), kind=["guardrail", "lane_marking"])
    code, out, err = run(capsys, found, truth)
    assert code == 0
    assert "fence" in err
    assert "lane_marking" in err
    assert "fence" not in out
    s = scores(capsys, found, truth, "--kinds", "guardrail,fence,lane_marking")
    assert [k["kind"] for k in s["kinds"]] == ["guardrail", "fence", "lane_marking"]
    assert (s["overall"]["at"]["completeness"], s["overall"]["at"]["correctness"]) == (0.5, 0.5)


def foreign_map(path):
    """A map with names of its own: paint by its mark, edges by their kind."""

    def feature(y, **properties):
        line = {"type": "LineString", "coordinates": straight(y).tolist()}
        return {"type": "Feature", "properties": properties, "geometry": line}

    features = [
        feature(0, kind="lane_boundary", mark="SOLID_WHITE"),
        feature(3, kind="lane_boundary", mark="NONE"),
        feature(6, kind="drivable_area_edge"),
    ]
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    return path


def test_names_of_another_map(tmp_path, capsys):
    truth = foreign_map(tmp_path / "map.geojson")
    found = save(
        tmp_path / "lines.gpkg", straight(), straight(3), straight(6),
        kind=["lane_marking", "lane_marking", "road_boundary"],
    )  # fmt: skip
    mapping = "SOLID_WHITE=lane_marking, drivable_area_edge=road_boundary"
    s = scores(capsys, found, truth, "--kind-field", "mark", "--kind-map", mapping, "--crs", "local")
    figures = {k["kind"]: (k["at"]["completeness"], k["at"]["correctness"]) for k in s["kinds"]}
    assert figures == {"lane_marking": (1, 0.5), "road_boundary": (1, 1)}
    code, _, err = run(capsys, found, truth, "--kind-map", "SOLID=lane_marking", "--crs", "local")
    assert code == 3
    assert "lane_boundary" in err


def test_the_hd_map(tmp_path, capsys):
    if not AV2.exists():
        pytest.skip(f"{AV2} is not there")
    document = json.loads(AV2.read_text())
    marked = [f for f in document["features"] if f["properties"].get("mark") == "SOLID_WHITE"]
    edges = [f for f in document["features"] if f["properties"]["kind"] == "drivable_area_edge"]
    lines = [np.array(f["geometry"]["coordinates"], dtype=float) for f in [*marked, *edges]]
    kinds = ["lane_marking"] * len(marked) + ["road_boundary"] * len(edges)
    found = save(tmp_path / "lines.gpkg", *lines, kind=kinds)
    mapping = "SOLID_WHITE=lane_marking,drivable_area_edge=road_boundary"
    s = scores(capsys, found, AV2, "--kind-field", "mark", "--kind-map", mapping, "--crs", "local")
    assert [(k["kind"], k["n_reference"]) for k in s["kinds"]] == [("lane_marking", 60), ("road_boundary", 8)]
    assert s["overall"]["at"]["completeness"] == 1


def test_a_real_place_against_none_needs_crs(tmp_path, capsys):
    found = save(tmp_path / "lines.gpkg", straight(), crs=parse_crs("EPSG:25832"))
    truth = save(tmp_path / "truth.gpkg", straight())
    code, _, err = run(capsys, found, truth)
    assert code == 3
    assert "--crs" in err
    assert scores(capsys, found, truth, "--crs", "EPSG:25832")["overall"]["at"]["completeness"] == 1


@pytest.mark.parametrize(
    ("arguments", "code", "said"),
    [
        (["{found}", "{dir}/none.gpkg"], 3, "none.gpkg"),
        (["{found}", "{text}"], 3, "text.gpkg"),
        (["{found}", "{fence}"], 3, "no kind in common"),
        (["{found}", "{truth}", "--kinds", "gardrail"], 2, "gardrail"),
        (["{found}", "{truth}", "--kinds", ","], 2, "--kinds"),
        (["{found}", "{truth}", "--kind-map", "a"], 2, "NAME=KIND"),
        (["{found}", "{truth}", "--kind-map", "a=rail"], 2, "rail"),
        (["{found}", "{truth}", "--tolerance-m", "0"], 2, "tolerance"),
        (["{found}", "{truth}", "--tolerance-m", "nan"], 2, "tolerance"),
        (["{found}", "{truth}", "--picture", "{dir}/hits.jpg"], 2, ".png"),
        (["{found}", "{truth}", "--crs", "EPSG:0"], 3, "EPSG:0"),
        (["{found}"], 2, "REFERENCE"),
    ],
)
def test_what_cannot_be_done_is_one_line(tmp_path, capsys, files, arguments, code, said):
    (tmp_path / "text.gpkg").write_text("not a GeoPackage")
    fence = save(tmp_path / "fence.gpkg", straight(), kind="fence")
    names = {
        "found": files[0], "truth": files[1], "dir": tmp_path, "text": tmp_path / "text.gpkg", "fence": fence,
    }  # fmt: skip
    given, out, err = run(capsys, *[a.format(**names) for a in arguments])
    assert given == code, err
    assert out == ""
    assert err.startswith("error: ")
    assert err.count("\n") == 1
    assert said in err
    assert not list(tmp_path.glob("hits.*"))
