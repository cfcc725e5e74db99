"""What the package imports is what pyproject.toml declares: the core everywhere, an extra only where it is named."""

from __future__ import annotations

import ast
import subprocess
import sys
import tomllib
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import pytest
from tests.scenes.places import ROOT

import linework
from linework.errors import EXTRAS, MissingPackageError, check_extra, extra_needed, needed

HOUSE = Path(linework.__file__).parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
#: Modules of packages that have another name.
MODULES = {
    "laspy[lazrs]": ("laspy", "lazrs"),
    "opencv-python-headless": ("cv2",),
    "psycopg[binary]": ("psycopg",),
    "pillow": ("PIL",),
    "arro3-core": ("arro3",),
    "matplotlib": ("matplotlib", "mpl_toolkits"),
}
#: Imported by another package that is told its name (uvicorn's implementation of WebSockets).
BY_OTHERS = {"websockets"}


def modules_of(requirements: list[str]) -> set[str]:
    """Return the modules that requirements install; extras of linework itself are left out."""
    found: set[str] = set()
    for requirement in requirements:
        name = requirement.split(">")[0].split("<")[0].strip()
        if not name.startswith("linework"):
            found.update(MODULES.get(name, (name.replace("-", "_"),)))
    return found


def is_for_types(node: ast.AST) -> bool:
    return isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)


def imported(node: ast.AST, extra: str = "") -> Iterator[tuple[str, str]]:
    """Yield (extra, module) of the imports in a tree; "" for those outside `extra_needed` and `needed`."""
    for child in ast.iter_child_nodes(node):
        within = extra
        if is_for_types(child):
            continue
        if isinstance(child, ast.With):
            for item in child.items:
                call = item.context_expr
                if isinstance(call, ast.Call) and ast.unparse(call.func) == "extra_needed":
                    within = (
                        ast.literal_eval(call.args[0]) if isinstance(call.args[0], ast.Constant) else extra
                    )
        if isinstance(child, ast.Import):
            yield from ((extra, alias.name.split(".")[0]) for alias in child.names)
        elif isinstance(child, ast.ImportFrom) and child.module and child.level == 0:
            yield extra, child.module.split(".")[0]
        elif isinstance(child, ast.Call) and ast.unparse(child.func) == "needed":
            module, name = child.args[:2]
            if isinstance(module, ast.Constant):
                # A constant of the file names the extra
                yield (name.value if isinstance(name, ast.Constant) else "?"), module.value.split(".")[0]
        yield from imported(child, within)


def third_party() -> dict[str, set[str]]:
    """Return the modules that the package imports, by extra; those of the workbench's room belong to its extra."""
    core = modules_of(PROJECT["dependencies"])
    found: dict[str, set[str]] = defaultdict(set)
    for path in HOUSE.rglob("*.py"):
        room = path.relative_to(HOUSE).parts[0]
        for extra, module in imported(ast.parse(path.read_text(encoding="utf-8"))):
            if module == "linework" or module in sys.stdlib_module_names or module == "msvcrt":
                continue
            if room == "workbench" and not extra and module not in core:
                extra = "workbench"
            found[extra].add(module)
    return found


def test_the_core_imports_what_it_declares():
    assert third_party()[""] == modules_of(PROJECT["dependencies"])


def test_every_extra_is_declared_checked_and_used():
    used = third_party()
    everything = set().union(*used.values())
    declared = PROJECT["optional-dependencies"]
    assert set(declared) == {*EXTRAS, "all", "dev", "docs", "dist"}
    for extra, (purpose, modules) in EXTRAS.items():
        assert purpose
        assert set(modules) == modules_of(declared[extra]) - {"mpl_toolkits"}
        assert used[extra] <= modules_of(declared[extra]), extra
        assert set(modules) - BY_OTHERS <= everything, extra
    (everything_of,) = declared["all"]
    assert set(everything_of.removeprefix("linework[").removesuffix("]").split(",")) == set(EXTRAS)


@pytest.mark.parametrize("extra", EXTRAS)
def test_all_of_an_extra_is_installed_here(extra):
    check_extra(extra)


def test_a_missing_package_is_named_with_its_command(monkeypatch):
    monkeypatch.setitem(EXTRAS, "cad", ("DXF files", ("no_such_package",)))
    line = "DXF files: needs the package no_such_package. pip install 'linework[cad]'"
    with pytest.raises(MissingPackageError) as caught:
        check_extra("cad")
    assert str(caught.value) == line
    with pytest.raises(MissingPackageError) as caught, extra_needed("cad"):
        import no_such_package.inner  # noqa: F401
    assert str(caught.value) == line
    with pytest.raises(MissingPackageError) as caught:
        needed("no_such_package", "cad", where="--output")
    assert str(caught.value) == line.replace("DXF files", "--output")


def test_a_fault_of_our_own_is_not_taken_for_a_missing_package():
    with pytest.raises(ModuleNotFoundError) as caught, extra_needed("cad"):
        import linework.no_such_room  # noqa: F401
    assert not isinstance(caught.value, MissingPackageError)


def test_importing_linework_imports_no_package():
    code = "import sys; before = set(sys.modules); import linework; print(*sorted(set(sys.modules) - before))"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    names = {name.split(".")[0] for name in out.split()}
    assert names - set(sys.stdlib_module_names) == {"linework"}
