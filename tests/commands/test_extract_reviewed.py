"""`linework extract` over lines that people have worked on: what they said stays."""

import json
import shutil
import sqlite3
from contextlib import closing

import numpy as np
import pytest
from tests.scenes.drawing_scenes import same, whole

from linework.files.line_file.file import LineFile
from linework.files.line_file.tables import connect_database
from linework.files.vectors.gpkg import read_own_gpkg, read_poles
from linework.files.vectors.read_write import read_lines
from linework.model.changes import Change
from linework.model.lines import POLE, LineSet
from linework.simulation.folder import write_survey_folder
from linework.simulation.simulate import simulate_survey


@pytest.fixture(scope="module")
def survey(tmp_path_factory):
    folder = tmp_path_factory.mktemp("reviewed") / "survey"
    write_survey_folder(simulate_survey("straight", 982, 60.0, points_per_m=1500), folder)
    return folder


@pytest.fixture(scope="module")
def made(survey, tmp_path_factory):
    """Return the lines of the survey as extracted first, and its work folder."""
    from linework.cli.app import main

    out = tmp_path_factory.mktemp("made")
    arguments = ["-o", str(out / "lines.gpkg"), "--work", str(out / "work"), "--workers", "1", "--quiet"]
    assert main(["extract", str(survey), *arguments, "--features", "guardrail,cable"]) == 0
    return out


@pytest.fixture
def out(made, tmp_path):
    for name in ("lines.gpkg", "run.json"):
        shutil.copy(made / name, tmp_path / name)
    return tmp_path


@pytest.fixture
def again(linework, survey, made, out):
    def run(*more):
        arguments = ("-o", out / "lines.gpkg", "--work", made / "work", "--workers", "1", "--quiet")
        features = () if "--features" in more else ("--features", "guardrail,cable")
        return linework("extract", survey, *arguments, *features, *more)

    return run


def edited(lines):
    """Return the lines that a line file holds: all but poles."""
    return lines.take(lines.kind != POLE)


def worked_on(path, *, deletes=True):
    """Accept, move, reject, delete and draw a line each; return them as they are now."""
    crs = read_lines(path).crs
    with LineFile.opened(path, crs=crs) as drawing:

        def change(action, before, after):
            return drawing.commit(Change(action, before, after), who="Ann").change.after

        rail, cable = (drawing.lines[kind] for kind in ("guardrail", "cable"))
        assert len(rail) >= 2 and len(cable) >= 2
        accepted = change("accept", cable.take([0]), cable.take([0]).with_columns(review=["accepted"]))
        rejected = change("reject", rail.take([0]), rail.take([0]).with_columns(review=["rejected"]))
        moved = rail.take([1])
        moved = change(
            "move", moved, moved.with_columns(xyz=moved.xyz + np.array([0.0, 0.4, 0.0]), review=["edited"])
        )
        if deletes:
            change("delete", cable.take([1]), LineSet.empty(crs))
        far = accepted.xyz + np.array([0.0, 100.0, 0.0])
        drawn = LineSet.from_lines([far], crs=crs, kind=["fence"], review=["drawn"], note=["new"])
        drawn = change("draw", LineSet.empty(crs), drawn)
        return LineSet.concatenate([accepted, rejected, moved, drawn]), str(cable.id[1]), drawing.lines


def test_what_people_said_stays_and_is_not_found_again(again, out):
    path = out / "lines.gpkg"
    first = read_lines(path)
    said, deleted, held = worked_on(path)
    assert again().code != 0
    found = again("--overwrite")
    assert found.code == 0, found.stderr
    assert "kept the reviews of its lines (1 accepted, 1 edited, 1 drawn, 1 rejected)" in found.stderr
    there = read_own_gpkg(path, rejected=True)
    assert same(there.take(np.isin(there.id, said.id)), said)
    others = there.take(~np.isin(there.id, said.id))
    assert same(others, first.take(~np.isin(first.id, [*said.id, deleted])))
    assert len(read_lines(path)) == len(there) - 1
    record = json.loads((out / "run.json").read_text())
    reviews = record["counts"]["reviews"]
    assert reviews == {"accepted": 1, "edited": 1, "drawn": 1, "rejected": 1, "found_again": 4}
    assert sum(record["counts"]["lines"].values()) == len(read_lines(path))
    whole_again = {p.name for p in out.iterdir()}
    assert whole_again == {"lines.gpkg", "run.json"}
    with LineFile.opened(path, crs=first.crs) as drawing:
        # Nothing else has changed, so that the history is as it was, and goes on
        assert (drawing.revision, drawing.can_undo) == (5, True)
        for _ in range(5):
            drawing.undo(who="")
        assert same(drawing.lines, edited(first))
    assert len(held) == len(edited(first))
    # Poles are points that nobody edits here: they are those of the last extraction
    assert same(read_poles(path), first.take(first.kind == POLE))


