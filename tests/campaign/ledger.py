"""What the campaign has tried so far, kept on disk, so that it goes on where it was stopped."""

from __future__ import annotations

import json
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

#: What no trial may come to, in the order of the table.
WRONGS = ("silent losses", "hangs", "signals", "exit 1", "unclear messages", "other faults")


@dataclass
class Trial:
    """What one trial came to.

    Parameters
    ----------
    cases
        How many cases it holds: a trial may be a batch of damaged files.
    came
        How often each outcome was seen.
    wrong
        How often each of `WRONGS` was seen.
    offenders
        What to look at: a seed or a command, and what it came to.
    figures
        Numbers of interest: seconds, megabytes.
    """

    cases: int = 1
    came: Counter[str] = field(default_factory=Counter)
    wrong: Counter[str] = field(default_factory=Counter)
    offenders: list[str] = field(default_factory=list)
    figures: dict[str, Any] = field(default_factory=dict)

    def blame(self, kind: str, what: str) -> None:
        """Note that a rule was broken."""
        assert kind in WRONGS, kind
        self.wrong[kind] += 1
        self.offenders.append(f"{kind}: {what}")

    @classmethod
    def total(cls, trials: Iterable[Trial]) -> Trial:
        """Return all trials as one; of figures, the largest."""
        found = cls(cases=0)
        for trial in trials:
            found.cases += trial.cases
            found.came += trial.came
            found.wrong += trial.wrong
            found.offenders += trial.offenders
            for name, value in trial.figures.items():
                there = found.figures.get(name)
                found.figures[name] = value if there is None else max(there, value)
        return found


@dataclass(frozen=True)
class Step:
    """A step of the campaign.

    Parameters
    ----------
    name, what
        For options and for the table.
    trials
        Yields (key, trial to run); the key names the trial in the ledger. Given a folder for files, and a share of
        the trials: 1 is all of them, smaller ones are for a quick look.
    """

    name: str
    what: str
    trials: Callable[[Path, float], Iterator[tuple[str, Callable[[], Trial]]]]


class Ledger:
    """Trials and what they came to, a line of JSON each; a line that was cut off by a kill is tried again."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.found: dict[tuple[str, str], Trial] = {}
        self.dates: dict[str, str] = {}
        path.parent.mkdir(parents=True, exist_ok=True)
        for line in path.read_text(encoding="utf-8").splitlines() if path.exists() else ():
            try:
                one = json.loads(line)
            except ValueError:
                continue
            self._hold(one)
        if path.exists() and not path.read_bytes().endswith(b"\n"):
            with path.open("a", encoding="utf-8") as file:
                file.write("\n")

    def _hold(self, one: dict[str, Any]) -> None:
        trial = Trial(
            one["cases"], Counter(one["came"]), Counter(one["wrong"]), one["offenders"], one["figures"]
        )
        self.found[one["step"], one["key"]] = trial
        self.dates[one["step"]] = max(one["date"], self.dates.get(one["step"], ""))

    def run(
        self, step: Step, folder: Path, share: float = 1.0, tell: Callable[[str], None] = lambda _: None
    ) -> Trial:
        """Run those trials of a step that are not there yet; return what all of them came to."""
        for key, trial in step.trials(folder, share):
            if (step.name, key) in self.found:
                continue
            start = time.monotonic()
            result = trial()
            self.add(step.name, key, result)
            wrong = ", ".join(f"{n} {kind}" for kind, n in result.wrong.items())
            tell(
                f"{step.name} {key}: {result.cases} cases in {time.monotonic() - start:.0f} s {wrong}".rstrip()
            )
            for offender in result.offenders[:20]:
                tell(f"    {offender}")
        return self.of(step.name)

    def add(self, step: str, key: str, trial: Trial) -> None:
        """Write down what a trial came to."""
        one = {
            "step": step, "key": key, "date": time.strftime("%Y-%m-%d", time.gmtime()), "cases": trial.cases,
            "came": +trial.came, "wrong": +trial.wrong, "offenders": trial.offenders, "figures": trial.figures,
        }  # fmt: skip
        with self.path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(one) + "\n")
        self._hold(one)

    def of(self, step: str) -> Trial:
        """Return what the trials of a step came to so far."""
        return Trial.total(trial for (name, _), trial in self.found.items() if name == step)

    def trials_of(self, step: str) -> dict[str, Trial]:
        """Return the trials of a step by key."""
        return {key: trial for (name, key), trial in self.found.items() if name == step}
