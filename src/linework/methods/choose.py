"""The methods for the kinds that are asked for."""

from __future__ import annotations

from linework.methods.kinds import ALL_KINDS as ALL_KINDS
from linework.methods.kinds import check_method
from linework.methods.protocol import Method
from linework.methods.radon.method import RadonConfig, RadonMethod, parts_of


def choose_methods(method: str, kinds: tuple[str, ...], radon: RadonConfig) -> tuple[Method, ...]:
    """Return the methods that look for `kinds`, ready to be run (see `check_method`)."""
    check_method(method, kinds)
    return parts_of(RadonMethod(radon, kinds))
