"""Turn an edit from the page into the change to save: which lines are replaced, and by which."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from linework.arrays import FloatArray, IntArray, distance_along
from linework.editing.edits.attributes import check_line_kind, with_attribute, with_kind, with_review
from linework.editing.edits.dashes import dashes_by_paint, with_missing_dashes
from linework.editing.edits.new_lines import line_beside, wire_through, with_heights
from linework.editing.edits.split_join import join_two_lines, split_line
from linework.editing.edits.vertices import (
    ONE_PLACE_M,
    insert_vertex,
    move_vertex,
    remove_vertex,
    reversed_line,
    smooth_by_sigmas,
    trim_to_vertices,
)
from linework.errors import AbsentError, UsageError
from linework.lines.companions import COMPANION_BESIDE_M, HungWires
from linework.lines.companions import companions_of as lies_beside
from linework.model.changes import Change
from linework.model.lines import LineSet
from linework.workbench.edits.hung_wires import wires_change
from linework.workbench.edits.keep_trace import kept_change
from linework.workbench.edits.median_rails import partner_change
from linework.workbench.edits.orders import (
    AddDashes,
    AddPartner,
    AddWires,
    ChangeKind,
    DeleteLines,
    DismissSuspect,
    DrawBeside,
    DrawLine,
    DrawWire,
    EditOrder,
    InsertVertex,
    JoinLines,
    KeepTrace,
    LinesBeside,
    MoveVertex,
    RemoveVertex,
    ReshapeLine,
    ReviewLines,
    SetAttribute,
    SplitLine,
    TrimLine,
    positions_of,
)
from linework.workbench.edits.template_lines import parts_beside, with_template, without_twins
from linework.workbench.server.documents import lines_of


@dataclass(frozen=True, slots=True)
class EditInputs:
    """Inputs of an edit beside the lines.

    Parameters
    ----------
    heights
        (k, 2) height and its sigma at the places that it names, in its order [m]; NaN: nothing was measured there. (0, 2):
        nothing was measured at all.
    kept
        The followed line that it saves first, and then those beside it.
    beside
        The lines of a template beside the line that is kept or named, or the other rail of its median.
    wires
        The wires that hang with the one that is named.
    spans
        By id of a line: where along it the paint shows dashes, (k, 2) [m].
    """

    heights: FloatArray = field(default_factory=lambda: np.zeros((0, 2)))
    kept: LineSet | None = None
    beside: LineSet | None = None
    wires: HungWires | None = None
    spans: Mapping[str, FloatArray] = field(default_factory=dict)


def change_of(edit: EditOrder, lines: LineSet, inputs: EditInputs) -> Change:
    """Return the change that an edit makes to lines.

    Raises
    ------
    AbsentError
        A line does not exist.
    UsageError
        The edit is not possible for these lines.
    """
    for kind, make in _MAKERS.items():
        if isinstance(edit, kind):
            change: Change = make(edit, lines, inputs)
            return change
    raise UsageError(f"{edit.action} is not an edit", where="edit", advice="reload the page")


def _reviewed(edit: ReviewLines, lines: LineSet, _: EditInputs) -> Change:
    review = {"accept": "accepted", "reject": "rejected", "restore": ""}[edit.action]
    own = lines_of(lines, edit.ids)
    chosen = with_companions(own, lines)
    # What a person decided about a dash or a top by itself stays; those with their line's review were decided with it
    is_open = np.isin(chosen.id, own.id) | (chosen.review == "")
    for before in sorted(set(own.review.tolist())):
        those = with_companions(own.take(own.review == before), lines)
        is_open |= np.isin(chosen.id, those.id) & (chosen.review == before)
    chosen = chosen.take(is_open)
    return Change(edit.action, chosen, with_review(chosen, review))


def _deleted(edit: DeleteLines, lines: LineSet, _: EditInputs) -> Change:
    chosen = with_companions(lines_of(lines, edit.ids), lines)
    return Change(edit.action, chosen, LineSet.empty(lines.crs))


def _split(edit: SplitLine, lines: LineSet, _: EditInputs) -> Change:
    line = lines_of(lines, [edit.id])
    return _edited(edit.action, line, split_line(line, np.array(edit.at)))


def _joined(edit: JoinLines, lines: LineSet, _: EditInputs) -> Change:
    both = lines_of(lines, edit.ids)
    if len(both) != 2:
        raise UsageError("a line cannot be joined to itself", where="join", advice="choose two lines")
    others = lines.take((lines.review != "rejected") & ~np.isin(lines.id, both.id))
    change = _edited(edit.action, both, join_two_lines(both.take([0]), both.take([1]), others))
    tops = [with_companions(both.take([k]), others)["kerb_top"] for k in (0, 1)]
    return with_tops(change, tops[0], tops[1])


def _shaped(edit: ReshapeLine, lines: LineSet, _: EditInputs) -> Change:
    line = lines_of(lines, [edit.id])
    make = smooth_by_sigmas if edit.action == "smooth" else reversed_line
    return _edited(edit.action, line, make(line))


def _dashed(edit: AddDashes, lines: LineSet, inputs: EditInputs) -> Change:
    return dashes_change(lines_of(lines, edit.ids), lines, inputs.spans)


def _as_kind(edit: ChangeKind, lines: LineSet, _: EditInputs) -> Change:
    chosen = lines_of(lines, edit.ids)
    whole = with_companions(chosen, lines)
    # A line of another kind has no such dashes, or no such top
    left = whole.take(~np.isin(whole.id, chosen.id) & (whole.kind != edit.kind))
    after = LineSet.concatenate(
        [
            with_review(with_kind(chosen, edit.kind), "edited"),
            with_review(left, "rejected"),
        ]
    )
    return Change(edit.action, LineSet.concatenate([chosen, left]), after)


def _set(edit: SetAttribute, lines: LineSet, _: EditInputs) -> Change:
    chosen = lines_of(lines, edit.ids)
    return _edited(edit.action, chosen, with_attribute(chosen, edit.column, edit.value))


def _vertex(edit: MoveVertex | InsertVertex, lines: LineSet, inputs: EditInputs) -> Change:
    line = lines_of(lines, [edit.id])
    (to,), (sigma_z_m,) = _placed(edit, inputs, line.xyz)
    if isinstance(edit, MoveVertex):
        after = move_vertex(line, edit.vertex, to, sigma_z_m=sigma_z_m)
    else:
        after = insert_vertex(line, edit.after, to, sigma_z_m=sigma_z_m)
    return _edited(edit.action, line, after)


def _removed(edit: RemoveVertex, lines: LineSet, _: EditInputs) -> Change:
    line = lines_of(lines, [edit.id])
    return _edited(edit.action, line, remove_vertex(line, edit.vertex))


def _trimmed(edit: TrimLine, lines: LineSet, _: EditInputs) -> Change:
    line = lines_of(lines, [edit.id])
    return _edited(edit.action, line, trim_to_vertices(line, edit.first, edit.last))


def _drawn(edit: DrawLine, lines: LineSet, inputs: EditInputs) -> Change:
    check_line_kind(edit.kind)
    xyz, sigma_z = _placed(edit, inputs, None)
    if np.any(np.linalg.norm(np.diff(xyz, axis=0), axis=1) < ONE_PLACE_M):
        raise UsageError("two consecutive vertices are at one place", where="draw", advice="leave one out")
    line = LineSet.from_lines([xyz], crs=lines.crs, kind=[edit.kind], method=["drawn"], sigma_z_m=sigma_z)
    return Change(edit.action, LineSet.empty(lines.crs), with_review(line, "drawn"))


def _beside(edit: DrawBeside, lines: LineSet, inputs: EditInputs) -> Change:
    new = with_heights(line_beside(lines_of(lines, [edit.id]), edit.kind, np.array(edit.at)), inputs.heights)
    return replace(kept_change(lines, new, (0, len(new.xyz) - 1)), action=edit.action)


def _hung(edit: DrawWire, lines: LineSet, inputs: EditInputs) -> Change:
    asked = np.array([len(place) == 2 for place in edit.xyz])
    if asked.any() and (len(inputs.heights) == 0 or np.isnan(inputs.heights[asked, 0]).any()):
        raise UsageError(
            "no cable was measured at one of the places",
            where="wire",
            advice="click where points are, or in 3-D",
        )
    new = wire_through(_placed(edit, inputs, None)[0], lines.crs)
    return Change(edit.action, LineSet.empty(lines.crs), with_review(new, "drawn"))


def _kept(edit: KeepTrace, lines: LineSet, inputs: EditInputs) -> Change:
    if inputs.kept is None or len(inputs.kept) == 0:
        raise AbsentError("the followed line is gone", where="keep", advice="follow it again")
    continues = None if edit.continues is None else lines_of(lines, [edit.continues])
    span = edit.first, min(edit.last, int(inputs.kept.offsets[1]) - 1)
    if inputs.beside is None or not len(inputs.beside):
        return kept_change(lines, inputs.kept, span, continues)
    along = trim_to_vertices(inputs.kept.take([0]), *span)
    parts = parts_beside(inputs.beside, along)
    # Before they are joined with saved lines, which would go with them
    own = without_twins(inputs.kept, parts)
    return with_template(kept_change(lines, own, span, continues), parts, lines, along)


def _with_template(edit: LinesBeside, lines: LineSet, inputs: EditInputs) -> Change:
    line, empty = lines_of(lines, [edit.id]), LineSet.empty(lines.crs)
    parts = parts_beside(empty if inputs.beside is None else inputs.beside, line)
    if not parts:
        raise UsageError(
            "the points show no edge of the template beside the line", where="template",
            advice="look at a section across it, or choose another template",
        )  # fmt: skip
    return with_template(Change(edit.action, empty, empty), parts, lines, line)


def _with_wires(edit: AddWires, lines: LineSet, inputs: EditInputs) -> Change:
    if inputs.wires is None:
        raise AbsentError("no wires were looked for", where="wires", advice="reload the page")
    return wires_change(edit.action, lines, inputs.wires, own_only=edit.which == "own")


def _with_partner(edit: AddPartner, lines: LineSet, inputs: EditInputs) -> Change:
    found = LineSet.empty(lines.crs) if inputs.beside is None else inputs.beside
    return partner_change(edit.action, lines, lines_of(lines, [edit.id]), found)


def _dismissed(edit: DismissSuspect, lines: LineSet, _: EditInputs) -> Change:
    empty = LineSet.empty(lines.crs)
    return Change(f"{edit.action} {edit.key}", empty, empty)


def _edited(action: str, before: LineSet, after: LineSet) -> Change:
    """Return the change of edited lines; lines that were drawn stay marked as drawn."""
    review = np.where(np.all(before.review == "drawn"), "drawn", "edited")
    return Change(action, before, replace(after, review=np.full(len(after), review)))


def _placed(edit: EditOrder, inputs: EditInputs, line: FloatArray | None) -> tuple[FloatArray, list[float]]:
    """Return the places of an edit (k, 3) and their sigmas: heights as named, else as measured, else as of the line.

    Raises
    ------
    UsageError
        None of them has a height.
    """
    placed, sigmas, places = [], [], positions_of(edit)
    heights = inputs.heights if len(inputs.heights) else np.full((len(places), 2), np.nan)
    for place, (measured_m, sigma_m) in zip(places, heights.tolist(), strict=True):
        is_named = len(place) == 3
        height = float(place[-1]) if is_named else measured_m
        if np.isnan(height) and line is not None:
            # Nothing was measured here: the height of the line's nearest vertex
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
    # Between places of known height it is interpolated
    along = distance_along(xyz)
    xyz[~known, 2] = np.interp(along[~known], along[known], xyz[known, 2])
    return xyz, sigmas


_MAKERS: dict[type, Callable[..., Change]] = {
    ReviewLines: _reviewed,
    DeleteLines: _deleted,
    SplitLine: _split,
    JoinLines: _joined,
    ReshapeLine: _shaped,
    AddDashes: _dashed,
    ChangeKind: _as_kind,
    SetAttribute: _set,
    MoveVertex: _vertex,
    InsertVertex: _vertex,
    RemoveVertex: _removed,
    TrimLine: _trimmed,
    DrawLine: _drawn,
    DrawBeside: _beside,
    DrawWire: _hung,
    KeepTrace: _kept,
    LinesBeside: _with_template,
    AddWires: _with_wires,
    AddPartner: _with_partner,
    DismissSuspect: _dismissed,
}


#: Kind that may lie beside a line of a kind and belongs to it: it is reviewed, joined and deleted with the line.
COMPANIONS = {"lane_marking": "lane_marking_dash", "road_boundary": "kerb_top"}


def with_companions(chosen: LineSet, lines: LineSet) -> LineSet:
    """Return lines together with the dashes that lie on them, and the tops of their kerbs."""
    is_in = np.isin(lines.id, chosen.id)
    for i in range(len(chosen)):
        kind = COMPANIONS.get(str(chosen.kind[i]), "")
        if kind:
            box = _near(lines, chosen[i].xyz, COMPANION_BESIDE_M[kind])
            is_in[box[lies_beside(lines.take(box), chosen[i].xyz, kind)]] = True
    return lines.take(is_in)


def _near(lines: LineSet, xyz: FloatArray, within_m: float) -> IntArray:
    """Return the indices of lines that begin in the rectangle around a line: the others cannot lie beside it."""
    low, high = xyz[:, :2].min(axis=0) - within_m, xyz[:, :2].max(axis=0) + within_m
    first = lines.xyz[lines.offsets[:-1], :2]
    return np.flatnonzero(np.all((first >= low) & (first <= high), axis=1))


def with_tops(change: Change, tops: LineSet, other_tops: LineSet) -> Change:
    """Return the change that joins two kerbs, with the two nearest ends of their tops joined too."""
    pairs = [
        (float(np.hypot(*(tops[i].xyz[a, :2] - other_tops[k].xyz[b, :2]))), i, k)
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
        return change  # tops that cannot be joined stay as they are
    return Change(
        change.action,
        LineSet.concatenate([change.before, *before]),
        LineSet.concatenate([change.after, with_review(top, str(change.after.review[0]))]),
    )


def dashes_change(chosen: LineSet, lines: LineSet, spans: Mapping[str, FloatArray]) -> Change:
    """Return the change that adds missing dashes: by the paint along the lines, else by the rhythm of existing ones.

    Parameters
    ----------
    chosen
        Markings; those that lack no dashes are skipped.
    lines
        All lines.
    spans
        By id of a line: where along it the paint shows dashes, (k, 2) [m].

    Raises
    ------
    UsageError
        None of them lacks dashes.
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
    """Return the dashes of a line that are replaced, and the new ones."""
    if str(line.kind[0]) != "lane_marking":
        raise UsageError(f"a {line.kind[0]} has no dashes", where="dashes", advice="choose a lane marking")
    if line.pattern[0] == "solid":
        raise UsageError(
            "the line is solid: it has no dashes", where="dashes", advice="set its pattern to dashed first"
        )
    own = with_companions(line, lines)["lane_marking_dash"]
    own = own.take(own.review != "rejected")
    if len(spans):
        return dashes_by_paint(line, own, spans)
    return LineSet.empty(lines.crs), with_missing_dashes(line, own)
