"""Import what comes later while the points are decoded."""

from __future__ import annotations

import contextlib
import gc
import importlib
import threading


def import_ahead(*modules: str) -> threading.Thread:
    """Begin to import modules in a thread of their own; join it before they are used.

    Decoding lets go of the interpreter's lock and leaves it to the imports: of the 0.9 s that numba, scipy
    and pyogrio take, 0.6 s pass beside it (4 million points, 2 cores). The garbage collector, which finds
    nothing in freshly imported modules but takes another 0.1 s, rests meanwhile.
    """

    def work() -> None:
        had_collector = gc.isenabled()
        gc.disable()
        try:
            # What cannot be imported fails again, and is told, where it is used
            with contextlib.suppress(Exception):
                for module in modules:
                    importlib.import_module(module)
        finally:
            gc.freeze()
            if had_collector:
                gc.enable()

    thread = threading.Thread(target=work, name="import ahead", daemon=True)
    thread.start()
    return thread
