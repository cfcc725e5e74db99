"""The methods for the kinds that are asked for."""

from __future__ import annotations

from linework.methods.kinds import ALL_KINDS as ALL_KINDS
from linework.methods.kinds import KINDS_OF, check_method
from linework.methods.obb.method import ObbConfig, ObbMethod
from linework.methods.protocol import Method
from linework.methods.radon.method import RadonConfig, RadonMethod, parts_of


def choose_methods(
    method: str, kinds: tuple[str, ...], *, radon: RadonConfig | None = None, obb: ObbConfig | None = None
) -> tuple[Method, ...]:
    """Return the methods that look for `kinds`, ready to be run (see `check_method`)."""
    check_method(method, kinds)
    by_boxes = tuple(kind for kind in kinds if kind in KINDS_OF["obb"])
    methods: tuple[Method, ...] = parts_of(RadonMethod(radon or RadonConfig(), kinds))
    return (ObbMethod(obb or ObbConfig(), by_boxes), *methods) if by_boxes else methods
