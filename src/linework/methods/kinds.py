"""Which kinds of line each method finds; light, so that a wrong name is refused at once."""

from __future__ import annotations

from linework.errors import UsageError

#: The kinds each method finds: obb and radon in laser points, stereo in images. `auto` takes all of them.
KINDS_OF = {
    "obb": ("lane_marking", "lane_marking_dash", "road_marking_other", "road_boundary", "kerb_top"),
    "radon": ("guardrail", "barrier", "cable"),
    "stereo": ("lane_marking", "lane_marking_dash"),
}
ALL_KINDS = tuple(dict.fromkeys(kind for kinds in KINDS_OF.values() for kind in kinds))


def parse_kinds(text: str) -> tuple[str, ...]:
    """Return the kinds named in a comma-separated list, in their fixed order, each once.

    Raises
    ------
    UsageError
        A name that no method finds; the message lists those that can be asked for.

    Examples
    --------
    >>> parse_kinds("cable, guardrail")
    ('guardrail', 'cable')
    """
    asked = {name.strip() for name in text.split(",") if name.strip()}
    unknown = sorted(asked - set(ALL_KINDS))
    if unknown or not asked:
        problem = f"{', '.join(unknown) or 'nothing'} cannot be looked for"
        raise UsageError(problem, where="--features", advice=f"choose from {','.join(ALL_KINDS)}")
    return tuple(kind for kind in ALL_KINDS if kind in asked)


def kinds_of_method(method: str) -> tuple[str, ...]:
    """Return the kinds that a method finds, in their fixed order; all for "auto" and for a method that is not there.

    >>> kinds_of("radon")
    ('guardrail', 'barrier', 'cable')
    """
    return KINDS_OF.get(method, ALL_KINDS)


def check_method(method: str, kinds: tuple[str, ...]) -> None:
    """Refuse a method that is not there, or does not find one of the kinds.

    Parameters
    ----------
    method
        A method's name, or "auto": for each kind the method that suits it.

    Raises
    ------
    UsageError
        With what can be chosen.
    """
    if method not in ("auto", *KINDS_OF):
        raise UsageError(
            f"method {method} is not there", where="--method", advice=f"choose auto or {', '.join(KINDS_OF)}"
        )
    candidates = KINDS_OF if method == "auto" else {method: KINDS_OF[method]}
    missing = [kind for kind in kinds if not any(kind in found for found in candidates.values())]
    if missing:
        raise UsageError(
            f"method {method} does not find {', '.join(missing)}", where="--method", advice="choose auto"
        )


def findable_kinds(kinds: tuple[str, ...], *, has_points: bool, asked: bool) -> tuple[str, ...]:
    """Return those kinds that can be found in what a survey has.

    Parameters
    ----------
    asked
        They were asked for by name.

    Raises
    ------
    UsageError
        One that was asked for cannot be found.
    """
    if has_points:
        return kinds
    missing = [kind for kind in kinds if kind not in KINDS_OF["stereo"]]
    if missing and asked:
        raise UsageError(f"{', '.join(missing)}: only laser points show them, and the survey has none",
                         where="--features", advice=f"ask for {','.join(KINDS_OF['stereo'])}")  # fmt: skip
    return tuple(kind for kind in kinds if kind in KINDS_OF["stereo"])


def recordings_for(method: str, kinds: tuple[str, ...]) -> dict[str, bool]:
    """Return which recordings a method looks at: the arguments `laser` and `images` of `opened_recordings`.

    >>> recordings_for("auto", ("cable",))
    {'laser': True, 'images': False}
    """
    by_images = set(kinds) & set(KINDS_OF["stereo"])
    return {"laser": method != "stereo", "images": method in ("auto", "stereo") and bool(by_images)}
