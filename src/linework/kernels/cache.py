"""Where compiled code is kept; decided before the first kernel is imported, which is when numba looks for a place.

Numba keeps it beside the source or in the user's cache, and refuses to compile where it can do neither.
"""

from __future__ import annotations

import atexit
import os
from pathlib import Path

_CACHE = "NUMBA_CACHE_DIR"


def _usable(folder: Path) -> bool:
    """Return whether files can be created in a folder, or in the one that it would be made in."""
    there = next(path for path in (folder, *folder.parents) if path.exists())
    return there.is_dir() and os.access(there, os.W_OK)


def _users_cache() -> Path | None:
    given = os.environ.get("XDG_CACHE_HOME", "")
    try:
        return Path(given) if given else Path.home() / ".cache"
    except RuntimeError:
        return None


def _temporary_cache() -> str:
    """Return a new folder for compiled code where neither the package nor the user's cache can be written to.

    The folder is this program's alone, for code of others must never be run, and is removed at its end; worker
    processes get it by the environment variable. "": there is another place.
    """
    users = _users_cache()
    places = [Path(__file__).parent / "__pycache__", *([users] if users else [])]
    if os.environ.get(_CACHE) or any(_usable(place) for place in places):
        return ""
    import shutil
    import tempfile

    folder = tempfile.mkdtemp(prefix="linework-kernels-")
    os.environ[_CACHE] = folder
    owner = os.getpid()

    def remove() -> None:
        if os.getpid() == owner:
            shutil.rmtree(folder, ignore_errors=True)

    atexit.register(remove)
    return folder


#: Folder of the compiled code of this program alone, "" where it is kept for the next one.
TEMPORARY_CACHE = _temporary_cache()
