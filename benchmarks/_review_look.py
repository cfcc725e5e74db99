"""What a scripted user does where the road is looked over: false lines rejected, wrong ends cut off, missing lines added."""

import numpy as np

from benchmarks._review_scene import KINDS, missing_runs, right_share
from linework.model.grid import holds
from linework.tracing.rails import distance_m

#: Drawing is worth it from so many metres for a click where all that points to more is settled. [m]
LEAST_LOOKED_M = 1.0
#: To select a line costs one action, and so does each key.
_SELECT, _KEY = 1, 1
#: A person mends so many things in one look before going on.
MOST_MENDS = 12


def look_over(user, item):
    """Mend what is wrong or missing in the box of an item, what brings most first."""
    done = [_rejected(user, item.box)]
    cuts = [cut_off(user, line, LEAST_LOOKED_M, _SELECT)[0] for line in _near(user, item.box)]
    done += [f"cut {cut_m:.0f} m off" for cut_m in cuts if cut_m]
    tried = set()
    for _ in range(MOST_MENDS):
        runs = [
            (run, kind)
            for kind in KINDS
            for run in missing_runs(user.line_file.lines, user.truth, kind, item.box, beyond=True)
            if (kind, *np.round(run[1][len(run[1]) // 2], 1).tolist()) not in tried
        ]
        runs = [(run, kind) for run, kind in runs if run[0] >= 2.0 * LEAST_LOOKED_M]
        if not runs or user.left <= 0:
            break
        run, kind = max(runs, key=lambda one: one[0][0])
        tried.add((kind, *np.round(run[1][len(run[1]) // 2], 1).tolist()))
        done.append(f"{kind} {user.mend(kind, item.box, run, LEAST_LOOKED_M)}")
    if user.left > 0:
        user.do({"action": "dismiss", "key": item.key})
    return "; ".join(part for part in done if part) or "nothing is wrong"


def _near(user, box):
    """Ids of the lines that a box shows."""
    lines = user.line_file.lines
    inside = holds(box, lines.xyz) & (lines.review != "rejected")[lines.line_of_vertex]
    return [str(lines.id[i]) for i in np.unique(lines.line_of_vertex[inside]) if lines.kind[i] in KINDS]


def _rejected(user, box):
    """Reject the lines that are wrong: a click on each, and one key for all."""
    names = _near(user, box)
    lines = user.line_file.lines
    wrong, wrong_m = [], 0.0
    for name in names:
        line = lines.take(lines.id == name)
        length_m = float(line.length_m[0])
        if length_m >= LEAST_LOOKED_M and right_share(line, user.truth) < 0.5:
            wrong.append(name)
            wrong_m += length_m
    wrong = wrong[: max(user.left - _KEY, 0)]
    if not wrong:
        return ""
    user.do({"action": "reject", "ids": wrong}, cost=_SELECT * len(wrong) + _KEY)
    return f"rejected {len(wrong)} lines"


def cut_off(user, name, least_m, select=0):
    """Cut what is wrong off a line and reject it, while an action brings `least_m`; return how much [m], and what is left.

    A cut at the mouse is a key; so is the rejection of the piece, which is clicked. Of a piece in the middle the second cut
    needs a click, too. `select`: what it costs to select the line.
    """
    cut_m = 0.0
    while True:
        line = user.line_file.lines.take(user.line_file.lines.id == name)
        step = np.linalg.norm(np.diff(line.xyz[:, :2], axis=0), axis=1)
        wrong = np.concatenate([[0], (~user.good_segments(line)).astype(int), [0]])
        edges = np.flatnonzero(np.diff(wrong)).reshape(-1, 2).tolist()
        a, b = max(edges, key=lambda run: step[run[0] : run[1]].sum(), default=(0, 0))
        wrong_m, cuts = float(step[a:b].sum()), [k for k in (a, b) if 0 < k < len(step)]
        cost = select + _KEY + (len(cuts) - 1) * (_SELECT + _KEY) + _SELECT + _KEY
        if not cuts or wrong_m < least_m * cost or cost > user.left:
            return cut_m, name
        pieces, middle = [name], line.xyz[(a + b) // 2 : (a + b) // 2 + 2].mean(axis=0)
        for k in cuts:
            there = set(user.line_file.lines.id.tolist())
            at = tuple(line.xyz[k, :2].tolist())
            user.do({"action": "split", "id": _piece_at(user, pieces, middle), "at": at}, cost=0)
            pieces += sorted(set(user.line_file.lines.id.tolist()) - there)
        gone = _piece_at(user, pieces, middle)
        user.do({"action": "reject", "ids": [gone]}, cost=cost)
        left = user.line_file.lines.take(np.isin(user.line_file.lines.id, [p for p in pieces if p != gone]))
        cut_m, select, name = cut_m + wrong_m, _SELECT, str(left.id[np.argmax(left.length_m)])


def _piece_at(user, names, place):
    """Id of the line of some that runs through a place."""
    lines = user.line_file.lines
    return min(names, key=lambda name: distance_m(lines.take(lines.id == name).xyz[:, :2], place[:2]))
