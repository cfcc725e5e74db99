"""The table of faults, and whether what it names is there."""

from __future__ import annotations

import ast
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from tests.scenes.places import ROOT

TABLE = Path(__file__).with_name("faults.toml")
#: Groups of faults, and how many each has.
GROUPS = {
    "A": ("Point-cloud files that lie", 28),
    "B": ("Numbers, CRS, geometry", 16),
    "C": ("Time, trajectory, images", 18),
    "D": ("Other readers, configuration, models", 14),
    "E": ("Writing and storage", 20),
    "F": ("Death of processes, signals, resuming", 14),
    "G": ("Memory, processors, limits", 8),
    "H": ("Work on several processes and machines", 10),
    "I": ("Databases", 8),
    "J": ("Safety of the workbench", 24),
    "K": ("Paths and operating systems", 10),
    "L": ("Dependencies and claims", 6),
}
#: Begins the name of a step of the campaign where otherwise the name of a test stands.
STEP = "campaign:"


@dataclass(frozen=True)
class Fault:
    """A fault, and what tries it.

    Parameters
    ----------
    name
        Letter of its group and number.
    fault
        What it is.
    tests
        Tests as "file::function", and steps of the campaign as "campaign:NAME".
    note
        What is to be said about the trial.
    """

    name: str
    fault: str
    tests: tuple[str, ...]
    note: str = ""

    @property
    def steps(self) -> tuple[str, ...]:
        """The steps of the campaign that try it."""
        return tuple(test.removeprefix(STEP) for test in self.tests if test.startswith(STEP))

    @property
    def functions(self) -> tuple[str, ...]:
        """The tests that try it."""
        return tuple(test for test in self.tests if not test.startswith(STEP))


def read_faults(path: Path = TABLE) -> list[Fault]:
    """Return the faults of the table, in its order."""
    table = tomllib.loads(path.read_text(encoding="utf-8"))
    return [
        Fault(name, row["fault"], tuple(row["tests"]), row.get("note", "")) for name, row in table.items()
    ]


@cache
def functions_in(file: Path) -> frozenset[str]:
    """Return the names of the tests that a file defines, without running it."""
    body = ast.parse(file.read_text(encoding="utf-8")).body
    return frozenset(
        node.name for node in body if isinstance(node, ast.FunctionDef) and node.name.startswith("test_")
    )


def is_there(test: str, steps: Sequence[str]) -> bool:
    """Return whether a test exists, or a step of the campaign."""
    if test.startswith(STEP):
        return test.removeprefix(STEP) in steps
    name, _, function = test.partition("::")
    file = ROOT / name
    return file.is_file() and function.partition("[")[0] in functions_in(file)


def problems_of(faults: Sequence[Fault], steps: Sequence[str]) -> list[str]:
    """Return what is wrong with the table, a line each."""
    names = [f"{letter}{i:02d}" for letter, (_, n) in GROUPS.items() for i in range(1, n + 1)]
    found = [f"{name} is missing" for name in names if name not in {fault.name for fault in faults}]
    found += [f"{fault.name} is not a fault of the list" for fault in faults if fault.name not in names]
    found += [f"{fault.name} is tried by nothing" for fault in faults if not fault.tests]
    found += [
        f"{fault.name} names {test}, which is not there"
        for fault in faults
        for test in fault.tests
        if not is_there(test, steps)
    ]
    return found
