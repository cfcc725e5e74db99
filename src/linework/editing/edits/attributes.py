"""What people say of lines: right or wrong, what they are, and what they look like."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from linework.errors import UsageError
from linework.model.lines import CONDITIONS, KINDS, REVIEWS, LineSet

#: Words that can be chosen for a column; "" takes the word away.
CHOICES: Mapping[str, tuple[str, ...]] = {
    "role": ("edge", "lane", "centre"),
    "pattern": ("solid", "dashed"),
    "form": ("kerb", "edge", "barrier", "zebra", "stop", "arrow"),
    "condition": CONDITIONS,
}
#: A note is a sentence, not a report: as many characters.
LONGEST_REVIEW_NOTE = 500
_PAINT = ("lane_marking", "lane_marking_dash", "road_marking_other")
#: Columns that say something about some kinds only: of others they are empty.
_MEANT_FOR: Mapping[str, tuple[str, ...]] = {
    "role": ("lane_marking", "lane_marking_dash"),
    "pattern": ("lane_marking", "lane_marking_dash"),
    "double": ("lane_marking",),
    "form": ("road_boundary", "kerb_top", "road_marking_other", "guardrail", "barrier", "fence"),
    "width_m": _PAINT,
    "height_m": tuple(kind for kind in KINDS if kind not in _PAINT),
    "clearance_m": ("cable",),
}


def with_review(lines: LineSet, review: str) -> LineSet:
    """Return lines with what a person said of them; what was accepted or drawn is sure."""
    if review not in ("", *REVIEWS):
        raise UsageError(f"{review} is no review", where="review", advice=f"choose from {', '.join(REVIEWS)}")
    marked = lines.with_columns(review=np.full(len(lines), review))
    if review in ("accepted", "drawn"):
        marked = marked.with_columns(confidence=np.ones(len(lines)))
    return marked


def with_kind(lines: LineSet, kind: str) -> LineSet:
    """Return lines as lines of another kind, without what that kind cannot have: paint has no height ...

    Raises
    ------
    UsageError
        There is no such kind.
    """
    check_line_kind(kind)
    empty = {"double": False, "width_m": np.nan, "height_m": np.nan, "clearance_m": np.nan}
    columns: dict[str, object] = {"kind": np.full(len(lines), kind)}
    for name, kinds in _MEANT_FOR.items():
        keeps = (lines.kind == kind) | (kind in kinds and name != "form")
        columns[name] = np.where(keeps, getattr(lines, name), empty.get(name, ""))
    return lines.with_columns(**columns)


def with_attribute(lines: LineSet, column: str, value: str | bool) -> LineSet:
    """Return lines with a role, pattern, form, condition, note, or whether they are one of a double line.

    Raises
    ------
    UsageError
        The column is none of these, the value none of its words, or the kind has no such thing.
    """
    if column == "double":
        if not isinstance(value, bool):
            raise UsageError("double is true or false", where="set", advice="send true or false")
    elif column == "note":
        if (
            not isinstance(value, str)
            or len(value) > LONGEST_REVIEW_NOTE
            or not value.replace("\n", " ").isprintable()
        ):
            raise UsageError(
                f"a note is text of {LONGEST_REVIEW_NOTE} characters at most",
                where="set",
                advice="shorten it",
            )
    elif column not in CHOICES:
        known = ", ".join((*CHOICES, "double", "note"))
        raise UsageError(f"{column} cannot be set", where="set", advice=f"choose from {known}")
    elif value not in ("", *CHOICES[column]):
        raise UsageError(
            f"{value} is no {column}", where="set", advice=f"choose from {', '.join(CHOICES[column])}"
        )
    others = [kind for kind in lines.kind.tolist() if kind not in _MEANT_FOR.get(column, (kind,))]
    if others and value:
        raise UsageError(f"a {others[0]} has no {column}", where="set", advice="choose other lines")
    return lines.with_columns(**{column: np.full(len(lines), value)})


def check_line_kind(kind: str) -> None:
    """Refuse a kind that is none of `KINDS`.

    Raises
    ------
    UsageError
        With what can be chosen.
    """
    if kind not in KINDS:
        raise UsageError(f"there is no kind {kind}", where="kind", advice=f"choose from {', '.join(KINDS)}")
