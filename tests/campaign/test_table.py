"""Every fault is tried by something that exists, and the page says what came of it."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest
from tests.campaign.__main__ import STEPS
from tests.campaign.faults import GROUPS, Fault, is_there, problems_of, read_faults
from tests.campaign.ledger import WRONGS, Ledger, Step, Trial
from tests.campaign.page import PAGE, RESULTS, outcome_of, page_of, read_results, results_of

NAMES = [step.name for step in STEPS]
HERE = "tests/campaign/test_table.py::test_every_fault_is_tried_by_something_that_exists"


def test_every_fault_is_tried_by_something_that_exists():
    faults = read_faults()
    assert len(faults) == 176 == sum(n for _, n in GROUPS.values())
    assert problems_of(faults, NAMES) == []


def test_what_is_wrong_with_a_table_is_found():
    faults = read_faults()
    broken = [
        replace(faults[0], tests=()),
        replace(faults[1], tests=("tests/campaign/test_table.py::test_nothing",)),
        replace(faults[2], tests=("tests/no/such/file.py::test_nothing",)),
        replace(faults[3], tests=("campaign:nothing",)),
        *faults[5:],
        Fault("Z01", "of another list", (HERE,)),
    ]
    found = problems_of(broken, NAMES)
    ours = [line for line in found if line.split()[0] in ("A01", "A02", "A03", "A04", "A05", "Z01")]
    assert ours == [
        "A05 is missing",
        "Z01 is not a fault of the list",
        "A01 is tried by nothing",
        "A02 names tests/campaign/test_table.py::test_nothing, which is not there",
        "A03 names tests/no/such/file.py::test_nothing, which is not there",
        "A04 names campaign:nothing, which is not there",
    ]
    assert is_there(f"{HERE}[case]", NAMES)


def test_the_page_is_what_table_and_results_make_it():
    assert PAGE.read_text(encoding="utf-8") == page_of(read_faults(), read_results()), (
        "run python -m tests.campaign --page"
    )


@pytest.mark.skipif(not RESULTS.exists(), reason="the campaign has not run yet")
def test_no_fault_is_without_a_result():
    results = read_results()
    not_run = [fault.name for fault in read_faults() if not outcome_of(fault, results)["run"]]
    assert not_run == []
    assert set(results["steps"]) == set(NAMES) - {"tests"}


@pytest.mark.skipif(not RESULTS.exists(), reason="the campaign has not run yet")
def test_nothing_is_wrong_in_the_results():
    results = read_results()
    wrong = {name: one["wrong"] for name, one in results["steps"].items() if sum(one["wrong"].values())}
    assert wrong == {}
    assert [test for test, one in results["tests"].items() if one["failed"]] == []


def test_the_page_counts_what_went_wrong():
    faults = [Fault("A01", "something", (HERE, "campaign:kills"), "the nearest trial")]
    one = dict.fromkeys(WRONGS, 0) | {"hangs": 3}
    results = {
        "tests": {HERE: {"cases": 7, "failed": 0, "date": "2026-01-01"}},
        "steps": {"kills": {"what": "x", "cases": 20, "share": 0.5, "date": "2026-01-02", "wrong": one}},
    }
    page = page_of(faults, results)
    assert "| A. Point-cloud files that lie | 1 | 1 | 7 | 0 | 3 | 0 | 0 | 0 | 0 |" in page
    assert "7 passed; kills: 20, 3 wrong | 2026-01-02 |" in page
    assert "the nearest trial" in page
    assert "| `kills` | x | 20 | 50% |" in page
    assert "not run" in page_of(faults, {"tests": results["tests"], "steps": {}})


def test_a_ledger_goes_on_where_it_was_stopped(tmp_path: Path):
    ran: list[str] = []

    def trials(folder: Path, share: float):
        for key in "abc":

            def trial(key=key) -> Trial:
                ran.append(key)
                if key == "b" and ran.count("b") == 1:
                    raise KeyboardInterrupt
                found = Trial(cases=2, figures={"s": len(ran)})
                if key == "c":
                    found.blame("signals", "c died")
                return found

            yield key, trial

    step = Step("some", "something", trials)
    path = tmp_path / "ledger.jsonl"
    try:
        Ledger(path).run(step, tmp_path)
    except KeyboardInterrupt:
        # Killed while it wrote a line
        with path.open("a") as file:
            file.write('{"step": "some", "key": "b", "ca')
    total = Ledger(path).run(step, tmp_path)
    assert ran == ["a", "b", "b", "c"]
    assert (total.cases, total.wrong, total.offenders) == (6, {"signals": 1}, ["signals: c died"])
    again = Ledger(path)
    assert again.run(step, tmp_path).cases == 6
    assert len(ran) == 4
    results = results_of(again, [step], [], {"some": 0.25})
    assert results["steps"]["some"]["wrong"]["signals"] == 1
    assert results["steps"]["some"]["share"] == 0.25
    assert json.loads(json.dumps(results)) == results
