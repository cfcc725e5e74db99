"""The program `linework`: its commands, and the one place that turns every failure into one line and a code.

Nothing heavy is imported here or at the top of a command's module, so that ``linework --help`` is instant.
"""

from __future__ import annotations

import contextlib
import gc
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
from linework.cli.commands.calibrate import calibrate_command
from linework.cli.commands.classify import classify_command
from linework.cli.commands.clean import clean
from linework.cli.commands.compile import compile_command
from linework.cli.commands.config import config
from linework.cli.commands.demo import demo
from linework.cli.commands.extract import extract_command
from linework.cli.commands.info import info
from linework.cli.commands.live import live
from linework.cli.commands.locate import locate_command
from linework.cli.commands.of_lines.compare import compare_command
from linework.cli.commands.of_lines.convert import convert
from linework.cli.commands.of_lines.evaluate import evaluate_command
from linework.cli.commands.of_lines.publish import publish_command
from linework.cli.commands.of_lines.report import report_command
from linework.cli.commands.photolog import photolog
from linework.cli.commands.raster import raster
from linework.cli.commands.serve import serve
from linework.cli.commands.simulate import simulate_command
from linework.cli.commands.trace import trace_command
from linework.cli.failures import Interrupted, failure_of, save_log
from linework.cli.options import option_words
from linework.errors import LineworkError
from linework.processes.forced_end import watch_for_signals
from linework.processes.system import end_on_second

_SUMMARY = "Extract georeferenced 3-D road lines from mobile-mapping surveys."

app = typer.Typer(
    name="linework",
    help=_SUMMARY,
    rich_markup_mode=None,  # plain help: rich alone would double its time
)
for command in (
    demo,
    info,
    locate_command,
    calibrate_command,
    extract_command,
    live,
    trace_command,
    serve,
    evaluate_command,
    report_command,
    compare_command,
    publish_command,
    raster,
    classify_command,
    photolog,
    convert,
    simulate_command,
    config,
    compile_command,
    clean,
):
    app.command(command.__name__.removesuffix("_command"))(command)


def _print_version(is_requested: bool) -> None:
    if is_requested:
        typer.echo(f"linework {linework.__version__}")
        raise typer.Exit


@app.callback(help=_SUMMARY)
def _options(
    version: Annotated[
        bool,
        typer.Option("--version", help="Print the version and exit.", callback=_print_version, is_eager=True),
    ] = False,
    debug: Annotated[bool, typer.Option("--debug", help="Print the traceback of an error.")] = False,
) -> None:
    """Declare the options that stand before a command; `main` reads --debug itself."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code; a failure is printed as one line on stderr.

    Parameters
    ----------
    arguments
        Without the program's name; None: those of this process.
    """
    is_program = arguments is None
    arguments = list(sys.argv[1:] if arguments is None else arguments)
    # Accepted anywhere in the line: to investigate an error one appends it to the command
    debug = "--debug" in arguments
    arguments = [a for a in arguments if a != "--debug"]
    _open_missing_streams()
    if is_program and not {"--help", "--version"} & set(arguments):
        watch_for_signals()
    with _signals_raise(), _warnings_on_one_line():
        try:
            code = _run(arguments)
            _flush(sys.stdout)
        except BaseException as error:  # a panic in a Rust decoder is not an Exception
            return _report(error, debug=debug)
    return code


def _run(arguments: list[str]) -> int:
    command = typer.main.get_command(app)
    try:
        result = command.main(args=arguments, prog_name="linework", standalone_mode=False)
    except SystemExit as leaving:
        # typer exits with 1 where the reader of our output has closed the pipe
        if isinstance(leaving.__context__, BrokenPipeError):
            raise leaving.__context__ from None
        return leaving.code if isinstance(leaving.code, int) else 1
    return result if isinstance(result, int) else 0


def _report(error: BaseException, *, debug: bool) -> int:
    """Print the line of a failure, with the path of the log of a bug, and return the exit code."""
    failure = failure_of(error)
    line = failure.line
    if failure.is_bug:
        log = save_log(error)
        line += f" Please report it with the command and the log {log}." if log else ""
    with contextlib.suppress(OSError, ValueError):
        if debug:
            traceback.print_exception(error)
        if line:
            print(line, file=sys.stderr, flush=True)
    for stream in (sys.stdout, sys.stderr):
        _discard(stream)
    return failure.exit_code


def _open_missing_streams() -> None:
    """Open closed standard streams on the null device: the next file opened would take their number."""
    for number in (0, 1, 2):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def _flush(stream: TextIO | None) -> None:
    """Flush while a full disk can still become an error with an exit code."""
    if stream is not None:
        stream.flush()


def _discard(stream: TextIO | None) -> None:
    """Send what a broken stream still holds to the null device; Python would complain about it at exit."""
    try:
        _flush(stream)
    except (OSError, ValueError):
        with contextlib.suppress(OSError, ValueError, AttributeError):
            null = os.open(os.devnull, os.O_WRONLY)
            os.dup2(null, stream.fileno())  # type: ignore[union-attr]
            os.close(null)


@contextlib.contextmanager
def _signals_raise() -> Iterator[None]:
    """Raise an exception on SIGINT and SIGTERM, so that partial files are removed; a second one kills.

    Until the command has ended, errors in deleting objects that the signal left half made are not printed.
    """
    hook, is_interrupted = sys.unraisablehook, False

    def stop(number: int, _frame: FrameType | None) -> None:
        nonlocal is_interrupted
        signal.signal(number, signal.SIG_DFL)
        is_interrupted = True
        sys.unraisablehook = _ignore_failed_deletion
        raise Interrupted(number)

    before = {number: signal.signal(number, stop) for number in (signal.SIGINT, signal.SIGTERM)}
    for number in before:
        end_on_second(number)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        if is_interrupted:
            gc.collect()  # deletes half-made objects while their errors are still ignored
            sys.unraisablehook = hook


def _ignore_failed_deletion(failed: sys.UnraisableHookArgs) -> None:
    """Ignore errors in deleting objects; print what else Python could not raise, such as an interruption."""
    if not isinstance(failed.exc_value, Exception):
        sys.__unraisablehook__(failed)


@contextlib.contextmanager
def _warnings_on_one_line() -> Iterator[None]:
    """Print each distinct UserWarning once, as one line; other categories are meant for developers."""
    shown: set[str] = set()

    def show(
        message: Warning | str,
        category: type[Warning],
        filename: str,
        lineno: int,
        file: TextIO | None = None,
        line: str | None = None,
    ) -> None:
        del filename, lineno, file, line
        text = LineworkError(str(message).rstrip(".")).line(option_words).strip()
        if issubclass(category, UserWarning) and text not in shown:
            shown.add(text)
            print(f"warning: {text}", file=sys.stderr)

    before = warnings.showwarning
    warnings.showwarning = show
    try:
        yield
    finally:
        warnings.showwarning = before
