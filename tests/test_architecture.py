"""The house rules that a machine can check: directions of imports, rooms, words, and one way for each task."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections import Counter, defaultdict
from collections.abc import Iterator
from pathlib import Path

import pytest
from tests.scenes.places import ROOT

import linework

HOUSE = Path(linework.__file__).parent
#: Each level imports only from those above it in this list.
LEVELS = [
    {"errors", "arrays"},
    {"crs", "kernels"},
    {"model", "processes"},
    {"navigation", "scanlines", "surface", "imaging", "lines"},
    {"editing"},
    {"methods"},
    {"published"},
    {"files"},
    {"runs", "simulation"},
    {"tracing", "evaluation", "live"},
    {"library"},
    {"workbench"},
    {"cli"},
]
LEVEL = {room: i for i, rooms in enumerate(LEVELS) for room in rooms}
VAGUE_NAMES = {"utils", "helpers", "common", "core", "tools", "manager"}
MOST_FILES, FEWEST_LINES, MOST_LINES = 15, 40, 450


def place(path: Path) -> str:
    """Return a file as messages name it."""
    return path.relative_to(HOUSE).as_posix()


def files() -> list[Path]:
    """Return the modules of all rooms, and those that stand beside them."""
    return [path for path in sorted(HOUSE.rglob("*.py")) if path.parent != HOUSE or path.stem in LEVEL]


FILES = files()
TREES = {path: ast.parse(path.read_text(encoding="utf-8")) for path in FILES}
MODULES = {"linework." + place(path).removesuffix(".py").replace("/", "."): path for path in FILES}


def imports(tree: ast.Module) -> Iterator[str]:
    """Yield the modules that a file imports, anywhere in it."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module:
            assert node.level == 0, "relative import"
            yield node.module
            yield from (f"{node.module}.{a.name}" for a in node.names if f"{node.module}.{a.name}" in MODULES)
        elif isinstance(node, ast.Import):
            yield from (a.name for a in node.names)


def test_imports_run_one_way():
    wrong = []
    for path, tree in TREES.items():
        own = place(path).split("/")[0].removesuffix(".py")
        for module in imports(tree):
            if module.startswith("linework."):
                other = module.split(".")[1]
                if other != own and LEVEL[other] >= LEVEL[own]:
                    wrong.append(f"{place(path)} imports {module}")
    assert len(FILES) > 300
    assert not wrong, "\n".join(wrong)


