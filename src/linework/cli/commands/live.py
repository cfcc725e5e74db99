"""`linework live`: lines, photolog and the operator's keys while the van drives."""

from __future__ import annotations

import contextlib
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from linework.cli.options import AllowOutside, AllowRemote, AsJson, Crs, Overwrite, Quiet, WorkFolder
from linework.cli.said import say, say_json

if TYPE_CHECKING:
    from contextlib import AbstractContextManager

    from linework.live.drive import LiveDrive


def live(
    survey_folder: Annotated[
        Path,
        typer.Argument(
            metavar="SURVEY", help="Survey folder with [cameras] and [navigation] in survey.toml."
        ),
    ],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="LINES", help="GeoPackage of the lines so far.")
    ],
    longest_lag_s: Annotated[
        float,
        typer.Option(
            "--longest-lag-s",
            min=0.2,
            max=1e6,
            help="Skip pairs that are further behind the newest pair [s].",
        ),
    ] = 5.0,
    until_quiet_s: Annotated[
        float | None,
        typer.Option(
            "--until-quiet-s",
            min=0.5,
            max=1e6,
            help="End when nothing arrives for this time [s]; default: never.",
        ),
    ] = None,
    port: Annotated[
        int, typer.Option("--port", min=0, max=65535, help="Port; 0: a fixed port per survey, if it is free.")
    ] = 0,
    no_page: Annotated[bool, typer.Option("--no-page", help="Do not serve the page with the keys.")] = False,
    no_browser: Annotated[
        bool, typer.Option("--no-browser", help="Print the link without opening a browser.")
    ] = False,
    crs: Crs = None,
    allow_outside: AllowOutside = False,
    allow_remote: AllowRemote = False,
    work: WorkFolder = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Follow SURVEY while the van records it.

    Looks at stereo pairs as they arrive, and writes the lines and the photolog so far every few seconds. Serves a page
    with the operator's keys ([[live.keys]] in survey.toml) to this machine. Where it cannot keep up, it skips pairs and
    names them. Run the same command again to continue a drive. Afterwards, linework extract makes the final lines with
    the smoothed trajectory. Stop with Ctrl-C.
    """
    from linework.cli.failures import Interrupted
    from linework.errors import PartialError, check_extra
    from linework.library.progress import open_display

    for extra in ("stereo", *(() if no_page else ("workbench",))):
        check_extra(extra, where="live")
    with contextlib.ExitStack() as held:
        display = held.enter_context(open_display(quiet=quiet))
        from linework.files.survey.open import open_survey
        from linework.live.follow import Following, follow_drive
        from linework.runs.compile import compile_stage
        from linework.runs.opened.work_folder import work_folder
        from linework.runs.steps import RunSteps

        survey = open_survey([survey_folder], crs=crs, allow_outside=allow_outside, allow_remote=allow_remote)
        compile_stage(("stereo",), RunSteps(display))
        display.__exit__(None, None, None)

        def ready(url: str) -> None:
            _print_link(url, output, as_json=as_json, quiet=quiet)
            if not no_browser:
                from linework.cli.commands.serve import opened_browser

                held.enter_context(opened_browser(url))

        def serve(drive: LiveDrive) -> AbstractContextManager[Any]:
            if no_page:
                return contextlib.nullcontext()
            from linework.workbench.operator.server import LiveServer

            return LiveServer(drive, port, ready=ready, renewed=_renewed(quiet=quiet), save_log=_log)

        following = Following(
            survey=survey, output=output, work=work_folder(survey.root, work), overwrite=overwrite,
            longest_lag_s=longest_lag_s, until_quiet_s=until_quiet_s, serve=serve, report=_warn,
            progress=(lambda _: None) if quiet else (lambda line: say(line, to_stderr=True)),
        )  # fmt: skip
        summary, number = follow_drive(following)
    _print_summary(summary, output, as_json=as_json)
    if number is not None:
        raise Interrupted(
            number, "stopped: everything so far is written; linework extract makes the final lines"
        )
    n_skipped, n_failed = summary["pairs"]["skipped"], summary["pairs"]["failed"]
    if n_skipped or n_failed:
        raise PartialError(
            f"{n_skipped} pairs skipped to keep up, {n_failed} cannot be read", where=output,
            advice="linework extract looks at all of them",
        )  # fmt: skip


def _warn(text: str) -> None:
    from linework.cli.failures import warn

    warn(text)


def _renewed(*, quiet: bool) -> Any:
    def renewed(url: str) -> None:
        if not quiet:
            say(f"link used; for another browser: {url}", to_stderr=True)

    return renewed


def _log(error: BaseException) -> None:
    from linework.cli.failures import save_log

    say(f"error: a bug in linework. Please report it with the log {save_log(error)}.", to_stderr=True)


def _print_link(url: str, output: Path, *, as_json: bool, quiet: bool) -> None:
    """Print the link, flushed at once: a program that started the server may be waiting for that line."""
    if as_json:
        say_json({"url": url, "lines": str(output)}, indent=None)
    else:
        say(url)
    sys.stdout.flush()
    if not quiet:
        say(f"lines: {output}; stop with Ctrl-C", to_stderr=True)


def _print_summary(summary: dict[str, Any], output: Path, *, as_json: bool) -> None:
    if as_json:
        say_json({**summary, "output": str(output)}, indent=None)
        return
    counts = summary["pairs"]
    say(
        f"{output}: {counts['looked']:,} pairs looked at, {counts['skipped']:,} skipped, {counts['failed']:,} cannot "
        f"be read, {counts['no position']:,} without a position; {summary['driven_m']:,.0f} m, {summary['keys']} keys"
    )
