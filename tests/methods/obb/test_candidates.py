"""Candidates: what was measured and not taken is kept on request, with the reason, and changes nothing else."""

import numpy as np
import pytest
from tests.laws.test_obb_splitting import assert_same

from linework.editing.edits.attributes import with_kind
from linework.evaluation.measures import evaluate
from linework.files.vectors.read_write import read_lines, write_lines
from linework.methods.obb.method import OBB_KINDS, Obb
from linework.methods.protocol import context_of_tile, tile_of, whole_tile
from linework.methods.tracking.boundary_lines import SHORT
from linework.model.lines import CANDIDATE, LineSet
from linework.simulation.simulate import simulate_survey


@pytest.fixture(scope="module")
def found():
    """The lines of a country road between parallel edges: without candidates, with them, of boundaries alone."""
    survey = simulate_survey("rural", 932, 60.0, points_per_m=3000.0)
    tile = whole_tile(tile_of(survey.points, survey.trajectory))
    context = context_of_tile(tile)
    boxes = Obb().look(tile)
    kinds = (OBB_KINDS, (*OBB_KINDS, CANDIDATE), ("road_boundary", CANDIDATE))
    return [Obb(kinds=of).join(boxes, context) for of in kinds]


def test_the_other_lines_are_the_same_with_and_without(found):
    plain, with_them, of_boundaries = found
    assert CANDIDATE not in plain.kinds
    assert_same(with_them.take(with_them.kind != CANDIDATE), plain)
    assert_same(of_boundaries["road_boundary"], plain["road_boundary"])


def test_what_was_not_taken_is_kept_with_the_reason(found):
    _, with_them, of_boundaries = found
    candidates = with_them[CANDIDATE]
    assert (candidates.reason != "").all()
    edges = candidates[candidates.reason == SHORT]
    assert len(edges) > 0
    assert set(edges.candidate_kind.tolist()) == {"road_boundary"}
    assert (edges.length_m > 3.9).all()
    assert ((edges.confidence > 0.0) & (edges.confidence <= 1.0)).all()
    # Only candidates for kinds that are asked for
    assert set(of_boundaries[CANDIDATE].candidate_kind.tolist()) == {"road_boundary"}
    taken = with_them[with_them.kind != CANDIDATE]
    assert (taken.reason == "").all()
    assert (taken.candidate_kind == "").all()


@pytest.mark.parametrize("suffix", [".gpkg", ".geojson", ".parquet", ".dxf", ".fgb", ".landxml"])
def test_every_format_holds_them_with_their_reasons(found, tmp_path, suffix):
    pytest.importorskip({".parquet": "pyarrow", ".dxf": "ezdxf"}.get(suffix, "numpy"))
    lines = found[1].with_columns(crs="EPSG:25832+7837")
    path = tmp_path / f"lines{suffix}"
    write_lines(lines, path)
    content = path.read_bytes()
    back = read_lines(path)
    assert CANDIDATE in back.kinds
    assert len(back[CANDIDATE]) == len(lines[CANDIDATE])
    if suffix in (".gpkg", ".geojson", ".parquet", ".fgb"):
        assert sorted(back[CANDIDATE].reason.tolist()) == sorted(lines[CANDIDATE].reason.tolist())
    else:
        assert SHORT.encode() in content


def test_files_without_candidates_have_no_field_for_them(found, tmp_path):
    for name, lines in zip(("plain", "with"), found[:2], strict=True):
        write_lines(lines.with_columns(crs="EPSG:25832+7837"), tmp_path / f"{name}.geojson")
    assert b"candidate_kind" not in (tmp_path / "plain.geojson").read_bytes()
    features = [
        [line.rstrip(",") for line in (tmp_path / f"{name}.geojson").read_text().splitlines()]
        for name in ("plain", "with")
    ]
    taken = [line for line in features[1] if '"kind":"candidate"' not in line]
    assert taken == features[0]


def test_a_candidate_that_a_person_takes_keeps_what_was_measured(found):
    candidates = found[1][CANDIDATE]
    edge = candidates[candidates.reason == SHORT][:1]
    taken = with_kind(edge, "road_boundary")
    assert taken.kind.tolist() == ["road_boundary"]
    assert taken.form.tolist() == edge.form.tolist() != [""]
    assert taken.height_m.tolist() == edge.height_m.tolist()
    assert taken.reason.tolist() == taken.candidate_kind.tolist() == [""]


def test_candidates_do_not_count_in_scores_unless_they_are_named():
    line = np.array([[0.0, 0.0, 0.0], [10.0, 0.0, 0.0]])
    lines = LineSet.from_lines([line, line + np.array([0.0, 3.0, 0.0])], kind=["road_boundary", CANDIDATE])
    assert evaluate(lines, lines["road_boundary"]).overall.at.correctness == 1.0
    assert [s.kind for s in evaluate(lines, lines, kinds=[CANDIDATE]).kinds] == [CANDIDATE]
