"""Choosing the methods that find the kinds of line that are asked for, and checking those that a user gives."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

from linework.errors import UsageError, argument, did_you_mean
from linework.methods.kinds import KINDS_OF, check_method, kinds_in_order
from linework.methods.obb.method import Obb, ObbConfig
from linework.methods.protocol import Method, is_own
from linework.methods.radon.method import Radon, RadonConfig
from linework.methods.stereo.method import Stereo, StereoConfig
from linework.model.lines import CANDIDATE

#: Names of methods and kinds: they become names of layers and of files in the work folder.
_NAME = re.compile(r"[\w-]+")


def choose_methods(
    method: str,
    kinds: tuple[str, ...],
    *,
    radon: RadonConfig | None = None,
    obb: ObbConfig | None = None,
    stereo: StereoConfig | None = None,
    paint: str | None = None,
) -> tuple[Method, ...]:
    """Return the methods that look for `kinds`, whatever recordings a survey has.

    Parameters
    ----------
    method
        A method's name, or "auto": all that find one of the kinds.
    radon, obb, stereo
        Settings of the methods; None: defaults.
    paint
        Column of the points with the probability of paint, for obb; None: the intensity.

    Raises
    ------
    UsageError
        As for `check_method`; or obb is not asked to find paint although `paint` is given.

    Examples
    --------
    >>> [method.name for method in choose_methods("auto", ("lane_marking", "cable"))]
    ['obb', 'radon', 'stereo']
    """
    check_method(method, kinds)
    own = {name: tuple(kind for kind in kinds if kind in found) for name, found in KINDS_OF.items()}
    asked = {name for name, found in own.items() if found and method in ("auto", name)}
    methods: list[Method] = []
    if "obb" in asked:
        methods.append(Obb(obb or ObbConfig(), own["obb"], paint=paint))
    if "radon" in asked:
        methods += Radon(radon or RadonConfig(), own["radon"]).parts
    if "stereo" in asked:
        methods.append(Stereo(stereo or StereoConfig(), own["stereo"]))
    if paint and not any(isinstance(chosen, Obb) and chosen.seeks_paint for chosen in methods):
        raise UsageError(
            f"nothing that is looked for is paint: {', '.join(kinds)}", where=argument("paint"),
            advice="ask for lane_marking, lane_marking_dash or road_marking_other",
        )  # fmt: skip
    return tuple(methods)


def with_candidates(methods: Iterable[Method]) -> tuple[Method, ...]:
    """Return methods of which obb also returns the lines that it measured and did not take, of its kinds.

    Raises
    ------
    UsageError
        None of them is obb.

    >>> [method.kinds for method in with_candidates([Obb(kinds=("road_boundary",))])]
    [('road_boundary', 'candidate')]
    """
    given = tuple(methods)
    if not any(isinstance(method, Obb) for method in given):
        raise UsageError(
            "only obb keeps lines that it did not take, and it is not asked",
            where=argument("candidates"), advice="ask for lane_marking or road_boundary, or leave it out",
        )  # fmt: skip
    return tuple(
        replace(method, kinds=tuple(dict.fromkeys((*method.kinds, CANDIDATE))))
        if isinstance(method, Obb)
        else method
        for method in given
    )


def selected_methods(
    methods: Method | Iterable[Method], kinds: Iterable[str] | None = None
) -> tuple[Method, ...]:
    """Return methods as a run takes them: checked, radon in its parts, and only those that find one of the kinds.

    Parameters
    ----------
    methods
        Of linework or own ones.
    kinds
        Kinds of line to look for; None: all that the methods find. An own method finds all of its kinds if one of
        them is asked for.

    Raises
    ------
    UsageError
        Something that is not a method, or kinds that none of them finds.

    Examples
    --------
    >>> [method.kinds for method in selected_methods([Radon(), Obb()], ["cable", "kerb_top"])]
    [('cable',), ('kerb_top',)]
    """
    given = [methods] if isinstance(methods, Method) else list(methods)
    for method in given:
        _check_own_method(method)
    if not given:
        raise UsageError(
            "no method is given", where=argument("methods"), advice="leave it out for all of linework's"
        )
    asked = None if kinds is None else tuple(kinds)
    found_by_any = kinds_in_order(kind for method in given for kind in method.kinds)
    missing = [kind for kind in asked or () if kind not in found_by_any]
    if missing or asked == ():
        problem = f"no method finds {', '.join(missing)}" if missing else "no kind of line is named"
        raise UsageError(problem, where=argument("kinds"), advice=f"choose from {', '.join(found_by_any)}")
    chosen: list[Method] = []
    for method in given:
        own = tuple(kind for kind in method.kinds if asked is None or kind in asked)
        if not own:
            continue
        if isinstance(method, Radon) and not is_own(method):
            chosen += replace(method, kinds=own).parts
        elif not is_own(method):
            chosen.append(replace(method, kinds=own))  # type: ignore[type-var]
        else:
            chosen.append(method)
    _check_found_once(chosen)
    return tuple(chosen)


def _check_found_once(methods: Iterable[Method]) -> None:
    """Refuse two methods that look for one kind in the same recording: its lines would be there twice."""
    finder: dict[tuple[str, str], str] = {}
    for method in methods:
        for kind in method.kinds:
            if (method.recording, kind) in finder:
                raise UsageError(
                    f"{finder[method.recording, kind]} and {method.name} both find {kind} in {method.recording}",
                    where=argument("methods"), advice="leave one out, or give each other kinds",
                )  # fmt: skip
            finder[method.recording, kind] = method.name


def _check_own_method(method: Any) -> None:
    """Refuse what is not a method."""
    if isinstance(method, type):
        raise UsageError(
            f"{method.__name__} is a class, expected an object", where=argument("methods"),
            advice=f"write {method.__name__}()",
        )  # fmt: skip
    if not isinstance(method, Method):
        raise UsageError(
            f"{type(method).__name__} is not a method", where=argument("methods"),
            advice="inherit from linework.Method, and give it a name, kinds and look",
        )  # fmt: skip
    kinds = method.kinds
    if isinstance(kinds, str) or not kinds or not all(isinstance(kind, str) and kind for kind in kinds):
        raise UsageError(
            f"kinds of {method.name!r} are {kinds!r}, expected names", where=argument("methods"),
            advice=f'write kinds=("{kinds if isinstance(kinds, str) and kinds else "ridge"}",), with the comma',
        )  # fmt: skip
    findable = next((own().kinds for own in (Radon, Obb, Stereo) if type(method) is own), kinds)
    unknown = [kind for kind in kinds if kind not in findable]
    if unknown:
        raise UsageError(
            f"{method.name} does not find {', '.join(unknown)}" + did_you_mean(unknown, findable),
            where=argument("kinds"), advice=f"choose from {', '.join(findable)}",
        )  # fmt: skip
    wrong = [name for name in (method.name, *kinds) if not _NAME.fullmatch(name)]
    if wrong:
        raise UsageError(
            f"{wrong[0]!r} is not a name of a method or kind", where=argument("methods"),
            advice="use letters, digits, - and _",
        )  # fmt: skip
    if isinstance(method, Radon) and method.find_peaks is not None and not callable(method.find_peaks):
        raise UsageError(
            f"expected a function, got {method.find_peaks!r:.60}", where=argument("find_peaks"),
            advice="see linework.methods.radon.peaks.find_peaks",
        )  # fmt: skip
    if isinstance(method, Obb) and not (
        method.paint is None or isinstance(method.paint, str) or callable(method.paint)
    ):
        raise UsageError(
            f"expected a column or a function, got {method.paint!r:.60}", where=argument("paint"),
            advice="name a column of the points",
        )  # fmt: skip
    if method.recording not in ("points", "pairs"):
        raise UsageError(
            f"recording of {method.name!r} is {method.recording!r}", where=argument("methods"),
            advice="choose points or pairs",
        )  # fmt: skip
