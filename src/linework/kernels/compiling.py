"""Compile kernels before they are called, by the types that the methods call them with.

A kernel is compiled when it is first called with arguments of certain types; numba keeps the result in its cache. Here
the same is done by the types alone, so that no input is needed, kernels can be compiled side by side, and it is known
how many are left.
"""

from __future__ import annotations

import contextlib
import importlib
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from linework.kernels.called_with import CALLED_WITH


@dataclass(frozen=True, slots=True)
class CalledKernel:
    """A kernel that methods call, and the types that they call it with.

    Parameters
    ----------
    name
        Module below `linework.kernels`, and function: "radon.transform.radon".
    signatures
        Types of the arguments, as in `linework.kernels.called_with`.
    """

    name: str
    signatures: tuple[str, ...]

    @property
    def module(self) -> str:
        """Module below `linework.kernels`."""
        return self.name.rpartition(".")[0]


def called_kernels(groups: Iterable[str]) -> list[CalledKernel]:
    """Return the kernels that some groups of methods call, in the order of the table.

    >>> len(called_kernels(["trajectory"])) > 0
    True
    """
    wanted, found = set(groups), []
    name, users = "", set[str]()
    signatures: list[str] = []
    for line in [*CALLED_WITH.strip().splitlines(), "="]:
        if line.startswith(" "):
            signatures.append(line.strip())
            continue
        if users & wanted:
            found.append(CalledKernel(name, tuple(signatures)))
        before, _, after = line.partition("=")
        name, users, signatures = before.strip(), set(after.split()), []
    return found


def compile_kernel(kernel: CalledKernel) -> str:
    """Compile a kernel for all its signatures, or load it from numba's cache; return its name."""
    dispatcher = _dispatcher(kernel.name)
    for signature in kernel.signatures:
        dispatcher.compile(tuple(_type_of(word) for word in signature.split()))
    return kernel.name


def load_kernels(*groups: str) -> None:
    """Load the compiled kernels that groups of methods call. One that fails to load fails again, with its error, when used."""
    for kernel in called_kernels(groups):
        with contextlib.suppress(Exception):
            compile_kernel(kernel)


def cache_folder(module: str) -> Path:
    """Return the folder where numba caches the kernels of a module below `linework.kernels`."""
    loaded = importlib.import_module(f"linework.kernels.{module}")
    kernels = [value for value in vars(loaded).values() if hasattr(value, "py_func")]
    own = [kernel for kernel in kernels if kernel.py_func.__module__ == loaded.__name__]
    # A module without kernels has nothing in any cache
    return Path(own[0].stats.cache_path) if own else Path(str(loaded.__file__)).parent / "__pycache__"


def signature_of(types: Iterable[Any]) -> str:
    """Return the types of a kernel's arguments as `linework.kernels.called_with` writes them.

    >>> import numba
    >>> signature_of([numba.typeof(np.zeros((2, 3), np.float32)), numba.int64])
    'f4:2C i8'
    """
    return " ".join(map(_word_of, types))


def _dispatcher(name: str) -> Any:
    module, _, function = name.rpartition(".")
    return getattr(importlib.import_module(f"linework.kernels.{module}"), function)


def _word_of(numba_type: Any) -> str:
    """Return a type of numba as the table writes it: dtype, ``:`` with dimensions and layout, ``!`` where it is read-only."""
    import numba
    from numba.np.numpy_support import as_dtype

    types: Any = numba.types
    if isinstance(numba_type, types.Array):
        read_only = "" if numba_type.mutable else "!"
        return f"{_word_of(numba_type.dtype)}:{numba_type.ndim}{numba_type.layout}{read_only}"
    if isinstance(numba_type, types.BaseTuple):
        named = getattr(numba_type, "instance_class", None)
        name = f"{named.__module__.removeprefix('linework.kernels.')}.{named.__name__}" if named else ""
        return f"{name}({','.join(map(_word_of, numba_type))})"
    return str(as_dtype(numba_type).str[1:])


def _type_of(word: str) -> Any:
    """Return the type of numba that is written so in the table."""
    import numba

    # Numba's types are annotated in part only
    types: Any = numba.types
    if word.endswith(")"):
        name, _, inside = word[:-1].partition("(")
        members = [_type_of(part) for part in _split(inside)]
        if not name:
            return types.Tuple(members)
        module, _, named = name.rpartition(".")
        named_tuple = getattr(importlib.import_module(f"linework.kernels.{module}"), named)
        if len(set(members)) == 1:
            return types.NamedUniTuple(members[0], len(members), named_tuple)
        return types.NamedTuple(members, named_tuple)
    dtype, is_array, rest = word.partition(":")
    scalar = numba.from_dtype(np.dtype(dtype))
    return types.Array(scalar, int(rest[0]), rest[1], readonly=rest.endswith("!")) if is_array else scalar


def _split(text: str) -> list[str]:
    """Return the words between commas that stand outside of inner brackets."""
    parts, depth = [""], 0
    for character in text:
        depth += (character == "(") - (character == ")")
        if character == "," and depth == 0:
            parts.append("")
        else:
            parts[-1] += character
    return parts
