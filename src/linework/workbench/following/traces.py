"""What has been followed and may yet be saved: the last traces, by id."""

from __future__ import annotations

import secrets
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from linework.errors import UsageError
from linework.model.lines import LineSet

if TYPE_CHECKING:
    from linework.workbench.server.bench import AppState

#: So many traces can still be saved: those of all pages that are open, and some before them.
MOST_KEPT = 32


@dataclass(frozen=True, slots=True)
class KeptTrace:
    """A followed line as a page has last been told of it.

    Parameters
    ----------
    lines
        The line first, and then what runs beside it: its dashes, its kerb's top.
    in_images
        Whether it was picked in an image.
    stops
        Why it starts and ends where it does; "" while it grows.
    """

    lines: LineSet
    in_images: bool = False
    stops: tuple[str, str] = ("", "")


@dataclass(slots=True)
class KeptTraces:
    """The last traces of a bench."""

    _traces: dict[str, KeptTrace] = field(default_factory=dict)
    _stop: Callable[[], None] | None = None

    def new_id(self) -> str:
        """Return an id that no trace has had, of this server or of one before it."""
        return f"trace-{secrets.token_hex(8)}"

    def keep(self, trace_id: str, trace: KeptTrace) -> None:
        """Keep a trace, or what it has become; the oldest is forgotten when there are too many."""
        self._traces.pop(trace_id, None)
        self._traces[trace_id] = trace
        while len(self._traces) > MOST_KEPT:
            del self._traces[next(iter(self._traces))]

    def get(self, trace_id: str) -> KeptTrace:
        """Return a trace.

        Raises
        ------
        UsageError
            It is not kept: any more, or it has never been.
        """
        if trace_id not in self._traces:
            raise UsageError("the followed line is not at hand any more", where="workbench",
                             advice="follow it again")  # fmt: skip
        return self._traces[trace_id]

    @contextmanager
    def interruptible(self, stop: Callable[[], None]) -> Iterator[None]:
        """Let `interrupt` call `stop` for as long as this lasts."""
        self._stop = stop
        try:
            yield
        finally:
            self._stop = None

    def interrupt(self) -> None:
        """Interrupt what is being followed, if anything is."""
        if self._stop is not None:
            self._stop()


def kept_trace(bench: AppState, trace_id: str) -> LineSet:
    """Return a followed line as a page has last been told of it: the line first, then what runs beside it.

    Raises
    ------
    UsageError
        It is not at hand any more.
    """
    return bench.traces.get(trace_id).lines
