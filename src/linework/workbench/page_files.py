"""The page's own files, read once at the start: what is not among them is not served."""

from __future__ import annotations

import mimetypes
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

PAGE = Path(__file__).parent / "page"
#: Said where the package holds no page, which no release does.
_NO_PAGE = b"<!doctype html><title>linework</title><p>This copy of linework was made without its page.</p>"


@dataclass(frozen=True, slots=True)
class PageFile:
    """A file of the page."""

    content: bytes
    content_type: str


def page_files(folder: Path = PAGE) -> Mapping[str, PageFile]:
    """Return the files of the page by their URL path; "/" is index.html."""
    found = {
        f"/{path.relative_to(folder).as_posix()}": PageFile(path.read_bytes(), _type_of(path))
        for path in sorted(folder.rglob("*"))
        if path.is_file() and not path.is_symlink() and not path.name.startswith(".")
    }
    found["/"] = found.get("/index.html", PageFile(_NO_PAGE, "text/html; charset=utf-8"))
    return MappingProxyType(found)


def _type_of(path: Path) -> str:
    """Return the content type; of scripts always the same, whatever this machine's own table says."""
    if path.suffix in (".js", ".mjs"):
        return "text/javascript; charset=utf-8"
    kind = mimetypes.guess_type(path.name)[0] or "application/octet-stream"
    return f"{kind}; charset=utf-8" if kind.startswith("text/") else kind
