"""Addresses of points: which paths are one, what an address may hold, and how it is shown.

An address travels as a path, like any other input. Paths drop one of its slashes (``https:/host/a.laz``), which
`address_text` puts back. It holds no secret: what it holds goes into records and messages.
"""

from __future__ import annotations

import re
from pathlib import Path
from urllib.parse import urlsplit

from linework.errors import ConfigError, InputError, argument, check_extra

#: Formats that are read by ranges.
REMOTE_SUFFIXES = (".las", ".laz")
_ADDRESS = re.compile(r"(?i)(https?|s3):/+")
_HERE_FIRST = "copy it here first"


def is_remote(path: Path) -> bool:
    """Return whether a path is an address that points are read from.

    >>> [is_remote(Path(name)) for name in ("https://host/a.laz", "s3://bucket/a.laz", "ftp://host/a.laz", "a.laz")]
    [True, True, False, False]
    """
    return _ADDRESS.match(str(path)) is not None


def address_text(path: Path) -> str:
    """Return a path as people write it: an address with both its slashes, any other path as it is.

    >>> address_text(Path("https://host/a.laz")), address_text(Path("points/a.laz"))
    ('https://host/a.laz', 'points/a.laz')
    """
    found = _ADDRESS.match(str(path))
    return f"{found[1].lower()}://{str(path)[found.end() :]}" if found else str(path)


def check_address(path: Path) -> None:
    """Refuse an address that points cannot be read from; nothing is asked of the network.

    Raises
    ------
    InputError
        It has no host or name of a file, holds a secret or a pattern, or is not that of a LAS or LAZ file.
    MissingPackageError
        The extra that reads addresses is not installed.
    """
    try:
        parts = urlsplit(address_text(path))
        host, _ = parts.hostname, parts.port
    except ValueError as error:
        raise InputError(f"is not an address: {error}", where=_public(path), advice="check it") from error
    if "@" in parts.netloc:
        raise InputError(
            "the address holds a user name or a password, which would end up in records", where=_public(path),
            advice=f"leave it out, or {_HERE_FIRST}",
        )  # fmt: skip
    if parts.query or parts.fragment or "?" in str(path):
        raise InputError(
            "the address has a part after '?' or '#', which may be a signature and would end up in records",
            where=_public(path), advice=f"leave that out, or {_HERE_FIRST}",
        )  # fmt: skip
    if not host or not parts.path.strip("/"):
        raise InputError("the address names no file", where=_public(path), advice="give it in full")
    if set("*[").intersection(parts.path):
        raise InputError("patterns are not matched at an address", where=path, advice="name each file")
    if path.suffix.lower() not in REMOTE_SUFFIXES:
        raise InputError(
            f"suffix '{path.suffix}', expected {', '.join(REMOTE_SUFFIXES)} at an address", where=path,
            advice=_HERE_FIRST,
        )  # fmt: skip
    check_extra("remote", where=address_text(path))


def remote_names(names: list[str], where: Path, *, allow_remote: bool) -> list[Path]:
    """Return the addresses among the names of files in a survey.toml.

    Parameters
    ----------
    where
        The survey.toml: anybody may have written it, and its addresses are only called if the caller allows it.

    Raises
    ------
    ConfigError
        There is one, and none is allowed.
    InputError, MissingPackageError
        As for `check_address`.
    """
    found = [Path(name) for name in names if is_remote(Path(name))]
    if found and not allow_remote:
        raise ConfigError(
            f"points.files: '{_public(found[0]):.120}' is not on this machine", where=where,
            advice=f"give {argument('allow_remote', True)} if you trust who wrote this file, or copy the points here",
        )  # fmt: skip
    for path in found:
        check_address(path)
    return found


def _public(path: Path) -> str:
    """Return an address without what may be secret in it."""
    text = re.split(r"[?#]", address_text(path), maxsplit=1)[0]
    return re.sub(r"(?<=://)[^/]*@", "", text)
