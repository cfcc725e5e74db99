"""The review queue: what may be wrong or missing in a set of lines, largest expected gain first."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from linework.arrays import BoolArray, FloatArray, IntArray, distance_along
from linework.editing.edits.dashes import missing_middles, missing_spans, rhythm_of
from linework.lines.along import DrivenPath
from linework.model.grid import Bounds
from linework.model.lines import LineSet

#: Returns for (n, 2) places [m] whether ground was measured there: (n,).
WasMeasured = Callable[[FloatArray], BoolArray]
#: Length that fits on a screen with 10 cm visible; longer lines take several views. [m]
VIEW_M = 60.0
#: Smallest expected error that is queued. [m]
LEAST_SUSPECT_M = 2.0
#: Longest arrow, bar or stop line; longer paint along the road is a line. [m]
LONGEST_BAR_M = 12.0
#: Least share of bridged length that is wrong: 61 of 2,850 m on simulated streets of few points.
BRIDGED_WRONG = 0.02
#: Least share of a boundary without a kerb that is wrong, however sure it is: 209 of 1,331 m that were at least 95 % sure on
#: simulated motorways, rural roads and junctions (seeds 3410 to 3412, 150 m each); of kerbs it was 20 of 1,561 m.
EDGE_WRONG = 0.16
#: Confidence from which a line has nothing to check, and from which accepting it is proposed.
SURE_LINE, LIKELY_LINE = 0.98, 0.95
#: Kinds of which at least 20 lines that were so sure were counted on worlds that nobody had looked at, and 95 % right: nothing
#: else is proposed to be accepted (decision 134; seeds from 7001 on, 2026-11-28: docs/workbench.md has the counts).
COUNTED = ("lane_marking", "cable", "guardrail")
#: Types of items of many lines, which end the queue.
ALL_IN_ONE = ("rest", "sure")
#: Companion lines, reviewed together with their line; edges beside a boundary are an extra to it.
REVIEWED_TOGETHER = ("lane_marking_dash", "kerb_top", "edge_other")
#: Tolerance of the offset from the trajectory for paint to be aligned. [m]
IN_LINE_M = 0.5
#: Share of uncertain length that is wrong, by kind: 39 of 2,506 m of cables and 323 of 675 m of markings on eleven simulated
#: streets of 500 to 2,000 points per metre; 8 of 49 m of what stands beside streets and motorways (seeds 3410 to 3412).
#: Of boundaries it was 34 of 560 m on those streets, which have kerbs; what edges leave uncertain counts whole, and
#: `EDGE_WRONG` at least.
KERB_WRONG = 0.06
WRONG_SHARE = {"cable": 0.02, "lane_marking": 0.5, "guardrail": 0.2, "barrier": 0.2, "fence": 0.2}
#: Margin around the object in the view. [m]
_AROUND_M = 5.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Suspect:
    """Something that may be wrong or missing.

    Parameters
    ----------
    type
        "line", "copy", "gap", "boundary" or "dashes"; "stretch": road to look over; "rest": all lines too short or too
        sure for an item each; "sure": all lines with nothing to check, which one edit accepts.
    ids
        Lines it is about; of a gap: the one that ends, and the one that may go on.
    kind
        Of the line that is wrong or missing; "" of a stretch, where it may be any.
    at
        East and north of where to look first. [m, world]
    box
        What to look at.
    length_m
        How much is expected to be wrong or missing: its length times how likely that is.
    confidence
        That all is well there, 0 to 1.
    reason
        In words.
    proposal
        Proposed action: "accept"; "" if there is none.
    as_kind
        Kind that the lines may be of instead; "": theirs. Nothing is proposed: it was hardly ever counted.
    n_looks
        How many screens one has to look at.
    form
        Of a single boundary, "kerb", "edge" ...; "" of all else.
    """

    type: str
    ids: tuple[str, ...]
    kind: str
    at: tuple[float, float]
    box: Bounds
    length_m: float
    confidence: float
    reason: str
    proposal: str = ""
    as_kind: str = ""
    n_looks: float = 1.0
    form: str = ""

    @property
    def gain_m(self) -> float:
        """Expected length that a review corrects. [m]"""  # noqa: D400
        is_scaled = self.type == "line" and not self.as_kind
        return (wrong_share(self.kind, self.form) if is_scaled else 1.0) * self.length_m / self.n_looks

    @property
    def is_of_many(self) -> bool:
        """Whether it is the item of all lines that have none of their own."""
        return self.type in ALL_IN_ONE

    @property
    def key(self) -> str:
        """Key of its subject, a line or a gap from a place on; stable as long as the subject exists."""
        if self.is_of_many:
            # Of these lines: dismissed, it comes again with others
            return f"{self.type} {hashlib.blake2b(' '.join(sorted(self.ids)).encode(), digest_size=8).hexdigest()}"
        if self.type in ("line", "copy", "dashes"):
            return f"{self.type} {self.ids[0]}"
        east, north = (int(np.floor(v)) for v in self.at)
        return " ".join(part for part in (self.type, self.kind, str(east), str(north)) if part)


def wrong_share(kind: str, form: str = "") -> float:
    """Return the share of the length of a kind, of boundaries of a form, that is wrong of what its lines leave uncertain."""
    return KERB_WRONG if kind == "road_boundary" and form == "kerb" else WRONG_SHARE.get(kind, 1.0)


def rank_suspects(suspects: list[Suspect]) -> list[Suspect]:
    """Return suspects by expected gain, largest first; each key once."""
    worth = [s for s in suspects if s.length_m >= LEAST_SUSPECT_M]
    worth.sort(key=lambda s: (-s.gain_m, s.key))
    return list({s.key: s for s in reversed(worth)}.values())[::-1]


def unsure_lines(lines: LineSet, way: DrivenPath) -> list[Suspect]:
    """Return unreviewed lines, with the length of each that is expected to be wrong.

    Dashes and kerb tops are not among them: they go with their lines.
    """
    length_m, bridged_m, wrong_m, found = lines.length_m, lines.bridged_m, expected_wrong_m(lines), []
    sure_of, likely = _is_sure(lines), _is_likely(lines)
    # However sure they are: who reads "100 % sure" would wonder why it is listed
    is_edge = _has_no_kerb(lines) & (lines.confidence > 1.0 - EDGE_WRONG)
    long_bars = _long_bars(lines, way)
    for i in np.flatnonzero((lines.review == "") & ~np.isin(lines.kind, REVIEWED_TOGETHER)).tolist():
        if any(i in run for run in long_bars) or bool(sure_of[i]):
            continue
        xyz, sure = lines[i].xyz, float(lines.confidence[i])
        suspect = Suspect(
            type="line",
            ids=(str(lines.id[i]),),
            kind=str(lines.kind[i]),
            at=line_middle(xyz),
            box=view_box(xyz),
            length_m=float(wrong_m[i]),
            confidence=sure,
            reason=f"{100.0 * sure:.0f} % sure over {length_m[i]:.0f} m"
            + (f", {bridged_m[i]:.0f} m of it bridged" if bridged_m[i] >= LEAST_SUSPECT_M else "")
            + (f", but without a kerb: {100.0 * EDGE_WRONG:.0f} % of such were wrong" if is_edge[i] else ""),
            proposal="accept" if bool(likely[i]) else "",
            n_looks=max(float(length_m[i]) / VIEW_M, 1.0),
            form=str(lines.form[i]),
        )
        found.append(suspect)
    return found + [_no_bars(lines.take(run)) for run in long_bars]


def _is_likely(lines: LineSet) -> BoolArray:
    """Return which lines (n,) are proposed to be accepted: of those that are so sure, as many were right as `LIKELY_LINE`.

    Rejecting was not tried often enough to be proposed.
    """
    is_counted = np.isin(lines.kind, COUNTED)
    is_seen = lines.bridged_m <= lines.length_m / 2
    return np.asarray(is_counted & is_seen & (lines.confidence >= LIKELY_LINE))


def _is_sure(lines: LineSet) -> BoolArray:
    """Return which lines (n,) have nothing to check: hardly any of their length is expected to be wrong.

    Road boundaries are not among them: some that were wrong were as sure as any.
    """
    is_sure = (lines.confidence >= SURE_LINE) & (expected_wrong_m(lines) < LEAST_SUSPECT_M)
    is_seen = lines.bridged_m <= lines.length_m / 2
    return np.asarray(is_sure & is_seen & (lines.review == "") & np.isin(lines.kind, COUNTED))


def expected_wrong_m(lines: LineSet) -> FloatArray:
    """Return the length of each line (n,) that is expected to be wrong. [m]"""  # noqa: D400
    wrong_m = (lines.length_m - lines.bridged_m) * (1.0 - lines.confidence)
    wrong_m += lines.bridged_m * np.maximum(1.0 - lines.confidence, BRIDGED_WRONG)
    return np.asarray(
        np.where(_has_no_kerb(lines), np.maximum(wrong_m, EDGE_WRONG * lines.length_m), wrong_m)
    )


def _has_no_kerb(lines: LineSet) -> BoolArray:
    """Return which lines (n,) are boundaries without a kerb."""
    return np.asarray((lines.kind == "road_boundary") & (lines.form == "edge"))


def sure_lines(lines: LineSet) -> list[Suspect]:
    """Return the lines with nothing to check as one item, which one edit accepts; empty where there are none."""
    return _all_in_one("sure", lines.take(_is_sure(lines)), "accept")


def unlisted_lines(lines: LineSet, listed: list[Suspect]) -> list[Suspect]:
    """Return unreviewed lines that are in no other item as one item without a proposal; empty where there are none.

    Parameters
    ----------
    listed
        The items of single lines; those of `sure_lines` need not be among them.
    """
    ids = [name for suspect in listed if suspect.type in ("line", "copy") for name in suspect.ids]
    is_open = (lines.review == "") & ~np.isin(lines.kind, REVIEWED_TOGETHER) & ~_is_sure(lines)
    return _all_in_one("rest", lines.take(is_open & ~np.isin(lines.id, ids)), "")


def _all_in_one(type_: str, lines: LineSet, proposal: str) -> list[Suspect]:
    """Return an item of many lines, as a list of one; empty where there are none."""
    if len(lines) == 0:
        return []
    names, least = "a line" if len(lines) == 1 else f"{len(lines):,} lines", float(lines.confidence.min())
    return [
        Suspect(
            type=type_,
            ids=tuple(lines.id.tolist()),
            kind=str(lines.kind[0]),
            at=line_middle(lines[0].xyz),
            box=view_box(lines.xyz),
            length_m=float(expected_wrong_m(lines).sum()) if type_ == "rest" else 0.0,
            confidence=least,
            reason=f"{names} of {lines.length_m.sum():,.0f} m, at least {np.floor(100.0 * least + 1e-9):.0f} % sure",
            proposal=proposal,
        )
    ]


def _no_bars(bars: LineSet) -> Suspect:
    """Return suspects of paint classified as bars that is a line along the road."""
    whole_m, longest_m = float(bars.length_m.sum()), float(bars.length_m.max())
    return Suspect(
        type="line",
        ids=tuple(bars.id.tolist()),
        kind="road_marking_other",
        at=line_middle(bars[0].xyz),
        box=view_box(bars.xyz),
        # Wrong under its present kind, and missing under its true kind
        length_m=2.0 * whole_m,
        confidence=0.0,
        reason=f"{whole_m:.0f} m of paint, up to {longest_m:.0f} m in one, are no bars or arrows",
        as_kind="lane_marking",
    )


def _long_bars(lines: LineSet, way: DrivenPath) -> list[list[int]]:
    """Return bars that are too long, aligned ones together."""
    length_m = lines.length_m
    is_bar = (lines.kind == "road_marking_other") & (lines.review == "") & (length_m > LONGEST_BAR_M)
    rows: list[tuple[float, list[int]]] = []
    for i in np.flatnonzero(is_bar).tolist():
        along, left_m = way.offsets(lines[i].xyz[[0, -1], :2], VIEW_M)
        if len(way) and not abs(along[1] - along[0]) > 0.7 * length_m[i]:
            continue
        off = float(left_m.mean()) if len(way) else float(i)
        row = next((row for at, row in rows if abs(at - off) <= IN_LINE_M), None)
        if row is None:
            rows.append((off, [i]))
        else:
            row.append(i)
    return [row for _, row in rows]


def view_box(xyz: FloatArray) -> Bounds:
    """Return the rectangle to view for some places."""
    low, high = xyz[:, :2].min(axis=0), xyz[:, :2].max(axis=0)
    return Bounds(float(low[0]), float(low[1]), float(high[0]), float(high[1])).grown(_AROUND_M)


def line_stations(xyz: FloatArray, step_m: float) -> FloatArray:
    """Return places (k, 2) along a line, no further apart than a step."""
    along = distance_along(xyz)
    at = np.linspace(0.0, along[-1], max(int(np.ceil(along[-1] / step_m)), 1) + 1)
    return np.stack([np.interp(at, along, xyz[:, axis]) for axis in (0, 1)], axis=1)


def line_middle(xyz: FloatArray) -> tuple[float, float]:
    """Return the point halfway along a line (n, 3)."""
    along = distance_along(xyz)
    return (
        float(np.interp(0.5 * along[-1], along, xyz[:, 0])),
        float(np.interp(0.5 * along[-1], along, xyz[:, 1])),
    )


# Missing dashes: lines whose rhythm has gaps, and dashed lines with few or no dashes

#: A dash lies within a stripe's width of its line. [m]
ON_LINE_M = 0.10
#: Painted share of a dashed line whose rhythm is unknown: lane lines have a quarter to a half.
DASH_SHARE = 1.0 / 3.0
#: Shortest line that can show a rhythm. [m]
LEAST_DASHED_LINE_M = 40.0


def missing_dashes(lines: LineSet, paint: Mapping[str, FloatArray] | None = None) -> list[Suspect]:
    """Return the lines that lack dashes, an item for each.

    A solid line lacks none, whatever its worn paint looks like: its pattern was measured.

    Parameters
    ----------
    paint
        By id, where along a line its paint shows dashes, as `dashes_in_paint` finds them. What a line that is not among
        them lacks follows from the rhythm of its dashes; without one it is estimated.

    Notes
    -----
    Nothing is proposed: too many of the dashes that paint or rhythm suggest were wrong (decision 134).
    """
    paint = paint or {}
    number = np.flatnonzero((lines.kind == "lane_marking") & (lines.pattern != "solid"))
    owner = _line_of_dashes(lines, number)
    found = []
    may_lack = np.isin(number, owner) | np.isin(lines.id[number], list(paint))
    may_lack |= (lines.length_m[number] >= LEAST_DASHED_LINE_M) & (lines.pattern[number] == "dashed")
    for i in number[may_lack].tolist():
        line, dashes = lines.take([i]), lines.take(owner == i)
        missing_m = _lacking_m(line, dashes, paint.get(str(line.id[0])))
        there_m = float(dashes.length_m.sum())
        if missing_m < LEAST_SUSPECT_M:
            continue
        found.append(
            Suspect(
                type="dashes",
                ids=(str(line.id[0]),),
                kind="lane_marking_dash",
                at=line_middle(line.xyz),
                box=view_box(line.xyz),
                length_m=missing_m,
                confidence=there_m / (there_m + missing_m),
                reason=f"about {missing_m:.0f} m of dashes may be missing, {there_m:.0f} m are there",
            )
        )
    return found


def _lacking_m(line: LineSet, dashes: LineSet, spans: FloatArray | None) -> float:
    """Return the expected length of a line's missing dashes. [m]"""  # noqa: D400
    if spans is not None and len(spans):
        return float(np.diff(spans[missing_spans(line, dashes, spans)[0]], axis=1).sum())
    rhythm, length_m = rhythm_of(line, dashes), float(line.length_m[0])
    if rhythm is not None:
        return len(missing_middles(rhythm, length_m)) * rhythm.dash_m
    if length_m < LEAST_DASHED_LINE_M or spans is not None or line.pattern[0] != "dashed":
        return 0.0
    return max(DASH_SHARE * length_m - float(dashes.length_m.sum()), 0.0)


