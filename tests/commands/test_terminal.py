"""Names in files, and of files, never reach a terminal as the commands that they could be."""

from __future__ import annotations

import ast
import json
import warnings
from pathlib import Path

import laspy
import numpy as np
import pytest
from tests.conftest import CRS, road_points

import linework as lw
from linework.cli import said
from linework.errors import LineworkWarning, printable
from linework.files.las.write import write_las
from linework.files.vectors.read_write import write_lines
from linework.library.progress import open_display
from linework.library.report import warn_of
from linework.model.lines import LineSet

#: Clears the screen, renames the window, returns to the start of the line, and turns letters round.
HOSTILE = "a\x1b[2J\x1b]0;owned\x07\r\x9b31m\u202eb\x7f"
CLI = Path(said.__file__).parent
#: What has its own way to a terminal: rich draws tables and bars, from texts that passed `printable`.
ITS_OWN = {"said.py", "failures.py", "app.py"}


def assert_tame(text: str) -> None:
    """Only line ends are not printable, and every line end is ours."""
    left = {c for c in text if not c.isprintable()} - {"\n"}
    assert not left, repr(text)
    assert "owned" not in text or "\\x1b" in text or "\\u001b" in text


@pytest.fixture
def hostile_lines(tmp_path: Path) -> Path:
    """Return lines of another program, whose kinds are hostile."""
    path = tmp_path / "lines.geojson"
    write_lines(LineSet.from_lines([np.array([[0.0, 0, 1], [9, 0, 1]])], kind=HOSTILE, id=HOSTILE), path)
    return path


def test_names_of_files(linework, tmp_path):
    folder = tmp_path / HOSTILE
    write_las(road_points(), folder / f"{HOSTILE}.laz", crs=CRS)
    for words in (["info", folder], ["clean", folder], ["convert", folder / "no.gpkg", tmp_path / f"{HOSTILE}.gpkg"],
                  ["evaluate", folder, folder / f"{HOSTILE}.geojson"],
                  ["locate", folder, "-o", folder / "l.csv"], ["photolog", folder, "-o", folder / "p.html"],
                  [HOSTILE], ["info", folder, f"--{HOSTILE}"]):  # fmt: skip
        found = linework(*words)
        assert_tame(found.stdout)
        assert_tame(found.stderr)
    assert "\\x1b[2J" in linework("info", folder).stdout


def test_names_in_files(linework, hostile_lines, tmp_path):
    out = tmp_path / f"{HOSTILE}.geojson"
    for words in (["convert", hostile_lines, out, "--overwrite"], ["evaluate", hostile_lines, hostile_lines],
                  ["evaluate", hostile_lines, hostile_lines, "--kind-map", "no=cable"],
                  ["evaluate", hostile_lines, hostile_lines, "--kinds", HOSTILE]):  # fmt: skip
        found = linework(*words)
        assert_tame(found.stdout)
        assert_tame(found.stderr)
    assert out.is_file()
    table = linework("evaluate", hostile_lines, hostile_lines)
    assert table.code == 0
    assert "\\x1b[2J" in table.stdout


def test_json_is_ascii_and_still_holds_the_name(linework, hostile_lines):
    found = linework("evaluate", hostile_lines, hostile_lines, "--json")
    assert_tame(found.stdout)
    assert found.stdout.isascii()
    assert any(HOSTILE in text for text in _texts(json.loads(found.stdout)))


def _texts(value: object) -> list[str]:
    if isinstance(value, dict):
        return [*value, *(key for inner in value.values() for key in _texts(inner))]
    if isinstance(value, list):
        return [key for inner in value for key in _texts(inner)]
    return [value] if isinstance(value, str) else []


def test_texts_of_laser_headers_and_further_columns(linework, tmp_path):
    path = tmp_path / "a.las"
    header = laspy.LasHeader(version="1.4", point_format=6)
    header.system_identifier, header.generating_software = "\x1b[2Jsys", "\x1b]0;soft\x07"
    header.add_extra_dim(laspy.ExtraBytesParams("x\x1b[2J", "uint8", "\x1b[31mtext"))
    header.offsets, header.scales = [5e5, 5.4e6, 0], [0.001] * 3
    las = laspy.LasData(header)
    las.xyz = road_points().xyz
    las.write(path)
    for words in (
        ["info", path, "--crs", CRS],
        ["info", path],
        ["extract", path, "--carry", "\x1b[2J", "-o", tmp_path / "l.gpkg"],
    ):
        found = linework(*words)
        assert_tame(found.stdout)
        assert_tame(found.stderr)
    assert linework("info", path, "--crs", CRS).code == 0


@pytest.mark.parametrize(
    "toml",
    [
        'name = "\\u001b[2Jdrive"\n[points]\nfiles = ["a.laz"]\n',
        '"\\u001b[2Jkey" = 1\n',
        'crs = "\\u001b[2J"\n',
        '[points]\nfiles = ["\\u001b[2J*.laz"]\n',
        '[trajectory]\nfile = "\\u001b[2J.csv"\n[points]\nfiles = ["a.laz"]\n',
        '[points]\nfiles = ["a.laz"]\n[cameras.left]\nimages = "\\u001b[2J/*"\n',
        "a = '\x1b[2J'\n",
    ],
)  # fmt: skip
def test_texts_of_a_survey_toml(linework, tmp_path, toml):
    folder = tmp_path / "drive"
    write_las(road_points(), folder / "a.laz", crs=CRS)
    (folder / "survey.toml").write_text(toml, encoding="utf-8")
    for words in (
        ["info", folder],
        ["extract", folder, "-o", tmp_path / "l.gpkg", "--features", "guardrail", "--workers", "1"],
    ):
        found = linework(*words)
        assert_tame(found.stdout)
        assert_tame(found.stderr)


def test_what_python_shows(hostile_lines, tmp_path, capsys):
    lines = lw.read_lines(hostile_lines)
    assert lines.kinds == (HOSTILE,)
    for shown in (lines, lines[0], lw.evaluate(lines, lines), lw.evaluate(lines, lines)[HOSTILE]):
        assert_tame(repr(shown))
    write_las(road_points(), tmp_path / HOSTILE / "a.laz", crs=CRS)
    assert_tame(repr(lw.open_survey(tmp_path / HOSTILE)))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        warn_of([HOSTILE])
    assert [(w.category, str(w.message)) for w in caught] == [(LineworkWarning, printable(HOSTILE))]


def test_progress(capsys):
    with open_display(quiet=False) as display:
        display.begin(HOSTILE, "tiles")
        display.advance(1, 1)
        display.end(HOSTILE, 1.0)
    assert_tame(capsys.readouterr().err)


def test_a_line_that_is_printed_is_one_line(capsys):
    said.say("a\nb", "c\x1b[2Jd", to_stderr=True)
    assert capsys.readouterr().err == "a\\nb\nc\\x1b[2Jd\n"
    said.say_json({"a": "\x7f\x1b\x9b"})
    assert capsys.readouterr().out == '{\n "a": "\\u007f\\u001b\\u009b"\n}\n'


@pytest.mark.parametrize("path", sorted(CLI.rglob("*.py")), ids=lambda path: path.name)
def test_all_commands_print_in_one_place(path):
    if path.name in ITS_OWN:
        return
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Call):
            name = ast.unparse(node.func)
            assert name not in ("print", "typer.echo", "click.echo") and not name.endswith(("stdout.write", "stderr.write")), (
                f"{path.name}:{node.lineno} prints past linework.cli.said"
            )  # fmt: skip
