"""Choosing the methods that find the kinds of line that are asked for."""

from __future__ import annotations

from linework.methods.kinds import KINDS_OF, check_method
from linework.methods.obb.method import Obb, ObbConfig
from linework.methods.protocol import Method
from linework.methods.radon.method import Radon, RadonConfig
from linework.methods.stereo.method import Stereo, StereoConfig


def choose_methods(
    method: str,
    kinds: tuple[str, ...],
    *,
    radon: RadonConfig | None = None,
    obb: ObbConfig | None = None,
    stereo: StereoConfig | None = None,
) -> tuple[Method, ...]:
    """Return the methods that look for `kinds`, whatever recordings a survey has.

    Parameters
    ----------
    method
        A method's name, or "auto": all that find one of the kinds.
    radon, obb, stereo
        Settings of the methods; None: defaults.

    Raises
    ------
    UsageError
        As for `check_method`.

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
        methods.append(Obb(obb or ObbConfig(), own["obb"]))
    if "radon" in asked:
        methods += Radon(radon or RadonConfig(), own["radon"]).parts
    if "stereo" in asked:
        methods.append(Stereo(stereo or StereoConfig(), own["stereo"]))
    return tuple(methods)
