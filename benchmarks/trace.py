"""How well and how fast picked places become lines, on simulated surveys of every road.

``python -m benchmarks trace``; ``python -m benchmarks.trace --seeds 800-803 --roads urban --worst`` takes others
and lists what went wrong. Every pick is the first on its opened survey: nothing is at hand but points and surface.
Seconds are the processor's, which one thread has: what else runs on the machine does not matter.
"""

import argparse
import time
from dataclasses import dataclass

import numpy as np

from benchmarks._trace_scenes import KINDS, opened_simulation, places_away, places_on, resampled
from benchmarks.accuracy import seeds_of
from linework.errors import InputError
from linework.runs.settings import RunSettings
from linework.simulation.roads.draw import USUAL_ROADS
from linework.tracing.rails import distance_m
from linework.tracing.trace import Tracer

WITHIN_M, FOLLOW_M = 0.10, 100.0
#: Ends are not known better than this, those of dashed lines than the longest gap between dashes. [m]
END_M = {"solid": 2.0, "dashed": 12.0}
#: A line that is hidden for longer than by a parked lorry has its end there. [m]
HIDDEN_M = 12.0
#: Of lines that lie above one another, or as near to the place as this, either is right. [m]
AS_NEAR_M = 0.10


@dataclass(frozen=True)
class Result:
    """What came of one pick."""

    survey: str
    place: np.ndarray
    kind: str
    is_right: bool
    said: str
    seconds: float
    first_s: float
    length_m: float


def main(arguments=()):
    options = parsed(arguments)
    surveys = [(road, seed) for road in options.roads.split(",") for seed in seeds_of(options.seeds)]
    on, away = [], []
    for k, (road, seed) in enumerate(surveys):
        n_on, n_away = (_share(n, k, len(surveys)) for n in (options.on, options.away))
        with opened_simulation(road, seed, options.length_m) as (simulated, opened, surface):
            rng = np.random.default_rng([seed, k])
            name = f"{road} {seed}"
            fresh = lambda o=opened, s=surface: Tracer(o, s, RunSettings())  # noqa: E731
            places = places_on(simulated.truth, n_on, rng)
            if k == 0:
                for place in places[:5]:  # compiles
                    picked(fresh(), place)
            on += [picked_on(name, simulated.truth, fresh(), place) for place in places]
            away += [picked_away(name, fresh(), a) for a in places_away(simulated, n_away, rng)]
        print(f"{name}: {_tally(on[-n_on:])} followed, {_tally(away[-n_away:])} refused rightly", flush=True)
    report(on, away)
    if options.worst:
        for r in [*on, *away]:
            if not r.is_right:
                print(f"{r.survey}: {r.kind} at {r.place[0]:.2f},{r.place[1]:.2f}: {r.said}")


def parsed(arguments):
    parser = argparse.ArgumentParser(prog="python -m benchmarks.trace")
    parser.add_argument("--seeds", default="800-803", help="first-last, or a list")
    parser.add_argument("--roads", default=",".join(USUAL_ROADS))
    parser.add_argument("--length-m", type=float, default=150.0)
    parser.add_argument("--on", type=int, default=500, help="picks on lines")
    parser.add_argument("--away", type=int, default=200, help="picks away from all lines")
    parser.add_argument("--worst", action="store_true", help="list what went wrong")
    return parser.parse_args(list(arguments))


def picked(tracer, place):
    """Return the line (or the refusal), and the seconds to the end and to the first step."""
    start, first = time.process_time(), None
    steps = tracer.trace((float(place[0]), float(place[1])))
    try:
        while True:
            next(steps)
            first = first or time.process_time() - start
    except StopIteration as end:
        found = end.value
    except InputError as error:
        found = error
    seconds = time.process_time() - start
    return found, seconds, first or seconds


