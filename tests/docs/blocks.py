"""Code blocks of the documentation, and what runs each of them: one evaluator per language, none is skipped."""

import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path

import httpx
from packaging.requirements import Requirement
from sybil import Example
from sybil.document import Document
from sybil.parsers.markdown import CodeBlockParser, PythonCodeBlockParser
from tests.workbench.serve_process import served_survey

from linework.files.settings_file import settings_from
from linework.files.survey.toml import check_cameras, read_survey_file
from linework.runs.settings import RunSettings

ROOT = Path(__file__).parents[2]
#: Longest that one command may take on a loaded machine that compiles the kernels first. [s]
LONGEST_S = 1200.0
#: What stands between two lines of one command, and before a comment after it.
CONTINUED, COMMENT = re.compile(r"\\\n\s*"), re.compile(r"\s+#\s.*$")
#: First words of what belongs in a block of Python or of a shell.
CODE = re.compile(r"(?:import|from|linework|make|pip|python|cd|docker) \S")


# Blocks of a page


def fences(text: str) -> list[str]:
    """Return the languages of all fenced blocks of a page, in order; Sphinx's own directives are no code."""
    found, inside = [], False
    for line in text.splitlines():
        if opened := re.match(r"```(.*)", line.lstrip()):
            if not inside and not opened[1].startswith("{"):
                found.append(opened[1].strip())
            inside = not inside
    return found


def indented(text: str) -> list[int]:
    """Return the numbers of lines that begin an indented block, of which nobody knows what runs it."""
    found, inside, before = [], False, ""
    for number, line in enumerate(text.splitlines(), 1):
        if line.lstrip().startswith("```"):
            inside = not inside
        if not inside and line.startswith("    ") and line.strip() and not before.strip():
            found.append(number)
        before = line
    return found


def blocks(page: Path) -> list[Example]:
    """Return the blocks of a page that an evaluator takes; those of Python share their names."""
    return list(Document.parse(str(page), *(parser() for parser in PARSERS)).examples())


# Shells


def run_shell(example: Example) -> None:
    """Run the commands of a block in the working directory; any that fails, fails the block."""
    for command in commands(str(example.parsed)):
        if is_so := next((check for begin, check in OTHERWISE.items() if command.startswith(begin)), None):
            is_so(command)
        else:
            bash(command)


def commands(block: str) -> list[str]:
    """Return the commands of a block, a line each, without comments."""
    lines = [COMMENT.sub("", line).strip() for line in CONTINUED.sub("", block).splitlines()]
    return [line for line in lines if line and not line.startswith("#")]


def bash(command: str, **environment: str) -> None:
    """Run a command line as a user types it; `linework` is this checkout's."""
    shell = shutil.which("bash")
    assert shell is not None, "the blocks of shells need bash"
    folder = str(Path.cwd() / ".bin")
    _write_linework(Path(folder))
    path = f"{folder}{os.pathsep}{os.environ['PATH']}"
    done = subprocess.run(
        [shell, "-euo", "pipefail", "-c", command],
        capture_output=True, text=True, timeout=LONGEST_S, env=os.environ | {"PATH": path} | environment,
    )  # fmt: skip
    assert done.returncode == 0, f"{command}\nended with {done.returncode}\n{done.stdout}{done.stderr}"


def _write_linework(folder: Path) -> None:
    script = folder / "linework"
    if not script.exists():
        folder.mkdir(exist_ok=True)
        script.write_text(
            f'#!/bin/sh\nexec {shlex.quote(sys.executable)} -m linework "$@"\n', encoding="utf-8"
        )
        script.chmod(0o755)


# Commands that do not end, or would install: what is checked of them instead of running them as they stand


def check_make(command: str) -> None:
    """Check that all targets exist, down to those that they need: make prints what it would run."""
    bash(f"make --dry-run --directory {shlex.quote(str(ROOT))} {command.removeprefix('make')}")


def check_install(command: str) -> None:
    """Check that what is installed is this package, with extras that it has."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    for word in shlex.split(command)[2:]:
        if word.startswith("-"):
            continue
        wanted = Requirement(re.sub(r"^\.", "linework", word))
        assert wanted.name == project["name"], f"{command}: not {project['name']}"
        unknown = wanted.extras - set(project["optional-dependencies"])
        assert not unknown, f"{command}: no extras {sorted(unknown)}"


def check_serve(command: str) -> None:
    """Start the workbench, open its page by the link that it prints, and end it as Ctrl-C does."""
    survey, *options = shlex.split(command)[2:]
    with served_survey(Path(survey), *options) as served:
        page = served.client.get("/")
        assert page.status_code == httpx.codes.OK, page.text
        assert "<!doctype html>" in page.text.lower()
        assert served.stop() == 128 + signal.SIGINT


def check_live(command: str) -> None:
    """Follow the survey, which is complete already, until nothing more comes; its pairs may be older than is kept up."""
    folder = Path(shlex.split(command)[2])
    keys = "" if "[[live.keys]]" in (folder / "survey.toml").read_text() else '\n[[live.keys]]\nname = "a"\n'
    with (folder / "survey.toml").open("a") as file:
        file.write(keys)
    bash(f"{command} --until-quiet-s 1 --longest-lag-s 1e6 --no-browser")


OTHERWISE: dict[str, Callable[[str], None]] = {
    "make ": check_make,
    "pip install ": check_install,
    "linework serve ": check_serve,
    "linework live ": check_live,
}


# Files and diagrams


def read_settings(example: Example) -> None:
    """Read a block as the file it shows: a survey.toml, or a run file with settings."""
    text = str(example.parsed)
    tables = tomllib.loads(text)
    if set(tables) & set(RunSettings.__dataclass_fields__):
        settings_from(RunSettings, tables, where=example.path)
        return
    shown = Path.cwd() / "shown.toml"
    shown.write_text(text, encoding="utf-8")
    check_cameras(read_survey_file(shown).get("cameras", {}), where=example.path)


def is_diagram(example: Example) -> None:
    """Check that nobody takes the block for something to type: formulas and diagrams only."""
    code = [line for line in str(example.parsed).splitlines() if CODE.match(line)]
    assert not code, f"these belong in a block of sh or python: {code}"


PARSERS: tuple[Callable[[], object], ...] = (
    PythonCodeBlockParser,
    lambda: CodeBlockParser("sh", run_shell),
    lambda: CodeBlockParser("toml", read_settings),
    lambda: CodeBlockParser("text", is_diagram),
)
