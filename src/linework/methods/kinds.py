"""Kinds of line that each method finds; imports no method, so that a wrong name is refused at once."""

from __future__ import annotations

from collections.abc import Iterable

from linework.errors import UsageError
from linework.model.lines import KINDS

#: Kinds that each method finds; "auto" stands for all methods.
KINDS_OF = {
    "obb": ("lane_marking", "lane_marking_dash", "road_marking_other", "road_boundary", "kerb_top"),
    "radon": ("guardrail", "barrier", "cable"),
    "stereo": ("lane_marking", "lane_marking_dash"),
}
#: Recordings that each method looks at, as its `Method.recording`.
RECORDING_OF = {"obb": "points", "radon": "points", "stereo": "pairs"}
#: All kinds that can be asked for, in their fixed order.
ALL_KINDS = tuple(dict.fromkeys(kind for kinds in KINDS_OF.values() for kind in kinds))


def kinds_in_order(kinds: Iterable[str]) -> tuple[str, ...]:
    """Return kinds of line, each once: those of linework in their fixed order, then own ones as they come.

    >>> kinds_in_order(["pole", "cable", "guardrail", "cable"])
    ('guardrail', 'cable', 'pole')
    """
    listed = dict.fromkeys(kinds)
    return (*(kind for kind in KINDS if kind in listed), *(kind for kind in listed if kind not in KINDS))


def parse_kinds(text: str) -> tuple[str, ...]:
    """Return the kinds named in a comma-separated list, in their fixed order, each once.

    Raises
    ------
    UsageError
        No method finds one of the kinds; the message lists those that can be asked for.

    Examples
    --------
    >>> parse_kinds("cable, guardrail")
    ('guardrail', 'cable')
    """
    asked = {name.strip() for name in text.split(",") if name.strip()}
    unknown = sorted(asked - set(ALL_KINDS))
    if unknown or not asked:
        problem = f"unknown kinds of line: {', '.join(unknown)}" if unknown else "no kind of line is named"
        raise UsageError(problem, where="--features", advice=f"choose from {','.join(ALL_KINDS)}")
    return tuple(kind for kind in ALL_KINDS if kind in asked)


def kinds_of_method(method: str) -> tuple[str, ...]:
    """Return the kinds that a method finds, in their fixed order; all for "auto" and for an unknown method.

    >>> kinds_of_method("radon")
    ('guardrail', 'barrier', 'cable')
    """
    return KINDS_OF.get(method, ALL_KINDS)


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
    if method not in ("auto", *KINDS_OF):
        raise UsageError(
            f"unknown method {method}", where="--method", advice=f"choose auto or {', '.join(KINDS_OF)}"
        )
    candidates = KINDS_OF if method == "auto" else {method: KINDS_OF[method]}
    missing = [kind for kind in kinds if not any(kind in found for found in candidates.values())]
    if missing:
        raise UsageError(
            f"method {method} does not find {', '.join(missing)}", where="--method", advice="choose auto"
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
                         where="--features", advice=f"ask for {','.join(kinds_from('pairs', ALL_KINDS))}")  # fmt: skip
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
