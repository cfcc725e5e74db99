"""One error, in the words of each caller: parameters in Python, options on the command line, names on the page."""

from __future__ import annotations

import ast
import pickle
import re
from pathlib import Path

import pytest

import linework
from linework.cli.app import app
from linework.cli.failures import failure_of
from linework.cli.options import option_words
from linework.errors import LineworkError, OutputExistsError, UsageError, argument, in_words
from linework.methods.kinds import check_method, parse_kinds
from linework.workbench.server.problems import status_and_message

SOURCE = Path(linework.__file__).parent
ERROR = OutputExistsError("exists", where=Path("a.gpkg"), advice=f"give {argument('overwrite', True)}")


def test_an_error_speaks_as_its_caller():
    assert str(ERROR) == "a.gpkg: exists. Give overwrite=True."
    assert failure_of(ERROR).line == "error: a.gpkg: exists. Give --overwrite."
    assert status_and_message(ERROR) == (409, "a.gpkg: exists. Give overwrite.")
    assert str(pickle.loads(pickle.dumps(ERROR))) == str(ERROR)  # it may come from a worker


def test_a_parameter_in_front_stands_alone():
    error = UsageError("not a CRS", where=argument("crs"), advice=f"give {argument('crs', 'local')}")
    assert str(error) == 'crs: not a CRS. Give crs="local".'
    assert failure_of(error).line == "error: --crs: not a CRS. Give --crs local."


def test_names_and_values_of_users_are_not_taken_for_parameters():
    error = UsageError("crs=1 {overwrite} --resume", where="overwrite=.laz")
    assert str(error) == "overwrite=.laz: crs=1 {overwrite} --resume."


def test_messages_outside_the_command_line_name_no_option():
    """Texts of every module but those of cli/, docstrings too: an option is named by `argument`."""
    wrong = []
    for path in sorted(SOURCE.rglob("*.py")):
        if (SOURCE / "cli") in path.parents:
            continue
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                wrong += [
                    f"{path.name}:{node.lineno}: {text}"
                    for text in re.findall(r"(?<![\w-])--[a-z].*", node.value)
                ]
    assert not wrong, "\n".join(wrong)


def test_every_parameter_that_a_message_names_is_an_option():
    """What `argument` names in the code exists on the command line, under the name that is printed for it."""
    import typer

    group = typer.main.get_command(app)
    options = {
        option
        for command in group.commands.values()  # type: ignore[attr-defined]
        for parameter in command.params
        for option in parameter.opts
    }
    #: Not options: what stands without a name on the command line, and what only functions take.
    positional = {
        "src",
        "frame",
        "shapes",
        "table",
        "on_problem",
        "methods",
        "ground",
        "at",
        "progress",
        "find_peaks",
    }
    named = {
        name
        for path in SOURCE.rglob("*.py")
        for name in re.findall(r"argument\([\"'](\w+)[\"']", path.read_text(encoding="utf-8"))
    }
    assert {"crs", "overwrite", "kinds"} <= named
    assert {option_words(name, None) for name in named - positional} <= options


@pytest.mark.parametrize(
    ("kinds", "line"),
    [
        (
            "guard_rail",
            "kinds: unknown kinds of line: guard_rail. Did you mean guardrail? Choose from lane_marking,",
        ),
        (["cabel", "kerb"], "kinds: unknown kinds of line: cabel, kerb. Did you mean cable"),
        (["unicorn"], "kinds: unknown kinds of line: unicorn. Choose from lane_marking,"),
        ([3], "kinds: 3 is not a kind of line. Choose from lane_marking,"),
        (3, "kinds: 3 is not a kind of line. Choose from lane_marking,"),
        ((), "kinds: no kind of line is named. Choose from lane_marking,"),
        (" , ", "kinds: no kind of line is named. Choose from lane_marking,"),
    ],
)
def test_unknown_kinds_are_refused_with_the_nearest(kinds, line):
    with pytest.raises(UsageError) as caught:
        parse_kinds(kinds)
    assert str(caught.value).startswith(line)
    assert failure_of(caught.value).line.startswith("error: --features: ")


def test_kinds_are_a_name_or_names_and_may_be_those_of_own_methods():
    assert (
        parse_kinds("guardrail") == parse_kinds(["guardrail"]) == parse_kinds({"guardrail"}) == ("guardrail",)
    )
    assert parse_kinds(iter(("cable", "guardrail", "cable"))) == ("guardrail", "cable")
    assert parse_kinds(["manhole", "cable"], own=("manhole",)) == ("cable", "manhole")
    with pytest.raises(UsageError, match="Did you mean manhole"):
        parse_kinds("manhle", own=("manhole",))


def test_unknown_methods_are_refused_with_the_nearest():
    with pytest.raises(
        UsageError, match=r"^methods: unknown method Radom\. Did you mean radon\? Choose auto or"
    ):
        check_method("Radom", ("cable",))


def test_a_warning_is_put_in_words_too(capsys):
    from linework.cli.failures import warn

    warn(f"left out; give {argument('crs', 'local')}")
    assert capsys.readouterr().err == "warning: left out; give --crs local.\n"
    assert in_words(f"give {argument('kinds')}") == "give kinds="
    assert str(LineworkError("a\nb")) == "a\\nb."
