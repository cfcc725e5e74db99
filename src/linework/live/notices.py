"""Notices of a drive that is followed: each trouble is reported once when it begins, and once when it is over.

Separate from `drive`, which decides what is a trouble: here is only what was reported already.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from linework.model.images import ImagePair

#: Notices that the page shows; the others were printed.
_SHOWN = 6
#: Time for which skipped pairs are gathered into one line; the record names each of them. [s]
_GATHERED_S = 10.0


@dataclass(frozen=True, slots=True)
class Notice:
    """A line that was reported, when [s, monotonic], and whether its trouble lasts."""

    text: str
    at_s: float
    lasts: bool


class Notices:
    """Lines for the operator.

    Parameters
    ----------
    report
        Called with each line.
    """

    def __init__(self, report: Callable[[str], None]) -> None:
        self._report = report
        self._lasting: dict[str, Notice] = {}
        self._past: deque[Notice] = deque(maxlen=_SHOWN)

    def once(self, text: str, now_s: float) -> None:
        """Report something that happened and is over."""
        self._report(text)
        self._past.append(Notice(text, now_s, lasts=False))

    def begin(self, trouble: str, text: str, now_s: float) -> None:
        """Report a trouble, unless it lasts already.

        Parameters
        ----------
        trouble
            Its identity.
        """
        if trouble not in self._lasting:
            self._lasting[trouble] = Notice(text, now_s, lasts=True)
            self._report(text)

    def end(self, trouble: str, text: str, now_s: float) -> None:
        """Report the end of a trouble, if there was one."""
        if self._lasting.pop(trouble, None) is not None:
            self.once(text, now_s)

    def shown(self) -> list[Notice]:
        """Return what the page shows: troubles that last, then the newest others."""
        return [*self._lasting.values(), *reversed(self._past)][:_SHOWN]


class SkipNotices:
    """Notices of the pairs that were skipped: of the first at once, of those after it together."""

    def __init__(self, notices: Notices) -> None:
        self._notices = notices
        self._pairs: list[ImagePair] = []
        self._reported_s = -float("inf")

    def add(self, pairs: Sequence[ImagePair], now_s: float) -> None:
        """Take in pairs that were skipped, and report them if that is due."""
        self._pairs.extend(pairs)
        if now_s - self._reported_s >= _GATHERED_S:
            self.report(now_s)

    def report(self, now_s: float) -> None:
        """Report the pairs that were not reported yet."""
        if not self._pairs:
            return
        first, last, n = self._pairs[0], self._pairs[-1], len(self._pairs)
        names = first.left.name if n == 1 else f"{first.left.name} to {last.left.name}"
        if last.number - first.number >= n:
            names = f"among {names}"
        self._notices.once(f"{n} pair{'s' * (n > 1)} skipped to keep up: {names}", now_s)
        self._reported_s = now_s
        self._pairs.clear()
