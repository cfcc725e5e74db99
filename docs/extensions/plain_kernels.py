"""What the gallery needs of kernels and folders, and what the reference needs of kernels once the gallery is built."""

from __future__ import annotations

import os
import sys
import tempfile
from types import ModuleType
from typing import Any

import numba
from numba.core.dispatcher import Dispatcher
from sphinx.application import Sphinx

#: Where the builder was started, and the folder that the running example writes to.
_folders: list[tuple[str, tempfile.TemporaryDirectory[str]]] = []


def in_a_folder_of_its_own(conf: dict[str, Any], name: str, when: str) -> None:
    """Run each example of the gallery in an empty temporary folder: what it writes does not stay."""
    if when == "before":
        _folders.append((str(conf["src_dir"]), tempfile.TemporaryDirectory(prefix="linework-gallery-")))
        os.chdir(_folders[-1][1].name)
    elif _folders:
        back, folder = _folders.pop()
        os.chdir(back)
        folder.cleanup()


def make_kernels_plain(app: Sphinx, env: object, names: list[str]) -> None:
    """Make kernels plain functions, so that the reference shows their signatures and docstrings.

    Examples need them compiled, and run before the pages are read. Kernels that are imported from here on are not
    compiled at all.
    """
    numba.config.DISABLE_JIT = 1
    for module in [module for name, module in sys.modules.items() if name.startswith("linework.")]:
        _make_plain(module)


def _make_plain(module: ModuleType) -> None:
    for name, value in list(vars(module).items()):
        if isinstance(value, Dispatcher):
            setattr(module, name, value.py_func)


def setup(app: Sphinx) -> dict[str, bool]:
    """Make kernels plain after the gallery has run, and before pages are read."""
    app.connect("env-before-read-docs", make_kernels_plain)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
