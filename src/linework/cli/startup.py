"""The start of a command: imports beside the decoding.

Separate from the commands: those that open a survey share it.
"""

from __future__ import annotations

import contextlib
import gc
import importlib
import threading
from collections.abc import Iterator


def preload_modules(*modules: str) -> threading.Thread:
    """Start importing modules in a thread; join it before they are used.

    Decoding releases the interpreter lock and leaves it to the imports: of the 0.9 s that numba, scipy
    and pyogrio take, 0.6 s overlap with it (4 million points, 2 cores).
    """

    def import_all() -> None:
        # A module that cannot be imported fails again, and is reported, where it is used
        with without_collector(), contextlib.suppress(Exception):
            for module in modules:
                importlib.import_module(module)

    thread = threading.Thread(target=import_all, name="import ahead", daemon=True)
    thread.start()
    return thread


@contextlib.contextmanager
def without_collector() -> Iterator[None]:
    """Keep the garbage collector off during imports: it finds nothing in them, and takes a tenth of their time."""
    had_collector = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        if had_collector:
            gc.enable()
