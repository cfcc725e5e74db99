"""Lines that may be one line measured twice: two of a kind that run closer to each other than two lines can.

Separate from `suspects`: this compares lines with each other, that looks at each by itself.
"""

from __future__ import annotations

import numpy as np
import shapely

from linework.arrays import FloatArray, distance_along
from linework.editing.queue.suspects import REVIEWED_TOGETHER, Suspect, line_middle, view_box
from linework.model.lines import STACKED_FORM, LineSet

#: Length over which two lines run together before they are queued: shorter, they may cross or meet. [m]
LEAST_TOGETHER_M = 5.0
#: Share of the weaker line's length that runs along the other.
_LEAST_SHARE = 0.5
#: Distance of the places at which two lines are compared. [m]
_STEP_M = 0.5
#: Standard deviations within which two measurements of one line agree (99.7 % of a normal distribution).
_N_SIGMAS = 3.0
#: Difference of heights above which lines are one above the other, as wires are. [m]
_LEAST_ABOVE_M = 0.3
#: That a line beside another is right: nothing says which of the two readings holds.
_UNDECIDED = 0.5


def copied_lines(lines: LineSet) -> list[Suspect]:
    """Return unreviewed lines that run along a better one of their kind, within what the accuracies of both allow.

    Two painted lines are at least a line's width apart (stripe and gap of a double line), and two kerbs do not run
    through each other: closer ones, with three standard deviations of their difference to spare, may be one. Which is
    meant to go, the one of lower confidence, then the shorter, is the item's line; nothing is proposed, since a double
    line in images can be measured as badly.
    """
    found = []
    for kind in sorted(set(lines.kind.tolist()) - set(REVIEWED_TOGETHER)):
        found += _copies_of(lines[kind])
    return found


def _copies_of(lines: LineSet) -> list[Suspect]:
    """Return the suspects among lines of one kind, one a line."""
    if len(lines) < 2:
        return []
    plan = [shapely.LineString(lines[k].xyz[:, :2]) for k in range(len(lines))]
    sigma_m = np.array([_median(lines[k].sigma_xy_m) for k in range(len(lines))])
    width_m = np.nan_to_num(lines.width_m)
    reach_m = width_m + _N_SIGMAS * sigma_m * np.sqrt(2.0)
    near = shapely.STRtree(plan).query(plan, predicate="dwithin", distance=np.maximum(reach_m, 1e-3) * 2.0)
    # Of each weaker line: the greatest length beside one other and, with its sign changed, the distance there
    best: dict[int, tuple[float, float]] = {}
    # Each line asks with its own reach: a pair counts whichever of the two reaches the other
    for i, j in np.unique(np.sort(near.T, axis=1), axis=0).tolist():
        if i == j:
            continue
        weak, other = _weaker_first(lines, i, j)
        # The pipes of a rail are one above another
        if lines.review[weak] != "" or set(lines.form[[i, j]].tolist()) == {STACKED_FORM}:
            continue
        limit_m = float(width_m[[i, j]].mean()) + _N_SIGMAS * float(np.hypot(sigma_m[i], sigma_m[j]))
        together_m, apart_m = _together(lines[weak].xyz, lines[other].xyz, limit_m)
        if together_m < max(LEAST_TOGETHER_M, _LEAST_SHARE * float(lines.length_m[weak])):
            continue
        best[weak] = max(best.get(weak, (0.0, 0.0)), (together_m, -apart_m))
    return [_suspect(lines, k, together_m, -nearness) for k, (together_m, nearness) in sorted(best.items())]


def _weaker_first(lines: LineSet, i: int, j: int) -> tuple[int, int]:
    """Return two lines, that one first which would go: unreviewed, of lower confidence, the shorter."""
    ranks = [
        (str(lines.review[k]) != "", float(lines.confidence[k]), float(lines.length_m[k]), str(lines.id[k]))
        for k in (i, j)
    ]
    return (i, j) if ranks[0] <= ranks[1] else (j, i)


def _together(line: FloatArray, other: FloatArray, limit_m: float) -> tuple[float, float]:
    """Return the length of a line (n, 3) that lies within a limit of another (m, 3), and their median distance there. [m]"""  # noqa: D400
    along = distance_along(line)
    stations = np.arange(0.5 * _STEP_M, along[-1], _STEP_M)
    places = np.column_stack([np.interp(stations, along, line[:, axis]) for axis in range(3)])
    reference = shapely.LineString(other[:, :2])
    points = shapely.points(places[:, :2])
    apart_m = shapely.distance(points, reference)
    at = shapely.line_locate_point(reference, points)
    height = np.interp(at, distance_along(other[:, :2]), other[:, 2])
    # Beyond the other's end nothing runs beside it
    is_beside = (at > 0.0) & (at < reference.length) & (apart_m <= limit_m)
    is_beside &= ~(np.abs(places[:, 2] - height) > _LEAST_ABOVE_M)
    n_beside = int(is_beside.sum())
    return n_beside * _STEP_M, float(np.median(apart_m[is_beside])) if n_beside else float("nan")


def _median(values: FloatArray) -> float:
    """Return the median of the known values; 0 where none is known."""
    known = values[np.isfinite(values)]
    return float(np.median(known)) if len(known) else 0.0


def _suspect(lines: LineSet, i: int, together_m: float, apart_m: float) -> Suspect:
    return Suspect(
        type="copy",
        ids=(str(lines.id[i]),),
        kind=str(lines.kind[i]),
        at=line_middle(lines[i].xyz),
        box=view_box(lines[i].xyz),
        length_m=_UNDECIDED * together_m,
        confidence=_UNDECIDED,
        reason=f"runs {100.0 * apart_m:.0f} cm beside a better one over {together_m:.0f} m: one line measured twice?",
    )
