"""A pick that no line can be followed from: why, and where the nearest one is that works."""

from __future__ import annotations

from pathlib import Path

from linework.errors import InputError


class RefusedPickError(InputError):
    """No line at a place, or at a pixel.

    Parameters
    ----------
    reason
        Why, without the place.
    at
        The place as it is said.
    where
        Survey or image.
    works
        The nearest place (east, north) [m, world] or pixel (col, row) that works; None: there is none near.
    """

    def __init__(
        self,
        reason: str,
        at: str,
        *,
        where: str | Path,
        advice: str,
        works: tuple[float, float] | None = None,
    ) -> None:
        super().__init__(f"{reason} {at}", where=where, advice=advice)
        self.reason, self.works = reason, works