def _line_of_dashes(lines: LineSet, markings: IntArray) -> IntArray:
    """Return for every line the marking of which it is a dash, or -1."""
    owner = np.full(len(lines), -1, dtype=np.int64)
    is_dash = lines.kind == "lane_marking_dash"
    if not is_dash.any() or len(markings) == 0:
        return owner
    every = [line_stations(lines[i].xyz, ON_LINE_M) for i in markings.tolist()]
    origin = every[0][0]
    tree = cKDTree(np.concatenate(every) - origin)
    middles = np.array([line_middle(lines[i].xyz) for i in np.flatnonzero(is_dash).tolist()])
    distance, nearest = tree.query(middles - origin)
    line = np.repeat(markings, [len(places) for places in every])[nearest]
    owner[is_dash] = np.where(distance <= ON_LINE_M, line, -1)
    return owner


# Wires that end without a continuation: the next span may be missing

#: Largest distance between wires of two spans at one support: one insulator, or two on the same arm. [m]
SAME_POLE_M = 1.0
#: Probability that a line of poles continues, with its next pole about one span away.
GOES_ON = 0.4
#: Least share of a missing span below which the ground was measured: where the scanners did not reach the ground, they
#: did not reach the wire.
LEAST_MEASURED_SHARE = 0.5
#: Largest gap between facing ends of one wire, in spans.
MOST_SPANS = 3.0
#: Largest change of direction across a missing span. [deg]
_IN_LINE_DEG = 10.0
_BOTH_SIDES = 0.9


