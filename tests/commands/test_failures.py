"""Every exception becomes one line and one exit code."""

from __future__ import annotations

import errno
import io
import signal
import sys
from pathlib import Path

import pytest

from linework.cli import app
from linework.cli.failures import Interrupted, failure_of, save_log, warn
from linework.errors import CrsError, InputError, OutputExistsError, PartialError, UsageError
from linework.library.progress import open_display


class Panic(BaseException):
    """What a decoder written in Rust raises: no Exception."""


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (UsageError("x"), 2),
        (CrsError("x"), 3),
        (PartialError("x"), 4),
        (OutputExistsError("x"), 6),
        (MemoryError(), 5),
        (OSError(errno.ENOSPC, "No space left on device", "a.gpkg"), 5),
        (PermissionError(errno.EACCES, "Permission denied", "a.gpkg"), 5),
        (OSError(errno.EROFS, "Read-only file system"), 5),
        (FileNotFoundError(errno.ENOENT, "No such file", "a.laz"), 3),
        (NotADirectoryError(errno.ENOTDIR, "Not a directory", "a.laz"), 3),
        (BrokenPipeError(errno.EPIPE, "Broken pipe"), 141),
        (Interrupted(2), 130),
        (KeyboardInterrupt(), 130),
        (Interrupted(15), 143),
        (ZeroDivisionError("division by zero"), 1),
        (Panic("index out of bounds\nbacktrace"), 1),
        (OSError("no number"), 1),
    ],
)
def test_the_exit_code_and_one_line(error, code):
    failure = failure_of(error)
    assert failure.exit_code == code
    assert failure.is_bug == (code == 1)
    assert "\n" not in failure.line
    if code not in (130, 141, 143):
        assert failure.line.startswith("error: ")


class HalfMade:
    """What a signal may leave of a library's object: its deletion fails."""

    def __init__(self, code):
        signal.raise_signal(signal.SIGINT)
        self.code = code

    def __del__(self):
        self.code()


def half_made(*_args):
    HalfMade(print)


def cleaned_up(*_args):
    try:
        signal.raise_signal(signal.SIGINT)
    except BaseException:
        raise AttributeError("nothing to clean up") from None


@pytest.mark.parametrize("run", [half_made, cleaned_up])
def test_an_interruption_is_one_line_wherever_it_comes(run, monkeypatch, capsys):
    unraisable = []
    monkeypatch.setattr(sys, "unraisablehook", unraisable.append)
    hook = sys.unraisablehook
    monkeypatch.setattr(app, "_run", run)
    assert app.main(["info"]) == 130
    assert capsys.readouterr().err == "interrupted: nothing was written; run the same command again\n"
    assert not unraisable
    assert sys.unraisablehook is hook


def test_a_line_names_the_file_and_says_what_to_do():
    failure = failure_of(OSError(errno.ENOSPC, "No space left on device", "a\nb.gpkg"))
    assert failure.line == (
        "error: a\\nb.gpkg: no space left on device. Free some space there, or write elsewhere."
    )


def test_the_log_of_a_bug_has_the_traceback(tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    try:
        int("not a number")
    except ValueError as error:
        log = save_log(error)
    assert "not a number" in Path(log).read_text(encoding="utf-8")
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "not there"))
    assert save_log(ValueError()) == ""


def test_a_warning_is_one_line(capsys):
    warn("a\x1b[31m.laz: odd.")
    assert capsys.readouterr().err == "warning: a\\x1b[31m.laz: odd.\n"


def test_a_terminal_gets_bars_with_rate_and_others_plain_lines(monkeypatch):
    class Terminal(io.StringIO):
        def isatty(self):
            return True

    for stream, expected in (
        (Terminal(), "500 of 1,000 points"),
        (io.StringIO(), "read: 0.5 s, 500 points\n"),
    ):
        monkeypatch.setattr(sys, "stderr", stream)
        with open_display(quiet=False) as display:
            display.begin("read", "points")
            display.advance(500, 1000)
            display.end("read", 0.5)
        assert expected in stream.getvalue()
    silent = io.StringIO()
    monkeypatch.setattr(sys, "stderr", silent)
    with open_display(quiet=True) as display:
        display.begin("read", "points")
        display.end("read", 0.5)
    assert silent.getvalue() == ""


def test_long_names_and_texts_are_cut_and_the_advice_is_kept():
    """In time that grows with their length: a name of 200,000 characters took minutes."""
    for text in ("a." * 100_000, "\0" * 100_000, "x" * 100_000, "pg:/" * 50_000):
        line = InputError(f"unknown {text}", where="a.toml", advice="correct it").line()
        assert len(line) < 1400
        assert line.endswith(" ... Correct it.") or line.endswith(" .... Correct it.")
        assert len(InputError("missing", where=text, advice="correct it").line()) < 6000
