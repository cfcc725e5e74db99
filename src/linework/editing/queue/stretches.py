"""Stretches of road to look over: where what is wrong or missing has no item of its own.

Separate from `suspects` and `gaps`, which list what points to an error by itself: this divides the road, so that each of
its metres is looked at, those first where most is expected.
"""

from __future__ import annotations

import numpy as np

from linework.arrays import FloatArray, IntArray
from linework.editing.queue.suspects import (
    REVIEWED_TOGETHER,
    VIEW_M,
    Suspect,
    WasMeasured,
    expected_wrong_m,
    line_stations,
    view_box,
    wrong_share,
)
from linework.lines.along import PATH_STEP_M, DrivenPath
from linework.model.lines import LineSet

#: Line that is missing and that no other item leads to, for each metre of road: 486 m on 1,800 m of simulated streets,
#: motorways, rural roads and junctions (seeds 3410 to 3412, 150 m each). [m]
MISSING_PER_M = 0.27
#: Distance from the path up to which a stretch is looked over: what lies beyond belongs to another road. [m]
LOOKED_OVER_M = 15.0
#: Distance of the places of a line at which it is told to which stretch it belongs. [m]
_STATION_M = 2.0


def road_stretches(
    lines: LineSet, way: DrivenPath, visible: WasMeasured, listed: frozenset[str] = frozenset()
) -> list[Suspect]:
    """Return the road in stretches that fit on a screen, with the length expected to be wrong or missing in each.

    Parameters
    ----------
    lines
        Without rejected ones; what a person has reviewed is taken for right.
    way
        The van's way; without one there are no stretches.
    visible
        Says where ground was measured: where nothing was, nothing is missing.
    listed
        Ids of lines that have an item of their own.
    """
    stretch_of_step, n = _stretches(way, visible)
    if n == 0:
        return []
    wrong_m, n_lines = _in_stretches(lines, way, stretch_of_step, listed)
    found = []
    for k in range(n):
        steps = np.flatnonzero(stretch_of_step == k)
        places = way.xy[steps]
        measured_m = float(np.mean(visible(places))) * len(steps) * PATH_STEP_M
        length_m = wrong_m[k] + MISSING_PER_M * measured_m
        middle = places[len(places) // 2]
        left_m = np.repeat([LOOKED_OVER_M, -LOOKED_OVER_M], len(steps))
        corners = way.places(np.tile(steps.astype(np.float64), 2), left_m)
        what = f"{n_lines[k] or 'no'} {'line' if n_lines[k] == 1 else 'lines'} that nobody has checked"
        found.append(
            Suspect(
                type="stretch",
                ids=(),
                kind="",
                at=(float(middle[0]), float(middle[1])),
                box=view_box(corners),
                length_m=float(length_m),
                confidence=0.0,
                reason=f"{len(steps) * PATH_STEP_M:.0f} m of road with {what}; about {length_m:.0f} m of lines may be wrong or missing",
            )
        )
    return found


def _stretches(way: DrivenPath, visible: WasMeasured) -> tuple[IntArray, int]:
    """Return the number of the stretch of each step of the path (k,), -1 where none is, and how many there are.

    A piece of the path counts from the first to the last step at which ground was measured: a trajectory may go on for
    hundreds of metres beyond the points.
    """
    number, n = np.full(len(way), -1, dtype=np.int64), 0
    if len(way) == 0:
        return number, 0
    measured = np.flatnonzero(visible(way.xy))
    for first, last in way.pieces:
        here = measured[(measured >= first) & (measured <= last)]
        if len(here) == 0:
            continue
        first, last = int(here[0]), int(here[-1])  # noqa: PLW2901
        n_steps = last - first + 1
        n_parts = max(round(n_steps * PATH_STEP_M / VIEW_M), 1)
        number[first : last + 1] = n + np.arange(n_steps) * n_parts // n_steps
        n += n_parts
    return number, n


def _in_stretches(
    lines: LineSet, way: DrivenPath, stretch_of_step: IntArray, listed: frozenset[str]
) -> tuple[FloatArray, IntArray]:
    """Return by stretch the length that is expected to be wrong [m], and how many unchecked lines it has.

    Dashes and tops are checked with their lines; edges beside a boundary are an extra to it.
    """
    n = int(stretch_of_step.max()) + 1
    number = np.flatnonzero((lines.review == "") & (lines.kind != "edge_other"))
    stations = [line_stations(lines[i].xyz, _STATION_M) for i in number.tolist()]
    # All lines at once: by itself each takes a tenth of a millisecond, and a survey may have 20,000
    n_stations = np.array([len(places) for places in stations], dtype=np.int64)
    step = way.offsets(np.concatenate([np.zeros((0, 2)), *stations]), LOOKED_OVER_M)[0]
    there = np.flatnonzero(np.isfinite(step))
    here = stretch_of_step[np.clip(np.rint(step[there]).astype(np.int64), 0, len(way) - 1)]
    line = np.repeat(np.arange(len(number)), n_stations)[there]
    part, count = np.unique((line * n + here)[here >= 0], return_counts=True)
    line, here = part // n, part % n
    n_lines = np.bincount(here[~np.isin(lines.kind[number], REVIEWED_TOGETHER)[line]], minlength=n)
    share = np.array([wrong_share(str(lines.kind[i]), str(lines.form[i])) for i in number.tolist()])
    wrong_m = share * expected_wrong_m(lines)[number]
    wrong_m[np.isin(lines.id[number], list(listed))] = 0.0
    weights: FloatArray = wrong_m[line] * count / n_stations[line]
    return np.bincount(here, weights, n).astype(np.float64), n_lines
