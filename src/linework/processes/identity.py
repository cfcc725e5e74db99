"""Identity of own code: a text that is the same in every process as long as the code and its values are.

A run that is resumed must not mix the lines of two versions of a function. Its identity covers the bytecode, the
constants, the values of closures and defaults, the functions of the same script that it calls, and the state of
objects. What is installed (numpy, a network's library) counts by its name.
"""

from __future__ import annotations

import dis
import hashlib
import sys
import sysconfig
from enum import Enum
from functools import lru_cache
from pathlib import Path
from types import BuiltinFunctionType, CodeType, FunctionType, MappingProxyType, MethodType, ModuleType
from typing import Any

import numpy as np

#: Folders of what is installed: it counts by its name.
_INSTALLED = tuple(
    {Path(sysconfig.get_path(name)) for name in ("stdlib", "platstdlib", "purelib", "platlib")}
)
#: What `functools.lru_cache` returns.
_CACHED: type = type(lru_cache(len))
_HOUSE = Path(__file__).parents[1]
#: Attributes of a class that say nothing about what it does, or differ between processes.
_ASIDE = {
    "__dict__", "__weakref__", "__doc__", "__module__", "__qualname__", "__firstlineno__",
    "__static_attributes__", "__annotations__", "__annotate__", "__abstractmethods__", "_abc_impl",
    "__parameters__", "_is_protocol", "__non_callable_proto_members__", "__protocol_attrs__",
    "__subclasshook__", "__slotnames__", "__match_args__", "__dataclass_fields__", "__dataclass_params__",
}  # fmt: skip


def identity_of(value: Any) -> str:
    """Return the identity of an own function, class or object: its name, and a hash of all that it depends on.

    >>> identity_of(np.float64(1.5)) == identity_of(np.float64(1.5)), identity_of(1) == identity_of(2)
    (True, False)
    >>> threshold = 2.0
    >>> one, other = (lambda x: x > threshold), (lambda x: x > 3.0)
    >>> identity_of(one) == identity_of(other)
    False
    """
    description = _Description()
    description.add(value)
    named = value if isinstance(value, FunctionType | type) else type(value)
    return f"{_name_of(named)} {description.digest()}"


