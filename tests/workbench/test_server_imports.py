"""The server imports no methods: it names the functions of its workers, and only they import what these need."""

from __future__ import annotations

import ast
import re
import subprocess
import sys

import pytest
from tests.scenes.places import ROOT

from linework.workbench.worker.process import worker_function

WORKBENCH = ROOT / "src" / "linework" / "workbench"
NAMED = re.compile(r"linework(\.\w+)+:\w+")
#: What takes long to import, and what the methods are made of.
HEAVY = ("numba", "scipy", "linework.surface", "linework.imaging", "linework.tracing", "linework.runs.opened")
METHODS = (
    "linework.methods.obb",
    "linework.methods.radon",
    "linework.methods.stereo",
    "linework.methods.tracking",
)
SERVER = "import linework.workbench.server.serve"
EDITS = "from linework.workbench.edits.routes import import_edits; import_edits()"


def imported(code):
    """Modules that a process has imported after some code."""
    shown = f"import sys; {code}; print(*sys.modules)"
    return subprocess.run(
        [sys.executable, "-c", shown], capture_output=True, text=True, check=True
    ).stdout.split()


@pytest.mark.parametrize(
    ("code", "absent"), [(SERVER, HEAVY + METHODS), (f"{SERVER}; {EDITS}", HEAVY[:1] + HEAVY[2:] + METHODS)]
)
def test_the_server_imports_no_methods(code, absent):
    found = imported(code)
    assert "linework.workbench.server.app" in found
    assert [name for name in found if name.startswith(absent)] == []


def named_functions():
    """Functions of workers that the workbench names as text."""
    texts = {
        node.value
        for path in WORKBENCH.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Constant) and isinstance(node.value, str)
    }
    return sorted(text for text in texts if NAMED.fullmatch(text) and not text.endswith("_main"))


def test_every_function_that_is_named_to_a_worker_exists():
    names = named_functions()
    assert len(names) > 20
    assert [name for name in names if not callable(worker_function(name))] == []
