"""`linework serve`: the browser workbench, on this machine alone."""

from __future__ import annotations

import contextlib
import html
import os
import sys
import tempfile
import threading
import webbrowser
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from linework.workbench.server.bench import AppState


def serve(
    surveys: Annotated[
        list[Path],
        typer.Argument(metavar="SURVEY...", help="Laser files, a folder of them, or a survey folder."),
    ],
    lines: Annotated[
        Path | None,
        typer.Option(
            "--lines", help="GeoPackage of lines to work on; lines.gpkg in the survey if not given."
        ),
    ] = None,
    port: Annotated[
        int, typer.Option("--port", min=0, max=65535, help="0: the same one for a survey, if it is free.")
    ] = 0,
    host: Annotated[str, typer.Option("--host", help="127.0.0.1: no other machine can ask.")] = "127.0.0.1",
    who: Annotated[str, typer.Option("--who", help="Who edits, for the record; the user if not given.")] = "",
    crs: Annotated[
        str, typer.Option("--crs", help="EPSG:... or local: the CRS where the files do not say.")
    ] = "",
    work: Annotated[
        Path | None,
        typer.Option("--work", help="Folder for points; .linework beside the survey if not given."),
    ] = None,
    config: Annotated[
        Path | None, typer.Option("--config", help="Run file (TOML) with settings; see `linework config`.")
    ] = None,
    no_browser: Annotated[bool, typer.Option("--no-browser", help="Print the link, open nothing.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the link and the file as JSON.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="No progress on stderr.")] = False,
) -> None:
    """Trace, review and edit the lines of SURVEY in a browser on this machine.

    Prints the link that opens it; a link works once, and the next one is printed when it has been used. Every
    change is in the file of lines before the page shows it. Ctrl-C ends it.
    """
    import asyncio
    import contextlib

    from linework.cli.extract import read_settings, usable_cores
    from linework.cli.failures import Interrupted, save_log
    from linework.cli.progress import open_display

    _check_host(host)
    settings = read_settings(config)
    with contextlib.ExitStack() as held:
        display = held.enter_context(open_display(quiet=quiet))
        from linework.cli.progress import announce_compilation
        from linework.methods.kinds import ALL_KINDS
        from linework.workbench.server.serve import RunningServer, run_server
        from linework.workbench.worker.session import SurveyOrder

        announce_compilation(ALL_KINDS, quiet=quiet)

        def ready(bench: AppState, url: str) -> None:
            display.__exit__(None, None, None)
            _print(bench, url, as_json=as_json, quiet=quiet)
            if not no_browser:
                held.enter_context(opened_browser(url))

        def renewed(url: str) -> None:
            if not quiet:
                typer.echo(f"opened; for another browser: {url}", err=True)

        def log(error: BaseException) -> None:
            typer.echo(f"error: a fault of linework. The log is in {save_log(error)}.", err=True)

        order = SurveyOrder(tuple(surveys), crs=crs, work=work, settings=settings, n_threads=usable_cores())
        serving = RunningServer(
            order=order, lines=lines, port=port, who=who or _user(), watcher=display,
            ready=ready, renewed=renewed, save_log=log,
        )  # fmt: skip
        number = asyncio.run(run_server(serving))
    raise Interrupted(number, "ended: every change is saved")


def _check_host(host: str) -> None:
    from linework.errors import UsageError

    if host not in ("127.0.0.1", "localhost"):
        raise UsageError(
            f"{host} can be asked by other machines", where="--host",
            advice="leave it out: the workbench serves this machine alone; from another one, use ssh -L",
        )  # fmt: skip


def _user() -> str:
    """Return who runs this, "" where the system does not know."""
    import getpass

    try:
        return getpass.getuser()
    except (OSError, KeyError):
        return ""


def _print(bench: AppState, url: str, *, as_json: bool, quiet: bool) -> None:
    """Say where it is; at once, as whoever started it in the background waits for that line."""
    import sys

    text = url
    if as_json:
        import json

        document: dict[str, Any] = {
            "url": url, "survey": bench.facts.name, "lines": str(bench.drawing.path), "who": bench.who,
        }  # fmt: skip
        text = json.dumps(document)
    typer.echo(text)
    sys.stdout.flush()
    if not quiet:
        typer.echo(f"lines: {bench.drawing.path}; Ctrl-C ends the workbench", err=True)


# Open a link in the user's browser without anybody else seeing it

_PAGE = '<!doctype html><meta charset="utf-8"><title>linework</title><meta http-equiv="refresh" content="0; url={}">'


@contextlib.contextmanager
def opened_browser(url: str) -> Iterator[None]:
    """Open a link, where there is a screen; for as long as the server runs.

    Notes
    -----
    Arguments of a command can be read by every user of the machine: the browser is given a file that only this one
    may read, and which sends it on.
    """
    if not has_screen():
        yield
        return
    with tempfile.TemporaryDirectory(prefix="linework-") as folder:
        page = Path(folder) / "open.html"
        page.touch(mode=0o600)
        page.write_text(_PAGE.format(html.escape(url)), encoding="utf-8")
        # A browser in the terminal would not return
        threading.Thread(target=_open, args=(page.as_uri(),), daemon=True).start()
        yield


def has_screen() -> bool:
    """Return whether a browser's window could be seen here."""
    return sys.platform == "darwin" or any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY"))


def _open(uri: str) -> None:
    with contextlib.suppress(webbrowser.Error, OSError):
        webbrowser.open(uri)
