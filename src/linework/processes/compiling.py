"""Whether kernels are being compiled, which happens once after an installation."""

from __future__ import annotations

import threading
from collections.abc import Callable

from numba.core import event


class CompilationMonitor(event.Listener):
    """Tells when compiling begins and when it ends; kernels that others need are compiled within it.

    Parameters
    ----------
    tell
        Called with True and False in turn, on the thread that compiles, if that is the main one: others send nothing.
    """

    def __init__(self, tell: Callable[[bool], None]) -> None:
        self._tell, self._depth = tell, 0
        event.register("numba:compile", self)  # type: ignore[no-untyped-call]

    def on_start(self, _event: event.Event) -> None:
        """Note that a kernel is begun."""
        self._change(1)

    def on_end(self, _event: event.Event) -> None:
        """Note that a kernel is done."""
        self._change(-1)

    def _change(self, step: int) -> None:
        if threading.current_thread() is not threading.main_thread():
            return
        before, self._depth = self._depth, self._depth + step
        if (before == 0) != (self._depth == 0):
            self._tell(self._depth > 0)