def test_importing_the_package_is_quick_and_light():
    code = (
        "import sys, linework; heavy = {'numba', 'rasterio', 'pyogrio', 'dask', 'matplotlib', 'scipy', 'laspy'};"
        "print(sorted(heavy & set(sys.modules)))"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert out.strip() == "[]"


def test_public_names_resolve():
    for name in linework.__all__:
        assert getattr(linework, name) is not None


# Rooms


def test_a_room_holds_at_most_15_files():
    count = Counter(path.parent for path in FILES if path.name != "__init__.py")
    assert {place(room): n for room, n in count.items() if n > MOST_FILES} == {}


def test_files_have_40_to_450_lines_and_say_why_they_stand_apart():
    """A short file, or one that only one file of its own folder imports, says in its docstring why: "Separate from"."""
    importers = defaultdict(set)
    for path, tree in TREES.items():
        for module in imports(tree):
            if module in MODULES:
                importers[MODULES[module]].add(path)
    wrong = []
    for path, tree in TREES.items():
        if path.name == "__init__.py":
            continue
        n = len(path.read_text(encoding="utf-8").splitlines())
        if n > MOST_LINES:
            wrong.append(f"{place(path)}: {n} lines, at most {MOST_LINES}")
        # The command line is a file per command, all imported by app.py
        alone = {by.parent for by in importers[path]} == {path.parent} and len(importers[path]) == 1
        is_apart = n < FEWEST_LINES or (alone and path.parent.name != "cli")
        if is_apart and "Separate from" not in (ast.get_docstring(tree) or ""):
            wrong.append(
                f"{place(path)}: {n} lines, {len(importers[path])} importers: say why it stands apart"
            )
    assert not wrong, "\n".join(wrong)


def test_rooms_have_no_vague_names_and_list_nothing():
    for path, tree in TREES.items():
        assert path.stem not in VAGUE_NAMES, path
        if path.name == "__init__.py":
            assert ast.get_docstring(tree), f"{path}: a room says what it is for"
            assert not list(imports(tree)), f"{path}: a room's __init__ lists nothing"


# Words


def public_names(tree: ast.Module) -> Iterator[str]:
    """Yield the functions, classes and constants that a module defines for others."""
    for node in tree.body:
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            yield node.name
        elif isinstance(node, ast.Assign):
            targets = [t for target in node.targets for t in getattr(target, "elts", [target])]
            yield from (t.id for t in targets if isinstance(t, ast.Name))
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            yield node.target.id


def test_a_public_name_is_defined_once():
    #: A router per group of the workbench's routes; a type variable.
    usual = {"router", "T"}
    places = defaultdict(list)
    for path, tree in TREES.items():
        for name in public_names(tree):
            if not name.startswith("_") and name not in usual:
                places[name].append(place(path))
    twice = [f"{name}: {', '.join(where)}" for name, where in sorted(places.items()) if len(where) > 1]
    assert not twice, "\n".join(twice)


def words_not_used() -> list[str]:
    """Return the words of the glossary's table of words that are not used."""
    glossary = (ROOT / "docs" / "glossary.md").read_text(encoding="utf-8")
    table = glossary.split("## Words not used", 1)[1].split("\n## ", 1)[0]
    words = [
        word.strip().strip("`")
        for row in re.findall(r"^\|([^|]+)\|", table, re.M)
        for word in row.split(",")
        if not set(row) <= set("-: ") and "not used" not in row.lower()
    ]
    assert len(words) > 5
    return words


def test_first_lines_and_messages_use_the_words_of_the_glossary():
    """First lines of docstrings, and the texts of errors and of the command line's help."""
    # "is no rotation" is dialect for "is not a rotation"; "there is no rotation" and "is no longer" are English
    is_no = r"(?<!there )is no (?!(?:longer|more|less)\b)"
    pattern = re.compile(rf"\b(?:{'|'.join(map(re.escape, words_not_used()))})\b|\b{is_no}", re.I)
    wrong = []
    for path, tree in TREES.items():
        texts: list[tuple[int, str]] = []
        for node in ast.walk(tree):
            if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
                texts.append((getattr(node, "lineno", 1), (ast.get_docstring(node) or "").split("\n")[0]))
            elif isinstance(node, ast.Raise) or (
                isinstance(node, ast.Call) and ast.unparse(node.func) in ("typer.Option", "typer.Argument")
            ):
                texts += [
                    (c.lineno, c.value)
                    for c in ast.walk(node)
                    if isinstance(c, ast.Constant) and isinstance(c.value, str)
                ]
            elif (
                isinstance(node, ast.Assign)
                and ast.unparse(node.targets[0]).endswith("ADVICE")
                and isinstance(node.value, ast.Constant)
            ):
                texts.append((node.lineno, str(node.value.value)))
        wrong += [f"{place(path)}:{line}: {text}" for line, text in texts if pattern.search(text)]
    assert not wrong, "\n".join(wrong)


# One way for each task: what it takes, and the only places that do it

ONE_WAY = {
    "starts a child process": (r"^\s*(?:import|from) (?:subprocess|multiprocessing)\b|os\.(?:fork|posix_spawn)", ("processes/",)),
    "makes an output whole": (r"os\.(?:fsync|replace|rename)\(|\.rename\(", ("files/output/",)),
    "reads CSV": (r"^\s*(?:import|from) csv\b", ("files/logs/tables.py",)),
    "reads TOML": (r"^\s*import tomllib\b", ("files/",)),
    # In arrays.py and not in lines/, because values of model/, below it, need them too. Sums of square roots are
    # left out: the drift of a simulated wheel is such a sum.
    "measures along a line": (r"cumsum\((?:np\.)?(?:hypot|linalg\.norm)\(", ("arrays.py",)),
    # `total` is a running total of values, not offsets of rows
    "makes ragged offsets": (r"^(?!\s*total = ).*(?:concatenate\(\[\[0\], np\.cumsum|cumsum\(\[0\])", ("arrays.py",)),
    "opens laser, raster or vector files": (r"^\s*(?:import|from) (?:laspy|rasterio|pyogrio|ezdxf|sqlite3)\b", ("files/",)),
    # What not every operating system has, each with its fallback; forced_end.py is a script that imports nothing of ours
    "locks files": (r"\bfcntl\.|^\s*import (?:fcntl|msvcrt)\b", ("files/output/locks.py",)),
    "limits and ends processes": (r"^\s*import resource\b|\bresource\.[a-zR]|\bprctl\b|signal\.SIG(?:KILL|HUP)|os\.(?:nice|kill)\(", ("processes/system.py", "processes/forced_end.py")),
    "connects processes": (r"AF_UNIX|socketpair|pass_fds|\bselect\.", ("processes/connection.py", "processes/forced_end.py")),
    "uses flags and reads of Unix": (r"os\.preadv?\b|O_(?:CLOEXEC|NONBLOCK|BINARY)", ("files/handles.py",)),
    "needs Unix": (r"os\.(?:fork|statvfs|getuid|geteuid|killpg|setsid|mkfifo)\b|^\s*import pwd\b|[\"']/proc/", ("processes/system.py",)),
    "is a number fitted to data": (r"^#:.*\b(?:fitted to (?:data|seeds|surveys)|tuned)\b", ("fitted.py",)),
}  # fmt: skip


@pytest.mark.parametrize("task", ONE_WAY)
def test_one_way_for_each_task(task):
    pattern, where = ONE_WAY[task]
    found = {
        f"{place(path)}: {line.strip()}"
        for path in FILES
        if not place(path).startswith(where) and not place(path).endswith("/" + where[0])
        for line in path.read_text(encoding="utf-8").splitlines()
        if re.search(pattern, line)
    }
    assert not found, f"only {', '.join(where)} {task}:\n" + "\n".join(sorted(found))
