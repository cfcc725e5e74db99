"""Shell completion: what the shell asks for, and the script that --show-completion prints for it."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest


def completed(shell: str, words: str) -> list[str]:
    """Return what the shell is offered for the last word."""
    environment = {
        **os.environ, "_LINEWORK_COMPLETE": f"complete_{shell}", "COMP_WORDS": words,
        "COMP_CWORD": str(len(words.split()) - 1), "_TYPER_COMPLETE_ARGS": words,
    }  # fmt: skip
    found = subprocess.run(
        [sys.executable, "-m", "linework"], env=environment, capture_output=True, text=True, check=True
    )
    return found.stdout.split()


def test_commands_and_options_are_completed():
    assert completed("bash", "linework ex") == ["extract"]
    assert completed("bash", "linework extract --wor") == ["--workers", "--work"]


@pytest.mark.parametrize("shell", ["zsh", "fish"])
def test_other_shells_are_answered_in_their_own_way(shell):
    answer = " ".join(completed(shell, "linework ex"))
    assert "extract" in answer and "evaluate" not in answer
