"""A scripted user of the review queue, who sees the truth where the queue says to look, and acts as a person would."""

from dataclasses import dataclass, field
from functools import partial

import numpy as np

from benchmarks._review_look import cut_off, look_over
from benchmarks._review_scene import WITHIN_M, matched, missing_runs, right_share
from linework.editing.edits.attributes import with_kind
from linework.editing.edits.new_lines import foot_along, places_beside
from linework.editing.edits.vertices import trim_to_vertices
from linework.errors import InputError, UsageError
from linework.model.changes import Change
from linework.model.lines import LineSet
from linework.tracing.rails import distance_m
from linework.workbench.edits.apply import EditInputs, change_of
from linework.workbench.edits.orders import ChangeOrder
from linework.workbench.review.queue import queue_item
from linework.workbench.server.documents import lines_of

#: A person takes a line for right that is right over this share.
RIGHT = 0.8
#: Vertices are clicked so that the chords between them are this near to the line. [m]
CHORD_M = 0.05
#: Drawing is worth it from so many metres for a click.
LEAST_PER_CLICK_M = 4.0
#: So many vertices off in between, or at an end, are not cut away.
FEW = 3
#: A person clicks so often in one stretch before giving up.
TRIES = 2


#: A line beside another: a click on that line, and one where each end is. As many hang a wire.
BESIDE_CLICKS = 3
#: A wire that extraction found nothing of is hung at once, if it is so long. [m]
WIRE_M = BESIDE_CLICKS * LEAST_PER_CLICK_M
#: Lines that run along the road, and are no farther from one another. [m]
ALONG, ROAD_M = ("lane_marking", "road_boundary", "guardrail", "barrier"), 15.0
#: A point of a wire is clicked where one is within this of it. [m]
CLICK_M = 0.15


