"""Kinds of line that each method finds; imports no method, so that a wrong name is refused at once."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from linework.errors import UsageError, argument, did_you_mean
from linework.model.lines import KINDS

#: Kinds that each method finds; "auto" stands for all methods.
KINDS_OF = {
    "obb": (
        "lane_marking",
        "lane_marking_dash",
        "road_marking_other",
        "road_boundary",
        "kerb_top",
        "edge_other",
    ),
    "radon": ("guardrail", "barrier", "fence", "cable"),
    "stereo": ("lane_marking", "lane_marking_dash"),
}
#: Kinds that the methods find that are as their papers describe them; they are only used when they are named.
PUBLISHED_KINDS_OF = {
    "radon-2002": ("guardrail",),
    "obb-2023": ("lane_marking", "road_boundary"),
    "stereo-1992": ("lane_marking",),
}
#: Recordings that each method looks at, as its `Method.recording`.
RECORDING_OF = {
    "obb": "points", "radon": "points", "stereo": "pairs",
    "obb-2023": "points", "radon-2002": "points", "stereo-1992": "pairs",
}  # fmt: skip
#: All kinds that can be asked for, in their fixed order.
ALL_KINDS = tuple(kind for kind in KINDS if any(kind in kinds for kinds in KINDS_OF.values()))


def kinds_in_order(kinds: Iterable[str]) -> tuple[str, ...]:
    """Return kinds of line, each once: those of linework in their fixed order, then own ones as they come.

    >>> kinds_in_order(["pole", "cable", "guardrail", "cable"])
    ('guardrail', 'cable', 'pole')
    """
    listed = dict.fromkeys(kinds)
    return (*(kind for kind in KINDS if kind in listed), *(kind for kind in listed if kind not in KINDS))


def parse_kinds(kinds: str | Iterable[str], *, own: Sequence[str] = ()) -> tuple[str, ...]:
    """Return the kinds that a caller names, in their fixed order, each once.

    Parameters
    ----------
    kinds
        A name, names, or names separated by commas.
    own
        Kinds of the caller's own methods, which may be asked for too.

    Raises
    ------
    UsageError
        No method finds one of the kinds; the message names the nearest, and those that can be asked for.

    Examples
    --------
    >>> parse_kinds("cable, guardrail")
    ('guardrail', 'cable')
    >>> parse_kinds(["manhole", "cable"], own=["manhole"])
    ('cable', 'manhole')
    >>> parse_kinds("guard_rail")
    Traceback (most recent call last):
    linework.errors.UsageError: kinds: unknown kinds of line: guard_rail. Did you mean guardrail? Choose from ...
    """
    allowed = tuple(dict.fromkeys((*ALL_KINDS, *own)))
    names = kinds.split(",") if isinstance(kinds, str) else _listed(kinds)
    asked = {name.strip() for name in names if name.strip()}
    unknown = sorted(asked - set(allowed))
    if unknown or not asked:
        problem = "no kind of line is named"
        if unknown:
            problem = f"unknown kinds of line: {', '.join(unknown)}" + did_you_mean(unknown, allowed)
        raise UsageError(problem, where=argument("kinds"), advice=f"choose from {','.join(allowed)}")
    return tuple(kind for kind in allowed if kind in asked)


def _listed(kinds: Iterable[str]) -> list[str]:
    """Return the names; what is not a list of texts is refused."""
    listed = list(kinds) if isinstance(kinds, Iterable) else [kinds]
    wrong = [one for one in listed if not isinstance(one, str)]
    if wrong:
        raise UsageError(f"{wrong[0]!r} is not a kind of line", where=argument("kinds"),
                         advice=f"choose from {','.join(ALL_KINDS)}")  # fmt: skip
    return listed


def kinds_of_method(method: str) -> tuple[str, ...]:
    """Return the kinds that a method finds, in their fixed order; all for "auto" and for an unknown method.

    >>> kinds_of_method("radon")
    ('guardrail', 'barrier', 'fence', 'cable')
    """
    return {**KINDS_OF, **PUBLISHED_KINDS_OF}.get(method, ALL_KINDS)


def check_method(method: str, kinds: tuple[str, ...]) -> None:
    """Refuse an unknown method, or one that does not find one of the kinds.

    Parameters
    ----------
    method
        A method's name, or "auto": all that find one of the kinds.

    Raises
    ------
    UsageError
        The message lists the methods that can be chosen.
    """
    named = {**KINDS_OF, **PUBLISHED_KINDS_OF}
    if method not in ("auto", *named):
        problem = f"unknown method {method}" + did_you_mean([str(method)], ("auto", *named))
        raise UsageError(problem, where=argument("methods"), advice=f"choose auto or {', '.join(named)}")
    candidates = KINDS_OF if method == "auto" else {method: named[method]}
    missing = [kind for kind in kinds if not any(kind in found for found in candidates.values())]
    if missing:
        raise UsageError(
            f"method {method} does not find {', '.join(missing)}",
            where=argument("methods"),
            advice="choose auto",
        )


def findable_kinds(kinds: tuple[str, ...], *, has_points: bool, asked: bool) -> tuple[str, ...]:
    """Return those kinds that can be found in the recordings of a survey.

    Parameters
    ----------
    has_points
        Whether the survey has laser points; otherwise it has stereo pairs only.
    asked
        Whether the user named the kinds.

    Raises
    ------
    UsageError
        A kind that the user named can only be found in points.
    """
    if has_points:
        return kinds
    found = kinds_from("pairs", kinds)
    missing = [kind for kind in kinds if kind not in found]
    if missing and asked:
        raise UsageError(f"{', '.join(missing)}: only laser points show them, and the survey has none",
                         where=argument("kinds"), advice=f"ask for {','.join(kinds_from('pairs', ALL_KINDS))}")  # fmt: skip
    return found


def kinds_from(recording: str, kinds: tuple[str, ...]) -> tuple[str, ...]:
    """Return those kinds that some method finds in a recording, "points" or "pairs".

    >>> kinds_from("pairs", ("cable", "lane_marking"))
    ('lane_marking',)
    """
    found = {kind for method, own in KINDS_OF.items() if RECORDING_OF[method] == recording for kind in own}
    return tuple(kind for kind in kinds if kind in found)


def recordings_for(method: str, kinds: tuple[str, ...]) -> dict[str, bool]:
    """Return which recordings a method looks at: the arguments `laser` and `images` of `opened_recordings`.

    >>> recordings_for("auto", ("cable",))
    {'laser': True, 'images': False}
    """
    recordings = {RECORDING_OF[name] for name in ([method] if method in RECORDING_OF else RECORDING_OF)}
    return {
        "laser": "points" in recordings,
        "images": "pairs" in recordings and bool(kinds_from("pairs", kinds)),
    }
