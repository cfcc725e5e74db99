"""The documentation holds together: links, anchors, and the modules and files that it names."""

import ast
import re
import runpy
import unicodedata
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("page/*.md"), *DOCS.rglob("*.md")])
#: Pages that Sphinx writes: their sources are there only after `make docs`.
GENERATED = (DOCS / "reference" / "generated", DOCS / "gallery")
LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")
FENCED = re.compile(r"^```.*?^```$", re.MULTILINE | re.DOTALL)
SPANS = re.compile(r"`[^`\n]*`")


def name(path: Path) -> str:
    return str(path.relative_to(ROOT))


def prose(page: Path) -> str:
    """Return the text of a page without its blocks and spans of code."""
    lines = FENCED.sub("", page.read_text(encoding="utf-8")).splitlines()
    return SPANS.sub("", "\n".join(line for line in lines if not line.startswith("    ")))


@cache
def anchors(page: Path) -> set[str]:
    """Return the anchors of a page's headings, as source hosts and Sphinx make them."""
    found = set()
    for line in FENCED.sub("", page.read_text(encoding="utf-8")).splitlines():
        if heading := re.match(r"#{1,6} (.*)", line):
            text = unicodedata.normalize("NFC", heading[1].strip().lower())
            found.add(re.sub(r"[^\w\- ]", "", text).replace(" ", "-"))
    return found


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_every_relative_link_leads_somewhere(page):
    wrong = []
    for link in LINK.findall(prose(page)):
        if re.match(r"[a-z]+:", link):
            continue
        file, _, anchor = link.partition("#")
        target = (page.parent / file).resolve() if file else page
        if any(target.is_relative_to(folder) for folder in GENERATED):
            continue
        if not target.exists() or (anchor and anchor not in anchors(target)):
            wrong.append(link)
    assert not wrong, wrong


def is_in_the_package(dotted: str) -> bool:
    """Return whether a dotted name is a module of the package, or stands in one, without importing anything."""
    parts = dotted.split(".")
    path = ROOT / "src"
    for i, part in enumerate(parts):
        if (path / part).is_dir():
            path = path / part
            continue
        file, rest = path / f"{part}.py", parts[i + 1 :]
        if not file.exists():
            file, rest = path / "__init__.py", parts[i:]
        return not rest or rest[0] in defined_in(file)
    return True


@cache
def defined_in(file: Path) -> set[str]:
    """Return the names that a module defines, and the public names if it is the root."""
    tree = ast.parse(file.read_text(encoding="utf-8"))
    found = {node.name for node in tree.body if isinstance(node, ast.ClassDef | ast.FunctionDef)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            found.add(node.id)
        if isinstance(node, ast.ImportFrom) and file.name == "__init__.py":
            found.update(alias.name for alias in node.names)
    return found


@pytest.mark.parametrize("page", [page for page in PAGES if page.name != "CHANGELOG.md"], ids=name)
def test_modules_and_files_that_are_named_exist(page):
    text = LINK.sub("", page.read_text(encoding="utf-8"))
    spans = [span.strip("`") for span in SPANS.findall(text)]
    modules = set(re.findall(r"\blinework(?:\.[A-Za-z_]\w*)+", text))
    files = {span for span in spans if re.fullmatch(r"(?:docs|tests|benchmarks|page|src)/[\w./-]*\w", span)}
    in_rooms = {span for span in spans if re.fullmatch(r"[a-z_]+(?:/[a-z_]+)+\.py", span)} - files
    wrong = [module for module in modules if not is_in_the_package(module)]
    wrong += [file for file in files if not (ROOT / file).exists()]
    wrong += [file for file in in_rooms if not (ROOT / "src" / "linework" / file).exists()]
    assert not wrong, sorted(wrong)


@pytest.mark.parametrize("script", sorted((DOCS / "make_pictures").glob("*.py")), ids=name)
def test_scripts_of_pictures_name_what_exists(script):
    wrong = [
        f"{node.module}.{alias.name}"
        for node in ast.walk(ast.parse(script.read_text(encoding="utf-8")))
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("linework.")
        for alias in node.names
        if not is_in_the_package(f"{node.module}.{alias.name}")
    ]
    assert not wrong, wrong


def test_the_picture_of_the_rooms_is_that_of_the_imports():
    script = runpy.run_path(str(DOCS / "make_pictures" / "rooms.py"))
    assert script["PICTURE"].read_text(encoding="utf-8") == script["picture"](), (
        "run python docs/make_pictures/rooms.py"
    )


def test_every_room_is_on_the_architecture_page():
    page = (DOCS / "architecture.md").read_text(encoding="utf-8")
    rooms = {path.parent.name for path in (ROOT / "src" / "linework").glob("*/__init__.py")}
    assert not {room for room in rooms if f"`{room}`" not in page}


def test_every_page_is_in_a_menu():
    listed = set()
    for page in DOCS.rglob("*.md"):
        for block in re.findall(
            r"^```\{toctree\}\n(.*?)^```$", page.read_text(encoding="utf-8"), re.M | re.S
        ):
            entries = [line for line in block.splitlines() if line and not line.startswith(":")]
            listed |= {path for entry in entries for path in page.parent.glob(f"{entry}.md")}
    missing = {name(page) for page in set(DOCS.rglob("*.md")) - listed - {DOCS / "index.md"}}
    assert not missing, sorted(missing)
