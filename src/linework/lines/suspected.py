"""What in a set of lines is worth a look, the most promising first."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from linework.arrays import BoolArray, FloatArray
from linework.lines.along_way import Way
from linework.model.grid import Bounds
from linework.model.lines import LineSet

#: Says for (n, 2) places [m] whether ground was measured there: (n,).
Sight = Callable[[FloatArray], BoolArray]
#: What fits on a screen so that a hand's breadth can be seen: a longer line takes more than one look. [m]
VIEW_M = 60.0
#: Less than this is not worth a look. [m]
LEAST_M = 2.0
#: No arrow, bar or stop line is longer: paint along the road that is, is a line. [m]
LONGEST_BAR_M = 12.0
#: Of what is bridged, no less is wrong: 61 of 2,850 m on simulated streets of few points.
BRIDGED_WRONG = 0.02
#: Companions are judged with their lines.
_COMPANIONS = ("lane_marking_dash", "kerb_top")
#: Paint at one distance from the van's way, to so much, is in line. [m]
IN_LINE_M = 0.5
#: How much of what extraction is not sure of is wrong, by kind: 39 of 2,506 m of cables, 34 of 560 m of boundaries and
#: 323 of 675 m of markings on eleven simulated streets of 500 to 2,000 points per metre.
WRONG_SHARE = {"cable": 0.02, "road_boundary": 0.06, "lane_marking": 0.5}
#: Around what is to be seen. [m]
_AROUND_M = 5.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Suspect:
    """Something that may be wrong or missing.

    Parameters
    ----------
    type
        "line", "gap", "boundary" or "dashes".
    ids
        Lines it is about; of a gap: the one that ends, and the one that may go on.
    kind
        Of the line that is wrong or missing.
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
        What would settle it: "accept", "reject", "join", "dashes", "kind" with `as_kind`; "" if no one thing would.
    n_looks
        How many screens one has to look at.
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

    @property
    def gain_m(self) -> float:
        """What a look at it is expected to set right. [m]"""  # noqa: D400
        share = WRONG_SHARE.get(self.kind, 1.0) if self.type == "line" and self.proposal != "kind" else 1.0
        return share * self.length_m / self.n_looks

    @property
    def key(self) -> str:
        """What it is about, a line or what is missing from a place on: the same as long as that is there."""
        if self.type in ("line", "dashes"):
            return f"{self.type} {self.ids[0]}"
        east, north = (int(np.floor(v)) for v in self.at)
        return f"{self.type} {self.kind} {east} {north}"


def ranked(suspects: list[Suspect]) -> list[Suspect]:
    """Return suspects in the order of what a look is expected to find; each key once."""
    worth = [s for s in suspects if s.length_m >= LEAST_M]
    worth.sort(key=lambda s: (-s.gain_m, s.key))
    return list({s.key: s for s in reversed(worth)}.values())[::-1]


def unsure_lines(lines: LineSet, way: Way) -> list[Suspect]:
    """Return lines that nobody has looked at, with how much of each is expected to be wrong.

    Dashes and kerb tops are not among them: they go with their lines.
    """
    length_m, bridged_m, found = lines.length_m, lines.bridged_m, []
    long_bars = _long_bars(lines, way)
    for i in np.flatnonzero((lines.review == "") & ~np.isin(lines.kind, _COMPANIONS)).tolist():
        if any(i in run for run in long_bars):
            continue
        xyz, sure = lines.line(i), float(lines.confidence[i])
        suspect = Suspect(
            type="line",
            ids=(str(lines.id[i]),),
            kind=str(lines.kind[i]),
            at=middle_of(xyz),
            box=box_of(xyz),
            length_m=float(length_m[i] - bridged_m[i]) * (1.0 - sure)
            + float(bridged_m[i]) * max(1.0 - sure, BRIDGED_WRONG),
            confidence=sure,
            reason=f"{100.0 * sure:.0f} % sure over {length_m[i]:.0f} m"
            + (f", {bridged_m[i]:.0f} m of it bridged" if bridged_m[i] >= LEAST_M else ""),
            proposal=_verdict(sure, float(bridged_m[i]), float(length_m[i])),
            n_looks=max(float(length_m[i]) / VIEW_M, 1.0),
        )
        found.append(suspect)
    return found + [_no_bars(lines.take(run)) for run in long_bars]


def _verdict(sure: float, bridged_m: float, length_m: float) -> str:
    """Return what to do with a line by one key; "" where more of it is carried over than was seen: look first."""
    if sure < 0.5:
        return "reject"
    return "accept" if bridged_m <= length_m / 2 else ""


def _no_bars(bars: LineSet) -> Suspect:
    """Return what is said of paint that was taken for bars, and is a line along the road."""
    whole_m, longest_m = float(bars.length_m.sum()), float(bars.length_m.max())
    return Suspect(
        type="line",
        ids=tuple(bars.id.tolist()),
        kind="road_marking_other",
        at=middle_of(bars.line(0)),
        box=box_of(bars.xyz),
        # Wrong as what it is, and missing as what it would be
        length_m=2.0 * whole_m,
        confidence=0.0,
        reason=f"{whole_m:.0f} m of paint, up to {longest_m:.0f} m in one, are no bars or arrows",
        proposal="kind",
        as_kind="lane_marking",
    )


def _long_bars(lines: LineSet, way: Way) -> list[list[int]]:
    """Return bars that are too long, those in line with each other together."""
    length_m = lines.length_m
    is_bar = (lines.kind == "road_marking_other") & (lines.review == "") & (length_m > LONGEST_BAR_M)
    rows: list[tuple[float, list[int]]] = []
    for i in np.flatnonzero(is_bar).tolist():
        along, left_m = way.offsets(lines.line(i)[[0, -1], :2], VIEW_M)
        if len(way) and not abs(along[1] - along[0]) > 0.7 * length_m[i]:
            continue
        off = float(left_m.mean()) if len(way) else float(i)
        row = next((row for at, row in rows if abs(at - off) <= IN_LINE_M), None)
        if row is None:
            rows.append((off, [i]))
        else:
            row.append(i)
    return [row for _, row in rows]


def box_of(xyz: FloatArray) -> Bounds:
    """Return the rectangle to look at for some places."""
    low, high = xyz[:, :2].min(axis=0), xyz[:, :2].max(axis=0)
    return Bounds(float(low[0]), float(low[1]), float(high[0]), float(high[1])).grown(_AROUND_M)


def stations(xyz: FloatArray, step_m: float) -> FloatArray:
    """Return places (k, 2) along a line, no further apart than a step."""
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(xyz[:, :2], axis=0).T))])
    at = np.linspace(0.0, along[-1], max(int(np.ceil(along[-1] / step_m)), 1) + 1)
    return np.stack([np.interp(at, along, xyz[:, axis]) for axis in (0, 1)], axis=1)


def middle_of(xyz: FloatArray) -> tuple[float, float]:
    """Return the place half way along a line (n, 3)."""
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(xyz[:, :2], axis=0).T))])
    return (
        float(np.interp(0.5 * along[-1], along, xyz[:, 0])),
        float(np.interp(0.5 * along[-1], along, xyz[:, 1])),
    )
