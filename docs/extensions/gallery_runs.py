"""How the gallery is run: in a copy of the examples, with compiled kernels, which the reference then needs plain."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import numba
from numba.core.dispatcher import Dispatcher
from sphinx.application import Sphinx

DOCS = Path(__file__).parents[1]
#: The examples, and the copy of them that is run: what they write does not stay among the sources.
EXAMPLES, COPY = DOCS / "examples", DOCS / ".examples"

#: Examples that stand first in their sections; others follow by name.
FIRST = (
    "lines_from_arrays.py", "evaluate_lines.py", "trace_one_line.py", "radon_steps.py", "rails.py", "cables.py",
    "obb_boundaries.py", "obb_markings.py",
)  # fmt: skip


class ReadingOrder:
    """Key that sorts the examples of a section in the order in which they are read."""

    def __init__(self, folder: str) -> None:
        self.folder = folder

    def __call__(self, name: str) -> tuple[int, str]:
        """Return the place of an example in its section."""
        file = Path(name).name
        return (FIRST.index(file) if file in FIRST else len(FIRST), file)


def copy_examples() -> str:
    """Copy the examples for a build, and return the name of the copy in docs."""
    shutil.rmtree(COPY, ignore_errors=True)
    shutil.copytree(EXAMPLES, COPY, ignore=shutil.ignore_patterns("__pycache__"))
    return COPY.name


def remove_what_was_written(conf: dict[str, Any], name: str) -> None:
    """Remove the files that an example wrote, so that the next one of its folder begins as a reader does."""
    for folder in (path for path in COPY.iterdir() if path.is_dir()):
        for path in folder.iterdir():
            if not (EXAMPLES / folder.name / path.name).exists():
                shutil.rmtree(path) if path.is_dir() else path.unlink()


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
