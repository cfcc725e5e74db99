"""`linework compile`: compile all kernels now, so that no later command does.

Separate from the other commands: each has a file of its own.
"""

from __future__ import annotations

from linework.cli.options import Quiet
from linework.cli.said import say


def compile_command(quiet: Quiet = False) -> None:
    """Compile everything that the other commands need.

    A command compiles what it needs on its first run, which takes minutes. Here all of it is compiled at once, for
    example when linework is installed for others.
    """
    import time

    from linework.library.progress import open_display
    from linework.runs.compile import COMPILED_FOR, compile_stage
    from linework.runs.steps import RunSteps

    start = time.monotonic()
    with open_display(quiet=quiet) as display:
        was_missing = compile_stage(COMPILED_FOR, RunSteps(display), needs_all=True)
    say(f"compiled in {time.monotonic() - start:.0f} s" if was_missing else "everything is compiled already")
