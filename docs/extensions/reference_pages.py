"""Write the pages of the API reference before Sphinx reads them: the public names, and a page for each room."""

from __future__ import annotations

import ast
import dataclasses
import functools
import importlib
import inspect
import re
from pathlib import Path
from types import GenericAlias, UnionType
from typing import Any, TypeVar

from jinja2 import FileSystemLoader
from jinja2.sandbox import SandboxedEnvironment
from numpydoc import docscrape_sphinx
from sphinx.application import Sphinx
from sphinx.domains.python import PythonDomain
from sphinx.environment import BuildEnvironment

import linework
from linework.runs.settings import RunSettings

PACKAGE = Path(linework.__file__).parent
#: The title of the page for modules that stand in no room.
ROOT_PAGE = "errors, arrays"


class ExactNames(PythonDomain):
    """The Python domain without the search for names that end alike.

    Annotations are given in full here. The search goes through all 9,000 names for each of 60,000 references
    and took a third of the build, and where two modules use one name it cannot tell which is meant.
    """

    def find_obj(
        self,
        env: BuildEnvironment,
        modname: str | None,
        classname: str | None,
        name: str,
        objtype: str | None,
        searchmode: int = 0,
    ) -> list[Any]:
        """Return the object of exactly this name, or none; public names stand for where they are defined."""
        return super().find_obj(env, modname, classname, defined_name(name), objtype, 0)


def defined_name(name: str) -> str:
    """Return the full name of what a public name stands for: `linework.extract` is defined in a room."""
    package, _, rest = name.partition(".")
    public, dot, member = rest.partition(".")
    if package != "linework" or public not in linework.__all__ or public.startswith("__"):
        return name
    value = getattr(linework, public)
    return f"{value.__module__}.{value.__name__}{dot}{member}"


@functools.cache
def numpydoc_templates() -> SandboxedEnvironment:
    """Return the templates of numpydoc, which compiles them anew for each of 16,000 docstrings otherwise."""
    return SandboxedEnvironment(loader=FileSystemLoader(Path(docscrape_sphinx.__file__).parent / "templates"))


def rooms() -> dict[str, list[str]]:
    """Return the modules of each room by the room's dotted name, in alphabetical order."""
    found: dict[str, list[str]] = {}
    for path in sorted(PACKAGE.rglob("*.py")):
        parts = ("linework", *path.relative_to(PACKAGE).with_suffix("").parts)
        if parts[-1].startswith("__"):
            continue
        found.setdefault(".".join(parts[:-1]), []).append(".".join(parts))
    return found


def room_page(room: str, modules: list[str]) -> str:
    """Return the page of one room: its own docstring, then each of its modules with all public members."""
    title = room.removeprefix("linework.") if room != "linework" else ROOT_PAGE
    lines = [title, "=" * len(title), ""]
    if room != "linework":
        lines += [f".. automodule:: {room}", "   :no-members:", ""]
    for module in modules:
        name = module.removeprefix(room + ".")
        if room != "linework":
            lines += [name, "-" * len(name), ""]
        lines += [f".. automodule:: {module}", ""]
    return "\n".join(lines)


def public_page() -> str:
    """Return the page of `linework.__all__`: a table of its names, then each of them.

    Its entries are indexed on the pages of their rooms.
    """
    names = [name for name in linework.__all__ if not name.startswith("__")]
    values = {name: getattr(linework, name) for name in names}
    functions = [name for name in names if not isinstance(values[name], type)]
    classes = [name for name in names if name not in functions]
    lines = ["linework", "========", "", ".. automodule:: linework", "   :no-members:", ""]
    for title, chosen in (("Functions", functions), ("Classes", classes)):
        lines += [title, "-" * len(title), "", ".. list-table::", "   :widths: 20 80", ""]
        for name in chosen:
            summary = (inspect.getdoc(values[name]) or "").split("\n", maxsplit=1)[0]
            lines += [
                f"   * - :ref:`{name} <public-{name.lower()}>`",
                f"     - {BAR.sub(chr(92) + '|', summary)}",
            ]
        lines.append("")
        for name in chosen:
            value = values[name]
            lines += [f".. _public-{name.lower()}:", "", name, "~" * len(name), ""]
            lines += [f"``linework.{name}``, defined in :py:mod:`{value.__module__}`.", ""]
            directive = (
                "autoexception"
                if _is_error(value)
                else "autoclass"
                if isinstance(value, type)
                else "autofunction"
            )
            lines += [f".. {directive}:: {value.__module__}.{value.__name__}", "   :no-index:", ""]
    return "\n".join(lines)


