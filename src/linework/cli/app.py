"""The command `linework`: its sub-commands, and the one place where everything that fails becomes a line.

Nothing heavy is imported here or at the top of a command's module, so that ``linework --help`` is instant.
"""

from __future__ import annotations

import contextlib
import io
import os
import signal
import sys
import traceback
import warnings
from collections.abc import Iterator, Sequence
from types import FrameType
from typing import Annotated, TextIO

import typer

import linework
from linework.cli.demo import demo
from linework.cli.evaluate import evaluate
from linework.cli.extract import extract_command
from linework.cli.failures import Interrupted, failure_of, save_log
from linework.cli.info import info
from linework.cli.locate import locate
from linework.cli.photolog import photolog
from linework.cli.raster import raster
from linework.cli.serve import serve
from linework.cli.simulate import simulate
from linework.cli.small_commands import clean, config, convert
from linework.cli.trace import trace
from linework.errors import LineworkError

app = typer.Typer(
    name="linework",
    help="From what a mapping van records to finished, georeferenced 3-D road lines.",
    add_completion=False,
    rich_markup_mode=None,  # plain help: rich alone would double its time
)
for command in (
    demo,
    info,
    locate,
    extract_command,
    trace,
    serve,
    evaluate,
    raster,
    photolog,
    convert,
    simulate,
    config,
    clean,
):
    app.command(command.__name__.removesuffix("_command"))(command)


def _print_version(asked: bool) -> None:
    if asked:
        typer.echo(f"linework {linework.__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version.", callback=_print_version, is_eager=True)
    ] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Show tracebacks.")] = False,
) -> None:
    """From what a mapping van records to finished, georeferenced 3-D road lines."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return the exit code; every failure is one line on stderr.

    Parameters
    ----------
    arguments
        Without the program's name; None: those of this process.
    """
    arguments = list(sys.argv[1:] if arguments is None else arguments)
    # Wherever it stands: who looks for a fault adds it at the end of the line
    debug = "--debug" in arguments
    arguments = [a for a in arguments if a != "--debug"]
    _open_missing_streams()
    with _signals_raise(), _warnings_on_one_line():
        try:
            code = _run(arguments)
            _flush(sys.stdout)
        except BaseException as error:  # a decoder's panic is not an Exception
            return _report(error, debug=debug)
    return code


def _run(arguments: list[str]) -> int:
    command = typer.main.get_command(app)
    try:
        result = command.main(args=arguments, prog_name="linework", standalone_mode=False)
    except SystemExit as leaving:
        # typer leaves with 1 where the reader of our output has gone
        if isinstance(leaving.__context__, BrokenPipeError):
            raise leaving.__context__ from None
        return leaving.code if isinstance(leaving.code, int) else 1
    return result if isinstance(result, int) else 0


def _report(error: BaseException, *, debug: bool) -> int:
    """Print the one line of a failure, and where the log of a bug is; return the exit code."""
    failure = failure_of(error)
    line = failure.line
    if failure.is_bug:
        log = save_log(error)
        line += f" The log is in {log}: send it with the command." if log else ""
    with contextlib.suppress(OSError, ValueError):
        if debug:
            traceback.print_exception(error)
        if line:
            print(line, file=sys.stderr, flush=True)
    for stream in (sys.stdout, sys.stderr):
        _give_up(stream)
    return failure.exit_code


def _open_missing_streams() -> None:
    """Point closed standard streams at nothing: the next file opened would take their place."""
    for number in (0, 1, 2):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def _flush(stream: TextIO | None) -> None:
    """Flush now, where a full disk is still an error with an exit code."""
    if stream is not None:
        stream.flush()


def _give_up(stream: TextIO | None) -> None:
    """Let what a broken stream still holds go to nothing, or Python complains about it at its end."""
    try:
        _flush(stream)
    except (OSError, ValueError):
        with contextlib.suppress(OSError, ValueError, AttributeError):
            nothing = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nothing, stream.fileno())  # type: ignore[union-attr]
            os.close(nothing)


@contextlib.contextmanager
def _signals_raise() -> Iterator[None]:
    """Make SIGINT and SIGTERM an exception, so that part files are taken away; a second one ends at once."""

    def stop(number: int, _frame: FrameType | None) -> None:
        signal.signal(number, signal.SIG_DFL)
        raise Interrupted(number)

    before = {number: signal.signal(number, stop) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextlib.contextmanager
def _warnings_on_one_line() -> Iterator[None]:
    """Print each different warning once, as one line; what libraries warn about is not for the user."""
    told: set[str] = set()

    def show(
        message: Warning | str,
        category: type[Warning],
        filename: str,
        lineno: int,
        file: TextIO | None = None,
        line: str | None = None,
    ) -> None:
        del filename, lineno, file, line
        text = str(LineworkError(str(message).rstrip("."))).strip()
        if issubclass(category, UserWarning) and text not in told:
            told.add(text)
            print(f"warning: {text}", file=sys.stderr)

    before = warnings.showwarning
    warnings.showwarning = show
    try:
        yield
    finally:
        warnings.showwarning = before
