"""Checkers that need an environment of their own, because they pin old packages or replace others."""

import os
from pathlib import Path

import pytest
from tests.scenes.places import ROOT


def checker(name: str) -> Path:
    """Return a program of `build/checkers` (made by .ci/run); skip without it, fail in continuous integration."""
    folder = Path(os.environ.get("LINEWORK_CHECKERS", ROOT / "build" / "checkers"))
    program = folder / "bin" / name
    if not program.exists():
        text = f"no {name}: python -m venv {folder}; {folder}/bin/pip install asam-qc-opendrive simple-lanelet2 pyxodr"
        if os.environ.get("CI") == "true":
            pytest.fail(text)
        pytest.skip(text)
    return program