def rooms_table() -> str:
    """Return the table of all rooms, with the first line that each says of itself."""
    lines = ["| room | what it is |", "|---|---|"]
    for room in rooms():
        if room != "linework":
            title = room.removeprefix("linework.")
            lines.append(f"| [{title}](generated/{room}.rst) | {first_line(room)} |")
    lines.append(f"| [{ROOT_PAGE}](generated/linework.errors.rst) | {first_line('linework.errors')} |")
    return "\n".join([*lines, ""])


def first_line(module: str) -> str:
    """Return the first line of a module's docstring, without importing it."""
    path = PACKAGE.parent.joinpath(*module.split("."))
    file = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
    text = ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or ""
    return text.split("\n", maxsplit=1)[0].replace("``", "`").replace("|", "\\|")


def settings_page() -> str:
    """Return the page of all settings of a run file, a table for each of its tables."""
    lines = [
        "# Settings", "",
        "All settings of a run file, as `linework config` prints them. A run file is TOML: write the tables and keys",
        "to change, and pass the file with `--config`. An unknown key is an error.", "",
    ]  # fmt: skip
    return "\n".join([*lines, *_settings_tables(RunSettings(), "")])


def _settings_tables(settings: Any, prefix: str) -> list[str]:
    own, nested = [], []
    for field in dataclasses.fields(settings):
        value = getattr(settings, field.name)
        if dataclasses.is_dataclass(value):
            name = f"{prefix}{field.name}"
            nested += [f"## [{name}]", "", *_settings_tables(value, f"{name}.")]
        else:
            facts = field.metadata
            limits = f"{facts['low']:g} to {facts['high']:g}" if isinstance(value, int | float) else ""
            limits = "" if isinstance(value, bool) or "inf" in limits else limits
            own.append(f"| `{field.name}` | {value!r} | {facts['unit']} | {limits} | {facts['reason']} |")
    table = ["| setting | default | unit | allowed | reason |", "|---|---|---|---|---|", *own, ""]
    return [*(table if own else []), *nested]


def _is_error(value: object) -> bool:
    return isinstance(value, type) and issubclass(value, Exception)


#: A literal of reStructuredText, and a bar that is no column of a diagram.
LITERAL, BAR = re.compile(r"(``.*?``)"), re.compile(r"(?<=\S)\||\|(?=\S)")


def escape_bars(app: Sphinx, what: str, name: str, value: object, options: Any, lines: list[str]) -> None:
    """Escape the bars of lengths and absolute values (|E|), which reStructuredText takes for substitutions."""
    for i, line in enumerate(lines):
        if "|" in line:
            lines[i] = "".join(
                part if part.startswith("``") else BAR.sub(r"\\|", part) for part in LITERAL.split(line)
            )


def is_skipped(app: Sphinx, what: str, name: str, value: object, skip: bool, options: Any) -> bool | None:
    """Return True for aliases of types and for classes of other packages; None leaves the decision as it is."""
    if what == "module" and isinstance(value, GenericAlias | UnionType):
        return True
    if isinstance(value, type) and not value.__module__.startswith("linework"):
        return True
    return None


def plain_if_it_has_no_entry(app: Sphinx, env: BuildEnvironment, node: Any, text: Any) -> Any:
    """Return the text of a reference to a type variable or a private class as it is: neither has an entry."""
    module, _, name = str(node.get("reftarget", "")).rpartition(".")
    if not module.startswith("linework"):
        return None
    try:
        value = getattr(importlib.import_module(module), name, None)
    except ImportError:
        return None
    return text if name.startswith("_") or isinstance(value, TypeVar) else None


def write_pages(app: Sphinx) -> None:
    """Write docs/reference/generated; a page that has not changed keeps its time, so that it is not read anew."""
    folder = Path(app.srcdir) / "reference" / "generated"
    folder.mkdir(parents=True, exist_ok=True)
    pages = {"linework.rst": public_page(), "settings.md": settings_page(), "rooms.txt": rooms_table()}
    for room, modules in rooms().items():
        pages[f"{room if room != 'linework' else 'linework.errors'}.rst"] = room_page(room, modules)
    for stale in {path.name for path in folder.iterdir()} - set(pages):
        (folder / stale).unlink()
    for name, text in pages.items():
        path = folder / name
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


def setup(app: Sphinx) -> dict[str, bool]:
    """Write the pages when the builder is ready; keep the build quick."""
    docscrape_sphinx.SandboxedEnvironment = lambda loader: numpydoc_templates()
    app.add_domain(ExactNames, override=True)
    app.connect("autodoc-skip-member", is_skipped)
    app.connect("autodoc-process-docstring", escape_bars)
    app.connect("missing-reference", plain_if_it_has_no_entry)
    app.connect("builder-inited", write_pages)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
