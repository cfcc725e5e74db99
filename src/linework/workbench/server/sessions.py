"""Browser sessions: a token that opens one, and the cookies of the open ones.

Separate from `guard`, because a session is opened and known without any request.
"""

from __future__ import annotations

import hmac
import secrets
from collections.abc import Callable

#: Sessions that are open at once: browsers, and those forgotten; the oldest ends when another one begins.
MOST_SESSIONS = 16
#: Randomness of a token and of a cookie: none can be guessed. [bytes]
_BYTES = 32


class Sessions:
    """The sessions of one run of the server.

    Parameters
    ----------
    port
        Part of the cookie's name: browsers send a cookie to every port of a host.
    renewed
        Called with the next token when one has been used.

    Notes
    -----
    A token opens one session and is void then. Comparing takes the same time for every wrong value.
    """

    def __init__(self, port: int, renewed: Callable[[str], None] = lambda _token: None) -> None:
        self.cookie_name = f"linework-{port}"
        self.token = secrets.token_urlsafe(_BYTES)
        self._renewed = renewed
        self._open: list[str] = []

    def enter(self, token: str) -> str:
        """Return the cookie of a new session, "" if the token is wrong."""
        if not hmac.compare_digest(token.encode(), self.token.encode()):
            return ""
        self.token = secrets.token_urlsafe(_BYTES)
        cookie = secrets.token_urlsafe(_BYTES)
        self._open = [*self._open, cookie][-MOST_SESSIONS:]
        self._renewed(self.token)
        return cookie

    def knows(self, cookie_header: str) -> bool:
        """Return whether a request's Cookie header holds the cookie of an open session."""
        given = ""
        for part in cookie_header.split(";"):
            name, _, value = part.strip().partition("=")
            if name == self.cookie_name:
                given = value
        found = [hmac.compare_digest(given.encode(), known.encode()) for known in self._open]
        return any(found)
