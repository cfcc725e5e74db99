"""The methods for the kinds that are asked for, and the settings of all of them: the run file."""

from __future__ import annotations

from dataclasses import dataclass

from linework.methods.kinds import ALL_KINDS as ALL_KINDS
from linework.methods.kinds import check_method
from linework.methods.protocol import Method
from linework.methods.radon.method import RadonConfig, RadonMethod
from linework.model.settings import group


@dataclass(frozen=True, slots=True, kw_only=True)
class RunSettings:
    """The settings of every method, as the tables of a run file."""

    radon: RadonConfig = group(RadonConfig)


def choose_methods(method: str, kinds: tuple[str, ...], settings: RunSettings) -> tuple[Method, ...]:
    """Return the methods that look for `kinds`, ready to be run (see `check_method`)."""
    check_method(method, kinds)
    return (RadonMethod(settings.radon, kinds),)
