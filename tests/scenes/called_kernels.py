"""Run a command of linework in a process of its own and write down which kernels were called, and with what.

``python -m tests.scenes.called_kernels FILE COMMAND ...``
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from numba.core.dispatcher import Dispatcher

from linework.kernels.compiling import signature_of


def main() -> int:
    """Run the command; each line of the file is a kernel and its signature, tab between them."""
    called: list[str] = []
    compile_ = Dispatcher.compile
    depth = 0

    def recorded(self: Any, sig: Any) -> Any:
        nonlocal depth
        # Kernels that a kernel calls are compiled with it
        if depth == 0 and self.py_func.__module__.startswith("linework.kernels."):
            name = f"{self.py_func.__module__.removeprefix('linework.kernels.')}.{self.py_func.__name__}"
            called.append(f"{name}\t{signature_of(sig)}")
        depth += 1
        try:
            return compile_(self, sig)
        finally:
            depth -= 1

    Dispatcher.compile = recorded
    from linework.cli.app import main as command

    code = command(sys.argv[2:])
    Path(sys.argv[1]).write_text("\n".join(called), encoding="utf-8")
    return code


if __name__ == "__main__":
    raise SystemExit(main())
