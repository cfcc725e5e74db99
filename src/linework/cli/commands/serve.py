"""`linework serve`: the browser workbench, served to this machine only."""

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

from linework.cli.options import (
    AllowOutside,
    AllowRemote,
    AsJson,
    Crs,
    Quiet,
    RunFile,
    SurveyArgument,
    TrajectoryFile,
    WorkFolder,
    read_settings,
)
from linework.cli.said import say, say_json
from linework.cli.startup import without_collector
from linework.processes.forced_end import removed_if_forced

if TYPE_CHECKING:
    from linework.workbench.server.app_state import AppState


def serve(
    surveys: SurveyArgument,
    lines: Annotated[
        Path | None,
        typer.Option(
            "--lines", metavar="LINES", help="GeoPackage to edit; default: lines.gpkg in the survey."
        ),
    ] = None,
    port: Annotated[
        int, typer.Option("--port", min=0, max=65535, help="Port; 0: a fixed port per survey, if it is free.")
    ] = 0,
    host: Annotated[
        str, typer.Option("--host", help="Address to listen on; only 127.0.0.1 is allowed.")
    ] = "127.0.0.1",
    who: Annotated[
        str, typer.Option("--who", help="Name recorded with each edit; default: the login name.")
    ] = "",
    crs: Crs = None,
    allow_outside: AllowOutside = False,
    allow_remote: AllowRemote = False,
    trajectory: TrajectoryFile = None,
    work: WorkFolder = None,
    config: RunFile = None,
    no_browser: Annotated[
        bool, typer.Option("--no-browser", help="Print the link without opening a browser.")
    ] = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Open the workbench to trace, review and edit lines of SURVEY.

    It runs in a browser on this machine. Prints a link that opens it; a link works once, and a new one is printed
    after it is used. Every change is saved
    to the line file before the page shows it. Stop with Ctrl-C.
    """
    import asyncio

    from linework.cli.failures import Interrupted, save_log
    from linework.errors import check_extra
    from linework.library.progress import open_display

    _check_host(host)
    for extra in ("workbench", "reports"):
        check_extra(extra, where="serve")
    # The usual settings are left to the workers: they import all methods, which the server does not need
    settings = None if config is None else read_settings(config)
    with contextlib.ExitStack() as held:
        display = held.enter_context(open_display(quiet=quiet))
        from linework.workbench.worker.conversation import start_worker_process

        # Before the imports below, which take as long as those of the process
        process = start_worker_process()
        # Whatever fails, and whoever else ends it; its socket is left to who reads it
        held.callback(process.kill)
        with without_collector():
            from linework.methods.kinds import ALL_KINDS
            from linework.processes.system import usable_cores
            from linework.runs.compile import compile_stage
            from linework.runs.steps import RunSteps
            from linework.workbench.server.serve import RunningServer, run_server
            from linework.workbench.worker.order import SurveyOrder

        compile_stage((*ALL_KINDS, "stereo"), RunSteps(display))

        def ready(app_state: AppState, url: str) -> None:
            display.__exit__(None, None, None)
            _print(app_state, url, as_json=as_json, quiet=quiet)
            if not no_browser:
                held.enter_context(opened_browser(url))

        def renewed(url: str) -> None:
            if not quiet:
                say(f"link used; for another browser: {url}", to_stderr=True)

        def log(error: BaseException) -> None:
            say(f"error: a bug in linework. Please report it with the log {save_log(error)}.", to_stderr=True)

        order = SurveyOrder(
            tuple(surveys), crs=crs, allow_outside=allow_outside, allow_remote=allow_remote, trajectory=trajectory, work=work,
            settings=settings, n_threads=usable_cores(),
        )  # fmt: skip
        serving = RunningServer(
            order=order, lines=lines, process=process, port=port, who=who or _user(), watcher=display,
            ready=ready, renewed=renewed, save_log=log,
        )  # fmt: skip
        number = asyncio.run(run_server(serving))
    raise Interrupted(number, "stopped: all changes are saved")


def _check_host(host: str) -> None:
    from linework.errors import UsageError

    if host not in ("127.0.0.1", "localhost"):
        raise UsageError(
            f"{host} is reachable from other machines", where="--host",
            advice="omit it: the workbench serves this machine only; from another machine, tunnel with ssh -L",
        )  # fmt: skip


def _user() -> str:
    """Return the name of the system user; "" where it is unknown."""
    import getpass

    try:
        return getpass.getuser()
    except (OSError, KeyError):
        return ""


def _print(app_state: AppState, url: str, *, as_json: bool, quiet: bool) -> None:
    """Print the link, flushed at once: a program that started the server may be waiting for that line."""
    if as_json:
        document: dict[str, Any] = {
            "url": url, "survey": app_state.facts.name, "lines": str(app_state.line_file.path), "who": app_state.who,
        }  # fmt: skip
        say_json(document, indent=None)
    else:
        say(url)
    sys.stdout.flush()
    if not quiet:
        say(f"lines: {app_state.line_file.path}; stop with Ctrl-C", to_stderr=True)


#: A page that forwards to the link.
_PAGE = '<!doctype html><meta charset="utf-8"><title>linework</title><meta http-equiv="refresh" content="0; url={}">'


@contextlib.contextmanager
def opened_browser(url: str) -> Iterator[None]:
    """Open a link in the user's browser, where there is a screen; to be held while the server runs.

    Notes
    -----
    The arguments of a process can be read by every user of the machine, and the link is a secret. The browser is
    therefore given a file that only this user may read, which forwards to the link.
    """
    if not has_screen():
        yield
        return
    with tempfile.TemporaryDirectory(prefix="linework-") as folder, removed_if_forced(Path(folder)):
        page = Path(folder) / "open.html"
        page.touch(mode=0o600)
        page.write_text(_PAGE.format(html.escape(url)), encoding="utf-8")
        # In a thread: a text browser in the terminal would not return
        threading.Thread(target=_open, args=(page.as_uri(),), daemon=True).start()
        yield


def has_screen() -> bool:
    """Return whether there is a screen to open a browser window on."""
    return sys.platform == "darwin" or any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY"))


def _open(uri: str) -> None:
    with contextlib.suppress(webbrowser.Error, OSError):
        webbrowser.open(uri)