@dataclass
class User:
    """Works a queue; every click and every key that changes something is an action.

    `tracer` follows lines, `heights` measures heights of a kind of line at places, and `spans` says where the
    paint along a line shows dashes, as the workbench does.
    """

    line_file: object
    truth: LineSet
    tracer: object
    heights: object
    spans: object
    most: int
    n_actions: int = 0
    told: list = field(default_factory=list)
    tried: set = field(default_factory=set)

    @property
    def left(self):
        return self.most - self.n_actions

    def settle(self, item):
        """Do about an item of the queue what a person would do."""
        before = self.n_actions
        done = {
            "line": self._judge,
            "copy": self._judge,
            "dashes": self._dash,
            "sure": self._take_sure,
            "rest": self._leave,
            "stretch": partial(look_over, self),
        }.get(item.type, self._fill)(item)
        self.told.append((item, done, self.n_actions - before))

    def do(self, edit, given=None, cost=1):
        """Save an edit; it costs actions."""
        order = ChangeOrder.model_validate({"revision": self.line_file.revision, "edit": edit})
        self.save(change_of(order.edit, self.line_file.lines, given or self._given(order.edit)), cost)

    def _given(self, edit):
        """Return what a worker measures for an edit."""
        if edit.action != "dashes":
            return EditInputs()
        chosen = lines_of(self.line_file.lines, edit.ids)
        spans = {
            str(chosen.id[k]): self.spans(chosen[k].xyz, float(chosen.width_m[k])) for k in range(len(chosen))
        }
        return EditInputs(spans=spans)

    def save(self, change: Change, cost=1):
        self.line_file.commit(change, who="scripted", based_on=self.line_file.revision)
        self.n_actions += cost

    def _judge(self, item):
        """Accept or reject a line, or take what it is proposed to be."""
        line = lines_of(self.line_file.lines, item.ids)
        if item.as_kind and right_share(with_kind(line, item.as_kind), self.truth) >= RIGHT:
            self.do({"action": "kind", "ids": list(item.ids), "kind": item.as_kind})
            return "taken"
        is_right = right_share(line, self.truth) >= 0.5
        cut_m, names = 0.0, list(item.ids)
        if is_right and len(names) == 1:
            cut_m, *names = cut_off(self, names[0], LEAST_PER_CLICK_M)
        if self.left > 0:
            self.do({"action": "accept" if is_right else "reject", "ids": names})
        return "rejected" if not is_right else f"accepted but for {cut_m:.0f} m" if cut_m else "accepted"

    def agrees(self, item):
        """Whether the proposal of an item is right."""
        line = lines_of(self.line_file.lines, item.ids)
        if item.proposal in ("accept", "reject"):
            is_right = right_share(line, self.truth) >= (RIGHT if item.proposal == "accept" else 0.5)
            return is_right == (item.proposal == "accept")
        raise ValueError(f"whether to {item.proposal} is right is not known")

    def _take_sure(self, item):
        """Accept what has nothing to check, at once."""
        self.do(queue_item(item).proposal)
        return "accepted"

    def _leave(self, item):
        """Leave lines of which hardly any length is expected to be wrong."""
        self.do({"action": "dismiss", "key": item.key})
        return "left"

    def _dash(self, item):
        """Add the dashes that the paint shows if they are right: the item shows the paint, and proposes nothing."""
        edit = {"action": "dashes", "ids": list(item.ids)}
        if self._adds_right(edit):
            self.do(edit)
            return "dashes added"
        self.do({"action": "dismiss", "key": item.key})
        return "dismissed"

    def _adds_right(self, edit):
        """Whether what an edit adds would be right."""
        order = ChangeOrder.model_validate({"revision": 0, "edit": edit})
        try:
            change = change_of(order.edit, self.line_file.lines, self._given(order.edit))
        except UsageError:
            return False
        new = added(change)
        return len(new) > 0 and right_share(new, self.truth) >= RIGHT

    def _fill(self, item):
        """Join, follow, or draw what is missing."""
        runs = missing_runs(self.line_file.lines, self.truth, item.kind, item.box)
        if not runs:
            self.do({"action": "dismiss", "key": item.key})
            return "dismissed: nothing is missing"
        joint = {"action": "join", "ids": list(item.ids)}  # the item selects both
        if len(item.ids) == 2 and self._adds_right(joint):
            self.do(joint)
            return "joined"
        length_m, xyz, lacks_m = runs[0]
        attempt = (item.key, *np.round(xyz[len(xyz) // 2], 1).tolist())
        if attempt in self.tried:
            self.do({"action": "dismiss", "key": item.key})
            return "dismissed: what was done did not help"
        self.tried.add(attempt)
        return self.mend(item.kind, item.box, (length_m, xyz, lacks_m), LEAST_PER_CLICK_M, item.key)

    def mend(self, kind, box, run, least_m, key=""):
        """Add a line that is missing: hung, put beside another, followed, or drawn where a click brings `least_m`."""
        length_m, xyz, lacks_m = run
        seen = np.flatnonzero(lacks_m)
        if kind == "cable" and length_m >= WIRE_M:
            runs = missing_runs(self.line_file.lines, self.truth, kind, box)
            hung = sum(self._saved(self._wire(run[1]), "cable") for run in runs if run[0] >= WIRE_M)
            if hung:
                return f"hung {hung} wires"
        elif self._put_beside(kind, box):
            return "put beside a line"
        # A refused click costs as much as one that helps: little is not worth trying twice
        for k in range(min(TRIES, int(length_m / (2.0 * LEAST_PER_CLICK_M)))):
            if self.left <= 0:
                return "out of actions"
            place = xyz[seen[(2 * k + 1) * len(seen) // (2 * TRIES)]]
            if self._followed(kind, place):
                return f"followed {length_m:.0f} m"
        return self._draw(kind, key, xyz[seen[0] : seen[-1] + 1], (length_m, least_m))

    def _followed(self, kind, place):
        """Click on the line; keep what grows from there as far as it is right."""
        self.n_actions += 1
        steps = self.tracer.trace((float(place[0]), float(place[1])), kind=kind)
        try:
            while True:
                next(steps)
        except StopIteration as end:
            traced = end.value
        except InputError:
            return False
        span = self.right_span(traced.lines.take([0]))
        if span is None or traced.kind != kind:
            return False
        kept = trim_to_vertices(traced.lines.take([0]), *span)
        if distance_m(kept.xyz[:, :2], place[:2]) > WITHIN_M:
            return False  # another line grew
        # Nodes that went wrong are taken back one by one, or the line is trimmed: one more action
        is_whole = span == (0, int(traced.lines.offsets[1]) - 1)
        edit = {"action": "keep", "trace": "1", "first": span[0], "last": span[1]}
        order = ChangeOrder.model_validate({"revision": 0, "edit": edit})
        change = change_of(order.edit, self.line_file.lines, EditInputs(kept=traced.lines))
        self.save(change, cost=0 if is_whole else 1)
        return True

    def right_span(self, line):
        """First and last vertex of the longest stretch of a line that is right; None if that is little."""
        good, n = self.good_segments(line), int(line.offsets[1])
        edges = np.flatnonzero(np.diff(np.concatenate([[0], good.astype(int), [0]]))).reshape(-1, 2)
        # A vertex off here and there is no reason to cut a line
        merged = []
        for a, b in edges.tolist():
            if merged and a - merged[-1][1] <= FEW:
                merged[-1][1] = b
            else:
                merged.append([a, b])
        best = max(merged, key=lambda run: run[1] - run[0], default=None)
        if best is None:
            return None
        return 0 if best[0] < FEW else best[0], n - 1 if best[1] >= n - FEW else best[1]

    def good_segments(self, line):
        """Which segments of a line are right."""
        kind = str(line.kind[0])
        match, is_right, _ = matched(line.with_columns(crs=self.truth.crs), self.truth, kind)
        step = np.linalg.norm(np.diff(line.xyz[:, : match.reference.n_dims], axis=0), axis=1)
        along, pieces = np.concatenate([[0.0], np.cumsum(step)]), match.e_pieces
        segment = np.clip(np.searchsorted(along, pieces.chainage_m, side="right") - 1, 0, len(step) - 1)
        right, whole = (
            np.bincount(segment, weights=length, minlength=len(step))
            for length in (pieces.length_m * is_right, pieces.length_m)
        )
        return right >= 0.5 * whole

    def _put_beside(self, kind, box):
        """Put the line that lacks most beside another, and a kerb's top beside it."""
        done = False
        for one in (kind, *(("kerb_top",) if kind == "road_boundary" else ())):
            runs = missing_runs(self.line_file.lines, self.truth, one, box, whole=True)
            if runs:
                done |= self._saved(self._beside(one, *runs[0][1:]), one)
        return done

    def _saved(self, change, kind):
        """Save a line of three clicks; one more takes back what is not right."""
        if change is None or self.left <= BESIDE_CLICKS:
            return False
        self.n_actions += BESIDE_CLICKS
        if right_share(change.after[kind], self.truth) >= RIGHT:
            self.save(change, cost=0)
            return True
        self.n_actions += 1
        return False

    def _beside(self, kind, xyz, lacks_m):
        """Return the change that puts a line beside one that runs evenly along most of what is missing."""
        lines = self.line_file.lines
        lines = lines.take((lines.review != "rejected") & np.isin(lines.kind, ALONG))
        covers = [covered(lines[i].xyz, xyz, lacks_m) for i in range(len(lines))]
        best = max(range(len(lines)), key=lambda i: covers[i][0], default=None)
        if best is None or covers[best][0] < BESIDE_CLICKS * LEAST_PER_CLICK_M:
            return None
        first, last = covers[best][1]
        edit = {"action": "beside", "id": str(lines.id[best]), "kind": kind}
        edit["at"] = [tuple(xyz[k, :2].tolist()) for k in (first, last)]
        order = ChangeOrder.model_validate({"revision": 0, "edit": edit}).edit
        try:
            places = places_beside(lines.take([best]), kind, np.array(order.at))
            heights = np.column_stack(self.heights(kind, places.tolist()))
            return change_of(order, self.line_file.lines, EditInputs(heights=heights))
        except UsageError:
            return None

    def _wire(self, xyz):
        """Return the change that hangs a wire through points of it that are seen in 3-D."""
        heights = self.heights("cable", xyz.tolist())[0]
        seen = np.flatnonzero(np.abs(heights - xyz[:, 2]) <= CLICK_M)
        if len(seen) < 3:
            return None
        clicked = seen[[0, len(seen) // 2, -1]]
        places = [(float(xyz[k, 0]), float(xyz[k, 1]), float(heights[k])) for k in clicked]
        order = ChangeOrder.model_validate({"revision": 0, "edit": {"action": "wire", "xyz": places}}).edit
        try:
            return change_of(order, self.line_file.lines, EditInputs())
        except UsageError:
            return None

    def _draw(self, kind, key, xyz, worth):
        """Draw what cannot be followed, if a click brings enough; else dismiss the item of a key."""
        vertices, (length_m, least_m) = simplified(xyz, CHORD_M), worth
        # A wire hangs in a curve: two clicks do not make one
        if kind == "cable" or len(vertices) > self.left or length_m < least_m * len(vertices):
            if self.left > 0 and key:
                self.do({"action": "dismiss", "key": key})
            return f"left {length_m:.0f} m"
        heights = np.column_stack(self.heights(kind, vertices[:, :2]))
        edit = {"action": "draw", "kind": kind, "xyz": [(float(e), float(n)) for e, n, _ in vertices]}
        self.do(edit, EditInputs(heights=heights), cost=len(vertices))
        return f"drew {length_m:.0f} m with {len(vertices)} clicks"


def added(change):
    """What a change adds: dashes, and of joined lines the piece between them."""
    if change.action == "dashes":
        return change.after["lane_marking_dash"]
    if change.action != "join":
        return change.after
    whole = change.after.take([0])  # the line itself: tops come along
    is_old = np.isin(whole.xyz[:, 0], change.before.xyz[:, 0])
    new = np.flatnonzero(~is_old)
    if len(new):
        return trim_to_vertices(whole, max(int(new[0]) - 1, 0), min(int(new[-1]) + 1, len(whole.xyz) - 1))
    widest = int(np.argmax(np.hypot(*np.diff(whole.xyz[:, :2], axis=0).T)))
    return trim_to_vertices(whole, widest, widest + 1)


def length_of(xyz):
    return float(np.hypot(*np.diff(xyz[:, :2], axis=0).T).sum())


def covered(line, xyz, lacks_m):
    """How much of what is missing a line runs along evenly [m], and from which to which place."""
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line[:, :2], axis=0).T))])
    foot = np.array([foot_along(line, along, place) for place in xyz])
    places = np.stack([np.interp(foot, along, column) for column in line[:, :2].T], axis=1)
    away = np.hypot(*(places - xyz[:, :2]).T)
    near = np.flatnonzero((away <= ROAD_M) & (foot > 0.0) & (foot < along[-1]) & (lacks_m > 0.0))
    if len(near) < 2:
        return 0.0, (0, 0)
    span = slice(near[0], near[-1] + 1)
    evenly = np.polyval(np.polyfit(foot[span], away[span], 1), foot[span])
    is_even = float(np.std(away[span] - evenly)) <= CHORD_M
    return float(lacks_m[span].sum()) if is_even else 0.0, (int(near[0]), int(near[-1]))


def simplified(xyz, within_m):
    """Fewest places (k, 3) of a line whose chords are near to it (Douglas and Peucker 1973)."""
    keep = [0, len(xyz) - 1]
    stack = [(0, len(xyz) - 1)]
    while stack:
        a, b = stack.pop()
        if b - a < 2:
            continue
        way = xyz[b, :2] - xyz[a, :2]
        step = xyz[a + 1 : b, :2] - xyz[a, :2]
        off = np.abs(way[0] * step[:, 1] - way[1] * step[:, 0]) / max(float(np.hypot(*way)), 1e-9)
        k = int(np.argmax(off))
        if off[k] > within_m:
            keep.append(a + 1 + k)
            stack += [(a, a + 1 + k), (a + 1 + k, b)]
    return xyz[sorted(keep)]
