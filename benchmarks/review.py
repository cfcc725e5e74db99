"""How much of what is wrong a person removes who works the review queue of an automatic extraction.

A street of 1 km is simulated with few points, worn paint and parked cars, and extracted. A scripted user then works
the queue of the workbench, first things first, with its own edits and its own tracer, and sees the truth only where
the queue says to look. Every click and every key that changes something is an action: a verdict, a proposal taken, a
place picked (also where following is refused), each vertex of a drawn line, a followed line cut to what is right, a cut,
and each click on a line that the item does not select; for a line put beside another that line and both ends, for a wire its three places, and one key to take back what came out
wrong.

Seeds draw streets of 2,000 to 19,000 points per metre, and 0 to 70 % of a line's paint gone. Unless told otherwise the
points are fewer, and half of all paint at least is gone: harder than any seed draws. ``--points-per-m 2000 --wear 0`` is
the sparsest street that a seed draws, worn as it draws it. Paint that is gone counts as missing all the same where the
road was measured.

Before that, every proposal of the queue is held against the truth: the precision of each type.

``python -m benchmarks.review --seeds 990-994 --roads urban,motorway``; ``--keep FOLDER`` keeps surveys and lines for the next time;
``--tell`` says what was done about each item. Tuned on seeds 980 to 989; nothing may be tuned on those reported.
"""

import argparse
import tempfile
from collections import Counter
from functools import partial
from pathlib import Path

from benchmarks._review_scene import (
    KINDS,
    LENGTH_M,
    POINTS_PER_M,
    WEAR,
    copied,
    errors_of,
    scene_of,
    truth_of,
)
from benchmarks._review_user import User
from benchmarks.accuracy import seeds_of
from linework.files.line_file.file import LineFile
from linework.runs.settings import RunSettings
from linework.tracing.trace import Tracer
from linework.workbench.review.paint import dash_spans
from linework.workbench.review.queue import Dismissed
from linework.workbench.review.suspects import suspects_in_worker
from linework.workbench.views.heights import heights_at
from linework.workbench.worker.order import SurveyOrder
from linework.workbench.worker.session import SurveySession

#: Simulates and extracts kilometres: run where it is asked for.
ON_REQUEST = True
MOST_ACTIONS = 60


def main(arguments=()):
    options = parsed(arguments)
    proposals = Counter()
    with tempfile.TemporaryDirectory(prefix="linework-review-") as scratch:
        folder = Path(options.keep or scratch)
        folder.mkdir(parents=True, exist_ok=True)
        for road in options.roads.split(","):
            totals = [reviewed(road, seed, folder, options, proposals) for seed in seeds_of(options.seeds)]
            before, after = (sum(total[i] for total in totals) for i in (0, 1))
            print(
                f"{road}: {before:.0f} m in error before, {after:.0f} m after: {share(before, after)} removed\n"
            )
    for action in sorted({action for action, _ in proposals}):
        right, wrong = proposals[action, True], proposals[action, False]
        print(f"proposals to {action}: {right} of {right + wrong} right")


def parsed(arguments):
    parser = argparse.ArgumentParser(prog="python -m benchmarks.review")
    parser.add_argument("--roads", default="urban", help="kinds of road, with commas between")
    parser.add_argument("--seeds", default="990-994", help="first-last, or a list")
    parser.add_argument("--length-m", type=float, default=LENGTH_M)
    parser.add_argument("--actions", type=int, default=MOST_ACTIONS)
    parser.add_argument("--points-per-m", type=float, default=POINTS_PER_M)
    parser.add_argument("--wear", type=float, default=WEAR, help="share of the paint that is gone, at least")
    parser.add_argument("--keep", default="", help="folder for surveys and lines")
    parser.add_argument("--tell", action="store_true", help="say what was done about each item")
    return parser.parse_args(list(arguments))


def reviewed(road, seed, folder, options, proposals):
    """Work the queue of one drive; count its right and wrong proposals; return the error before and after."""
    scene = scene_of(road, seed, folder, options)
    truth = truth_of(scene)
    table = SurveySession(SurveyOrder((scene.survey,), work=scene.work), lambda _: None)
    tracer = Tracer(table.recordings.points, table.surface, RunSettings())
    with LineFile.opened(copied(scene), crs=truth.crs) as line_file:
        before = errors_of(line_file.lines, truth)
        user = User(
            line_file, truth, tracer, partial(heights_at, table), partial(dash_spans, table), options.actions
        )
        for item in suspects_in_worker(table, line_file.lines):
            if item.proposal:
                is_right = user.agrees(item)
                proposals[f"{item.proposal} ({item.type}, {item.kind})", is_right] += 1
                if options.tell and not is_right:
                    print(f"  wrong: {item.proposal} {item.type} {item.kind}: {item.reason}")
        dismissed = Dismissed()
        while user.left > 0:
            settled = dismissed.keys(line_file)
            items = [s for s in suspects_in_worker(table, line_file.lines, settled) if s.key not in settled]
            if not items:
                break
            user.settle(items[0])
            if options.tell:
                item, done, cost = user.told[-1]
                print(
                    f"  {cost:2} {item.type:8} {item.kind:18} {item.length_m:6.1f} m  {item.reason}: {done}",
                    flush=True,
                )
        after = errors_of(line_file.lines, truth)
    report(f"{road} {seed}", before, after, user.n_actions)
    return tuple(sum(e.total_m for e in errors.values()) for errors in (before, after))


def report(name, before, after, n_actions):
    print(f"{name}: {n_actions} actions")
    print(f"  {'':20}{'missing m':>18}{'wrong m':>18}")
    for kind in KINDS:
        a, b = before[kind], after[kind]
        if a.total_m + b.total_m >= 0.5:
            print(f"  {kind:20}{a.missing_m:8.0f} -> {b.missing_m:6.0f}{a.wrong_m:8.0f} -> {b.wrong_m:6.0f}")
    a, b = (sum(e.total_m for e in errors.values()) for errors in (before, after))
    print(f"  in error: {a:.0f} m before, {b:.0f} m after, {share(a, b)} removed", flush=True)


def share(before, after):
    return f"{100.0 * (1.0 - after / max(before, 1e-9)):.0f} %"


if __name__ == "__main__":
    import sys

    main(sys.argv[1:])
