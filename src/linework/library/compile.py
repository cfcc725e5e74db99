"""Compile all kernels in one call, before they are needed.

Separate from `linework.runs.compile`, which does it: here is the function for users, with their forms of progress.
"""

from __future__ import annotations

from linework.library.progress import Progress, display_of
from linework.runs.compile import COMPILED_FOR, compile_stage
from linework.runs.steps import RunSteps


def compile_kernels(progress: Progress = None) -> bool:
    """Compile the kernels of all methods, and return whether anything was missing.

    Functions that need a kernel compile it when they first come to it, once per installation; here all are compiled
    before, side by side. When nothing is missing it takes milliseconds. The compiled code is kept beside the package,
    in the folder that the environment variable ``NUMBA_CACHE_DIR`` names, or where neither can be written to, in the
    user's cache.

    Parameters
    ----------
    progress
        True: show progress on stderr. A function is called with (stage, done, total), the number of kernels.

    Raises
    ------
    MachineError
        A kernel could not be compiled; the message names it.

    Examples
    --------
    >>> import linework
    >>> was_missing = linework.compile_kernels()
    >>> linework.compile_kernels()  # it is compiled now
    False
    """
    with display_of(progress) as display:
        return compile_stage(COMPILED_FOR, RunSteps(display), needs_all=True)
