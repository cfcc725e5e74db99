"""Thousands of damaged files through every reader: nothing may hang, crash, lie, or take all memory.

An answer within 10 s; no signal and no traceback, also not in the process that decodes; what a header promises is read
or accounted for; a refusal is one line that names the file and says what to do.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

from tests.campaign.ledger import Step, Trial
from tests.campaign.mutants.readers import LASER, NAMES
from tests.campaign.mutants.watched import Watched

#: Damaged files of all formats.
FILES = 12_000
#: Laser files get this part of them: most of the code that reads them is not ours.
LASER_PART = 0.4
BATCH = 100


def trials(folder: Path, share: float) -> Iterator[tuple[str, Callable[[], Trial]]]:
    """Yield a trial per batch of seeds of a format."""
    watched = Watched(folder / "mutations")
    watched.folder.mkdir(parents=True, exist_ok=True)
    others = round(FILES * (1 - LASER_PART) / (len(NAMES) - 1))
    try:
        for name in NAMES:
            n = round((FILES * LASER_PART if name == LASER else others) * min(share, 1.0))
            for first in range(0, n, BATCH):
                seeds = range(first, min(first + BATCH, n))
                yield f"{name} {first}", lambda name=name, seeds=seeds: batch(watched, name, seeds)
    finally:
        watched.end()


def batch(watched: Watched, name: str, seeds: range) -> Trial:
    """Read the damaged files of some seeds."""
    trial = Trial(cases=len(seeds))
    for seed in seeds:
        found = watched.ask({"format": name, "seed": seed})
        trial.came[found["came"]] += 1
        if found["wrong"]:
            trial.blame(
                found["wrong"],
                f"{name} seed {seed} ({found.get('done', '')}): {found['came']}: {found['said']}",
            )
        for figure in ("ms", "mb"):
            trial.figures[figure] = round(max(trial.figures.get(figure, 0.0), found[figure]), 1)
    return trial


STEP = Step("mutations", "damaged files through every reader", trials)
