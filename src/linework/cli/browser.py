"""Open a link in the user's browser without anybody else seeing it."""

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
