"""The tests that the table of faults names, run file by file, with the outcome of each of their cases."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from tests.campaign.faults import read_faults
from tests.campaign.ledger import Step, Trial
from tests.scenes.places import ROOT

#: A file of tests on a loaded machine. [s]
LIMIT_S = 1800.0
#: Where this module, as a plug-in of pytest, writes outcomes.
_OUTCOMES = "LINEWORK_CAMPAIGN_OUTCOMES"


def pytest_runtest_logreport(report: object) -> None:
    """Write down the outcome of a case, where pytest runs with this module as a plug-in."""
    when, outcome = report.when, report.outcome  # type: ignore[attr-defined]
    if when == "call" or outcome != "passed":
        with Path(os.environ[_OUTCOMES]).open("a", encoding="utf-8") as file:
            file.write(json.dumps({"test": report.nodeid, "outcome": outcome}) + "\n")  # type: ignore[attr-defined]


def trials(folder: Path, share: float) -> Iterator[tuple[str, Callable[[], Trial]]]:
    """Yield a trial per file of tests, with the tests of it that the table names."""
    files = defaultdict(set)
    for fault in read_faults():
        for test in fault.functions:
            files[test.partition("::")[0]].add(test.partition("[")[0])
    chosen = sorted(files.items()) if share >= 0.5 else []
    for name, tests in chosen:
        yield name, lambda name=name, tests=tests: of_file(folder, name, sorted(tests))


def of_file(folder: Path, name: str, tests: Sequence[str]) -> Trial:
    """Run tests of a file; count their cases and blame those that fail."""
    outcomes = folder / "outcomes.jsonl"
    outcomes.unlink(missing_ok=True)
    # Each test is asked for by its name alone: as many as there are would not fit every command line
    environment = os.environ | {_OUTCOMES: str(outcomes)}
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-n", "0", "-p", "tests.campaign.rows", "-p", "no:cacheprovider", *tests],
        cwd=ROOT, env=environment, capture_output=True, text=True, timeout=LIMIT_S, check=False,
    )  # fmt: skip
    found: dict[str, Counter[str]] = defaultdict(Counter)
    for line in outcomes.read_text(encoding="utf-8").splitlines() if outcomes.exists() else ():
        one = json.loads(line)
        found[one["test"].partition("[")[0]][one["outcome"]] += 1
    trial = Trial(cases=0)
    for test in tests:
        came = found.get(test, Counter())
        trial.cases += came.total()
        trial.came += came
        trial.figures[test] = came["passed"]
        if came["failed"]:
            trial.blame("other faults", f"{test}: {came['failed']} of {came.total()} failed")
        elif not came["passed"]:
            trial.blame("other faults", f"{test}: no case passed: {came or done.stdout[-300:]}")
    return trial


STEP = Step("tests", "the tests that the table of faults names", trials)
