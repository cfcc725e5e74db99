"""The campaign: everything that takes too long for the tests. Command line: ``python -m tests.campaign``.

    python -m tests.campaign                       all steps, going on where it was stopped
    python -m tests.campaign mutations kills       some of them
    python -m tests.campaign --share 0.1           a tenth of the trials of each
    python -m tests.campaign --anew                forgets what was tried before
    python -m tests.campaign --page                writes results and page from what was tried so far

State lies in build/campaign. At the end, one table on stdout; results are written to tests/campaign/results.json and
docs/reliability.md. The exit code is 1 where something went wrong that no trial may come to.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path

from tests.campaign import bounds, calls, disks, kills, mutations, rows, soak
from tests.campaign.faults import problems_of, read_faults
from tests.campaign.ledger import WRONGS, Ledger
from tests.campaign.page import PAGE, RESULTS, page_of, results_of
from tests.scenes.places import ROOT

STEPS = [module.STEP for module in (rows, mutations, calls, disks, kills, soak, bounds)]
STATE = ROOT / "build" / "campaign"


def main(arguments: Sequence[str]) -> int:
    """Run the steps that are asked for; return the exit code."""
    options = parsed(arguments)
    for problem in problems_of(read_faults(), [step.name for step in STEPS]):
        print(f"faults.toml: {problem}", file=sys.stderr)
    state = options.state.resolve()
    if options.anew:
        (state / "ledger.jsonl").unlink(missing_ok=True)
        (state / "shares.json").unlink(missing_ok=True)
    ledger = Ledger(state / "ledger.jsonl")
    shares = json.loads((state / "shares.json").read_text()) if (state / "shares.json").exists() else {}
    if not options.page:
        for step in [step for step in STEPS if not options.steps or step.name in options.steps]:
            shares[step.name] = max(options.share, shares.get(step.name, 0.0))
            (state / "shares.json").write_text(json.dumps(shares))
            ledger.run(step, state, options.share, lambda text: print(text, file=sys.stderr, flush=True))
    n_wrong = tell(ledger)
    if not options.steps or options.page:
        results = results_of(ledger, STEPS, read_faults(), shares)
        RESULTS.write_text(json.dumps(results, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
        PAGE.write_text(page_of(read_faults(), results), encoding="utf-8")
    return int(n_wrong > 0)


def parsed(arguments: Sequence[str]) -> argparse.Namespace:
    """Return the options."""
    parser = argparse.ArgumentParser(prog="python -m tests.campaign")
    parser.add_argument("steps", nargs="*", choices=[[], *(step.name for step in STEPS)], help="default: all")
    parser.add_argument("--share", type=float, default=1.0, help="part of the trials of each step")
    parser.add_argument("--state", type=Path, default=STATE, help="folder of what was tried so far")
    parser.add_argument("--anew", action="store_true", help="forget what was tried before")
    parser.add_argument("--page", action="store_true", help="only write results and page")
    return parser.parse_args(list(arguments))


def tell(ledger: Ledger) -> int:
    """Print the table and what broke a rule; return how often rules were broken."""
    print(f"{'step':10} {'cases':>7} " + " ".join(f"{kind:>17}" for kind in WRONGS))
    n_wrong = 0
    for step in STEPS:
        trial = ledger.of(step.name)
        n_wrong += trial.wrong.total()
        print(f"{step.name:10} {trial.cases:7,} " + " ".join(f"{trial.wrong[kind]:17}" for kind in WRONGS))
    for step in STEPS:
        for offender in ledger.of(step.name).offenders:
            print(f"  {step.name}: {offender}")
    return n_wrong


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