class _Description:
    """A hash of values, in an order that does not depend on the process."""

    def __init__(self) -> None:
        self._hash = hashlib.sha256()
        #: Digests of the objects that were added, "" while they are: cycles end there.
        self._known: dict[int, str] = {}
        self._kept: list[Any] = []  # so that no id is used twice

    def digest(self) -> str:
        return self._hash.hexdigest()[:16]

    def add(self, value: Any) -> None:
        """Add a value."""
        if value is None or isinstance(value, bool | int | float | complex | str | bytes):
            self._text(f"{type(value).__name__} {value!r}")
        elif isinstance(value, np.ndarray) and value.dtype != object:
            self._text(f"array {value.dtype!r} {value.shape}")
            self._hash.update(np.ascontiguousarray(value).tobytes())
        else:
            if id(value) not in self._known:
                self._known[id(value)] = ""
                self._kept.append(value)
                outer, self._hash = self._hash, hashlib.sha256()
                self._add_object(value)
                self._known[id(value)] = self._hash.hexdigest()
                self._hash = outer
            self._text(self._known[id(value)])

    def _add_object(self, value: Any) -> None:
        if isinstance(value, ModuleType):
            self._module(value)
        elif isinstance(value, CodeType):
            self._code(value)
        elif isinstance(value, FunctionType):
            self._function(value)
        elif isinstance(value, MethodType):
            self._items("method", value.__func__, value.__self__)
        elif isinstance(value, type):
            self._class(value)
        elif isinstance(value, Enum):
            self._text(f"enum {value}")
        elif type(value) in (dict, MappingProxyType):
            self._text(f"dict {len(value)}")
            for key in sorted(value, key=identity_of):
                self._items("item", key, value[key])
        elif type(value) in (tuple, list):
            self._items(f"{type(value).__name__} {len(value)}", *value)
        elif type(value) in (set, frozenset):
            self._text(f"set {' '.join(sorted(identity_of(item) for item in value))}")
        elif isinstance(value, BuiltinFunctionType | np.ufunc):
            self._text(f"builtin {_name_of(value)}")
        else:
            self._copied(value)

    def _module(self, module: ModuleType) -> None:
        """Add a module: one that is not installed by its source, a package by all of its files."""
        self._text(f"module {module.__name__} {getattr(module, '__version__', '')}")
        file = getattr(module, "__file__", None)
        if file is None or _lies_in_installation(file):
            return
        path = Path(file)
        files = sorted(path.parent.rglob("*.py")) if hasattr(module, "__path__") else [path]
        for source in files:
            self._text(source.relative_to(path.parent).as_posix())
            self._hash.update(hashlib.sha256(source.read_bytes()).digest())

    def _function(self, function: FunctionType) -> None:
        self._text(f"function {_name_of(function)}")
        if _lies_in_installation(function.__code__.co_filename):
            return
        closure = [_content(cell) for cell in function.__closure__ or ()]
        self._items("code", function.__code__, function.__defaults__, function.__kwdefaults__, *closure)
        # What it calls of its own script; names that are not there yet are attributes, or builtins
        for name in sorted(_names_in(function.__code__)):
            if name in function.__globals__:
                self._items(f"global {name}", function.__globals__[name])

    def _code(self, code: CodeType) -> None:
        self._text(f"bytecode {code.co_name} {code.co_argcount} {code.co_varnames} {code.co_names}")
        self._hash.update(code.co_code)
        self._items("constants", *code.co_consts)

    def _class(self, own: type) -> None:
        self._text(f"class {_name_of(own)}")
        if is_installed(own):
            return
        self._items("bases", *own.__bases__)
        for name in sorted(vars(own).keys() - _ASIDE):
            self._items(f"attribute {name}", vars(own)[name])

    def _copied(self, value: Any) -> None:
        """Add an object by what its copy would be made of; an object that cannot be copied counts by its class."""
        if isinstance(value, staticmethod | classmethod):
            self._items(type(value).__name__, value.__func__)
            return
        if isinstance(value, property):
            self._items("property", value.fget, value.fset)
            return
        # Compiled by numba, or kept by functools.lru_cache
        wrapped = getattr(value, "__wrapped__" if type(value) is _CACHED else "py_func", None)
        if isinstance(wrapped, FunctionType):
            self._items("compiled", wrapped)
            return
        self.add(type(value))
        try:
            made_of = value.__reduce_ex__(4)
        except Exception:
            return
        if isinstance(made_of, tuple):
            parts = [list(part) if hasattr(part, "__next__") else part for part in made_of[1:]]
            self._items("object", *parts)
        else:
            self._text(f"named {made_of}")

    def _items(self, what: str, *values: Any) -> None:
        self._text(what)
        for value in values:
            self.add(value)

    def _text(self, text: str) -> None:
        data = text.encode("utf-8", "backslashreplace")
        self._hash.update(len(data).to_bytes(8, "big") + data)


def _names_in(code: CodeType) -> set[str]:
    """Return the global names that code and the code inside it use."""
    found = {
        step.argval for step in dis.get_instructions(code) if step.opname in ("LOAD_GLOBAL", "LOAD_NAME")
    }
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            found |= _names_in(constant)
    return found


def _content(cell: Any) -> Any:
    try:
        return cell.cell_contents
    except ValueError:  # not filled yet
        return None


def _name_of(value: Any) -> str:
    return f"{getattr(value, '__module__', '')}.{getattr(value, '__qualname__', type(value).__qualname__)}"


def is_installed(own: type) -> bool:
    """Return whether a class is linework's, or is installed: its version is in the description of a run.

    >>> is_installed(np.ndarray), is_installed(type("Mine", (), {}))
    (True, False)
    """
    module = sys.modules.get(own.__module__)
    found: Any = module
    for name in own.__qualname__.split("."):
        found = getattr(found, name, None)
    if module is None or found is not own:  # of a notebook, a doctest, a function
        return False
    file = getattr(module, "__file__", None)
    if file is None:
        return own.__module__ in sys.stdlib_module_names
    return _lies_in_installation(file)


def _lies_in_installation(file: str) -> bool:
    parents = Path(file).absolute().parents
    return _HOUSE in parents or any(folder in parents for folder in _INSTALLED)
