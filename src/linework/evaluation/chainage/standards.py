"""Limits of road authorities, each with its source; a table per standard.

Separate from `rows`, which compares: these are tables to read and to correct.
"""

from __future__ import annotations

from typing import NamedTuple


class Limit(NamedTuple):
    """A limit of a quantity.

    Parameters
    ----------
    topic, quantity
        As in the rows of a report.
    least, most
        What the values must not be below and above, None without such a limit; in the unit of the quantity.
    source
        Where the limit is stated.
    """

    topic: str
    quantity: str
    least: float | None
    most: float | None
    source: str


class Rhythm(NamedTuple):
    """A pattern of dashes: length of a dash and of the gap after it [m]."""

    dash_m: float
    gap_m: float
    name: str


#: Height of a rail's top edge that US practice takes as the least acceptable: 27 3/4 inches.
_FHWA = Limit("guardrail", "top_height", 0.705, None, "FHWA 2010: 27 3/4 in")
LIMITS: dict[str, tuple[Limit, ...]] = {
    "us": (_FHWA, Limit("clearance", "clearance", 4.90, None, "AASHTO: 16 ft")),
    "uk": (
        Limit("clearance", "clearance", 5.03, None, "CD 127: 5.03 m at existing, 5.30 m at new structures"),
        Limit(
            "kerb", "upstand", 0.025, None, "Inclusive Mobility: 25 mm at vehicle crossings, 60 mm detectable"
        ),
        Limit("road", "crossfall", -2.5, 2.5, "CD 109: 2.5 % (superelevation apart)"),
    ),
    "de": (
        Limit("clearance", "clearance", 4.50, None, "RAL: 4.50 m, of new roads 4.70 m"),
        Limit("road", "crossfall", -2.5, 2.5, "RAL: 2.5 % (superelevation apart)"),
    ),
}
RHYTHMS: dict[str, tuple[Rhythm, ...]] = {
    "us": (Rhythm(3.05, 9.14, "MUTCD 10/30 ft"),),
    "uk": (
        Rhythm(2.0, 7.0, "TSM 5: 2/7"),
        Rhythm(3.0, 6.0, "TSM 5: 3/6"),
        Rhythm(4.0, 2.0, "TSM 5: 4/2"),
        Rhythm(6.0, 3.0, "TSM 5: 6/3"),
    ),
    "de": (Rhythm(6.0, 12.0, "RMS: 6/12"), Rhythm(4.0, 8.0, "RMS: 4/8"), Rhythm(3.0, 6.0, "RMS: 3/6")),
}
#: Tolerance within which a measured pattern is one of the standard's. [m]
RHYTHM_TOLERANCE_M = 0.5


def verdict_of(limit: Limit | None, value: float | None) -> str:
    """Return "ok", "below" or "above", "unknown" without a value, "" without a limit.

    >>> rail = Limit("guardrail", "top_height", 0.705, None, "FHWA")
    >>> verdict_of(rail, 0.69), verdict_of(rail, 0.75), verdict_of(rail, None), verdict_of(None, 1.0)
    ('below', 'ok', 'unknown', '')
    """
    if value is None:
        return "unknown"
    if limit is None:
        return ""
    if limit.least is not None and value < limit.least:
        return "below"
    return "above" if limit.most is not None and value > limit.most else "ok"


def limit_for(standard: str, topic: str, quantity: str) -> Limit | None:
    """Return the limit of a quantity in a standard, None where it has none."""
    found = [one for one in LIMITS.get(standard, ()) if (one.topic, one.quantity) == (topic, quantity)]
    return found[0] if found else None


def rhythm_name(standard: str, dash_m: float, gap_m: float) -> str:
    """Return the standard's pattern that a measured one is, "" where it is none of them.

    >>> rhythm_name("de", 5.9, 12.2), rhythm_name("de", 5.0, 5.0)
    ('RMS: 6/12', '')
    """
    for rhythm in RHYTHMS.get(standard, ()):
        if (
            abs(dash_m - rhythm.dash_m) <= RHYTHM_TOLERANCE_M
            and abs(gap_m - rhythm.gap_m) <= RHYTHM_TOLERANCE_M
        ):
            return rhythm.name
    return ""
