"""How near the truth vertices drawn by hand end, with and without snapping to the edge under the cursor.

Places on the true lines of simulated drives are moved by a hand that is off by 10 cm (normal, in both directions) and
sent to the workbench's snap. Counted is what ends within 2 cm and within 5 cm of the true line, and what the snap made
worse by more than 2 cm.

``python -m benchmarks.snap --seeds 4611,4612 --roads urban,motorway``
"""

import argparse
import tempfile
import time
from pathlib import Path

import numpy as np

from benchmarks.accuracy import seeds_of
from linework.arrays import distance_along
from linework.files.vectors.read_write import read_lines
from linework.simulation.folder import write_survey_folder
from linework.simulation.roads.draw import draw_scenario
from linework.simulation.simulate import survey_of
from linework.workbench.views.snap import SNAP_EDGES, snapped_place
from linework.workbench.worker.order import SurveyOrder
from linework.workbench.worker.session import SurveySession

#: Simulates surveys: run where it is asked for.
ON_REQUEST = True
HAND_M, REACH_M, EVERY_M = 0.10, 0.30, 5.0


def main(arguments=()):
    options = parsed(arguments)
    counts = {}
    with tempfile.TemporaryDirectory(prefix="linework-snap-") as scratch:
        for survey in [Path(one) for one in options.surveys.split(",") if one] or simulated(options, scratch):
            count(survey, Path(scratch, f"work-{survey.name}"), counts)
    print(
        f"{'kind':20}{'places':>8}{'<= 2 cm by hand':>17}{'snapped':>9}{'<= 5 cm':>9}{'moved':>8}{'worse':>7}{'ms':>6}"
    )
    for kind, rows in sorted(counts.items()):
        before, after, moved, seconds = np.array(rows).T
        share = [np.mean(before <= 0.02), np.mean(after <= 0.02), np.mean(after <= 0.05), np.mean(moved),
                 np.mean(after > before + 0.02)]  # fmt: skip
        a, b, c, d, e = (f"{100.0 * value:.0f} %" for value in share)
        print(f"{kind:20}{len(rows):8}{a:>17}{b:>9}{c:>9}{d:>8}{e:>7}{1e3 * np.median(seconds):6.0f}")


def parsed(arguments):
    parser = argparse.ArgumentParser(prog="python -m benchmarks.snap")
    parser.add_argument("--roads", default="urban", help="kinds of road, with commas between")
    parser.add_argument("--seeds", default="4611")
    parser.add_argument("--length-m", type=float, default=120.0)
    parser.add_argument("--surveys", default="", help="simulated surveys that are there, with commas between")
    return parser.parse_args(list(arguments))


def simulated(options, scratch):
    for road in options.roads.split(","):
        for seed in seeds_of(options.seeds):
            folder = Path(scratch, f"{road}{seed}")
            write_survey_folder(survey_of(draw_scenario(road, seed, options.length_m)), folder)
            yield folder


def count(survey, work, counts):
    session = SurveySession(SurveyOrder((survey,), work=work), lambda _: None)
    truth = read_lines(survey / "truth.gpkg")
    rng = np.random.default_rng(7)
    for i in range(len(truth)):
        kind = str(truth.kind[i])
        if kind not in SNAP_EDGES:
            continue
        line = truth.take([i]).xyz[:, :2]
        along = distance_along(line)
        at_m = np.arange(1.0, along[-1] - 1.0, EVERY_M)
        places = np.stack([np.interp(at_m, along, line[:, k]) for k in (0, 1)], axis=1)
        ahead = np.stack([np.interp(at_m + 1.0, along, line[:, k]) for k in (0, 1)], axis=1) - places
        for place, step in zip(places, ahead, strict=True):
            hand = place + rng.normal(scale=HAND_M, size=2)
            heading = float(np.degrees(np.arctan2(*step)) + rng.normal(scale=5.0))
            start = time.perf_counter()
            found = snapped_place(session, kind, (float(hand[0]), float(hand[1])), REACH_M, heading)
            seconds = time.perf_counter() - start
            before = off(hand, line)
            after = off(np.array(found["at"]), line) if found else before
            counts.setdefault(kind, []).append((before, after, found is not None, seconds))


def off(place, line):
    step = np.diff(line, axis=0)
    share = np.clip(
        ((place - line[:-1]) * step).sum(axis=1) / np.maximum((step**2).sum(axis=1), 1e-12), 0.0, 1.0
    )
    return float(np.hypot(*(line[:-1] + share[:, None] * step - place).T).min())


if __name__ == "__main__":
    import sys

    main(sys.argv[1:])