def test_an_extraction_that_finds_other_lines_is_an_edit_that_can_be_undone(again, out):
    path = out / "lines.gpkg"
    said, _, held = worked_on(path, deletes=False)
    assert again("--overwrite", "--features", "guardrail").code == 0
    with LineFile.opened(path, crs=said.crs) as drawing:
        edit = drawing.history(1)[0]
        assert (edit.change.action, edit.number) == ("extract", 5)
        assert set(drawing.lines.kind.tolist()) >= {"cable", "guardrail", "fence"}
        assert len(drawing.lines) < len(held)
        assert same(drawing.lines.take(drawing.lines.review != ""), said)
        drawing.undo(who="")
        assert same(drawing.lines, held)
        drawing.redo(who="")
    # Once more: who judged is asked no more
    assert again("--overwrite").code == 0
    with LineFile.opened(path, crs=said.crs) as drawing:
        assert same(drawing.lines, held)


def test_reviews_are_forgotten_where_that_is_asked_for(again, out):
    path = out / "lines.gpkg"
    before = path.read_bytes()
    worked_on(path)
    assert path.read_bytes() != before
    found = again("--overwrite", "--forget-reviews")
    assert found.code == 0
    assert "kept the reviews" not in found.stderr
    assert path.read_bytes() == before


def test_a_file_that_was_only_looked_at_is_replaced_as_any_other(again, out):
    path = out / "lines.gpkg"
    before = path.read_bytes()
    with LineFile.opened(path, crs=read_lines(path).crs):
        pass
    assert again("--overwrite").code == 0
    assert path.read_bytes() == before


def test_reviews_typed_in_elsewhere_count_too(again, out):
    path = out / "lines.gpkg"
    n = len(read_lines(path))
    with closing(connect_database(path)) as db:
        db.execute("ALTER TABLE cable ADD COLUMN review TEXT")
        db.execute("UPDATE cable SET review = 'rejected' WHERE fid = 1")
    found = again("--overwrite", "--json")
    assert json.loads(found.stdout)["counts"]["reviews"]["rejected"] == 1
    assert len(read_lines(path)) == n - 1


def test_an_open_workbench_is_not_written_over(again, out):
    path = out / "lines.gpkg"
    with LineFile.opened(path, crs=read_lines(path).crs):
        found = again("--overwrite")
    assert found.code == 6
    assert "another run is writing it" in found.stderr


def test_reviews_that_cannot_be_used_stop_the_run_and_stay(again, out):
    path = out / "lines.gpkg"
    worked_on(path)
    with closing(sqlite3.connect(path)) as db:
        db.execute("UPDATE line_version SET content = x'00'")
        db.commit()
    before = path.read_bytes()
    found = again("--overwrite")
    assert found.code == 3
    assert "--forget-reviews" in found.stderr
    assert path.read_bytes() == before


def test_convert_and_evaluate_leave_rejected_lines_out(linework, out):
    path = out / "lines.gpkg"
    said, _, held = worked_on(path)
    assert linework("convert", path, out / "lines.geojson").code == 0
    converted = read_lines(out / "lines.geojson")
    n_poles = np.count_nonzero(converted.kind == POLE)
    assert n_poles == len(read_poles(path)) > 0
    assert len(converted) == len(held) - 1 + n_poles
    assert sorted(set(edited(converted).review.tolist())) == ["accepted", "drawn", "edited"]
    assert "new" in converted.note
    assert linework("convert", path, out / "copy.gpkg").code == 0
    assert same(read_lines(out / "copy.gpkg"), read_lines(path))
    scored = linework("evaluate", path, path, "--json")
    assert scored.code == 0, scored.stderr
    assert "rejected" not in scored.stdout
    assert str(said.id[1]) not in read_lines(path).id
    whole_file = out / "alone"
    whole_file.mkdir()
    shutil.copy(path, whole_file / path.name)
    whole(whole_file / path.name)


def test_what_another_program_added_is_not_lost(again, out):
    path = out / "lines.gpkg"
    worked_on(path)
    with closing(connect_database(path)) as db, db:
        db.execute("CREATE TABLE notes (fid INTEGER PRIMARY KEY, text TEXT)")
        db.execute("ALTER TABLE guardrail ADD COLUMN owner TEXT")
    before = path.read_bytes()
    outcome = again("--overwrite")
    assert outcome.code == 6
    assert "another program added guardrail.owner, notes, which would be lost" in outcome.stderr
    assert path.read_bytes() == before
    assert again("--overwrite", "--forget-reviews").code == 0
    assert again("--overwrite").code == 0
