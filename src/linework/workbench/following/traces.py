"""The last followed lines, which can still be saved or bridged, by id."""

from __future__ import annotations

import secrets
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from linework.errors import UsageError
from linework.model.lines import LineSet

if TYPE_CHECKING:
    from linework.workbench.server.app_state import AppState

#: Sent to a request: stop at the next step, and return what there is.
INTERRUPT = "interrupt"
#: Traces that are kept: those of all open pages, and some before them.
MOST_KEPT = 32


@dataclass(frozen=True, slots=True)
class KeptTrace:
    """A followed line as it was last sent to a page.

    Parameters
    ----------
    lines
        The line first, and then those beside it: its dashes, or the top of its kerb.
    in_images
        Whether it was picked in an image.
    stops
        Why it starts and why it ends where it does; "" while it grows.
    beside
        The lines of a template beside it; None: without a template, or while it grows.
    unseen
        Nodes of the template that were seen nowhere.
    left_out
        Name of the template that was interrupted, so that none of its lines are there; "": none was.
    """

    lines: LineSet
    in_images: bool = False
    stops: tuple[str, str] = ("", "")
    beside: LineSet | None = None
    unseen: tuple[str, ...] = ()
    left_out: str = ""

    @property
    def shown(self) -> LineSet:
        """All lines, as the page shows them: the line first."""
        return self.lines if self.beside is None else LineSet.concatenate([self.lines, self.beside])


@dataclass(frozen=True, slots=True)
class FollowMessage:
    """A message for the page ("": none), and the trace as the page then knows it (None: as before)."""

    text: str
    trace: KeptTrace | None = None


@dataclass(slots=True)
class KeptTraces:
    """The last traces of all pages, and how to interrupt the current one."""

    _traces: dict[str, KeptTrace] = field(default_factory=dict)
    _stop: Callable[[], None] | None = None

    def new_id(self) -> str:
        """Return an id that no trace of this or an earlier server has had."""
        return f"trace-{secrets.token_hex(8)}"

    def keep(self, trace_id: str, trace: KeptTrace) -> None:
        """Keep a trace, or its new state; the oldest is dropped when there are too many."""
        self._traces.pop(trace_id, None)
        self._traces[trace_id] = trace
        while len(self._traces) > MOST_KEPT:
            del self._traces[next(iter(self._traces))]

    def get(self, trace_id: str) -> KeptTrace:
        """Return a trace.

        Raises
        ------
        UsageError
            It is no longer kept, or never was.
        """
        if trace_id not in self._traces:
            raise UsageError("the followed line is no longer available", where="workbench",
                             advice="follow it again")  # fmt: skip
        return self._traces[trace_id]

    @contextmanager
    def interruptible(self, stop: Callable[[], None]) -> Iterator[None]:
        """Let `interrupt` call `stop` inside this block."""
        self._stop = stop
        try:
            yield
        finally:
            self._stop = None

    def interrupt(self) -> None:
        """Interrupt the line that is being followed, if there is one."""
        if self._stop is not None:
            self._stop()


def kept_trace(app_state: AppState, trace_id: str) -> KeptTrace:
    """Return a followed line as it was last sent to a page.

    Raises
    ------
    UsageError
        It is no longer available.
    """
    return app_state.traces.get(trace_id)