def picked_on(name, truth, tracer, place):
    found, seconds, first = picked(tracer, place)
    lines = np.flatnonzero(np.isin(truth.kind, KINDS))
    apart = np.array([distance_m(truth[i].xyz[:, :2], place) for i in lines])
    meant = [lines[k] for k in np.flatnonzero(apart <= apart.min() + AS_NEAR_M)]
    kind = "/".join(dict.fromkeys(truth.kind[meant].tolist()))
    if isinstance(found, InputError):
        return Result(name, place, kind, False, str(found), seconds, first, 0.0)
    own = found.lines[found.kind]
    length = float(own.length_m.sum())
    short = [missing_m(truth, i, own, place) for i in meant if truth.kind[i] == found.kind]
    said = f"{found.kind} of {length:.1f} m, {min(short, default=np.nan):.1f} m are missing"
    return Result(name, place, kind, 0.0 in short, said, seconds, first, length)


def missing_m(truth, i, own, place):
    """Return how much of 100 m each way, or to the line's observed end, was not followed. [m]"""
    xy, seen = resampled(truth, i)
    step = float(np.hypot(*(xy[1] - xy[0])))
    apart = np.full(len(xy), np.inf)
    for j in range(len(own)):
        apart = np.minimum(apart, _distances(own[j].xyz[:, :2], xy))
    start = int(np.argmin(np.hypot(*(xy - place).T)))
    missing = 0.0
    for way in (slice(start, None), slice(start, None, -1)):
        good, visible = apart[way] <= WITHIN_M, seen[way]
        n = min(_end_of(visible, step), round(FOLLOW_M / step))
        bad = visible[:n] & ~good[:n]
        # From the first metre that is off, all is lost; so near to the end, nothing is
        lost = np.flatnonzero(np.convolve(bad, np.ones(3), "valid") >= 3)
        if len(lost) and (n - lost[0]) * step > END_M.get(truth.pattern[i], END_M["solid"]):
            missing += (n - lost[0]) * step
    return missing


def _distances(line, places):
    return np.array([distance_m(line, place) for place in places])


def _end_of(visible, step):
    """Return how many stations are left until the line is hidden for good."""
    seen = np.flatnonzero(visible)
    if len(seen) == 0:
        return 0
    hidden = np.flatnonzero(np.diff(seen) * step > HIDDEN_M)
    return int(seen[hidden[0]] if len(hidden) else seen[-1]) + 1


def picked_away(name, tracer, away):
    found, seconds, first = picked(tracer, away.place)
    if not isinstance(found, InputError):
        said = f"{found.kind} {found.distance_m:.2f} m away followed, right: {_named(away.reasons)}"
        return Result(name, away.place, away.where, False, said, seconds, first, 0.0)
    is_right = any(str(reason) in str(found) for reason in away.reasons)
    return Result(
        name, away.place, away.where, is_right, f"{found}; right: {_named(away.reasons)}", seconds, first, 0.0
    )


def _named(reasons):
    return " | ".join(sorted(reason.name for reason in reasons))


def report(on, away):
    print(
        f"\npicks on lines: {_tally(on)} followed for {FOLLOW_M:g} m or to the end within 10 cm (goal 95 %)"
    )
    for kind in KINDS:
        print(f"  {kind:14} {_tally([r for r in on if r.kind.startswith(kind)])}")
    print(f"picks away from lines: {_tally(away)} refused with the right reason (goal 98 %)")
    for where in ("carriageway", "beside", "off the data"):
        print(f"  {where:14} {_tally([r for r in away if r.kind == where])}")
    for name, some in (("lines", on), ("lines of 80 m and more", [r for r in on if r.length_m >= 80.0])):
        if some:
            whole, first = (np.array([getattr(r, f) for r in some]) for f in ("seconds", "first_s"))
            print(
                f"{name}: to the end {_spread(whole)} (goal 0.3 s), per 100 m "
                f"{_spread(100.0 * whole / np.maximum([r.length_m for r in some], 50.0))}, "
                f"first step {_spread(first)}"
            )


def _spread(values):
    return f"{np.median(values):.2f} s (95 %: {np.percentile(values, 95):.2f} s)"


def _tally(results):
    return f"{sum(r.is_right for r in results)} of {len(results)}"


def _share(n, k, of):
    return n * (k + 1) // of - n * k // of


if __name__ == "__main__":
    import sys

    main(sys.argv[1:])
