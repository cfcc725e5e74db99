"""Python children that lack packages, modules or functions, as on another machine, and so do their own children."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

_BLOCK = """
import sys

class Blocked:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in {modules!r}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)

sys.meta_path.insert(0, Blocked())
for name in {modules!r}:
    sys.modules.pop(name, None)
for place in {attributes!r}:
    module, _, name = place.rpartition(".")
    delattr(__import__(module), name)
"""


def environment_without(
    folder: Path, modules: Sequence[str] = (), attributes: Sequence[str] = ()
) -> dict[str, str]:
    """Return an environment in which Python has no such modules, and modules have no such attributes.

    Parameters
    ----------
    folder
        Where the file is written that Python runs when it starts.
    modules
        Names of modules, the packages that they are in, too.
    attributes
        As "os.preadv".
    """
    folder.mkdir(parents=True, exist_ok=True)
    text = _BLOCK.format(modules=set(modules), attributes=tuple(attributes))
    (folder / "sitecustomize.py").write_text(text, encoding="utf-8")
    paths = [str(folder), *filter(None, [os.environ.get("PYTHONPATH")])]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}


def run_linework(
    environment: dict[str, str], *arguments: object, cwd: Path | None = None
) -> subprocess.CompletedProcess[str]:
    """Run the command line in a child, to its end."""
    return subprocess.run(
        [sys.executable, "-m", "linework", *map(str, arguments)],
        env=environment, cwd=cwd, capture_output=True, text=True, check=False, timeout=900,
    )  # fmt: skip
