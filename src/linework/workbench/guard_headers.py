"""What every answer says to the browser: nothing from elsewhere, in no frame, kept nowhere."""

from __future__ import annotations

from starlette.types import Message, Send

#: The page's policy. A report is a page of its own, see `REPORT_POLICY`.
PAGE_POLICY = (
    "default-src 'self'; img-src 'self' data: blob:; object-src 'none'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'"
)
#: A report: pictures and styles that are in it, nothing else, and no part of the page's origin.
REPORT_POLICY = (
    "default-src 'none'; img-src data:; style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'; sandbox"
)
_ALWAYS = {
    b"content-security-policy": PAGE_POLICY.encode(),
    b"x-content-type-options": b"nosniff",
    b"x-frame-options": b"DENY",
    b"referrer-policy": b"no-referrer",
    b"cross-origin-opener-policy": b"same-origin",
    b"cross-origin-resource-policy": b"same-origin",
    b"cache-control": b"no-store",
}
#: What a route may say differently.
_OWN = b"content-security-policy"


def with_headers(send: Send) -> Send:
    """Return a `send` that adds the headers to what is answered."""

    async def sending(message: Message) -> None:
        if message["type"] == "http.response.start":
            there = [(name.lower(), value) for name, value in message.get("headers", ())]
            has_own = any(name == _OWN for name, _ in there)
            kept = [(name, value) for name, value in there if name not in _ALWAYS or name == _OWN]
            added = [(name, value) for name, value in _ALWAYS.items() if name != _OWN or not has_own]
            message = {**message, "headers": [*kept, *added]}
        await send(message)

    return sending