def loose_wires(lines: LineSet, visible: WasMeasured) -> list[Suspect]:
    """Return the ends of cables without a continuation, with the span that may be missing beyond.

    Parameters
    ----------
    lines
        Without rejected ones.
    visible
        Says where ground was measured: a span that the scanners did not reach is not missing.

    Notes
    -----
    An end alone counts only where a line of poles arrives: its wire continues a span before it. A wire from pole to
    house ends at both.
    """
    number = np.flatnonzero((lines.kind == "cable") & (lines.review != "accepted"))
    every = np.flatnonzero(lines.kind == "cable")
    if len(number) == 0:
        return []
    tips = np.concatenate([lines[i].xyz[[0, -1]] for i in every.tolist()])
    ways = np.concatenate([lines[i].xyz[[1, -2], :2] for i in every.tolist()]) - tips[:, :2]
    ways /= -np.maximum(np.hypot(*ways.T), 1e-9)[:, None]
    owner = np.repeat(every, 2)
    near = cKDTree(tips - tips[0]).query_ball_point(tips - tips[0], SAME_POLE_M)
    loose = np.array(
        [all(owner[k] == owner[i] or ways[k] @ ways[i] > 0 for k in own) for i, own in enumerate(near)]
    )
    found, loose_tips, loose_ways, loose_ends = [], tips[loose, :2], ways[loose], np.flatnonzero(loose)
    for i in loose_ends[np.isin(owner[loose], number)].tolist():
        span_m = float(np.hypot(*(tips[i ^ 1, :2] - tips[i, :2])))
        step = loose_tips - tips[i, :2]
        away = np.hypot(*step.T)
        ahead = step @ ways[i] >= np.cos(np.radians(_IN_LINE_DEG)) * np.maximum(away, 1e-9)
        facing = ahead & (away > SAME_POLE_M) & (away <= MOST_SPANS * span_m) & (loose_ways @ ways[i] < -0.9)
        beyond = loose_ends[facing]
        m = int(beyond[np.argmin(away[facing])]) if len(beyond) else -1
        if m >= 0 and m < i:
            continue  # found from the other end already
        if m < 0 and loose[i ^ 1]:
            continue
        length_m = float(np.hypot(*(tips[m, :2] - tips[i, :2]))) if m >= 0 else span_m
        likely = _BOTH_SIDES if m >= 0 else GOES_ON
        target = tips[m, :2] if m >= 0 else tips[i, :2] + length_m * ways[i]
        share = np.linspace(0.0, 1.0, max(int(length_m), 2))[:, None]
        measured = float(np.mean(visible((1.0 - share) * tips[i, :2] + share * target)))
        if measured < LEAST_MEASURED_SHARE:
            continue
        found.append(
            Suspect(
                type="gap",
                ids=tuple(str(lines.id[owner[k]]) for k in (i, m) if k >= 0),
                kind="cable",
                at=(float(tips[i, 0]), float(tips[i, 1])),
                box=view_box(np.stack([tips[i, :2], target])),
                length_m=likely * measured * length_m,
                confidence=1.0 - likely,
                reason=f"no wire continues here for {length_m:.0f} m",
            )
        )
    return found
