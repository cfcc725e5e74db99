"""Say why the first run takes longer: the kernels are compiled once, and kept."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable
from pathlib import Path

#: A kernel that the search for a kind always comes to; where it is compiled, so are the others.
_KERNEL_OF = {
    "lane_marking": "stripes_all", "lane_marking_dash": "stripes_all", "road_marking_other": "stripes_all",
    "road_boundary": "boundary_boxes", "kerb_top": "boundary_boxes",
    "guardrail": "follow", "barrier": "follow", "cable": "cable_fit",
    "trajectory": "navigation",
}  # fmt: skip


def tell_of_compiling(kinds: Iterable[str], *, quiet: bool) -> None:
    """Print one line on stderr where kernels for these kinds have to be compiled first.

    Where numba keeps them elsewhere (``NUMBA_CACHE_DIR``, a package that cannot be written) nothing is said.
    """
    import linework.kernels

    folder = Path(next(iter(linework.kernels.__path__)))
    names = {_KERNEL_OF[kind] for kind in kinds if kind in _KERNEL_OF}
    elsewhere = "NUMBA_CACHE_DIR" in os.environ or not os.access(folder, os.W_OK)
    if not quiet and not elsewhere and not all(is_compiled(folder / f"{name}.py") for name in names):
        print("first run: compiling, once, about half a minute", file=sys.stderr, flush=True)


def is_compiled(module: Path) -> bool:
    """Return whether numba's cache holds kernels of a module that are no older than it.

    The stamp of the source is in numba's index; by its time, one of an older version is told well enough.
    """
    indices = (module.parent / "__pycache__").glob(f"{module.stem}.*.nbi")
    changed = module.stat().st_mtime
    return any(index.stat().st_mtime >= changed for index in indices)
