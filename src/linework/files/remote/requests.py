"""Requests for parts of a remote file: bounded in number and time, one state of the file, errors in plain words.

Separate from `reader` and `copies`, which put the parts together: only this asks the network.

Refused files (missing, no access, no ranges, changed) are errors of the input; a server that cannot be reached or
fails again and again is one of the machine, so that a run ends and can be resumed, and no file is left out for it.
"""

from __future__ import annotations

import functools
import hashlib
import os
import re
import time
from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

from linework.errors import InputError, LineworkError, MachineError, needed
from linework.files.remote.address import address_text

#: Longest wait for a connection, for the next bytes of an answer, and for a whole part. [s]
CONNECT_S, SILENCE_S, PART_S = 10.0, 30.0, 300.0
#: Tries after the first, how long they may go on [s], and the waits between them. [s]
RETRIES, RETRY_S, FIRST_WAIT_S, LONGEST_WAIT_S = 5, 90.0, 0.2, 10.0
_AGAIN = "check the address and the connection, and run again"
#: Variables that give access to S3; without any of them requests go unsigned, as public buckets want them.
_S3_ACCESS = (
    "AWS_ACCESS_KEY_ID", "AWS_WEB_IDENTITY_TOKEN_FILE", "AWS_CONTAINER_CREDENTIALS_RELATIVE_URI",
    "AWS_CONTAINER_CREDENTIALS_FULL_URI",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class RemoteState:
    """State of a remote file, which differs once it has changed.

    Parameters
    ----------
    n_bytes
        Its length.
    tag
        Its ETag, or the date of its last change where the server sends none; "" without either.
    """

    n_bytes: int
    tag: str

    @property
    def text(self) -> str:
        """The state in words, which stand for the bytes of the file."""
        return f"{self.n_bytes} bytes, {self.tag or 'no ETag, no date'}"

    @property
    def numbers(self) -> tuple[int, int, int]:
        """The state as numbers, like size, time of change and inode of a local file."""
        return self.n_bytes, int.from_bytes(hashlib.sha256(self.tag.encode()).digest()[:8]), 0


def remote_start(path: Path, n_bytes: int) -> tuple[RemoteState, bytes]:
    """Return the state of a remote file and its first bytes.

    Parameters
    ----------
    n_bytes
        Number of bytes to return; fewer if the file is shorter.

    Raises
    ------
    InputError
        No such file, no access to it, or a server that sends no ranges.
    MachineError
        The server cannot be reached, is too slow, or fails.
    """
    got, data = _got(path, 0, n_bytes, {})
    state = _state(got.meta)
    if len(data) != min(n_bytes, state.n_bytes):
        raise _wrong_part(path)
    return state, data


def remote_part(path: Path, state: RemoteState, start: int, end: int) -> bytes:
    """Return the bytes from `start` to before `end` of a remote file in a known state.

    Raises
    ------
    InputError
        As for `remote_start`, or the file has changed since.
    MachineError
        As for `remote_start`.
    """
    # Neither a weak tag (W/) nor a date can be asked for
    pinned = {"if_match": state.tag} if state.tag.startswith('"') else {}
    got, data = _got(path, start, end, pinned)
    if _state(got.meta) != state:
        raise remote_change(path)
    if tuple(got.range) != (start, end) or len(data) != end - start:
        raise _wrong_part(path)
    return data


def _state(meta: Any) -> RemoteState:
    changed = meta["last_modified"]
    # The library has 1970 where the server sends no date
    date = changed.isoformat() if changed.timestamp() > 0 else ""
    return RemoteState(int(meta["size"]), meta["e_tag"] or date)


def remote_change(path: Path) -> InputError:
    """Return the error for a remote file that is another than before."""
    return InputError(
        "changed while it was read", where=path, advice="run again when nothing writes to it any more"
    )


def _got(path: Path, start: int, end: int, pinned: dict[str, str]) -> tuple[Any, bytes]:
    """Return an answer and its bytes; failing requests are repeated, with growing waits."""
    obstore = needed("obstore", "remote", where=address_text(path))
    store, key = _placed(address_text(path))
    until_s, wait_s = time.monotonic() + RETRY_S, FIRST_WAIT_S
    for n_left in reversed(range(RETRIES + 1)):
        try:
            got = obstore.get(store, key, options={"range": (start, end), **pinned})
            return got, bytes(got.bytes())
        except (OSError, RuntimeError, ValueError, obstore.exceptions.BaseError) as error:
            # The library repeats requests, but not all answers that break off
            if n_left == 0 or _CUT not in str(error) or time.monotonic() > until_s:
                raise _plain(path, error) from error
        time.sleep(wait_s)
        wait_s = min(2.0 * wait_s, LONGEST_WAIT_S)
    raise AssertionError("the last try returns or raises")


def _placed(address: str) -> tuple[Any, str]:
    """Return the store that an address is in, and the name in it."""
    parts = urlsplit(address)
    if parts.scheme == "s3":
        return _s3_store(parts.netloc, tuple(sorted(_aws_settings().items()))), address.split("/", 3)[3]
    # The store writes the characters of an address that have to be escaped
    return _http_store(f"{parts.scheme}://{parts.netloc}", _limits()), unquote(parts.path.lstrip("/"))


def _limits() -> tuple[float, ...]:
    return CONNECT_S, SILENCE_S, PART_S, RETRIES, RETRY_S, FIRST_WAIT_S, LONGEST_WAIT_S


def _options(limits: tuple[float, ...], *, is_plain: bool) -> dict[str, Any]:
    connect_s, silence_s, part_s, retries, retry_s, first_s, longest_s = limits
    return {
        "client_options": {
            "connect_timeout": timedelta(seconds=connect_s),
            "read_timeout": timedelta(seconds=silence_s),
            "timeout": timedelta(seconds=part_s),
            "user_agent": "linework",
            # Also keeps an https address from being led to one that is not
            "allow_http": is_plain,
        },
        "retry_config": {
            "max_retries": int(retries),
            "retry_timeout": timedelta(seconds=retry_s),
            "backoff": {
                "init_backoff": timedelta(seconds=first_s),
                "max_backoff": timedelta(seconds=longest_s),
                "base": 2,
            },
        },
    }


@functools.lru_cache(maxsize=16)
def _http_store(base: str, limits: tuple[float, ...]) -> Any:
    store = needed("obstore.store", "remote")
    return store.HTTPStore.from_url(base, **_options(limits, is_plain=base.startswith("http:")))


def _aws_settings() -> dict[str, str]:
    return {name: value for name, value in os.environ.items() if name.startswith("AWS_")}


@functools.lru_cache(maxsize=16)
def _s3_store(bucket: str, settings: tuple[tuple[str, str], ...]) -> Any:
    """Return the store of a bucket; region, endpoint and keys are read from the environment, of which `settings` are."""
    store = needed("obstore.store", "remote")
    given = dict(settings)
    endpoint = (
        given.get("AWS_ENDPOINT_URL_S3") or given.get("AWS_ENDPOINT_URL") or given.get("AWS_ENDPOINT") or ""
    )
    own: dict[str, Any] = {"endpoint": endpoint} if endpoint else {}
    if not any(given.get(name) for name in _S3_ACCESS):
        own["skip_signature"] = True
    return store.S3Store(bucket, **own, **_options(_limits(), is_plain=endpoint.lower().startswith("http:")))


#: What errors of the library hold about an answer that broke off.
_CUT = "response body error"
#: What errors of the library hold, and what it means: the first that is found.
_CAUSES = (
    ("certificate", "its certificate is not trusted"),
    ("following redirect", "it leads on to other addresses that cannot be followed"),
    ("kind: Timeout", "no answer, or none that continues, within the time allowed"),
    ("kind: Connect", "no connection to the server"),
    ("kind: Request", "no connection to the server"),
    (_CUT, "the connection was cut, again and again"),
    ("dns error", "the name of the server is not known"),
)


def _plain(path: Path, error: BaseException) -> LineworkError:
    """Return the error of a failed request in plain words; the library's own fills a page."""
    text, kind = str(error), type(error).__name__
    status = re.search(r"status code: (\d{3})", text)
    code = f" (HTTP {status[1]})" if status else ""
    if status and status[1] == "416":
        return InputError(
            "empty file, or one that has become shorter", where=path, advice="copy it there again"
        )
    if isinstance(error, FileNotFoundError):
        return InputError(f"no such file on the server{code}", where=path, advice="check the address")
    if kind in ("PermissionDeniedError", "UnauthenticatedError"):
        return InputError(
            f"no access{code}", where=path,
            advice="s3:// addresses take AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY; or copy it here first",
        )  # fmt: skip
    if re.search(r"Requested \d+\.\.\d+, got", text):
        return _wrong_part(path)
    if kind == "NotSupportedError":
        return InputError(
            "the server sends whole files only, no ranges of bytes", where=path, advice="copy it here first"
        )
    if kind == "PreconditionError":
        return remote_change(path)
    if status and status[1][0] == "4" and status[1] not in ("408", "429"):
        return InputError(f"the server refuses the request{code}", where=path, advice="check the address")
    cause = next((words for sign, words in _CAUSES if sign.lower() in text.lower()), "cannot be read")
    if status:
        cause = f"the server failed{code}, also when asked again"
    return MachineError(cause, where=path, advice=_AGAIN)


def _wrong_part(path: Path) -> InputError:
    return InputError(
        "the server sent other bytes than those asked for", where=path, advice="copy it here first"
    )
