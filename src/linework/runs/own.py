"""Own code in a run: what of its methods and its ground is not linework's, how it is sent, and its identity."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import fields, is_dataclass
from typing import Any

from linework.errors import OwnCodeError, UsageError, argument
from linework.methods.protocol import Method, is_own
from linework.model.ground import Ground
from linework.model.points import Points
from linework.model.trajectory import Trajectory
from linework.processes.identity import identity_of
from linework.processes.own_code import SentCode, sent_code
from linework.runs.extraction import Failure

#: Returns the ground below the points of an area, in the survey's coordinates; the path is the whole one, or None.
GroundFinder = Callable[[Points, Trajectory | None], Ground]


def check_own_code(methods: Sequence[Method], ground: Ground | GroundFinder | None = None) -> None:
    """Refuse own code that cannot be sent to worker processes, before any work.

    Raises
    ------
    UsageError
        The message names the parameter and the reason.
    """
    for parameter, _, value in _own_values(methods, ground):
        if isinstance(value, Ground):
            continue
        if not isinstance(value, Method) and not callable(value):
            raise UsageError(f"expected a function, got {type(value).__name__}", where=argument(parameter))
        sent_code(value, parameter)


def own_code_of(methods: Sequence[Method], ground: Ground | GroundFinder | None = None) -> dict[str, str]:
    """Return the identity of all own code by what it is part of; empty: the run has none.

    For the description of a run: lines of two versions of a function must not be mixed.
    """
    found: dict[str, str] = {}
    for parameter, owner, value in _own_values(methods, ground):
        name = f"{owner} {parameter}" if owner else parameter
        again = sum(other.split(" #")[0] == name for other in found)
        found[f"{name} #{again + 1}" if again else name] = identity_of(value)
    return found


def _own_values(
    methods: Sequence[Method], ground: Ground | GroundFinder | None
) -> Iterator[tuple[str, str, Any]]:
    """Yield the parameter of all own code, the method that it is part of ("": none), and the code."""
    for method in methods:
        owner = f"{method.name} {'+'.join(method.kinds)}"
        if is_own(method):
            yield "methods", owner, method
        else:
            yield from ((parameter, owner, value) for parameter, value in _functions_of(method))
    if ground is not None:
        yield "ground", "", ground


def _functions_of(method: Method) -> Iterator[tuple[str, Callable[..., Any]]]:
    """Yield the own functions that were passed to one of linework's methods."""
    if is_dataclass(method):
        for field in fields(method):
            value = getattr(method, field.name)
            if callable(value):
                yield field.name, value


def sent_method(method: Method) -> SentCode | None:
    """Return a method as it is sent to worker processes, as it is now; None: it has no own code, and goes as it is."""
    if is_own(method) or any(True for _ in _functions_of(method)):
        return sent_code(method, method.name)
    return None


def error_of_fault(fault: Failure) -> RuntimeError:
    """Return the error for a failure that a fault of the program or of own code has caused, with its traceback."""
    is_of_user = OwnCodeError.__name__ in fault.trace
    error = OwnCodeError(fault.problem.rstrip(".")) if is_of_user else RuntimeError(fault.problem)
    error.add_note(fault.trace)  # for the log
    return error
