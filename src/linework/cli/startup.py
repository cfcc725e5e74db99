"""The start of a command: the notice that kernels are compiled first, and imports beside the decoding."""

from __future__ import annotations

import contextlib
import gc
import importlib
import os
import sys
import threading
from collections.abc import Iterable
from pathlib import Path

#: For each kind (and for `locate`) a kernel that its search always calls, by its file in kernels/: where that
#: one is compiled, so are the others.
_KERNEL_OF = {
    "lane_marking": "paint/stripes_all", "lane_marking_dash": "paint/stripes_all", "road_marking_other": "paint/stripes_all",
    "road_boundary": "boundaries/boundary_boxes", "kerb_top": "boundaries/boundary_boxes",
    "guardrail": "radon/follow", "barrier": "radon/follow", "cable": "cables/fit",
    "trajectory": "navigation",
}  # fmt: skip


def announce_compilation(kinds: Iterable[str], *, quiet: bool) -> None:
    """Print one line on stderr where kernels for these kinds have to be compiled first.

    Nothing is printed where numba caches elsewhere (``NUMBA_CACHE_DIR``, or a package folder that is not
    writable): there it is not known.
    """
    import linework.kernels

    folder = Path(next(iter(linework.kernels.__path__)))
    names = {_KERNEL_OF[kind] for kind in kinds if kind in _KERNEL_OF}
    elsewhere = "NUMBA_CACHE_DIR" in os.environ or not os.access(folder, os.W_OK)
    if not quiet and not elsewhere and not all(is_compiled(folder / f"{name}.py") for name in names):
        print("first run: compiling once, about half a minute", file=sys.stderr, flush=True)


def is_compiled(module: Path) -> bool:
    """Return whether numba's cache holds kernels of a module that are no older than its source.

    numba's index holds the source's own stamp; comparing modification times is near enough for a notice.
    """
    indices = (module.parent / "__pycache__").glob(f"{module.stem}.*.nbi")
    changed = module.stat().st_mtime
    return any(index.stat().st_mtime >= changed for index in indices)


def preload_modules(*modules: str) -> threading.Thread:
    """Start importing modules in a thread; join it before they are used.

    Decoding releases the interpreter lock and leaves it to the imports: of the 0.9 s that numba, scipy
    and pyogrio take, 0.6 s overlap with it (4 million points, 2 cores). The garbage collector, which finds
    nothing in freshly imported modules but takes another 0.1 s, is off meanwhile.
    """

    def import_all() -> None:
        had_collector = gc.isenabled()
        gc.disable()
        try:
            # A module that cannot be imported fails again, and is reported, where it is used
            with contextlib.suppress(Exception):
                for module in modules:
                    importlib.import_module(module)
        finally:
            gc.freeze()
            if had_collector:
                gc.enable()

    thread = threading.Thread(target=import_all, name="import ahead", daemon=True)
    thread.start()
    return thread
