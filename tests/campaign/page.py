"""The page on reliability, written from the table of faults and the results of the campaign."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from tests.campaign.faults import GROUPS, STEP, Fault
from tests.campaign.ledger import WRONGS, Ledger, Step, Trial
from tests.scenes.places import ROOT

PAGE = ROOT / "docs" / "reliability.md"
RESULTS = Path(__file__).with_name("results.json")
#: What stands on the page for each of the steps that are told apart.
_OFFENDERS = 20
HEAD = """\
# Reliability

What `linework` does with files that lie, disks that fill up, processes that die and people who mistype, and how that is tried. The contract:

- **One line per error**: the file, what is wrong, with numbers, and what to do. No traceback, no control characters of a file in a terminal. [Exit codes](conventions.md#failures) say whose fault it is; 1 is always ours.
- **Whole outputs**: an output is written beside its final name, closed, read back, synchronised and renamed. What is there under its name is the old file or the new one.
- **Counts balance**: points that a header promises are read, or left out for a reason that is said. Success means that all of it is there.
- **A guarded decoder**: headers are checked against the size of the file before anything is allocated, and points are decoded in a child process with a limit on its memory ([decision 13](decisions/0013-laser-files-are-decoded-by-their-own-process.md), [14](decisions/0014-headers-are-checked-damaged-files-refused.md)).
- **Resuming**: whatever stops a command, running it again, `extract` with `--resume`, comes to the same bytes.

Each row below is a fault that is tried, by a test of the ordinary suite or by a step of the campaign: `make campaign`, which takes hours, goes on where it was stopped, and writes this page ([decision 36](decisions/0036-a-campaign-of-faults.md)). "Figure" is the number of cases that passed in the last campaign.
"""


def outcome_of(fault: Fault, results: Mapping[str, Any]) -> dict[str, Any]:
    """Return what the trials of a fault came to: cases, wrongs by kind, the date, and whether all have been run."""
    tests, steps = results.get("tests", {}), results.get("steps", {})
    cases, dates, is_run = 0, [], True
    wrong = dict.fromkeys(WRONGS, 0)
    for test in fault.functions:
        one = tests.get(test.partition("[")[0])
        if one is None:
            is_run = False
            continue
        cases += one["cases"]
        wrong["other faults"] += one["failed"]
        dates.append(one["date"])
    for name in fault.steps:
        one = steps.get(name)
        if one is None or not one["cases"]:
            is_run = False
            continue
        dates.append(one["date"])
    return {"cases": cases, "wrong": wrong, "date": max(dates, default=""), "run": is_run and bool(dates)}


def results_of(
    ledger: Ledger, steps: Sequence[Step], faults: Sequence[Fault], shares: Mapping[str, float]
) -> dict[str, Any]:
    """Return the results that are committed.

    Parameters
    ----------
    shares
        Which part of each step's trials was asked for.
    """
    found: dict[str, Any] = {"steps": {}, "tests": {}}
    for step in steps:
        trial = ledger.of(step.name)
        if step.name == "tests":
            continue
        if trial.cases:
            found["steps"][step.name] = {
                "what": step.what, "cases": trial.cases, "share": shares.get(step.name, 1.0),
                "date": ledger.dates[step.name], "came": dict(sorted(trial.came.items())),
                "wrong": {kind: trial.wrong[kind] for kind in WRONGS}, "offenders": trial.offenders[:_OFFENDERS],
                "figures": _figures(step, ledger, trial),
            }  # fmt: skip
    date = ledger.dates.get("tests", "")
    for trial in ledger.trials_of("tests").values():
        for test, passed in trial.figures.items():
            failed = sum(1 for one in trial.offenders if f"{test}:" in one)
            found["tests"][test] = {"cases": passed, "failed": failed, "date": date}
    named = {test.partition("[")[0] for fault in faults for test in fault.functions}
    found["tests"] = {test: found["tests"][test] for test in sorted(named) if test in found["tests"]}
    return found


def _figures(step: Step, ledger: Ledger, trial: Trial) -> dict[str, Any]:
    if step.name == "bounds":
        return {key: one.figures for key, one in ledger.trials_of("bounds").items()}
    return trial.figures


def page_of(faults: Sequence[Fault], results: Mapping[str, Any]) -> str:
    """Return the page."""
    parts = [HEAD, "## Summary\n", _summary(faults, results), "## The campaign\n", _campaign(results)]
    if "bounds" in results.get("steps", {}):
        parts += ["## Memory and disk\n", _bounds(results["steps"]["bounds"]["figures"])]
    for letter, (title, _) in GROUPS.items():
        rows = [fault for fault in faults if fault.name.startswith(letter)]
        parts += [f"## {letter}. {title}\n", _rows(rows, results)]
    return "\n".join(parts)


def _summary(faults: Sequence[Fault], results: Mapping[str, Any]) -> str:
    head = "| group | faults | tried | cases of tests | " + " | ".join(WRONGS) + " |"
    lines = [head, "|---|" + "--:|" * (len(WRONGS) + 3)]
    for letter, (title, _) in GROUPS.items():
        rows = [fault for fault in faults if fault.name.startswith(letter)]
        outcomes = [outcome_of(fault, results) for fault in rows]
        # A test or a step that several rows name counts once per group
        tests = {test.partition("[")[0] for fault in rows for test in fault.functions}
        steps = {name for fault in rows for name in fault.steps}
        known = results.get("tests", {})
        cases = sum(known[test]["cases"] for test in tests if test in known)
        wrong = dict.fromkeys(WRONGS, 0)
        wrong["other faults"] = sum(known[test]["failed"] for test in tests if test in known)
        for name in steps:
            for kind, n in results.get("steps", {}).get(name, {}).get("wrong", {}).items():
                wrong[kind] += n
        counts = " | ".join(str(wrong[kind]) for kind in WRONGS)
        tried = sum(outcome["run"] for outcome in outcomes)
        lines.append(f"| {letter}. {title} | {len(rows)} | {tried} | {cases:,} | {counts} |")
    tried = sum(outcome_of(fault, results)["run"] for fault in faults)
    return "\n".join(
        [
            *lines,
            f"\n{tried} of {len(faults)} faults were tried. A step of the campaign counts in every group whose faults it tries.\n",
        ]
    )


def _campaign(results: Mapping[str, Any]) -> str:
    lines = ["| step | | cases | part of the full campaign | " + " | ".join(WRONGS) + " | date |"]
    lines.append("|---|---|--:|--:|" + "--:|" * len(WRONGS) + "---|")
    for name, one in results.get("steps", {}).items():
        counts = " | ".join(str(one["wrong"][kind]) for kind in WRONGS)
        lines.append(
            f"| `{name}` | {one['what']} | {one['cases']:,} | {one['share']:.0%} | {counts} | {one['date']} |"
        )
    return "\n".join(lines) + "\n"


def _bounds(figures: Mapping[str, Mapping[str, float]]) -> str:
    lines = [
        "| command and file | memory MB | promised | disk MB | promised | s | exit |",
        "|---|--:|--:|--:|--:|--:|--:|",
    ]
    lines += [
        f"| {name} | {one['MB']} | {one['MB promised']} | {one['disk MB']} | {one['disk MB promised']} | {one['s']} | {one['exit']} |"
        for name, one in figures.items()
    ]
    return "\n".join(lines) + "\n"


def _rows(rows: Sequence[Fault], results: Mapping[str, Any]) -> str:
    lines = ["| | fault | tried by | figure | date |", "|---|---|---|---|---|"]
    for fault in rows:
        outcome = outcome_of(fault, results)
        tried = "<br>".join(_shown(test) for test in fault.tests) or "nothing"
        note = f"<br>{fault.note}" if fault.note else ""
        lines.append(
            f"| {fault.name} | {fault.fault} | {tried}{note} | {_figure(fault, outcome, results)} | {outcome['date']} |"
        )
    return "\n".join(lines) + "\n"


def _shown(test: str) -> str:
    if test.startswith(STEP):
        return f"step `{test.removeprefix(STEP)}`"
    file, _, function = test.partition("::")
    # The words of a test's name may be broken, unlike the name
    return f"`{file}` {function.removeprefix('test_').partition('[')[0].replace('_', ' ')}"


def _figure(fault: Fault, outcome: Mapping[str, Any], results: Mapping[str, Any]) -> str:
    if not outcome["run"]:
        return "not run"
    parts = [f"{outcome['cases']:,} passed"] if fault.functions else []
    if failed := outcome["wrong"]["other faults"]:
        parts.append(f"{failed} failed")
    for name in fault.steps:
        one = results["steps"][name]
        parts.append(f"{name}: {one['cases']:,}, {sum(one['wrong'].values())} wrong")
    return "; ".join(parts)


def read_results() -> dict[str, Any]:
    """Return the results that are committed, empty ones where there are none."""
    if not RESULTS.exists():
        return {}
    found: dict[str, Any] = json.loads(RESULTS.read_text(encoding="utf-8"))
    return found
