"""The methods for the kinds that are asked for."""

from __future__ import annotations

from linework.methods.kinds import KINDS_OF, check_method
from linework.methods.obb.method import ObbConfig, ObbMethod
from linework.methods.protocol import Method
from linework.methods.radon.method import RadonConfig, RadonMethod, parts_of
from linework.methods.stereo.method import StereoConfig, StereoMethod


def choose_methods(
    method: str, kinds: tuple[str, ...], *, radon: RadonConfig | None = None, obb: ObbConfig | None = None
) -> tuple[Method, ...]:
    """Return the methods that look for `kinds` in points, ready to be run (see `check_method`)."""
    check_method(method, kinds)
    if method == "stereo":
        return ()
    by_boxes = tuple(kind for kind in kinds if kind in KINDS_OF["obb"])
    methods: tuple[Method, ...] = parts_of(RadonMethod(radon or RadonConfig(), kinds))
    return (ObbMethod(obb or ObbConfig(), by_boxes), *methods) if by_boxes else methods


def stereo_method(
    method: str, kinds: tuple[str, ...], config: StereoConfig | None = None
) -> StereoMethod | None:
    """Return the method that looks for `kinds` in stereo pairs, or None where it is not asked for."""
    check_method(method, kinds)
    own = tuple(kind for kind in kinds if kind in KINDS_OF["stereo"])
    return StereoMethod(config or StereoConfig(), own) if own and method in ("auto", "stereo") else None
