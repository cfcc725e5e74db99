"""Plan, names, order and record of a run."""

import numpy as np

from linework.files.output.record import write_json
from linework.lines.names import midpoints
from linework.model.lines import LineSet
from linework.runs.extraction import identify
from linework.runs.record import record_path
from linework.runs.steps import RunSteps


def some_lines() -> LineSet:
    rng = np.random.default_rng(7)
    lines = [rng.uniform(0, 100, (3, 3)) for _ in range(12)]
    return LineSet.from_lines(lines, kind=["cable", "guardrail", "fence"] * 4)


def test_names_and_order_do_not_depend_on_the_order_lines_came_in():
    lines = some_lines()
    named = identify(lines)
    for seed in range(5):
        shuffled = lines.take(np.random.default_rng(seed).permutation(len(lines)))
        again = identify(shuffled)
        assert again.id.tolist() == named.id.tolist()
        np.testing.assert_array_equal(again.xyz, named.xyz)


def test_lines_at_the_same_place_get_different_names():
    line = np.array([[0.0, 0.0, 1.0], [10.0, 0.0, 1.0]])
    named = identify(LineSet.from_lines([line, line + 0.01, line], kind=["cable"] * 3))
    assert len(set(named.id)) == 3
    assert all(name.startswith("cable-") for name in named.id)


def test_a_name_survives_a_change_of_a_few_millimetres():
    line = np.array([[0.3, 0.4, 1.4], [10.5, 0.6, 1.5]])
    one = identify(LineSet.from_lines([line], kind=["guardrail"]))
    two = identify(LineSet.from_lines([line + 0.003], kind=["guardrail"]))
    assert one.id.tolist() == two.id.tolist()


def test_the_midpoint_is_half_way_along_not_the_middle_vertex():
    line = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [10.0, 0.0, 0.0]])
    np.testing.assert_allclose(midpoints(LineSet.from_lines([line])), [[5.0, 0.0, 0.0]])


def test_steps_add_up_and_are_shown():
    seen = []

    class Watcher:
        def begin(self, step, unit):
            seen.append(("begin", step, unit))

        def advance(self, done, total):
            seen.append((done, total))

        def end(self, step, seconds):
            seen.append(("end", step))

    steps = RunSteps(Watcher())
    for _ in range(2):
        with steps.step("read", unit="points") as advance:
            advance(3, 4)
    assert seen == [("begin", "read", "points"), (3, 4), ("end", "read")] * 2
    assert steps.timings_s["read"] >= 0


def test_two_outputs_in_a_folder_have_two_records(tmp_path):
    first, second = tmp_path / "a.gpkg", tmp_path / "b.gpkg"
    first.touch()
    assert record_path(first).name == "run.json"
    write_json({"output": {"file": "a.gpkg"}}, record_path(first))
    assert record_path(first).name == "run.json"
    assert record_path(second).name == "b.gpkg.run.json"
    assert record_path(tmp_path / "a.dxf").name == "a.dxf.run.json"
    first.unlink()
    assert record_path(second).name == "run.json"
    write_json({"output": {"file": "b.gpkg"}}, tmp_path / "b.gpkg.run.json")
    assert record_path(second).name == "b.gpkg.run.json"


def test_a_file_of_somebody_else_is_not_a_record(tmp_path):
    (tmp_path / "run.json").write_text('{"mine": 1}')
    assert record_path(tmp_path / "a.gpkg").name == "a.gpkg.run.json"
    assert record_path(tmp_path / "run.json").name == "run.json.run.json"
