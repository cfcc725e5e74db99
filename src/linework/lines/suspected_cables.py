"""Wires that end where none goes on: the next span may be missing."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from linework.lines.suspected import Suspect, box_of
from linework.model.lines import LineSet

#: Wires of two spans hang from one insulator, or from two on the same arm. [m]
SAME_POLE_M = 1.0
#: A line of poles that goes on has its next pole about as far away: how likely it does.
GOES_ON = 0.4
#: Ends that face each other over no more than this many spans are one wire's.
MOST_SPANS = 3.0
#: A wire that goes on after a missing span is in line with the one before. [deg]
_IN_LINE_DEG = 10.0
_BOTH_SIDES = 0.9


def loose_wires(lines: LineSet) -> list[Suspect]:
    """Return the ends of cables where no other cable begins, with the span that may be missing beyond."""
    number = np.flatnonzero((lines.kind == "cable") & (lines.review != "accepted"))
    every = np.flatnonzero(lines.kind == "cable")
    if len(number) == 0:
        return []
    tips = np.concatenate([lines.line(i)[[0, -1]] for i in every.tolist()])
    ways = np.concatenate([lines.line(i)[[1, -2], :2] for i in every.tolist()]) - tips[:, :2]
    ways /= -np.maximum(np.hypot(*ways.T), 1e-9)[:, None]
    owner = np.repeat(every, 2)
    near = cKDTree(tips - tips[0]).query_ball_point(tips - tips[0], SAME_POLE_M)
    loose = np.array(
        [all(owner[k] == owner[i] or ways[k] @ ways[i] > 0 for k in own) for i, own in enumerate(near)]
    )
    found = []
    for i in np.flatnonzero(loose & np.isin(owner, number)).tolist():
        span_m = float(np.hypot(*(tips[i ^ 1, :2] - tips[i, :2])))
        step = tips[loose, :2] - tips[i, :2]
        away = np.hypot(*step.T)
        ahead = step @ ways[i] >= np.cos(np.radians(_IN_LINE_DEG)) * np.maximum(away, 1e-9)
        facing = ahead & (away > SAME_POLE_M) & (away <= MOST_SPANS * span_m) & (ways[loose] @ ways[i] < -0.9)
        beyond = np.flatnonzero(loose)[facing]
        m = int(beyond[np.argmin(away[facing])]) if len(beyond) else -1
        if m >= 0 and m < i:
            continue  # seen from the other end already
        length_m = float(np.hypot(*(tips[m, :2] - tips[i, :2]))) if m >= 0 else span_m
        likely = _BOTH_SIDES if m >= 0 else GOES_ON
        target = tips[m, :2] if m >= 0 else tips[i, :2] + length_m * ways[i]
        found.append(
            Suspect(
                type="gap",
                ids=tuple(str(lines.id[owner[k]]) for k in (i, m) if k >= 0),
                kind="cable",
                at=(float(tips[i, 0]), float(tips[i, 1])),
                box=box_of(np.stack([tips[i, :2], target])),
                length_m=likely * length_m,
                confidence=1.0 - likely,
                reason=f"no wire goes on here for {length_m:.0f} m",
            )
        )
    return found
