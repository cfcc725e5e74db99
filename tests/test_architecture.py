"""Imports run one way, rooms stay light, and the root stays instant."""

import ast
import subprocess
import sys
from pathlib import Path

import linework

ROOT = Path(linework.__file__).parent
LEVELS = [
    {"errors", "arrays"},
    {"kernels"},
    {"model", "processes"},
    {"navigation", "surface", "imaging", "lines"},
    {"editing"},
    {"methods"},
    {"published"},
    {"files"},
    {"runs", "simulation"},
    {"tracing", "evaluation"},
    {"workbench"},
    {"cli"},
]
LEVEL = {room: i for i, rooms in enumerate(LEVELS) for room in rooms}
FORBIDDEN_NAMES = {"utils", "helpers", "common", "core", "tools", "manager"}


def room(module: str) -> str:
    return module.split(".")[1]


def imports_of(path: Path) -> set[str]:
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module:
            assert node.level == 0, f"{path}: relative import"
            found.add(node.module)
        elif isinstance(node, ast.Import):
            found.update(a.name for a in node.names)
    return found


def modules() -> list[Path]:
    return [p for p in sorted(ROOT.rglob("*.py")) if p.parent != ROOT or p.name in {"errors.py", "arrays.py"}]


def test_imports_run_one_way():
    wrong = []
    for path in modules():
        own = path.relative_to(ROOT).parts[0].removesuffix(".py")
        for module in imports_of(path):
            if module.startswith("linework."):
                other = room(module)
                if other != own and LEVEL[other] >= LEVEL[own]:
                    wrong.append(f"{path.relative_to(ROOT)} imports {module}")
    assert len(modules()) > 10
    assert not wrong, "\n".join(wrong)


def test_only_files_opens_files():
    readers = {"laspy", "rasterio", "pyogrio", "ezdxf", "csv", "tomllib"}
    wrong = []
    for path in modules():
        own = path.relative_to(ROOT).parts[0].removesuffix(".py")
        if own in {"files", "cli"}:
            continue
        wrong += [
            f"{path.relative_to(ROOT)} imports {m}" for m in imports_of(path) if m.split(".")[0] in readers
        ]
    assert not wrong, "\n".join(wrong)


def test_rooms_have_no_vague_names_and_list_nothing():
    for path in modules():
        assert path.stem not in FORBIDDEN_NAMES, path
        if path.name == "__init__.py":
            assert not imports_of(path), f"{path}: a room's __init__ lists nothing"


def test_import_is_instant_and_light():
    code = (
        "import sys, linework; heavy = {'numba', 'rasterio', 'pyogrio', 'dask', 'matplotlib', 'scipy', 'laspy'};"
        "print(sorted(heavy & set(sys.modules)))"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert out.strip() == "[]"


def test_public_names_resolve():
    for name in linework.__all__:
        assert getattr(linework, name) is not None
