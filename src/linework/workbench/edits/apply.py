"""From what a page asks for to the change that is saved: which lines go, and which come in their place."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from linework.arrays import FloatArray, IntArray
from linework.editing.edits import attributes as edited_words
from linework.editing.edits import split_join as edited_parts
from linework.editing.edits import vertices as edited
from linework.editing.edits import vertices as edited_smooth
from linework.editing.edits.attributes import with_review
from linework.editing.edits.dashes import dashes_by_paint, with_missing_dashes
from linework.editing.edits.new_lines import line_beside, wire_through, with_heights
from linework.editing.edits.split_join import join_two_lines
from linework.errors import AbsentError, UsageError
from linework.methods.obb.trace import COMPANION_BESIDE_M
from linework.methods.obb.trace import companions_of as lies_beside
from linework.model.changes import Change
from linework.model.lines import LineSet
from linework.workbench.edits import orders as edits
from linework.workbench.edits.keep_trace import kept_change
from linework.workbench.edits.orders import EditOrder, positions_of


@dataclass(frozen=True, slots=True)
class EditInputs:
    """What an edit needs beside the lines.

    Parameters
    ----------
    heights
        (k, 2) of the places that it names, in its order: height and its sigma [m]; NaN: nothing was measured there. Of no
        places: nothing was measured at all.
    kept
        The followed line that it keeps, first, and what runs beside it.
    spans
        Of lines by id: where along each of them the paint shows dashes, (k, 2) [m].
    """

    heights: FloatArray = field(default_factory=lambda: np.zeros((0, 2)))
    kept: LineSet | None = None
    spans: Mapping[str, FloatArray] = field(default_factory=dict)


def change_of(edit: EditOrder, lines: LineSet, given: EditInputs) -> Change:
    """Return the change that an edit makes to lines.

    Raises
    ------
    AbsentError
        A line is not there.
    UsageError
        The edit makes no sense for these lines, in one line.
    """
    for kind, make in _MAKERS.items():
        if isinstance(edit, kind):
            change: Change = make(edit, lines, given)
            return change
    raise UsageError(f"{edit.action} is no edit", where="edit", advice="reload the page")


def lines_of(lines: LineSet, ids: Iterable[str]) -> LineSet:
    """Return the lines of some ids, each once, in their order.

    Raises
    ------
    AbsentError
        One of them is not there.
    """
    number = {str(name): i for i, name in enumerate(lines.id)}
    wanted = list(dict.fromkeys(ids))
    absent = [name for name in wanted if name not in number]
    if absent:
        raise AbsentError(
            f"there is no line {absent[0]}", where="lines", advice="somebody deleted it; reload the page"
        )
    return lines.take(np.array([number[name] for name in wanted], dtype=np.int64))


def _reviewed(edit: edits.ReviewLines, lines: LineSet, _: EditInputs) -> Change:
    review = {"accept": "accepted", "reject": "rejected", "restore": ""}[edit.action]
    chosen = with_companions(lines_of(lines, edit.ids), lines)
    if edit.action == "reject":
        # What a person made of a dash or a top on its own stays
        own = np.isin(chosen.id, np.array(edit.ids))
        chosen = chosen.take(own | (chosen.review == ""))
    return Change(edit.action, chosen, edited_words.with_review(chosen, review))


def _deleted(edit: edits.DeleteLines, lines: LineSet, _: EditInputs) -> Change:
    chosen = with_companions(lines_of(lines, edit.ids), lines)
    return Change(edit.action, chosen, LineSet.empty(lines.crs))


def _split(edit: edits.SplitLine, lines: LineSet, _: EditInputs) -> Change:
    line = lines_of(lines, [edit.id])
    return _edited(edit.action, line, edited_parts.split_line(line, np.array(edit.at)))


def _joined(edit: edits.JoinLines, lines: LineSet, _: EditInputs) -> Change:
    both = lines_of(lines, edit.ids)
    if len(both) != 2:
        raise UsageError("a line cannot be joined to itself", where="join", advice="choose two lines")
    others = lines.take((lines.review != "rejected") & ~np.isin(lines.id, both.id))
    change = _edited(edit.action, both, edited_parts.join_two_lines(both.take([0]), both.take([1]), others))
    tops = [with_companions(both.take([k]), others).of_kind("kerb_top") for k in (0, 1)]
    return with_tops(change, tops[0], tops[1])


def _shaped(edit: edits.ReshapeLine, lines: LineSet, _: EditInputs) -> Change:
    line = lines_of(lines, [edit.id])
    make = edited_smooth.smooth_by_sigmas if edit.action == "smooth" else edited.reversed_line
    return _edited(edit.action, line, make(line))


def _dashed(edit: edits.AddDashes, lines: LineSet, given: EditInputs) -> Change:
    return dashes_change(lines_of(lines, edit.ids), lines, given.spans)


def _as_kind(edit: edits.ChangeKind, lines: LineSet, _: EditInputs) -> Change:
    chosen = lines_of(lines, edit.ids)
    whole = with_companions(chosen, lines)
    # Dashes of what is no marking, and tops of what is no kerb, are nothing
    left = whole.take(~np.isin(whole.id, chosen.id) & (whole.kind != edit.kind))
    after = LineSet.concatenate(
        [
            edited_words.with_review(edited_words.with_kind(chosen, edit.kind), "edited"),
            edited_words.with_review(left, "rejected"),
        ]
    )
    return Change(edit.action, LineSet.concatenate([chosen, left]), after)


def _set(edit: edits.SetAttribute, lines: LineSet, _: EditInputs) -> Change:
    chosen = lines_of(lines, edit.ids)
    return _edited(edit.action, chosen, edited_words.with_attribute(chosen, edit.column, edit.value))


def _vertex(edit: edits.MoveVertex | edits.InsertVertex, lines: LineSet, given: EditInputs) -> Change:
    line = lines_of(lines, [edit.id])
    (to,), (sigma_z_m,) = _placed(edit, given, line.xyz)
    if isinstance(edit, edits.MoveVertex):
        after = edited.move_vertex(line, edit.vertex, to, sigma_z_m=sigma_z_m)
    else:
        after = edited.insert_vertex(line, edit.after, to, sigma_z_m=sigma_z_m)
    return _edited(edit.action, line, after)


def _removed(edit: edits.RemoveVertex, lines: LineSet, _: EditInputs) -> Change:
    line = lines_of(lines, [edit.id])
    return _edited(edit.action, line, edited.remove_vertex(line, edit.vertex))


def _trimmed(edit: edits.TrimLine, lines: LineSet, _: EditInputs) -> Change:
    line = lines_of(lines, [edit.id])
    return _edited(edit.action, line, edited.trim_to_vertices(line, edit.first, edit.last))


def _drawn(edit: edits.DrawLine, lines: LineSet, given: EditInputs) -> Change:
    edited_words.check_line_kind(edit.kind)
    xyz, sigma_z = _placed(edit, given, None)
    if np.any(np.linalg.norm(np.diff(xyz, axis=0), axis=1) < edited.ONE_PLACE_M):
        raise UsageError("two vertices in a row are one place", where="draw", advice="leave one out")
    line = LineSet.from_lines([xyz], crs=lines.crs, kind=[edit.kind], method=["drawn"], sigma_z_m=sigma_z)
    return Change(edit.action, LineSet.empty(lines.crs), edited_words.with_review(line, "drawn"))


def _beside(edit: edits.DrawBeside, lines: LineSet, given: EditInputs) -> Change:
    new = with_heights(line_beside(lines_of(lines, [edit.id]), edit.kind, np.array(edit.at)), given.heights)
    return replace(kept_change(lines, new, (0, len(new.xyz) - 1)), action=edit.action)


def _hung(edit: edits.DrawWire, lines: LineSet, given: EditInputs) -> Change:
    asked = np.array([len(place) == 2 for place in edit.xyz])
    if asked.any() and (len(given.heights) == 0 or np.isnan(given.heights[asked, 0]).any()):
        raise UsageError(
            "no cable was measured at one of the places",
            where="wire",
            advice="click where points are, or in 3-D",
        )
    new = wire_through(_placed(edit, given, None)[0], lines.crs)
    return Change(edit.action, LineSet.empty(lines.crs), edited_words.with_review(new, "drawn"))


def _kept(edit: edits.KeepTrace, lines: LineSet, given: EditInputs) -> Change:
    if given.kept is None or len(given.kept) == 0:
        raise AbsentError("the followed line is gone", where="keep", advice="follow it again")
    continues = None if edit.continues is None else lines_of(lines, [edit.continues])
    return kept_change(lines, given.kept, (edit.first, edit.last), continues)


def _dismissed(edit: edits.DismissSuspect, lines: LineSet, _: EditInputs) -> Change:
    empty = LineSet.empty(lines.crs)
    return Change(f"{edit.action} {edit.key}", empty, empty)


def _edited(action: str, before: LineSet, after: LineSet) -> Change:
    """Return the change of lines that somebody had a hand in; what was drawn stays drawn."""
    review = np.where(np.all(before.review == "drawn"), "drawn", "edited")
    return Change(action, before, replace(after, review=np.full(len(after), review)))


def _placed(edit: EditOrder, given: EditInputs, line: FloatArray | None) -> tuple[FloatArray, list[float]]:
    """Return the places of an edit (k, 3) with heights: as named, else as measured, else as the line has it there.

    Raises
    ------
    UsageError
        There is no height.
    """
    placed, sigmas, places = [], [], positions_of(edit)
    heights = given.heights if len(given.heights) else np.full((len(places), 2), np.nan)
    for place, (measured_m, sigma_m) in zip(places, heights.tolist(), strict=True):
        is_named = len(place) == 3
        height = float(place[-1]) if is_named else measured_m
        if np.isnan(height) and line is not None:
            # Nothing was measured here: as high as the line's nearest vertex
            away = np.hypot(line[:, 0] - place[0], line[:, 1] - place[1])
            height = float(line[int(np.argmin(away)), 2])
        placed.append((place[0], place[1], height))
        sigmas.append(float("nan") if is_named else sigma_m)
    xyz = np.array(placed, dtype=np.float64)
    known = ~np.isnan(xyz[:, 2])
    if not known.any():
        raise UsageError(
            "nothing was measured at these places", where="draw", advice="draw where the survey has points"
        )
    # Between places of known height the line rises evenly
    along = np.r_[0.0, np.cumsum(np.hypot(*np.diff(xyz[:, :2], axis=0).T))]
    xyz[~known, 2] = np.interp(along[~known], along[known], xyz[known, 2])
    return xyz, sigmas


_MAKERS: dict[type, Callable[..., Change]] = {
    edits.ReviewLines: _reviewed,
    edits.DeleteLines: _deleted,
    edits.SplitLine: _split,
    edits.JoinLines: _joined,
    edits.ReshapeLine: _shaped,
    edits.AddDashes: _dashed,
    edits.ChangeKind: _as_kind,
    edits.SetAttribute: _set,
    edits.MoveVertex: _vertex,
    edits.InsertVertex: _vertex,
    edits.RemoveVertex: _removed,
    edits.TrimLine: _trimmed,
    edits.DrawLine: _drawn,
    edits.DrawBeside: _beside,
    edits.DrawWire: _hung,
    edits.KeepTrace: _kept,
    edits.DismissSuspect: _dismissed,
}


# What belongs to a line and is judged, joined and taken away with it: its dashes, or the top of its kerb

#: What may lie beside a line of each kind, and belongs to it: judged when the line is judged.
COMPANIONS = {"lane_marking": "lane_marking_dash", "road_boundary": "kerb_top"}


def with_companions(chosen: LineSet, lines: LineSet) -> LineSet:
    """Return lines with the dashes that lie on them, and the tops of their kerbs."""
    is_in = np.isin(lines.id, chosen.id)
    for i in range(len(chosen)):
        kind = COMPANIONS.get(str(chosen.kind[i]), "")
        if kind:
            box = _near(lines, chosen.line(i), COMPANION_BESIDE_M[kind])
            is_in[box[lies_beside(lines.take(box), chosen.line(i), kind)]] = True
    return lines.take(is_in)


def _near(lines: LineSet, xyz: FloatArray, within_m: float) -> IntArray:
    """Return which lines begin in the rectangle around a line: the others need no closer look."""
    low, high = xyz[:, :2].min(axis=0) - within_m, xyz[:, :2].max(axis=0) + within_m
    first = lines.xyz[lines.offsets[:-1], :2]
    return np.flatnonzero(np.all((first >= low) & (first <= high), axis=1))


def with_tops(change: Change, tops: LineSet, other_tops: LineSet) -> Change:
    """Return the change that joined two kerbs, with the tops joined that end where they did."""
    pairs = [
        (float(np.hypot(*(tops.line(i)[a, :2] - other_tops.line(k)[b, :2]))), i, k)
        for i, k, a, b in itertools.product(range(len(tops)), range(len(other_tops)), (0, -1), (0, -1))
        if tops.id[i] != other_tops.id[k]
    ]
    if not pairs:
        return change
    _, i, k = min(pairs)
    before = [tops.take([i]), other_tops.take([k])]
    try:
        top = join_two_lines(before[0], before[1], change.after)
    except UsageError:
        return change  # what does not fit stays as it is
    return Change(
        change.action,
        LineSet.concatenate([change.before, *before]),
        LineSet.concatenate([change.after, with_review(top, str(change.after.review[0]))]),
    )


# The change that gives lines the dashes that they lack


def dashes_change(chosen: LineSet, lines: LineSet, spans: Mapping[str, FloatArray]) -> Change:
    """Return the change that gives lines their dashes: by the paint along them, else by the rhythm of those there.

    Parameters
    ----------
    chosen
        Markings; those that lack none are passed over.
    lines
        All lines.
    spans
        By id, where along a line the paint shows dashes: (k, 2) [m].

    Raises
    ------
    UsageError
        None of them lacks any.
    """
    before, after = [LineSet.empty(lines.crs)], []
    refused: UsageError | None = None
    for k in range(len(chosen)):
        line = chosen.take([k])
        try:
            gone, new = _of_line(line, lines, spans.get(str(line.id[0]), np.zeros((0, 2))))
        except UsageError as refusal:
            refused = refused or refusal
            continue
        before.append(gone)
        after.append(with_review(new, "drawn"))
        if not line.pattern[0]:
            before.append(line)
            after.append(line.with_columns(pattern=np.array(["dashed"])))
    if not after:
        raise refused or UsageError("no line is chosen", where="dashes", advice="choose a marking")
    return Change("dashes", LineSet.concatenate(before), LineSet.concatenate(after))


def _of_line(line: LineSet, lines: LineSet, spans: FloatArray) -> tuple[LineSet, LineSet]:
    """Return the dashes of a line that go, and that come."""
    if str(line.kind[0]) != "lane_marking":
        raise UsageError(f"a {line.kind[0]} has no dashes", where="dashes", advice="choose a lane marking")
    own = with_companions(line, lines).of_kind("lane_marking_dash")
    own = own.take(own.review != "rejected")
    if len(spans):
        return dashes_by_paint(line, own, spans)
    return LineSet.empty(lines.crs), with_missing_dashes(line, own)
