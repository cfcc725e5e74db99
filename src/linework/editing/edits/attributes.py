"""Manual edits of attributes: review, kind, role, pattern, form, condition, note."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import chain

import numpy as np

from linework.errors import UsageError
from linework.model.lines import CANDIDATE, CONDITIONS, KINDS, POLE, REVIEWS, LineSet

_PAINT_ROLES, _EDGE_FORMS = ("edge", "lane", "centre"), ("kerb", "edge", "barrier")
#: Values that can be chosen for a column of a kind, where kinds differ.
_CHOICES_OF: Mapping[str, Mapping[str, tuple[str, ...]]] = {
    "role": {
        "lane_marking": _PAINT_ROLES,
        "lane_marking_dash": _PAINT_ROLES,
        "edge_other": ("gutter", "footway_back", "verge", "wall_foot"),
    },
    "form": {
        "road_boundary": _EDGE_FORMS,
        "kerb_top": _EDGE_FORMS,
        "edge_other": _EDGE_FORMS,
        "road_marking_other": ("zebra", "stop", "arrow"),
        "guardrail": ("w_beam", "thrie_beam", "box_beam", "tube", "cable_barrier"),
        "barrier": ("concrete",),
        "fence": ("mesh", "boards", "tubes"),
    },
}
#: Values that can be chosen for a column; "" clears it.
CHOICES: Mapping[str, tuple[str, ...]] = {
    **{column: tuple(dict.fromkeys(chain.from_iterable(of.values()))) for column, of in _CHOICES_OF.items()},
    "pattern": ("solid", "dashed"),
    "condition": CONDITIONS,
}
#: Longest note, in characters: a sentence or two.
LONGEST_REVIEW_NOTE = 500
_PAINT = ("lane_marking", "lane_marking_dash", "road_marking_other")
#: The kinds that a column applies to, where it does not apply to all; lines of other kinds leave them empty.
KINDS_WITH: Mapping[str, tuple[str, ...]] = {
    "role": tuple(_CHOICES_OF["role"]),
    "pattern": ("lane_marking", "lane_marking_dash"),
    "double": ("lane_marking",),
    "form": tuple(_CHOICES_OF["form"]),
    "width_m": _PAINT,
    "height_m": tuple(kind for kind in KINDS if kind not in _PAINT),
    "lower_m": ("guardrail", "barrier", "fence"),
    "n_beams": ("guardrail", "barrier", "fence"),
    "clearance_m": ("cable",),
    "network": ("cable", POLE),
    "span": ("cable",),
    "circuit": ("cable",),
    "candidate_kind": (CANDIDATE,),
    "reason": (CANDIDATE,),
}


def with_review(lines: LineSet, review: str) -> LineSet:
    """Return lines with a review decision; accepted and drawn lines get confidence 1."""
    if review not in ("", *REVIEWS):
        raise UsageError(
            f"{review} is not a review decision", where="review", advice=f"choose from {', '.join(REVIEWS)}"
        )
    marked = lines.with_columns(review=np.full(len(lines), review))
    if review in ("accepted", "drawn"):
        marked = marked.with_columns(confidence=np.ones(len(lines)))
    return marked


def with_kind(lines: LineSet, kind: str) -> LineSet:
    """Return lines changed to another kind, with the columns cleared that do not apply to it.

    Raises
    ------
    UsageError
        The kind does not exist.
    """
    check_line_kind(kind)
    empty = {"double": False, "width_m": np.nan, "height_m": np.nan, "clearance_m": np.nan}
    empty |= {"lower_m": np.nan, "n_beams": np.nan}
    columns: dict[str, object] = {"kind": np.full(len(lines), kind)}
    for name, kinds in KINDS_WITH.items():
        # Forms are a kind's own, and a candidate has one of the kind that it would be
        keeps = (lines.kind == kind) | (lines.candidate_kind == kind if name == "form" else kind in kinds)
        columns[name] = np.where(keeps, getattr(lines, name), empty.get(name, ""))
    return lines.with_columns(**columns)


def with_attribute(lines: LineSet, column: str, value: str | bool) -> LineSet:
    """Return lines with one attribute set: role, pattern, form, condition, note or double.

    Raises
    ------
    UsageError
        The column cannot be set, the value is not one of its choices, or the column does not apply to the kind.
    """
    if column == "double":
        if not isinstance(value, bool):
            raise UsageError("double must be true or false", where="set", advice="send true or false")
    elif column == "note":
        if (
            not isinstance(value, str)
            or len(value) > LONGEST_REVIEW_NOTE
            or not value.replace("\n", " ").isprintable()
        ):
            raise UsageError(
                f"a note has at most {LONGEST_REVIEW_NOTE} printable characters",
                where="set",
                advice="shorten it",
            )
    elif column not in CHOICES:
        known = ", ".join((*CHOICES, "double", "note"))
        raise UsageError(f"{column} cannot be set", where="set", advice=f"choose from {known}")
    elif value not in ("", *CHOICES[column]):
        raise UsageError(
            f"{value} is not a {column}", where="set", advice=f"choose from {', '.join(CHOICES[column])}"
        )
    own = _CHOICES_OF.get(column, {})
    others = [kind for kind in lines.kind.tolist() if kind in own and value not in ("", *own[kind])]
    if others:
        raise UsageError(
            f"a {others[0]} has no {column} {value}",
            where="set",
            advice=f"choose from {', '.join(own[others[0]])}",
        )
    others = [kind for kind in lines.kind.tolist() if kind not in KINDS_WITH.get(column, (kind,))]
    if others and value:
        raise UsageError(f"a {others[0]} has no {column}", where="set", advice="choose other lines")
    return lines.with_columns(**{column: np.full(len(lines), value)})


def choices_for(column: str, kind: str) -> tuple[str, ...]:
    """Return the values that can be chosen for a column of a kind; none where it does not apply to it.

    >>> choices_for("role", "edge_other"), choices_for("role", "kerb_top")
    (('gutter', 'footway_back', 'verge', 'wall_foot'), ())
    """
    if kind not in KINDS_WITH.get(column, (kind,)):
        return ()
    return _CHOICES_OF.get(column, {}).get(kind, CHOICES.get(column, ()))


def check_line_kind(kind: str) -> None:
    """Raise an error for a kind that is not one of `KINDS`.

    Raises
    ------
    UsageError
        With the kinds that exist.
    """
    if kind not in KINDS:
        raise UsageError(
            f"kind {kind} does not exist", where="kind", advice=f"choose from {', '.join(KINDS)}"
        )
