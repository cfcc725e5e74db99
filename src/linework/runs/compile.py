"""Compiling as a stage of its own: with progress, in processes side by side, and only what is missing."""

from __future__ import annotations

import contextlib
import textwrap
import warnings
from collections.abc import Iterable, Sequence

from linework.errors import LineworkWarning, MachineError
from linework.files.compiled import is_compiled, note_compiled, remove_stale
from linework.kernels.cache import TEMPORARY_CACHE
from linework.kernels.compiling import CalledKernel, cache_folder, called_kernels, compile_kernel
from linework.model.survey import Survey
from linework.processes.executors import Executor, Serial
from linework.processes.pool import Processes
from linework.runs.steps import Advance, RunSteps

#: Kernels of a kind of line, of stereo pairs, of the trajectory, of points on their way to every method (of users, too),
#: and of further columns of points, by their names in `linework.kernels.called_with`.
_GROUP_OF = {
    "lane_marking": "paint", "lane_marking_dash": "paint", "road_marking_other": "paint",
    "road_boundary": "boundaries", "kerb_top": "boundaries", "edge_other": "boundaries",
    "guardrail": "rails", "barrier": "rails", "fence": "rails", "cable": "cables",
    "stereo": "pairs", "trajectory": "trajectory", "points": "points", "columns": "columns",
    "classes": "classes",
}  # fmt: skip
#: Everything that can be compiled: kinds of line, and what else is in the table above.
COMPILED_FOR = tuple(_GROUP_OF)
#: A process that compiles takes up to 0.4 GB, and the longest kernel bounds the time from about this many on.
_MOST_PROCESSES = 4
#: A compiler's message goes on for pages; its beginning says what is wrong. [characters]
_MOST_OF_MESSAGE = 300
#: Below this number of kernels, starting processes takes longer than it saves.
_FEW_KERNELS = 6


def compiled_for(
    survey: Survey, kinds: Iterable[str], *, images: bool, in_memory: bool = False
) -> tuple[str, ...]:
    """Return the names for `compile_stage` and `loading_of` of what an extraction comes to.

    Parameters
    ----------
    images
        Whether stereo pairs are looked at, if the survey has any.
    in_memory
        Whether it has points that are in no file.
    """
    has_pairs = images and survey.has_pairs
    is_located = survey.trajectory_file is None and "navigation" in survey.settings
    others = {
        "points": in_memory or bool(survey.point_files), "columns": bool(survey.carry), "stereo": has_pairs,
        "trajectory": is_located,
    }  # fmt: skip
    return (*kinds, *(name for name, is_needed in others.items() if is_needed))


def compile_stage(names: Iterable[str], steps: RunSteps, *, needs_all: bool = False) -> bool:
    """Compile what is missing of the kernels for some kinds of line; return whether anything was.

    Nothing is shown, and it takes milliseconds, when all of it is compiled already.

    Parameters
    ----------
    names
        Kinds of line, "stereo" for stereo pairs, "trajectory" for locating; kinds of the user's own methods have no
        kernels here.
    steps
        The step "compile kernels" is shown by its number of kernels.
    needs_all
        Whether a kernel that cannot be compiled is an error. Otherwise it is a warning: the kernel is compiled, or
        fails again, when a method comes to it.

    Raises
    ------
    MachineError
        A kernel could not be compiled, and all are needed.
    """
    groups = sorted({_GROUP_OF[name] for name in names if name in _GROUP_OF})
    if is_compiled(groups):
        return False
    if TEMPORARY_CACHE:
        warnings.warn(
            "neither the package nor your cache can be written to: kernels are compiled for this command alone, which "
            "takes minutes. Let NUMBA_CACHE_DIR name a folder to keep them",
            LineworkWarning,
            stacklevel=2,
        )
    kernels = called_kernels(groups)
    with steps.step("compile kernels", unit="kernels") as advance:
        remove_stale(cache_folder)
        problems = _compile_all(kernels, advance)
    if not problems:
        note_compiled(groups, {cache_folder(kernel.module) for kernel in kernels})
        return True
    text = f"{len(problems)} of {len(kernels)} kernels could not be compiled, first {problems[0]}"
    if needs_all:
        raise MachineError(text)
    warnings.warn(text, LineworkWarning, stacklevel=2)
    return True


def loading_of(names: Iterable[str]) -> tuple[str, ...]:
    """Return what `linework.processes.pool.Processes` is prepared by for some names (see `compile_stage`).

    Only what is compiled is loaded; () where none of it is.
    """
    groups = sorted({_GROUP_OF[name] for name in names if name in _GROUP_OF})
    if not is_compiled(groups):
        groups = [group for group in groups if is_compiled([group])]
    return ("linework.kernels.compiling:load_kernels", *groups) if groups else ()


def _compile_all(kernels: Sequence[CalledKernel], advance: Advance) -> list[str]:
    """Compile kernels side by side, and return name and problem of each that could not be compiled."""
    from linework.processes.system import usable_cores

    n_processes = min(usable_cores(), _MOST_PROCESSES)
    problems = []
    with contextlib.ExitStack() as held:
        executor: Executor = Serial()
        if n_processes > 1 and len(kernels) >= _FEW_KERNELS:
            executor = held.enter_context(Processes(n_processes, modules=("linework.kernels.compiling",)))
        advance(0, len(kernels))
        for n_done, outcome in enumerate(executor.run(compile_kernel, kernels), start=1):
            if outcome.receipt is None:
                problem = textwrap.shorten(outcome.problem, _MOST_OF_MESSAGE, placeholder=" [...]")
                problems.append(f"{outcome.task.name}: {problem}")
            advance(n_done, len(kernels))
    return sorted(problems)
