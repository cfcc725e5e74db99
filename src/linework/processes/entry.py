"""Entry point of every child process: limits what it may take, then runs one function of a module.

Run by `linework.processes.child.Child` as ``python -P -m linework.processes.entry``. Separate from `child`, because it runs
in the child and must import next to nothing before the limits hold.
"""

from __future__ import annotations

import gc
import importlib
import sys

from linework.processes.channel import Channel
from linework.processes.connection import connect_to_parent
from linework.processes.system import die_with_parent, limit_process, watch_parent


def child_main(arguments: list[str]) -> None:
    """Run a function in this process.

    Parameters
    ----------
    arguments
        Address of the connection (`linework.processes.connection`); process number of its parent; limit on its address
        space, 0: none [bytes]; ``module:function``, called with a `Channel` and with what follows, a list of str.
    """
    address, parent, address_bytes, target, *rest = arguments
    die_with_parent(int(parent))
    limit_process(int(address_bytes))
    connected = connect_to_parent(address)
    watch_parent(connected)
    module, _, function = target.partition(":")
    # The collector finds nothing in modules that are being imported, and takes a tenth of the time (0.2 of 1.7 s)
    gc.disable()
    called = getattr(importlib.import_module(module), function)
    gc.freeze()
    gc.enable()
    called(Channel(connected), rest)


if __name__ == "__main__":
    child_main(sys.argv[1:])
